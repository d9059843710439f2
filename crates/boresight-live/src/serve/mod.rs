//! The page: what a browser sees of the run, and what programs ask of it.

mod access;
mod coded_pictures;
mod hub;
mod hubs;
mod metrics;
mod page_output;
mod picture;
mod routes;
mod server;
mod tls;
mod viewer;

pub use metrics::resident_bytes;
pub use server::{Page, PageOptions};
pub use tls::TlsFiles;
