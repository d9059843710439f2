//! Detections as Python gives them: arrays of positions with covariances, of boxes, or both.
//!
//! Boxes are corners left, top, right, bottom as object detectors give them: a box that begins in the first pixel has left 0. Ours
//! count from the centre of that pixel, so half a pixel is taken off here and put back in `boresight._supervision`, nowhere else.

use crate::errors::refused;
use boresight::{ClassId, Detection, Extent};
use nalgebra::{Matrix2, Vector2};
use numpy::{Element, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// What is said of the detections of one scan.
#[derive(Default)]
pub struct Given<'py> {
    /// N x 2, px.
    pub positions: Option<Bound<'py, PyAny>>,
    /// N x 2 x 2, or 2 x 2 for all, px².
    pub covariances: Option<Bound<'py, PyAny>>,
    /// N x 4, corners, px.
    pub boxes: Option<Bound<'py, PyAny>>,
    /// N.
    pub scores: Option<Bound<'py, PyAny>>,
    /// N.
    pub classes: Option<Bound<'py, PyAny>>,
    /// Standard deviation of positions without covariance, px.
    pub std_px: f64,
    /// The same as a share of the box's side, if that is more.
    pub std_per_side: f64,
}

/// Numbers of any array as f64, with their shape.
struct Numbers {
    shape: Vec<usize>,
    values: Vec<f64>,
}

fn numbers(object: &Bound<'_, PyAny>, name: &str) -> PyResult<Numbers> {
    if let Some(found) = plain::<f64>(object)? {
        return Ok(found);
    }
    if let Some(found) = plain::<f32>(object)? {
        return Ok(found);
    }
    let converted = object.py().import("boresight._frames")?.call_method1("numbers", (object, name))?;
    plain::<f64>(&converted)?.ok_or_else(|| refused("expected an array of numbers", name, "numpy.asarray makes one"))
}

/// The numbers of an array of this type, if it is one and its elements lie where they may.
fn plain<T: Element + Copy + Into<f64>>(object: &Bound<'_, PyAny>) -> PyResult<Option<Numbers>> {
    let Ok(array) = object.cast::<PyArrayDyn<T>>() else { return Ok(None) };
    let align = align_of::<T>();
    let strided = array.strides().iter().all(|s| s.unsigned_abs().is_multiple_of(align));
    if !((array.data() as usize).is_multiple_of(align) && strided) {
        return Ok(None);
    }
    let view = array.try_readonly()?;
    let values = match view.as_slice() {
        // A slice column by column is none of ours.
        Ok(slice) if array.is_c_contiguous() => slice.iter().map(|v| (*v).into()).collect(),
        _ => view.as_array().iter().map(|v| (*v).into()).collect(),
    };
    Ok(Some(Numbers { shape: array.shape().to_vec(), values }))
}

fn wrong_shape(name: &str, found: &[usize], expected: &str) -> PyErr {
    refused(format!("found an array of shape {found:?}, expected {expected}"), name, "one row for each detection")
}

