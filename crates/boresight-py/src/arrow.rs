//! The Arrow C stream of a run's columns, without a copy: any reader of `__arrow_c_stream__` takes it (polars, pyarrow, pandas 3).
//!
//! Source: the Arrow C data interface and C stream interface, format 1 (structures, flags, who releases what). Written out here because the
//! columns are plain vectors: one batch, no offsets; only `detection` has gaps and only `status` is a dictionary. Every structure owns a
//! count of the columns, so they live as long as any reader wants.
//! Limits: the one file with unsafe code; a stream is read by one thread at a time, as its standard says.
#![allow(unsafe_code)] // Raw pointers are what the Arrow C interface is made of; it stands in this file only.

use crate::columns::{Columns, N_FLOATS, STATUS};
use boresight::io::TRACKS_HEADER;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use std::ffi::{CString, c_char, c_int, c_void};
use std::ptr::null_mut;
use std::sync::Arc;

#[repr(C)]
struct Schema {
    format: *const c_char,
    name: *const c_char,
    metadata: *const c_char,
    flags: i64,
    n_children: i64,
    children: *mut *mut Schema,
    dictionary: *mut Schema,
    release: Option<unsafe extern "C" fn(*mut Schema)>,
    private: *mut c_void,
}

#[repr(C)]
struct Array {
    length: i64,
    null_count: i64,
    offset: i64,
    n_buffers: i64,
    n_children: i64,
    buffers: *mut *const c_void,
    children: *mut *mut Array,
    dictionary: *mut Array,
    release: Option<unsafe extern "C" fn(*mut Array)>,
    private: *mut c_void,
}

#[repr(C)]
struct Stream {
    get_schema: unsafe extern "C" fn(*mut Stream, *mut Schema) -> c_int,
    get_next: unsafe extern "C" fn(*mut Stream, *mut Array) -> c_int,
    get_last_error: unsafe extern "C" fn(*mut Stream) -> *const c_char,
    release: Option<unsafe extern "C" fn(*mut Stream)>,
    private: *mut c_void,
}

/// What a schema's pointers point to.
struct SchemaOwner {
    format: CString,
    name: CString,
    children: Vec<*mut Schema>,
    dictionary: *mut Schema,
}

/// What an array's pointers point to.
struct ArrayOwner {
    buffers: Vec<*const c_void>,
    children: Vec<*mut Array>,
    dictionary: *mut Array,
    _columns: Arc<Exported>,
}

/// The columns, and what Arrow wants that they do not hold.
struct Exported {
    columns: Arc<Columns>,
    /// Bits of the rows that took a detection.
    took: Vec<u8>,
    n_without: i64,
    words: String,
    offsets: Vec<i32>,
}

struct StreamOwner {
    exported: Arc<Exported>,
    done: bool,
}

impl Drop for SchemaOwner {
    fn drop(&mut self) {
        for &child in self.children.iter().chain([&self.dictionary]).filter(|c| !c.is_null()) {
            // SAFETY: each was made by `Box::into_raw` here and is freed only here; a consumer that moved it out has set its `release` to none.
            unsafe {
                if let Some(release) = (*child).release {
                    release(child);
                }
                drop(Box::from_raw(child));
            }
        }
    }
}

impl Drop for ArrayOwner {
    fn drop(&mut self) {
        for &child in self.children.iter().chain([&self.dictionary]).filter(|c| !c.is_null()) {
            // SAFETY: as for schemas.
            unsafe {
                if let Some(release) = (*child).release {
                    release(child);
                }
                drop(Box::from_raw(child));
            }
        }
    }
}

unsafe extern "C" fn release_schema(schema: *mut Schema) {
    // SAFETY: called once by the consumer, with the structure that `schema_of` filled.
    unsafe {
        drop(Box::from_raw((*schema).private.cast::<SchemaOwner>()));
        (*schema).release = None;
    }
}

unsafe extern "C" fn release_array(array: *mut Array) {
    // SAFETY: called once by the consumer, with the structure that `array_of` filled.
    unsafe {
        drop(Box::from_raw((*array).private.cast::<ArrayOwner>()));
        (*array).release = None;
    }
}

const NULLABLE: i64 = 2;

fn schema_of(format: &str, name: &str, flags: i64, children: Vec<Schema>, dictionary: Option<Schema>) -> Schema {
    let mut owner = Box::new(SchemaOwner {
        format: CString::new(format).unwrap_or_default(),
        name: CString::new(name).unwrap_or_default(),
        children: children.into_iter().map(|c| Box::into_raw(Box::new(c))).collect(),
        dictionary: dictionary.map_or(null_mut(), |d| Box::into_raw(Box::new(d))),
    });
    Schema {
        format: owner.format.as_ptr(),
        name: owner.name.as_ptr(),
        metadata: std::ptr::null(),
        flags,
        n_children: owner.children.len() as i64,
        children: owner.children.as_mut_ptr(),
        dictionary: owner.dictionary,
        release: Some(release_schema),
        private: Box::into_raw(owner).cast(),
    }
}

