//! ns per predict + update, 4 states and 2 measurements: every form in f64 and f32, alone and for 10 000 tracks.
//!
//! `alone`: one filter, 1 000 steps a sample: µs shown = ns a step. `tracks_10k`: 10 000 filters in a vector, one step
//! each: µs shown / 10 = ns a step. `batch`: the lane batch. Peers in the same run: the plain nalgebra
//! loop, adskalman, kfilter, minikalman (no crate offers U-D or square-root information filters).
//! Run: `cargo bench -p boresight-filters --bench filters` (with `--features simd` for run-time dispatch).

use boresight_filters::batch::{Lanes, Variance, step_all};
use boresight_filters::model::{ConstantVelocity, Dense};
use boresight_filters::{
    FuzzySrif, Gaussian, GaussianFilter, Information, Kf, Measurement, Real, SquareRoot, Srif, Start, Ud, Ukf,
};
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use nalgebra::{Matrix2x4, Matrix4, Vector2, Vector4};

const DT: f64 = 0.04;
const STEPS: usize = 1000;
const TRACKS: usize = 10_000;

type Cv<T> = ConstantVelocity<T>;

fn main() {
    divan::main();
}

/// Positions of a target that weaves, from a fixed recurrence.
fn positions<T: Real>(n: usize) -> Vec<Measurement<T>> {
    let mut seed = 1u32;
    let mut next = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(seed >> 8) / f64::from(1u32 << 24) - 0.5
    };
    (0..n)
        .map(|k| Measurement::isotropic(T::of(0.5 * k as f64 + next()), T::of(0.2 * k as f64 + next()), T::of(0.7)))
        .collect()
}

fn start<T: Real>() -> Gaussian<4, T> {
    let diagonal = Vector4::new(T::of(1.0), T::of(4.0), T::of(1.0), T::of(4.0));
    Gaussian { mean: Vector4::zeros(), cov: Matrix4::from_diagonal(&diagonal) }
}

fn cv<T: Real>() -> Cv<T> {
    Cv::discrete(T::of(0.5)).unwrap()
}

fn alone<F: GaussianFilter<4>>(bencher: Bencher, filter: F) {
    let z = positions::<F::Real>(STEPS);
    let dt = F::Real::of(DT);
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        let mut f = filter.clone();
        for z in &z {
            f.predict(black_box(dt)).unwrap();
            f.correct(z).unwrap();
        }
        f
    });
}

fn many<F: GaussianFilter<4>>(bencher: Bencher, filter: F) {
    let z = positions::<F::Real>(TRACKS);
    let dt = F::Real::of(DT);
    let mut filters = vec![filter; TRACKS];
    bencher.counter(ItemsCount::new(TRACKS)).bench_local(|| {
        for (f, z) in filters.iter_mut().zip(&z) {
            f.predict(black_box(dt)).unwrap();
            f.correct(z).unwrap();
        }
    });
}

