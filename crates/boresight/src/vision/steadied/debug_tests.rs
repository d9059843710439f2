use super::references::References;
use super::cover::{working,factor};
use crate::{Image, Pixels};
#[test]
fn debug_s1001() {
    let mut src = crate::io::open("/work/shared/data/uav_uavdt_S1001/frames", &crate::io::OpenOptions{colour: crate::io::Colour::Gray, ..Default::default()}).unwrap();
    let mut refs = References::new(0.32);
    let (mut line, mut now) = (Vec::new(), Image::default());
    let mut all = Vec::new();
    let mut frames: Vec<Image<u8>> = Vec::new();
    while let Some(f) = src.next_frame().unwrap() { if let Pixels::Gray8(i) = f.pixels { frames.push(i) } }
    for f in frames.iter().take(18).step_by(2) { let mut w = Image::default(); working(f, factor(f.width(), f.height()), &mut line, &mut w); all.push(w); }
    refs.prime(all);
    for (k, f) in frames.iter().enumerate() {
        working(f, factor(f.width(), f.height()), &mut line, &mut now);
        refs.step(&now, if k == 0 {0.0} else {0.04});
        let two = refs.two(&now).map(|t| t.map(|(_, h)| h));
        println!("{k} two {} {:?}", two.is_some(), two.map(|t| t[0].apply(nalgebra::Vector2::new(255.0, 134.0))));
        refs.keep(&mut now);
    }
}
