//! Spatial filters on a 1920x1080 frame of seeded noise, beside one copy of the same bytes.
//!
//! Run: `cargo bench -p boresight --bench spatial`. The seed is fixed; one thread.

use boresight::Image;
use boresight::vision::spatial::{
    Border, GaussianConfig, Kernel, SpatialConfig, SpatialFilter, SpatialPixel, WindowConfig, convolve,
};
use divan::Bencher;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const W: usize = 1920;
const H: usize = 1080;

fn main() {
    divan::main();
}

fn frame<T: SpatialPixel>() -> Image<T> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut bytes = vec![0u8; W * H];
    rng.fill_bytes(&mut bytes);
    Image::from_vec(W, H, bytes.into_iter().map(|v| T::from_f64(f64::from(v))).collect()).unwrap()
}

fn bench<T: SpatialPixel>(bencher: Bencher, config: SpatialConfig) {
    let (src, mut dst) = (frame::<T>(), Image::default());
    let mut filter = SpatialFilter::new(config).unwrap();
    filter.apply(&src, &mut dst);
    bencher
        .counter(divan::counter::BytesCount::new(W * H * size_of::<T>()))
        .bench_local(|| filter.apply(&src, &mut dst));
}

fn window(size: usize) -> WindowConfig {
    WindowConfig { size, border: Border::Replicate }
}

#[divan::bench]
fn copy_u8(bencher: Bencher) {
    let (src, mut dst) = (frame::<u8>(), Image::filled(W, H, 0u8));
    bencher
        .counter(divan::counter::BytesCount::new(W * H))
        .bench_local(|| dst.as_mut_slice().copy_from_slice(divan::black_box(&src).as_slice()));
}

#[divan::bench(args = [3, 5, 7, 15, 31, 101])]
fn mean_u8(bencher: Bencher, size: usize) {
    bench::<u8>(bencher, SpatialConfig::Mean(window(size)));
}

#[divan::bench(args = [3, 5, 7, 15])]
fn mean_u16(bencher: Bencher, size: usize) {
    bench::<u16>(bencher, SpatialConfig::Mean(window(size)));
}

#[divan::bench(args = [3, 5, 7, 15])]
fn mean_f32(bencher: Bencher, size: usize) {
    bench::<f32>(bencher, SpatialConfig::Mean(window(size)));
}

#[divan::bench(args = [3, 5, 7, 9, 15, 31, 101], sample_count = 20)]
fn median_u8(bencher: Bencher, size: usize) {
    bench::<u8>(bencher, SpatialConfig::Median(window(size)));
}

#[divan::bench(args = [3, 5, 7, 15], sample_count = 10)]
fn median_u16(bencher: Bencher, size: usize) {
    bench::<u16>(bencher, SpatialConfig::Median(window(size)));
}

#[divan::bench(args = [3, 5, 7, 15], sample_count = 10)]
fn median_f32(bencher: Bencher, size: usize) {
    bench::<f32>(bencher, SpatialConfig::Median(window(size)));
}

#[divan::bench(args = [1.0, 2.0, 5.0])]
fn gaussian_u8(bencher: Bencher, sigma_px: f64) {
    bench::<u8>(bencher, SpatialConfig::Gaussian(GaussianConfig { sigma_px, border: Border::Replicate }));
}

#[divan::bench]
fn convolution_3x3_u8(bencher: Bencher) {
    let (src, mut dst) = (frame::<u8>(), Image::default());
    let kernel = Kernel::new(3, vec![0.0, -1.0, 0.0, -1.0, 5.0, -1.0, 0.0, -1.0, 0.0]).unwrap();
    bencher.bench_local(|| convolve(&src, &kernel, Border::Replicate, &mut dst));
}