macro_rules! forms {
    ($($name:ident: $form:ty, $real:ty, $model:expr;)*) => {
        mod alone {
            use super::*;
            $(#[divan::bench] fn $name(b: Bencher) { super::alone(b, <$form>::start($model, start::<$real>()).unwrap()); })*
        }
        mod tracks_10k {
            use super::*;
            $(#[divan::bench] fn $name(b: Bencher) { many(b, <$form>::start($model, start::<$real>()).unwrap()); })*
        }
    };
}

forms! {
    kf: Kf<Cv<f64>, 4>, f64, cv();
    kf_dense: Kf<Dense<Cv<f64>>, 4>, f64, Dense(cv());
    ud: Ud<Cv<f64>, 4>, f64, cv();
    srif: Srif<Cv<f64>, 4>, f64, cv();
    fuzzy_srif: FuzzySrif<Cv<f64>, 4>, f64, cv();
    information: Information<Cv<f64>, 4>, f64, cv();
    square_root: SquareRoot<Cv<f64>, 4>, f64, cv();
    ukf: Ukf<Cv<f64>, 4>, f64, cv();
    kf_f32: Kf<Cv<f32>, 4, f32>, f32, cv();
    kf_dense_f32: Kf<Dense<Cv<f32>>, 4, f32>, f32, Dense(cv());
    ud_f32: Ud<Cv<f32>, 4, f32>, f32, cv();
    srif_f32: Srif<Cv<f32>, 4, f32>, f32, cv();
    square_root_f32: SquareRoot<Cv<f32>, 4, f32>, f32, cv();
}

mod batch {
    use super::*;

    fn run<T: Real, const L: usize>(bencher: Bencher, tracks: usize) {
        let mut packs = vec![Lanes::<L, T>::default(); tracks.div_ceil(L)];
        for pack in &mut packs {
            for lane in 0..L {
                pack.set(lane, &start()).unwrap();
            }
        }
        let z: Vec<[T; 2]> = positions::<T>(tracks).iter().map(|m| [m.position[0], m.position[1]]).collect();
        let model = cv();
        bencher.counter(ItemsCount::new(tracks)).bench_local(|| {
            step_all(&model, black_box(T::of(DT)), &mut packs, &z, Variance::Same(T::of(0.49))).unwrap()
        });
    }

    #[divan::bench(args = [1000, 10_000, 1_000_000])]
    fn lanes_f64(bencher: Bencher, tracks: usize) {
        run::<f64, 8>(bencher, tracks);
    }

    #[divan::bench(args = [1000, 10_000, 1_000_000])]
    fn lanes_f32(bencher: Bencher, tracks: usize) {
        run::<f32, 16>(bencher, tracks);
    }
}

mod peers {
    use super::*;
    use adskalman::{KalmanFilterNoControl, ObservationModel, StateAndCovariance, TransitionModelLinearNoControl};
    use nalgebra::{Matrix2, Matrix4x2, OMatrix, U2, U4};

    fn phi() -> Matrix4<f64> {
        Matrix4::new(1., DT, 0., 0., 0., 1., 0., 0., 0., 0., 1., DT, 0., 0., 0., 1.)
    }

    fn noise() -> Matrix4<f64> {
        let g = Matrix4x2::new(DT * DT / 2., 0., DT, 0., 0., DT * DT / 2., 0., DT);
        g * g.transpose() * 0.25
    }

    fn h() -> Matrix2x4<f64> {
        Matrix2x4::new(1., 0., 0., 0., 0., 0., 1., 0.)
    }

    #[derive(Clone, Copy)]
    struct Loop {
        x: Vector4<f64>,
        p: Matrix4<f64>,
    }

    impl Loop {
        fn step(&mut self, f: &Matrix4<f64>, q: &Matrix4<f64>, h: &Matrix2x4<f64>, r: &Matrix2<f64>, z: &Vector2<f64>) {
            let x = f * self.x;
            let p = f * self.p * f.transpose() + q;
            let pht = p * h.transpose();
            let k = pht * (h * pht + r).try_inverse().unwrap();
            self.x = x + k * (z - h * x);
            self.p = p - k * (h * p);
        }
    }

    #[divan::bench]
    fn nalgebra_loop_alone(bencher: Bencher) {
        let z = positions::<f64>(STEPS);
        let (f, q, h, r) = (black_box(phi()), black_box(noise()), h(), Matrix2::identity() * 0.49);
        bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
            let mut s = Loop { x: Vector4::zeros(), p: start().cov };
            for z in &z {
                s.step(&f, &q, &h, &r, &z.position);
            }
            s.x
        });
    }

    #[divan::bench]
    fn nalgebra_loop_10k(bencher: Bencher) {
        let z = positions::<f64>(TRACKS);
        let (f, q, h, r) = (black_box(phi()), black_box(noise()), h(), Matrix2::identity() * 0.49);
        let mut s = vec![Loop { x: Vector4::zeros(), p: start().cov }; TRACKS];
        bencher.counter(ItemsCount::new(TRACKS)).bench_local(|| {
            for (s, z) in s.iter_mut().zip(&z) {
                s.step(&f, &q, &h, &r, &z.position);
            }
        });
    }

    struct Motion {
        f: Matrix4<f64>,
        ft: Matrix4<f64>,
        q: Matrix4<f64>,
    }
    #[allow(non_snake_case)]
    impl TransitionModelLinearNoControl<f64, U4> for Motion {
        fn F(&self) -> &OMatrix<f64, U4, U4> {
            &self.f
        }
        fn FT(&self) -> &OMatrix<f64, U4, U4> {
            &self.ft
        }
        fn Q(&self) -> &OMatrix<f64, U4, U4> {
            &self.q
        }
    }
    struct Seen {
        h: Matrix2x4<f64>,
        ht: Matrix4x2<f64>,
        r: Matrix2<f64>,
    }
    #[allow(non_snake_case)]
    impl ObservationModel<f64, U4, U2> for Seen {
        fn H(&self) -> &OMatrix<f64, U2, U4> {
            &self.h
        }
        fn HT(&self) -> &OMatrix<f64, U4, U2> {
            &self.ht
        }
        fn R(&self) -> &OMatrix<f64, U2, U2> {
            &self.r
        }
    }

    #[divan::bench]
    fn adskalman_alone(bencher: Bencher) {
        let z = positions::<f64>(STEPS);
        let motion = Motion { f: phi(), ft: phi().transpose(), q: noise() };
        let seen = Seen { h: h(), ht: h().transpose(), r: Matrix2::identity() * 0.49 };
        let kf = KalmanFilterNoControl::new(&motion, &seen);
        bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
            let mut s = StateAndCovariance::new(Vector4::zeros(), start().cov);
            for z in &z {
                s = kf.step(&s, &z.position).unwrap();
            }
            s
        });
    }

    #[divan::bench]
    fn kfilter_alone(bencher: Bencher) {
        use kfilter::measurement::LinearMeasurement;
        use kfilter::system::LinearNoInputSystem;
        use kfilter::{Kalman1M, KalmanFilter, KalmanPredict};
        use kfilter_nalgebra::{SMatrix, SVector};
        let z = positions::<f64>(STEPS);
        let system = LinearNoInputSystem::new(
            SMatrix::<f64, 4, 4>::from_column_slice(phi().as_slice()),
            SMatrix::from_column_slice(noise().as_slice()),
            SVector::zeros(),
        );
        let r = SMatrix::<f64, 2, 2>::identity() * 0.49;
        let seen = LinearMeasurement::new(SMatrix::from_column_slice(h().as_slice()), r, SMatrix::zeros());
        let p0 = SMatrix::<f64, 4, 4>::from_column_slice(start::<f64>().cov.as_slice());
        bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
            let mut f = Kalman1M::<f64, 4, 0, 2, _, _>::new_custom(system.clone(), p0, seen.clone());
            for z in &z {
                f.predict().unwrap();
                f.update(SVector::<f64, 2>::new(z.position[0], z.position[1])).unwrap();
            }
            f.state()[0]
        });
    }

    #[divan::bench]
    fn minikalman_alone(bencher: Bencher) {
        use minikalman::prelude::*;
        use minikalman::regular::builder::KalmanFilterBuilder;
        let z = positions::<f64>(STEPS);
        let (f, q, h, p0) = (phi(), noise(), h(), start::<f64>().cov);
        let builder = KalmanFilterBuilder::<4, f64>::default();
        bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
            let mut filter = builder.build();
            let mut seen = builder.observations().build::<2>();
            let cells = || (0..4).flat_map(|r| (0..4).map(move |c| (r, c)));
            filter.state_transition_mut().apply(|a| cells().for_each(|(r, c)| a.set_at(r, c, f[(r, c)])));
            filter.estimate_covariance_mut().apply(|a| cells().for_each(|(r, c)| a.set_at(r, c, p0[(r, c)])));
            filter.direct_process_noise_mut().apply(|a| cells().for_each(|(r, c)| a.set_at(r, c, q[(r, c)])));
            seen.observation_matrix_mut()
                .apply(|a| cells().filter(|(r, _)| *r < 2).for_each(|(r, c)| a.set_at(r, c, h[(r, c)])));
            seen.measurement_noise_covariance_mut().apply(|a| {
                a.set_at(0, 0, 0.49);
                a.set_at(1, 1, 0.49);
            });
            for z in &z {
                filter.predict();
                seen.measurement_vector_mut().apply(|v| {
                    v.set_row(0, z.position[0]);
                    v.set_row(1, z.position[1]);
                });
                filter.correct(&mut seen);
            }
            filter.state_vector().get_row(0)
        });
    }
}
