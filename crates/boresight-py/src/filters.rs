//! The filters by hand: one belief a filter, any linear model; and the batch over many tracks at once.

use crate::errors::{OrRaise, refused};
use boresight_filters::batch::{Lanes, Variance, step_all};
use boresight_filters::model::{ConstantAcceleration, ConstantVelocity, Model, Singer};
use boresight_filters::{
    FilterError, Gaussian, GaussianFilter, Information, Kf, Measurement, SquareRoot, Srif, Start, Ud,
};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// A filter whose number of states is known at run time.
trait AnyFilter: Send + Sync {
    fn predict(&mut self, dt_s: f64) -> Result<(), FilterError>;
    fn correct(&mut self, m: &Measurement) -> Result<(), FilterError>;
    /// Mean, and covariance row by row.
    fn belief(&self) -> (Vec<f64>, Vec<f64>);
    fn predicted(&self) -> Gaussian<2>;
    fn log_likelihood(&self, m: &Measurement) -> Result<f64, FilterError>;
}

struct Held<F, const N: usize>(F);

impl<F: GaussianFilter<N, Real = f64> + Send + Sync, const N: usize> AnyFilter for Held<F, N> {
    fn predict(&mut self, dt_s: f64) -> Result<(), FilterError> {
        self.0.predict(dt_s)
    }

    fn correct(&mut self, m: &Measurement) -> Result<(), FilterError> {
        self.0.correct(m)
    }

    fn belief(&self) -> (Vec<f64>, Vec<f64>) {
        let b = self.0.belief();
        // Column by column is row by row: a covariance is symmetric.
        (b.mean.as_slice().to_vec(), b.cov.as_slice().to_vec())
    }

    fn predicted(&self) -> Gaussian<2> {
        self.0.predicted()
    }

    fn log_likelihood(&self, m: &Measurement) -> Result<f64, FilterError> {
        self.0.log_likelihood(m)
    }
}

/// Starts the form that is asked for; `None` for a name that is none.
fn started<M, const N: usize>(
    form: &str,
    model: M,
    x: &[f64],
    p: &[f64],
) -> Option<Result<Box<dyn AnyFilter>, FilterError>>
where
    M: Model<N, f64> + Send + Sync + 'static,
{
    let belief = Gaussian::<N>::new(SVector::from_row_slice(x), SMatrix::from_row_slice(p));
    fn boxed<F, const N: usize>(f: Result<F, FilterError>) -> Result<Box<dyn AnyFilter>, FilterError>
    where
        F: GaussianFilter<N, Real = f64> + Send + Sync + 'static,
    {
        f.map(|f| Box::new(Held::<F, N>(f)) as Box<dyn AnyFilter>)
    }
    Some(match form {
        "kf" => boxed(Kf::<M, N>::start(model, belief)),
        "ud" => boxed(Ud::<M, N>::start(model, belief)),
        "srif" => boxed(Srif::<M, N>::start(model, belief)),
        "information" => boxed(Information::<M, N>::start(model, belief)),
        "square-root" => boxed(SquareRoot::<M, N>::start(model, belief)),
        _ => return None,
    })
}

/// A measured position and its covariance from arrays or numbers.
fn measurement(z: PyReadonlyArray1<'_, f64>, r: PyReadonlyArray2<'_, f64>) -> PyResult<Measurement> {
    let (z, r) = (z.as_array(), r.as_array());
    if z.len() != 2 || r.shape() != [2, 2] {
        let found = format!("a measurement of {} numbers with a covariance of shape {:?}", z.len(), r.shape());
        return Err(refused(found, "correct", "z is (x, y), R is 2 x 2"));
    }
    let cov = Matrix2::new(r[(0, 0)], r[(0, 1)], r[(1, 0)], r[(1, 1)]);
    Ok(Measurement::new(Vector2::new(z[0], z[1]), cov))
}

/// One filter.
#[pyclass(module = "boresight._boresight", subclass)]
pub struct Filter {
    inner: Box<dyn AnyFilter>,
}

#[pymethods]
impl Filter {
    #[new]
    fn new(
        py: Python<'_>,
        form: &str,
        model: &str,
        parameters: Vec<f64>,
        x: PyReadonlyArray1<'_, f64>,
        p: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let x: Vec<f64> = x.as_array().iter().copied().collect();
        let (shape, p) = (p.as_array().shape().to_vec(), p.as_array().iter().copied().collect::<Vec<_>>());
        let n = if model == "constant-velocity" { 4 } else { 6 };
        if x.len() != n || shape != [n, n] {
            let found = format!("{} states with a covariance of shape {shape:?}", x.len());
            return Err(refused(found, model, format!("the model has {n} states")));
        }
        let started = match (model, &parameters[..]) {
            ("constant-velocity", &[q]) => started::<_, 4>(form, ConstantVelocity::continuous(q).or_raise(py)?, &x, &p),
            ("constant-acceleration", &[q]) => {
                started::<_, 6>(form, ConstantAcceleration::continuous(q, 1.0).or_raise(py)?, &x, &p)
            }
            ("singer", &[std, tau]) => started::<_, 6>(form, Singer::new(std, tau).or_raise(py)?, &x, &p),
            _ => None,
        };
        let inner = started.ok_or_else(|| {
            refused("there is no such filter", format!("{form} with {model}"), "boresight.filters lists them")
        })?;
        Ok(Self { inner: inner.or_raise(py)? })
    }