fn array_of(
    exported: &Arc<Exported>,
    length: usize,
    null_count: i64,
    buffers: Vec<*const c_void>,
    children: Vec<Array>,
    dictionary: Option<Array>,
) -> Array {
    let mut owner = Box::new(ArrayOwner {
        buffers,
        children: children.into_iter().map(|c| Box::into_raw(Box::new(c))).collect(),
        dictionary: dictionary.map_or(null_mut(), |d| Box::into_raw(Box::new(d))),
        _columns: Arc::clone(exported),
    });
    Array {
        length: length as i64,
        null_count,
        offset: 0,
        n_buffers: owner.buffers.len() as i64,
        n_children: owner.children.len() as i64,
        buffers: owner.buffers.as_mut_ptr(),
        children: owner.children.as_mut_ptr(),
        dictionary: owner.dictionary,
        release: Some(release_array),
        private: Box::into_raw(owner).cast(),
    }
}

fn whole_schema() -> Schema {
    let fields = TRACKS_HEADER.split(',').map(|name| match name {
        "frame" | "track_id" => schema_of("l", name, 0, Vec::new(), None),
        "status" => schema_of("c", name, 0, Vec::new(), Some(schema_of("u", "", 0, Vec::new(), None))),
        "detection" => schema_of("l", name, NULLABLE, Vec::new(), None),
        _ => schema_of("g", name, 0, Vec::new(), None),
    });
    schema_of("+s", "", 0, fields.collect(), None)
}

fn whole_array(e: &Arc<Exported>) -> Array {
    let c = &e.columns;
    let n = c.len();
    let plain = |values: *const c_void| array_of(e, n, 0, vec![std::ptr::null(), values], Vec::new(), None);
    let words = vec![std::ptr::null(), e.offsets.as_ptr().cast(), e.words.as_ptr().cast()];
    let words = array_of(e, STATUS.len(), 0, words, Vec::new(), None);
    let status = vec![std::ptr::null(), c.status.as_ptr().cast()];
    let mut children = vec![plain(c.frame.as_ptr().cast()), plain(c.time_s.as_ptr().cast())];
    children.push(plain(c.track_id.as_ptr().cast()));
    children.push(array_of(e, n, 0, status, Vec::new(), Some(words)));
    children.extend((0..N_FLOATS).map(|k| plain(c.floats[k].as_ptr().cast())));
    let taken = vec![e.took.as_ptr().cast(), c.detection.as_ptr().cast()];
    children.push(array_of(e, n, e.n_without, taken, Vec::new(), None));
    array_of(e, n, 0, vec![std::ptr::null()], children, None)
}

unsafe extern "C" fn get_schema(_: *mut Stream, out: *mut Schema) -> c_int {
    // SAFETY: the consumer hands a place to write to.
    unsafe { out.write(whole_schema()) };
    0
}

unsafe extern "C" fn get_next(stream: *mut Stream, out: *mut Array) -> c_int {
    // SAFETY: `private` was set by `capsule` and lives until `release_stream`; the consumer hands a place to write to.
    unsafe {
        let owner = &mut *(*stream).private.cast::<StreamOwner>();
        if owner.done {
            // The end is an array that is released already.
            std::ptr::write_bytes(out, 0, 1);
        } else {
            owner.done = true;
            out.write(whole_array(&owner.exported));
        }
    }
    0
}

unsafe extern "C" fn get_last_error(_: *mut Stream) -> *const c_char {
    std::ptr::null()
}

unsafe extern "C" fn release_stream(stream: *mut Stream) {
    // SAFETY: called once, by the consumer or by the capsule's destructor, whoever comes first.
    unsafe {
        drop(Box::from_raw((*stream).private.cast::<StreamOwner>()));
        (*stream).release = None;
    }
}

/// Holds the stream until a reader takes it.
#[repr(transparent)]
struct Unread(Stream);

// SAFETY: the stream's pointers lead only to what it owns itself.
unsafe impl Send for Unread {}

impl Drop for Unread {
    fn drop(&mut self) {
        if let Some(release) = self.0.release {
            // SAFETY: no reader took it over, else `release` would be gone.
            unsafe { release(&mut self.0) };
        }
    }
}

/// The columns as the capsule `arrow_array_stream`.
pub fn capsule<'py>(py: Python<'py>, columns: &Arc<Columns>) -> PyResult<Bound<'py, PyCapsule>> {
    let n = columns.len();
    let mut took = vec![0_u8; n.div_ceil(8)];
    let rows = columns.detection.iter().enumerate().filter(|(_, d)| **d >= 0);
    let n_took = rows.fold(0_i64, |count, (row, _)| {
        took[row / 8] |= 1 << (row % 8);
        count + 1
    });
    let mut offsets = vec![0];
    for word in STATUS {
        offsets.push(offsets[offsets.len() - 1] + word.len() as i32);
    }
    let n_without = n as i64 - n_took;
    let exported = Exported { columns: Arc::clone(columns), took, n_without, words: STATUS.concat(), offsets };
    let owner = Box::new(StreamOwner { exported: Arc::new(exported), done: false });
    let stream = Stream {
        get_schema,
        get_next,
        get_last_error,
        release: Some(release_stream),
        private: Box::into_raw(owner).cast(),
    };
    // The first thing in the capsule's memory is the stream itself, as readers want it.
    PyCapsule::new_with_value(py, Unread(stream), c"arrow_array_stream")
}
