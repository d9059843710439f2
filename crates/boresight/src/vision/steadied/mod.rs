//! What moves before a moving camera: frames some time ago are brought to cover the present one, and what differs from two of them moves by itself.
//!
//! `config` says how long ago and how surely, `references` keeps the frames and where their ground lies now, `cover` draws one as the present frame would
//! see it, `noise` says how large a difference the ground itself makes (`copied`: of pixels that no encoder copied), `segmenter` puts them together.

mod config;
mod copied;
mod cover;
mod noise;
mod references;
mod segmenter;

pub use config::SteadiedConfig;
pub(crate) use cover::plane_image;
pub(crate) use references::SECOND_LAG;
pub(super) use segmenter::Steadied;
