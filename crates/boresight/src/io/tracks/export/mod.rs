//! Formats that are written for other programs and not read back.

pub(super) mod cvat;
pub(super) mod geff;
pub(super) mod mot_zip;
pub(super) mod napari;
#[cfg(feature = "parquet")]
pub(super) mod parquet;
mod paths;
pub(super) mod trackmate_xml;
mod xml;
mod zarr;
mod zip;
