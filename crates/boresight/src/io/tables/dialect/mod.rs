//! The dialects of tables, one file each: which column means what, what numbers count from, what is special.

pub(crate) mod ab3dmot;
pub(crate) mod kitti;
pub(crate) mod mot;
pub(crate) mod named;
pub(crate) mod named_write;
