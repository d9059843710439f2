//! Formats that are written for other programs and not read back.

pub(super) mod cvat;
pub(super) mod foxglove;
pub(super) mod geff;
mod mcap;
pub(super) mod mot_zip;
mod mpeg_ts;
pub(super) mod napari;
#[cfg(feature = "parquet")]
pub(super) mod parquet;
mod paths;
mod times;
pub(super) mod trackmate_xml;
pub(super) mod vmti;
pub(super) mod xml;
mod zarr;
mod zip;