/// Rows of `W` numbers; an empty array has none.
fn rows<const W: usize>(object: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<[f64; W]>> {
    let n = numbers(object, name)?;
    let fits = n.values.is_empty() || matches!(n.shape[..], [_, w] if w == W);
    if !fits {
        return Err(wrong_shape(name, &n.shape, &format!("N x {W}")));
    }
    Ok(n.values.as_chunks::<W>().0.to_vec())
}

/// `n` numbers.
fn column(object: &Bound<'_, PyAny>, name: &str, n: usize) -> PyResult<Vec<f64>> {
    let found = numbers(object, name)?;
    if found.values.len() != n || found.shape.len() > 1 {
        return Err(wrong_shape(name, &found.shape, &format!("{n} numbers")));
    }
    Ok(found.values)
}

/// `n` covariances, or one for all.
fn covariances(object: &Bound<'_, PyAny>, n: usize) -> PyResult<Vec<Matrix2<f64>>> {
    let found = numbers(object, "covariances")?;
    let matrices: Vec<Matrix2<f64>> =
        found.values.as_chunks::<4>().0.iter().map(|m| Matrix2::from_row_slice(m)).collect();
    match found.shape[..] {
        [2, 2] => Ok(vec![matrices[0]; n]),
        [m, 2, 2] if m == n => Ok(matrices),
        _ if found.values.is_empty() && n == 0 => Ok(Vec::new()),
        _ => Err(wrong_shape("covariances", &found.shape, &format!("{n} x 2 x 2, or 2 x 2 for all"))),
    }
}

impl Given<'_> {
    /// The detections.
    pub fn detections(&self) -> PyResult<Vec<Detection>> {
        let boxes: Option<Vec<[f64; 4]>> = self.boxes.as_ref().map(|b| rows(b, "boxes")).transpose()?;
        if let Some(k) = boxes.iter().flatten().position(|[l, t, r, b]| r < l || b < t) {
            let place = format!("boxes, row {k}");
            return Err(refused("the right or bottom lies before the left or top", place, "left, top, right, bottom"));
        }
        if !(self.std_px > 0.0 && self.std_px.is_finite() && (0.0..=1.0).contains(&self.std_per_side)) {
            let place = format!("std_px = {}, std_per_side = {}", self.std_px, self.std_per_side);
            return Err(refused("expected a deviation above 0 px, a share in 0..=1", place, "1 px is a fair guess"));
        }
        let extents: Option<Vec<Extent>> = boxes.map(|boxes| boxes.iter().map(extent_of_corners).collect());
        let positions: Vec<Vector2<f64>> = match (&self.positions, &extents) {
            (Some(p), _) => rows::<2>(p, "positions")?.into_iter().map(Vector2::from).collect(),
            (None, Some(extents)) => extents.iter().map(centre).collect(),
            (None, None) => {
                return Err(refused(
                    "there are neither positions nor boxes",
                    "detections",
                    "give an N x 2 array, or boxes=",
                ));
            }
        };
        let n = positions.len();
        if let Some(extents) = &extents
            && extents.len() != n
        {
            return Err(refused(format!("{} boxes for {n} positions", extents.len()), "boxes", "one for each"));
        }
        let covs = self.covariances.as_ref().map(|c| covariances(c, n)).transpose()?;
        let scores = self.scores.as_ref().map(|s| column(s, "scores", n)).transpose()?;
        let classes = self.classes.as_ref().map(|c| column(c, "classes", n)).transpose()?;
        let one = |k: usize| {
            let extent = extents.as_ref().map(|e| e[k]);
            let side = |s: f64| (s * self.std_per_side).max(self.std_px);
            let cov = covs.as_ref().map(|c| c[k]).unwrap_or_else(|| {
                let (w, h) = extent.map_or((0.0, 0.0), |e| (e.width_px, e.height_px));
                Matrix2::new(side(w).powi(2), 0.0, 0.0, side(h).powi(2))
            });
            // Field by field: each `with_` would move the whole detection once more.
            let mut d = Detection::at(positions[k], cov);
            if let Some(e) = extent {
                d.extent = e;
                d.area_px = (e.width_px * e.height_px).max(1.0) as u32;
            }
            if let Some(s) = &scores {
                d.score = s[k] as f32;
            }
            let class = classes.as_ref().map(|c| c[k]).filter(|c| (0.0..4e9).contains(c));
            d.class = class.map(|c| ClassId(c as u32));
            d
        };
        Ok((0..n).map(one).collect())
    }
}

/// Corners left, top, right, bottom to a box that counts from the centre of the first pixel.
fn extent_of_corners([l, t, r, b]: &[f64; 4]) -> Extent {
    Extent { left_px: l - 0.5, top_px: t - 0.5, width_px: r - l, height_px: b - t }
}

fn centre(e: &Extent) -> Vector2<f64> {
    Vector2::new(e.left_px + 0.5 * e.width_px, e.top_px + 0.5 * e.height_px)
}

/// The corners of a box.
pub fn corners_of(e: &Extent) -> [f64; 4] {
    let (l, t) = (e.left_px + 0.5, e.top_px + 0.5);
    [l, t, l + e.width_px, t + e.height_px]
}

/// The detections in what a detector in Python returns: an array, a dictionary of arrays, `supervision.Detections`;
/// `std` holds for positions without covariance: px, and a share of the box's side.
pub fn detections_of(found: &Bound<'_, PyAny>, std: (f64, f64)) -> PyResult<Vec<Detection>> {
    let py = found.py();
    let parts = py.import("boresight._detections")?.call_method1("parts", (found,))?;
    let parts = parts.cast::<PyDict>().map_err(PyErr::from)?;
    let part = |name: &str| parts.get_item(name);
    let given = Given {
        positions: part("positions")?,
        covariances: part("covariances")?,
        boxes: part("boxes")?,
        scores: part("scores")?,
        classes: part("classes")?,
        std_px: part("std_px")?.map_or(Ok(std.0), |v| v.extract())?,
        std_per_side: part("std_per_side")?.map_or(Ok(std.1), |v| v.extract())?,
    };
    given.detections()
}
