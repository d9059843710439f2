//! Golden vectors of the spatial filters, noise generators, image metrics and colours.

use super::file::{load, number, rows};
use boresight::Image;
use boresight::metrics::image::{compare, pfe_spectral};
use boresight::vision::colour::{ColourMatch, ColourMatchConfig, distance, grey, hsi, matches};
use boresight::vision::noise::{gaussian, salt_and_pepper};
use boresight::vision::spatial::{
    Border, Kernel, SpatialConfig, SpatialFilter, WindowConfig, convolve_exact, mean_exact, median_exact,
};
use serde_json::Value;

fn image<T: Copy>(v: &Value, f: impl Fn(f64) -> T) -> Image<T> {
    let rows = rows(v);
    let (h, w) = (rows.len(), rows.first().map_or(0, Vec::len));
    Image::from_vec(w, h, rows.concat().into_iter().map(f).collect()).unwrap()
}

#[test]
fn the_spatial_filters_give_the_golden_images() {
    let golden = load("spatial_filters");
    let mut n_images = 0;
    for case in &golden.cases {
        let src = image(&case["inputs"]["image"], |v| v as f32);
        let bytes = image(&case["inputs"]["image"], |v| v as u8);
        let size = number(&case["inputs"]["n"]) as usize;
        let kernel_rows = rows(&case["inputs"]["kernel"]);
        let kernel = Kernel::new(kernel_rows.len(), kernel_rows.concat()).unwrap();
        for (name, border) in [("zero", Border::Zero), ("replicate", Border::Replicate), ("reflect", Border::Reflect)] {
            let want = |what: &str| case["outputs"].get(format!("{what}_{name}")).map(|v| rows(v).concat());
            if let Some(want) = want("mean") {
                let ours = mean_exact(&src, size, border).unwrap();
                golden.all_close(ours.as_slice(), &want, &format!("mean_{name}"));
                let mut fast = Image::default();
                let config = SpatialConfig::Mean(WindowConfig { size, border });
                SpatialFilter::new(config).unwrap().apply(&bytes, &mut fast);
                let rounded: Vec<u8> = want.iter().map(|v| v.round() as u8).collect();
                assert_eq!(fast.as_slice(), rounded, "mean_{name} of u8");
                n_images += 1;
            }
            if let Some(want) = want("median") {
                let ours = median_exact(&src, size, border).unwrap();
                golden.all_close(ours.as_slice(), &want, &format!("median_{name}"));
                let mut fast = Image::default();
                let config = SpatialConfig::Median(WindowConfig { size, border });
                SpatialFilter::new(config).unwrap().apply(&bytes, &mut fast);
                let bytes: Vec<u8> = want.iter().map(|v| *v as u8).collect();
                assert_eq!(fast.as_slice(), bytes, "median_{name} of u8");
                n_images += 1;
            }
            if let Some(want) = want("conv") {
                let ours = convolve_exact(&src, &kernel, border);
                golden.all_close(ours.as_slice(), &want, &format!("conv_{name}"));
                n_images += 1;
            }
        }
    }
    assert!(n_images >= 9 * golden.cases.len(), "only {n_images} images compared");
}

#[test]
fn the_noise_generators_give_the_golden_images() {
    let golden = load("image_noise");
    for case in &golden.cases {
        let inputs = &case["inputs"];
        let mut salted = image(&inputs["image"], |v| v);
        salt_and_pepper(&mut salted, number(&inputs["d"]), &rows(&inputs["u"]).concat()).unwrap();
        golden.all_close(salted.as_slice(), &rows(&case["outputs"]["salt_pepper"]).concat(), "salt_pepper");
        let clean = image(&inputs["image"], |v| v);
        let noisy = gaussian(&clean, number(&inputs["sigma"]), &rows(&inputs["z"]).concat()).unwrap();
        golden.all_close(noisy.as_slice(), &rows(&case["outputs"]["gaussian"]).concat(), "gaussian");
    }
}

#[test]
fn the_image_metrics_give_the_golden_numbers() {
    let golden = load("image_metrics");
    for case in &golden.cases {
        let truth = image(&case["inputs"]["truth"], |v| v);
        let filtered = image(&case["inputs"]["filtered"], |v| v);
        let m = compare(&truth, &filtered, number(&case["inputs"]["imax"])).unwrap();
        for (name, ours) in [
            ("mse", m.mse),
            ("rmse", m.rmse),
            ("mae", m.mae),
            ("pfe", m.pfe),
            ("snr", m.snr),
            ("psnr", m.psnr),
            ("psnr_as_printed", m.psnr_as_printed),
            ("pfe_spectral", pfe_spectral(&truth, &filtered).unwrap()),
        ] {
            golden.close(ours, number(&case["outputs"][name]), name);
        }
    }
}

#[test]
fn grey_hue_saturation_and_match_are_the_golden_ones() {
    let golden = load("colour");
    for case in &golden.cases {
        let colours: Vec<[u8; 3]> =
            rows(&case["inputs"]["rgb"]).iter().map(|c| [c[0] as u8, c[1] as u8, c[2] as u8]).collect();
        let out = &case["outputs"];
        // Distances and matches are against pixel 1.
        let config = ColourMatchConfig { reference: colours[1], ..ColourMatchConfig::default() };
        let mut bits = [0];
        ColourMatch::new(config).unwrap().row(&colours, &mut bits);
        for (i, &rgb) in colours.iter().enumerate() {
            let c = hsi(rgb);
            assert_eq!(f64::from(grey(rgb)), number(&out["gray"][i]), "grey of {rgb:?}");
            golden.close(c.hue_deg, number(&out["h"][i]), "hue");
            golden.close(c.saturation, number(&out["s"][i]), "saturation");
            golden.close(c.intensity, number(&out["i"][i]), "intensity");
            golden.close(distance(&c, &hsi(colours[1])), number(&out["dist_vs_1"][i]), "distance");
            let want = out["match_vs_1"][i].as_bool().unwrap();
            assert_eq!((matches(&config, rgb), bits[0] >> i & 1 == 1), (want, want), "match of {rgb:?}");
        }
    }
}
