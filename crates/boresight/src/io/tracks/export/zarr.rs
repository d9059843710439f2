//! A Zarr store of version 2 in a folder: groups with attributes, arrays of one chunk without compression.
//!
//! Source: *Zarr storage specification version 2*. Arrays are little-endian, rows first.

use crate::{Error, ErrorKind, Result};
use serde_json::{Value, json};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Values of an array, with their type in Zarr and in NumPy.
pub(super) enum Values<'a> {
    /// 64-bit floats.
    F64(&'a [f64]),
    /// 64-bit integers.
    I64(&'a [i64]),
    /// 64-bit integers from 0.
    U64(&'a [u64]),
    /// Bytes.
    U8(&'a [u8]),
    /// Truth values.
    Bool(&'a [bool]),
}

impl Values<'_> {
    /// NumPy's name of the type.
    pub fn name(&self) -> &'static str {
        match self {
            Self::F64(_) => "float64",
            Self::I64(_) => "int64",
            Self::U64(_) => "uint64",
            Self::U8(_) => "uint8",
            Self::Bool(_) => "bool",
        }
    }

    fn code(&self) -> &'static str {
        match self {
            Self::F64(_) => "<f8",
            Self::I64(_) => "<i8",
            Self::U64(_) => "<u8",
            Self::U8(_) => "|u1",
            Self::Bool(_) => "|b1",
        }
    }

    fn bytes(&self) -> Vec<u8> {
        match self {
            Self::F64(v) => v.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Self::I64(v) => v.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Self::U64(v) => v.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Self::U8(v) => v.to_vec(),
            Self::Bool(v) => v.iter().map(|v| u8::from(*v)).collect(),
        }
    }
}

/// A store that is being written.
pub(super) struct Store {
    root: PathBuf,
}

impl Store {
    /// Begins a store in a folder that is made.
    /// # Errors
    /// A folder that cannot be made.
    pub fn create(root: &Path) -> Result<Self> {
        let store = Self { root: root.to_path_buf() };
        store.group("", None)?;
        Ok(store)
    }

    /// Makes a group.
    /// # Errors
    /// A file that cannot be written.
    pub fn group(&self, at: &str, attributes: Option<Value>) -> Result<()> {
        let folder = self.folder(at)?;
        put(&folder.join(".zgroup"), json!({ "zarr_format": 2 }).to_string().as_bytes())?;
        attributes.map_or(Ok(()), |a| put(&folder.join(".zattrs"), format!("{a:#}\n").as_bytes()))
    }

    /// Writes an array of this shape.
    /// # Errors
    /// A file that cannot be written.
    pub fn array(&self, at: &str, shape: &[usize], values: &Values<'_>) -> Result<()> {
        let folder = self.folder(at)?;
        let chunks: Vec<usize> = shape.iter().map(|n| (*n).max(1)).collect();
        let about = json!({
            "zarr_format": 2, "shape": shape, "chunks": chunks, "dtype": values.code(), "compressor": null,
            "fill_value": null, "order": "C", "filters": null,
        });
        put(&folder.join(".zarray"), about.to_string().as_bytes())?;
        if shape.contains(&0) {
            return Ok(());
        }
        put(&folder.join(vec!["0"; shape.len()].join(".")), &values.bytes())
    }

    fn folder(&self, at: &str) -> Result<PathBuf> {
        let folder = self.root.join(at);
        std::fs::create_dir_all(&folder).map_err(|e| failed(&folder, e))?;
        Ok(folder)
    }
}

fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    File::create(path).and_then(|mut f| f.write_all(bytes).and_then(|()| f.sync_all())).map_err(|e| failed(path, e))
}

fn failed(path: &Path, e: std::io::Error) -> Error {
    Error::new(ErrorKind::Output, "cannot be written").at(path.display()).because(e)
}
