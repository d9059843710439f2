//! One file a command: its arguments and what it does.

mod also;
pub mod batch;
mod command_line;
pub mod completions;
pub mod config;
pub mod convert;
pub mod detect;
pub mod evaluate;
mod export_files;
pub mod fuse;
#[cfg(feature = "live")]
pub mod live;
pub mod preview;
pub mod reproduce;
mod run_folder;
mod run_options;
mod run_outcome;
mod run_summary;
pub mod sensor;
pub mod simulate;
pub mod smooth;
pub mod stitch;
mod stop;
mod table_motion;
pub mod track;
mod video_scale;
