//! Arrays to frames: one copy of the pixels, whatever their strides.
//!
//! Arrays of the library's own pixel types (u8, u16, f32 grey, u8 colour; native byte order, aligned) are copied straight; all
//! others go through `boresight._frames.normalise`, which makes such an array or says what was expected.

use crate::errors::refused;
use boresight::{Image, Pixels};
use numpy::{Element, PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// The pixels of any object that NumPy can read as an image.
pub fn pixels_of(frame: &Bound<'_, PyAny>) -> PyResult<Pixels> {
    if let Some(pixels) = plain(frame)? {
        return Ok(pixels);
    }
    let made = frame.py().import("boresight._frames")?.call_method1("normalise", (frame,))?;
    plain(&made)?.ok_or_else(|| {
        refused("expected an array of pixels", "frame", "a frame is rows x columns, or rows x columns x 3 for colour")
    })
}

/// The pixels of an array that needs no conversion.
fn plain(frame: &Bound<'_, PyAny>) -> PyResult<Option<Pixels>> {
    Ok(if let Ok(a) = frame.cast::<PyArray2<u8>>() {
        grey(a)?.map(Pixels::Gray8)
    } else if let Ok(a) = frame.cast::<PyArray3<u8>>() {
        colour(a)?.map(Pixels::Rgb8)
    } else if let Ok(a) = frame.cast::<PyArray2<u16>>() {
        grey(a)?.map(Pixels::Gray16)
    } else if let Ok(a) = frame.cast::<PyArray2<f32>>() {
        grey(a)?.map(Pixels::GrayF32)
    } else {
        None
    })
}

/// Whether every element of an array lies where its type may lie.
fn aligned<T>(address: usize, strides: &[isize]) -> bool {
    let align = align_of::<T>();
    address.is_multiple_of(align) && strides.iter().all(|s| s.unsigned_abs().is_multiple_of(align))
}

fn grey<T: Element + Copy>(array: &Bound<'_, PyArray2<T>>) -> PyResult<Option<Image<T>>> {
    if !aligned::<T>(array.data() as usize, array.strides()) {
        return Ok(None);
    }
    let view = array.try_readonly()?;
    let (height, width) = (array.shape()[0], array.shape()[1]);
    let data = match view.as_slice() {
        // A slice column by column is none of ours.
        Ok(slice) if array.is_c_contiguous() => slice.to_vec(),
        _ => view.as_array().iter().copied().collect(),
    };
    check_size(width, height)?;
    Ok(Image::from_vec(width, height, data))
}

fn colour(array: &Bound<'_, PyArray3<u8>>) -> PyResult<Option<Image<[u8; 3]>>> {
    let &[height, width, 3] = array.shape() else { return Ok(None) };
    let view = array.try_readonly()?;
    check_size(width, height)?;
    let data: Vec<[u8; 3]> = match view.as_slice() {
        Ok(slice) if array.is_c_contiguous() => slice.as_chunks::<3>().0.to_vec(),
        _ => {
            let a = view.as_array();
            let pixel = |(y, x)| [a[(y, x, 0)], a[(y, x, 1)], a[(y, x, 2)]];
            (0..height).flat_map(|y| (0..width).map(move |x| (y, x))).map(pixel).collect()
        }
    };
    Ok(Image::from_vec(width, height, data))
}

fn check_size(width: usize, height: usize) -> PyResult<()> {
    if width == 0 || height == 0 {
        return Err(refused(
            format!("the image has {width} x {height} pixels"),
            "frame",
            "expected at least one pixel",
        ));
    }
    Ok(())
}

/// Pixels as an array: rows x columns, and x 3 for colour.
pub fn array_of<'py>(py: Python<'py>, pixels: &Pixels) -> PyResult<Bound<'py, PyAny>> {
    fn shaped<'py, T: Element + Copy>(py: Python<'py>, image: &Image<T>) -> PyResult<Bound<'py, PyAny>> {
        let flat = numpy::PyArray1::from_slice(py, image.as_slice());
        Ok(flat.reshape([image.height(), image.width()])?.into_any())
    }
    match pixels {
        Pixels::Gray8(i) => shaped(py, i),
        Pixels::Gray16(i) => shaped(py, i),
        Pixels::GrayF32(i) => shaped(py, i),
        Pixels::Rgb8(i) => {
            let flat = numpy::PyArray1::from_slice(py, i.as_slice().as_flattened());
            Ok(flat.reshape([i.height(), i.width(), 3])?.into_any())
        }
    }
}
