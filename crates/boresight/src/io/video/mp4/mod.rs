//! MP4 and QuickTime files read in process: the tables of times, and H.264 pictures in their order.

mod ahead;
mod boxes;
mod decoders;
mod fragments;
mod h264;
mod movie;
mod picture;
mod progressive;
mod reorder;
mod sample;
mod source;
mod tables;
mod timeline;
mod worker;

pub(in crate::io::video) use source::{Opened, open};