    /// Moves the belief `dt_s` seconds ahead; the process noise follows.
    fn predict(&mut self, py: Python<'_>, dt_s: f64) -> PyResult<()> {
        self.inner.predict(dt_s).or_raise(py)
    }

    fn correct_native(
        &mut self,
        py: Python<'_>,
        z: PyReadonlyArray1<'_, f64>,
        r: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<()> {
        self.inner.correct(&measurement(z, r)?).or_raise(py)
    }

    fn log_likelihood_native(
        &self,
        py: Python<'_>,
        z: PyReadonlyArray1<'_, f64>,
        r: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<f64> {
        self.inner.log_likelihood(&measurement(z, r)?).or_raise(py)
    }

    /// Mean of the state.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.inner.belief().0)
    }

    /// Covariance of the state.
    #[getter(P)]
    fn p<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (x, p) = self.inner.belief();
        PyArray1::from_vec(py, p).reshape([x.len(), x.len()])
    }

    /// x, y, px.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.inner.predicted().mean.as_slice())
    }

    /// Covariance of the position, 2 x 2, px².
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        PyArray1::from_slice(py, self.inner.predicted().cov.as_slice()).reshape([2, 2])
    }
}

/// Tracks a pack holds: as many as the widest vector registers take.
const L: usize = 8;

/// Many constant-velocity tracks, each with uncorrelated axes.
#[pyclass(module = "boresight._boresight", subclass)]
pub struct Batch {
    model: ConstantVelocity,
    packs: Vec<Lanes<L>>,
    n: usize,
    /// Variances where some tracks are not measured.
    variances: Vec<[f64; 2]>,
}

#[pymethods]
impl Batch {
    #[new]
    fn new(py: Python<'_>, q: f64, x: PyReadonlyArray2<'_, f64>, p: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        let (x, p) = (x.as_array(), p.as_array());
        let n = x.shape()[0];
        let rows_of_p = p.shape()[0];
        if x.shape()[1] != 4 || p.shape()[1] != 16 || !(rows_of_p == 1 || rows_of_p == n) {
            return Err(refused("the shapes do not fit", "Batch", "x is N x 4, P is 4 x 4 for all or N x 4 x 4"));
        }
        let mut packs = vec![Lanes::<L>::default(); n.div_ceil(L)];
        for i in 0..n {
            let row = if rows_of_p == 1 { 0 } else { i };
            let cov = SMatrix::<f64, 4, 4>::from_fn(|r, c| p[(row, 4 * r + c)]);
            let mean = SVector::<f64, 4>::from_fn(|r, _| x[(i, r)]);
            packs[i / L].set(i % L, &Gaussian::new(mean, cov)).or_raise(py)?;
        }
        let model = ConstantVelocity::continuous(q).or_raise(py)?;
        Ok(Self { model, packs, n, variances: Vec::new() })
    }

    fn __len__(&self) -> usize {
        self.n
    }

    /// Predicts all tracks and corrects each by its position; NaN is a missed scan. Returns how many packs of 8 were refused.
    fn step_native(
        &mut self,
        py: Python<'_>,
        dt_s: f64,
        z: PyReadonlyArray2<'_, f64>,
        r: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<usize> {
        let shapes = (z.as_array().shape().to_vec(), r.as_array().shape().to_vec());
        let rows = z.is_c_contiguous() && r.is_c_contiguous();
        let (true, Ok(z), Ok(r)) = (rows, z.as_slice(), r.as_slice()) else {
            return Err(refused("expected contiguous arrays", "step", "numpy.ascontiguousarray makes one"));
        };
        let (z, r) = (z.as_chunks::<2>().0, r.as_chunks::<2>().0);
        if shapes.0 != [self.n, 2] || shapes.1[1] != 2 || !(r.len() == 1 || r.len() == self.n) {
            let found = format!("positions of shape {:?}, variances of shape {:?}", shapes.0, shapes.1);
            return Err(refused(found, "step", format!("{} x 2 positions; one variance, or one for each", self.n)));
        }
        let missed = z.iter().any(|z| z[0].is_nan() | z[1].is_nan());
        let Self { model, packs, variances, .. } = self;
        let refused_packs = py.detach(|| {
            if r.len() == 1 && r[0][0] == r[0][1] && !missed {
                return step_all(model, dt_s, packs, z, Variance::Same(r[0][0]));
            }
            variances.clear();
            variances.extend(z.iter().enumerate().map(|(i, z)| {
                let lost = z[0].is_nan() || z[1].is_nan();
                if lost { [f64::INFINITY; 2] } else { r[if r.len() == 1 { 0 } else { i }] }
            }));
            step_all(model, dt_s, packs, z, Variance::Each(variances))
        });
        refused_packs.or_raise(py)
    }

    /// N x 4, `[x, vx, y, vy]`.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let flat = (0..self.n).filter_map(|i| self.packs[i / L].get(i % L));
        let flat: Vec<f64> = flat.flat_map(|b| <[f64; 4]>::from(b.mean)).collect();
        PyArray1::from_vec(py, flat).reshape([self.n, 4])
    }

    /// N x 4 x 4.
    #[getter(P)]
    fn p<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let flat = (0..self.n).filter_map(|i| self.packs[i / L].get(i % L));
        let flat: Vec<f64> = flat.flat_map(|b| b.cov.as_slice().to_vec()).collect();
        PyArray1::from_vec(py, flat).reshape([self.n, 4, 4])
    }
}
