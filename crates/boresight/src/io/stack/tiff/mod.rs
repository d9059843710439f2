//! TIFF and BigTIFF, page by page, and what the `tiff` crate does not read of them.

mod chunk;
mod count;
mod failure;
mod hyperstack;
mod lzw;
mod packed;
mod pages;

pub(crate) use count::count_pages;
pub(crate) use pages::TiffPages;
