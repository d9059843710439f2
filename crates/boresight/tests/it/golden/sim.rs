//! Golden vectors of the room `sim`: rendering from supplied normals.

use super::file::{load, number, numbers, rows};
use boresight::Image;
use boresight::sim::{PaperTarget, quantise, render_from_normals};

#[test]
fn render_agrees_with_the_golden_vectors() {
    let g = load("render");
    for case in &g.cases {
        let i = &case["inputs"];
        let z = rows(&i["zbg"]);
        let (w, h) = (z[0].len(), z.len());
        let z_background = Image::from_vec(w, h, z.concat()).unwrap();
        // The papers count from 1.
        let targets: Vec<_> = i["targets"]
            .as_array()
            .unwrap()
            .iter()
            .map(|t| PaperTarget {
                x_px: number(&t["x"]) - 1.0,
                y_px: number(&t["y"]) - 1.0,
                nx: t["nx"].as_u64().unwrap() as usize,
                ny: t["ny"].as_u64().unwrap() as usize,
                mean: number(&t["mean"]),
                std: number(&t["std"]),
            })
            .collect();
        let z_targets: Vec<_> = i["ztgt"].as_array().unwrap().iter().map(|t| rows(t).concat()).collect();
        let raw = render_from_normals(&z_background, number(&i["bg_mean"]), number(&i["bg_std"]), &targets, &z_targets);
        g.all_close(raw.as_slice(), &rows(&case["outputs"]["raw"]).concat(), "raw");
        let image: Vec<f64> = raw.as_slice().iter().map(|v| f64::from(quantise(*v))).collect();
        let golden: Vec<f64> = case["outputs"]["image"].as_array().unwrap().iter().flat_map(numbers).collect();
        assert_eq!(image, golden, "image");
    }
}
