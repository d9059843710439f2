//! Golden vectors of `vision`: segmentation, probabilities, likelihood ratio, track before detect, dark box and window.

use super::file::{load, number, numbers, rows};
use boresight::Image;
use boresight::vision::Clusterer;
use boresight::vision::TrackBeforeDetect;
use boresight::vision::probability::{Level, PixelRect, pixel_probability, proximity_range, rounded_probability};
use boresight::vision::threshold::{band_bits, words};
use boresight::vision::{CentroidMethod, ClusterConfig};
use boresight::vision::{LlrTable, ScoreImage};
use boresight::vision::{Surroundings, centroid};
use boresight::vision::{dark_box, search_window};
use nalgebra::Vector2;
use serde_json::Value;

/// An image whose values are whole numbers 0..=255.
fn grey(v: &Value) -> Image<u8> {
    let rows = rows(v);
    let data: Vec<u8> = rows.iter().flatten().map(|&v| v as u8).collect();
    assert!(rows.iter().flatten().zip(&data).all(|(a, &b)| *a == f64::from(b)), "expected 8-bit pixels");
    Image::from_vec(rows[0].len(), rows.len(), data).unwrap()
}

#[test]
fn clusters_and_centroids_are_the_golden_ones() {
    let golden = load("segmentation");
    for case in &golden.cases {
        let image = grey(&case["inputs"]["image"]);
        let (lo, hi) = (number(&case["inputs"]["lo"]), number(&case["inputs"]["hi"]));
        for (name, out) in case["outputs"].as_object().unwrap() {
            let (distance, rule) = name.strip_prefix("dp").unwrap().split_once('_').unwrap();
            let config =
                ClusterConfig { distance_px: distance.parse().unwrap(), inclusive: rule == "le", ..Default::default() };
            let mut clusters = Clusterer::new(&config);
            clusters.begin(image.width());
            let mut bits = vec![0; words(image.width())];
            for y in 0..image.height() {
                band_bits(image.row(y), lo as u8, hi as u8, &mut bits);
                clusters.row(y, &bits, image.row(y));
            }
            let regions: Vec<_> = clusters.regions().cloned().collect();
            assert_eq!(regions.len() as u64, out["n"].as_u64().unwrap(), "{name}");
            let sizes: Vec<f64> = regions.iter().map(|r| f64::from(r.area)).collect();
            assert_eq!(sizes, numbers(&out["sizes"]), "{name}");
            // There is no label image; a region's sums must be those of the pixels with its label.
            let labels = rows(&out["labels"]);
            for (k, r) in regions.iter().enumerate() {
                let mut sums = [0.0; 6];
                for (y, row) in labels.iter().enumerate() {
                    for (x, _) in row.iter().enumerate().filter(|(_, l)| **l == k as f64) {
                        let (x, y) = (x as f64, y as f64);
                        for (s, v) in sums.iter_mut().zip([1.0, x, y, x * x, x * y, y * y]) {
                            *s += v;
                        }
                    }
                }
                assert_eq!(sums, [f64::from(r.area), r.x, r.y, r.xx, r.xy, r.yy], "{name}, label {k}");
            }
            let plain = Surroundings::plain();
            for (method, key) in [
                (CentroidMethod::Mask, "centroid_intensity"),
                (CentroidMethod::Binary, "centroid_binary"),
                (CentroidMethod::Bbox, "centroid_bbox"),
            ] {
                let expected = rows(&out[key]);
                assert_eq!(regions.len(), expected.len(), "{name} {key}");
                for (r, expected) in regions.iter().zip(expected) {
                    // The papers count pixels from 1.
                    let c = centroid(r, &image, method, &plain).position.add_scalar(1.0);
                    golden.all_close(c.as_slice(), &expected, &format!("{name} {key}"));
                }
            }
        }
    }
}

#[test]
fn pixel_probabilities_and_the_proximity_range_are_the_golden_ones() {
    let golden = load("pixel_probability");
    for case in &golden.cases {
        let (i, o) = (&case["inputs"], &case["outputs"]);
        let level = |m: &str, s: &str| Level { mean: number(&i[m]), sd: number(&i[s]) };
        let (t, v) = (level("mu_t", "sigma_t"), level("mu_v", "sigma_v"));
        let (lo, hi) = (number(&i["lo"]), number(&i["hi"]));
        let (p_t, p_v) = (pixel_probability(lo, hi, t), pixel_probability(lo, hi, v));
        golden.close(p_t, number(&o["p_t"]), "p_t");
        golden.close(p_v, number(&o["p_v"]), "p_v");
        golden.close(rounded_probability(lo, hi, t), number(&o["p_t_quantized"]), "p_t_quantized");
        golden.close(rounded_probability(lo, hi, v), number(&o["p_v_quantized"]), "p_v_quantized");
        let (low, high) = proximity_range(p_t, p_v);
        golden.close(low, number(&o["dp_low"]), "dp_low");
        golden.close(high, number(&o["dp_high"]), "dp_high");
    }
}

fn table(inputs: &Value) -> LlrTable {
    let level = |m: &str, s: &str| Level { mean: number(&inputs[m]), sd: number(&inputs[s]) };
    LlrTable::new(level("mean", "std"), level("bg_mean", "bg_std"), 256)
}

#[test]
fn likelihood_ratio_scores_are_the_golden_ones() {
    let golden = load("llr_detector");
    for case in &golden.cases {
        let (i, o) = (&case["inputs"], &case["outputs"]);
        let (image, table) = (grey(&i["image"]), table(i));
        let ours: Vec<f64> = [0, 50, 100, 150, 255].map(|g| table.at(g)).to_vec();
        golden.all_close(&ours, &numbers(&o["table_0_50_100_150_255"]), "table");
        let n = i["size"].as_u64().unwrap() as usize;
        let mut scores = ScoreImage::default();
        scores.fill(&image, &table, (n, n));
        let expected: Vec<f64> = rows(&o["score"]).concat();
        golden.all_close(scores.scores.as_slice(), &expected, "score");
        golden.all_close(scores.best().unwrap().0.add_scalar(1.0).as_slice(), &numbers(&o["argmax"]), "argmax");
        let mean = scores.posterior_mean().unwrap().add_scalar(1.0);
        golden.all_close(mean.as_slice(), &numbers(&o["posterior_mean"]), "posterior mean");
    }
}

#[test]
fn the_track_before_detect_density_is_the_golden_one() {
    let golden = load("tbd");
    for case in &golden.cases {
        let i = &case["inputs"];
        let table = table(i);
        let n = i["size"].as_u64().unwrap() as usize;
        let mut filter = TrackBeforeDetect::new(i["vmax"].as_u64().unwrap() as usize, number(&i["pv"]));
        let mut scores = ScoreImage::default();
        assert_eq!(i["images"].as_array().unwrap().len(), case["outputs"].as_array().unwrap().len(), "frames");
        for (k, (image, o)) in
            i["images"].as_array().unwrap().iter().zip(case["outputs"].as_array().unwrap()).enumerate()
        {
            scores.fill(&grey(image), &table, (n, n));
            let e = filter.step(&scores).unwrap();
            golden.all_close(e.map.add_scalar(1.0).as_slice(), &numbers(&o["map"]), &format!("frame {k}: map"));
            golden.all_close(e.mean.add_scalar(1.0).as_slice(), &numbers(&o["mean"]), &format!("frame {k}: mean"));
            golden.close(e.peak, number(&o["peak"]), &format!("frame {k}: peak"));
        }
    }
}

#[test]
fn the_dark_box_and_the_search_window_are_the_golden_ones() {
    let golden = load("dark_bbox_window");
    let (mut n_boxes, mut n_windows) = (0, 0);
    for case in &golden.cases {
        let (i, o) = (&case["inputs"], &case["outputs"]);
        let image = grey(&i["gray"]);
        let found = dark_box(&image, number(&i["thr"]), false, PixelRect::of_image(&image).unwrap());
        let Some(b) = found else {
            assert!(o["box"].is_null());
            continue;
        };
        let e = &o["box"];
        let sides = [b.left, b.right, b.top, b.bottom].map(|v| v as f64);
        assert_eq!(sides, ["left", "right", "top", "bottom"].map(|k| number(&e[k])));
        golden.all_close(b.centre().as_slice(), &[number(&e["cx"]), number(&e["cy"])], "centre");
        golden.all_close(b.semi_size().as_slice(), &[number(&e["semi_w"]), number(&e["semi_h"])], "semi size");
        n_boxes += 1;
        if o["window"].is_null() {
            continue;
        }
        n_windows += 1;
        let pair = |a: &str, b: &str| Vector2::new(number(&i[a]), number(&i[b]));
        let size = (image.width(), image.height());
        let margin = number(&i["margin"]);
        let w = search_window(pair("pred_cx", "pred_cy"), b.semi_size(), pair("dx", "dy"), margin, size).unwrap();
        assert_eq!([w.left, w.top, w.right, w.bottom].map(|v| v as f64).to_vec(), numbers(&o["window"]));
    }
    assert!(n_boxes > 0 && n_boxes < golden.cases.len() && n_windows > 0, "{n_boxes} boxes, {n_windows} windows");
}
