//! Still images, stacks and streams written by other programs, whole, cut short and damaged.
//!
//! The files show formulas (see images/make.py), so every pixel's value is known without another decoder.

use boresight::io::{Colour, OpenOptions, open};
use boresight::{Error, Frame, Image, Pixels};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};

const SIZE: (usize, usize) = (19, 11);

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/images")
}

fn image<T: Copy>(value: impl Fn(usize, usize) -> T) -> Image<T> {
    let data = (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))).map(|(x, y)| value(x, y)).collect();
    Image::from_vec(SIZE.0, SIZE.1, data).unwrap()
}

fn g8(p: usize) -> Image<u8> {
    image(|x, y| ((7 * x + 13 * y + 31 * p) % 256) as u8)
}

fn g16(p: usize) -> Image<u16> {
    image(|x, y| ((1031 * x + 557 * y + 7001 * p) % 65536) as u16)
}

fn f32s(p: usize) -> Image<f32> {
    image(|x, y| x as f32 / 2.0 - y as f32 + p as f32 / 4.0)
}

fn rgb(p: usize) -> Image<[u8; 3]> {
    let gray = g8(p);
    image(|x, y| {
        let v = gray.get(x, y).unwrap();
        [v, v.wrapping_add(85), 255 - v]
    })
}

fn bit() -> Image<u8> {
    let gray = g8(0);
    image(|x, y| if gray.get(x, y).unwrap() > 127 { 255 } else { 0 })
}

/// Reads all frames; the warnings come with them.
fn read(path: &Path) -> Result<(Vec<Frame>, Vec<String>), Error> {
    let mut source = open(path, &OpenOptions { max_pixels: 1 << 16, ..OpenOptions::default() })?;
    let mut frames = Vec::new();
    while let Some(frame) = source.next_frame()? {
        frames.push(frame);
        assert!(frames.len() <= 1000, "{} never ends", path.display());
    }
    Ok((frames, source.warnings().to_vec()))
}

/// Number of first bytes that tell what a file is.
fn n_magic(name: &str) -> usize {
    match name.rsplit('.').next() {
        Some("bmp") => 18,
        Some("png") => 8,
        Some("y4m") => 9,
        Some("gif") => 6,
        _ => 4,
    }
}

/// Name, and the pixels of every frame.
fn exact() -> Vec<(&'static str, Vec<Pixels>)> {
    let three = |f: fn(usize) -> Pixels| (0..3).map(f).collect::<Vec<_>>();
    let gray16 = || three(|p| Pixels::Gray16(g16(p)));
    let gray8 = || three(|p| Pixels::Gray8(g8(p)));
    let colour = || three(|p| Pixels::Rgb8(rgb(p)));
    vec![
        ("g8.png", vec![Pixels::Gray8(g8(0))]),
        ("g16.png", vec![Pixels::Gray16(g16(0))]),
        ("rgb.png", vec![Pixels::Rgb8(rgb(0))]),
        ("rgb_alpha.png", vec![Pixels::Rgb8(rgb(0))]),
        ("rgb_palette.png", vec![Pixels::Rgb8(rgb(0))]),
        ("bit.png", vec![Pixels::Gray8(bit())]),
        ("bit.bmp", vec![Pixels::Gray8(bit())]),
        ("g8.bmp", vec![Pixels::Gray8(g8(0))]),
        ("rgb.bmp", vec![Pixels::Rgb8(rgb(0))]),
        ("g16.pgm", vec![Pixels::Gray16(g16(0))]),
        ("rgb.ppm", vec![Pixels::Rgb8(rgb(0))]),
        ("f32.pfm", vec![Pixels::GrayF32(f32s(0))]),
        ("g8.tif", gray8()),
        ("g16_lzw.tif", gray16()),
        ("g16_tiled.tif", gray16()),
        ("g16_big.tif", gray16()),
        ("g16_imagej.tif", gray16()),
        ("f32_deflate.tif", three(|p| Pixels::GrayF32(f32s(p)))),
        ("rgb_planes.tif", colour()),
        ("rgb_palette.tif", colour()),
        ("g12_packed.tif", three(|p| Pixels::Gray16(image(|x, y| g16(p).get(x, y).unwrap() >> 4)))),
        ("g8.gif", gray8()),
        ("g8.y4m", gray8()),
        ("g16.y4m", gray16()),
    ]
}

#[test]
fn every_pixel_of_every_format_is_exact() {
    for (name, want) in exact() {
        let (frames, warnings) = read(&folder().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        let got: Vec<Pixels> = frames.into_iter().map(|f| f.pixels).collect();
        assert!(got == want, "{name}: {} frames of {:?}, expected {}", got.len(), got[0].kind(), want.len());
        assert!(warnings.is_empty(), "{name}: {warnings:?}");
    }
}

#[test]
fn jpeg_grey_progressive_and_colour_show_the_same_picture() {
    let gray = |name: &str| {
        let options = OpenOptions { colour: Colour::Gray, ..OpenOptions::default() };
        let mut source = open(folder().join(name), &options).unwrap();
        match source.next_frame().unwrap().unwrap().pixels {
            Pixels::Gray8(image) => image,
            other => panic!("{name}: {:?}", other.kind()),
        }
    };
    let plain = gray("smooth.jpg");
    let same =
        |other: Image<u8>, most: u8| plain.as_slice().iter().zip(other.as_slice()).all(|(a, b)| a.abs_diff(*b) <= most);
    assert!(same(gray("smooth_progressive.jpg"), 0));
    assert!(same(gray("smooth_rgb.jpg"), 2)); // conversion to YCbCr and back, 8 bits
    // The centre of the picture the encoder was given: Gaussian of the formula, quality 95.
    let centre = i32::from(plain.get(9, 5).unwrap());
    assert!((centre - i32::from(g8(0).get(9, 5).unwrap())).abs() <= 12, "{centre}");
}

#[test]
fn a_gif_has_its_delays_as_times_and_y4m_its_rational_rate() {
    let times = |name: &str| read(&folder().join(name)).unwrap().0.iter().map(|f| f.time.ns).collect::<Vec<_>>();
    assert_eq!(times("g8.gif"), [0, 40_000_000, 110_000_000]);
    assert_eq!(times("g8.y4m"), [0, 33_366_667, 66_733_333]);
}

#[test]
fn a_file_cut_anywhere_gives_whole_frames_or_an_error_and_says_what_is_lost() {
    let dir = tempfile::tempdir().unwrap();
    for (name, want) in exact() {
        let bytes = std::fs::read(folder().join(name)).unwrap();
        let path = dir.path().join(name);
        // Every length near the ends, every 7th between.
        for n in (0..bytes.len())
            .filter(|n| *n < 80 || n + 80 > bytes.len() || n % 7 == 0)
            .filter(|n| *n == 0 || *n >= n_magic(name))
        {
            put(&path, &bytes[..n]);
            // What is left must be right to the pixel; less than all of it must be said.
            let Ok((frames, warnings)) = read(&path) else { continue };
            assert!(frames.len() <= want.len());
            for (frame, want) in frames.iter().zip(&want) {
                assert!(frame.pixels == *want, "{name} cut at {n}: frame {} is wrong", frame.index.0);
            }
            let all = frames.len() == want.len();
            // A Y4M stream cut exactly between frames is a sound shorter stream.
            let between = name.ends_with("y4m");
            assert!(all || between || !warnings.is_empty(), "{name} cut at {n}: {} frames, no warning", frames.len());
        }
    }
}

#[test]
fn damaged_files_are_errors_or_wrong_pixels_but_never_panics_or_endless() {
    let dir = tempfile::tempdir().unwrap();
    let mut names: Vec<String> = exact().into_iter().map(|(n, _)| n.to_string()).collect();
    names.extend(["smooth.jpg", "smooth_progressive.jpg", "smooth_rgb.jpg"].map(String::from));
    let rounds: u64 = std::env::var("BORESIGHT_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(60);
    for name in names {
        let sound = std::fs::read(folder().join(&name)).unwrap();
        for seed in 0..rounds {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut bytes = sound.clone();
            for _ in 0..random.random_range(1..8) {
                // Half of the hits go to the header, where sizes and offsets are.
                let span = if random.random_bool(0.5) { bytes.len().min(160) } else { bytes.len() };
                let at = random.random_range(0..span);
                match random.random_range(0..4) {
                    0 => bytes[at] = random.next_u32() as u8,
                    1 => bytes[at] ^= 1 << random.random_range(0..8),
                    2 => bytes[at] = [0, 1, 0x7f, 0x80, 0xff][random.random_range(0..5)],
                    _ => {
                        let end = (at + random.random_range(1..16)).min(bytes.len());
                        bytes.drain(at..end);
                        if bytes.is_empty() {
                            break;
                        }
                    }
                }
            }
            let path = dir.path().join(&name);
            put(&path, &bytes);
            // A header that no longer says what it is goes to ffmpeg: not this test's matter.
            if !bytes.starts_with(&sound[..n_magic(&name)]) {
                continue;
            }
            if let Ok((frames, _)) = read(&path) {
                assert!(frames.iter().all(|f| f.pixels.width() * f.pixels.height() <= 1 << 16));
            }
        }
    }
}

/// Writes a file anew; a file cut to nothing and written again would be flushed to the disk each time.
fn put(path: &Path, bytes: &[u8]) {
    let _ = std::fs::remove_file(path);
    std::fs::write(path, bytes).unwrap();
}

fn write_pgm(path: &Path, w: usize, h: usize) {
    let mut bytes = format!("P5 {w} {h} 255\n").into_bytes();
    bytes.extend(vec![9u8; w * h]);
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn a_folder_is_read_in_natural_order_and_a_change_of_size_names_both_files() {
    let dir = tempfile::tempdir().unwrap();
    for n in [1, 2, 10] {
        write_pgm(&dir.path().join(format!("f{n}.pgm")), 4, 4);
    }
    std::fs::write(dir.path().join("notes.txt"), "not a frame").unwrap();
    std::fs::write(dir.path().join(".hidden.pgm"), "not a frame").unwrap();
    assert_eq!(read(dir.path()).unwrap().0.len(), 3);
    write_pgm(&dir.path().join("f2.pgm"), 5, 4);
    let error = read(dir.path()).unwrap_err().to_string();
    assert!(error.contains("f2.pgm has 5 x 4") && error.contains("f1.pgm has 4 x 4"), "{error}");
}

#[test]
fn a_damaged_end_of_a_folder_is_a_warning_and_a_hole_in_it_an_error() {
    let dir = tempfile::tempdir().unwrap();
    for n in 0..6 {
        write_pgm(&dir.path().join(format!("f{n}.pgm")), 4, 4);
    }
    std::fs::write(dir.path().join("f4.pgm"), b"P5 4 4 255\n123").unwrap();
    std::fs::write(dir.path().join("f5.pgm"), b"").unwrap();
    let (frames, warnings) = read(dir.path()).unwrap();
    assert_eq!(frames.len(), 4);
    assert!(warnings[0].contains("2 frames are lost") && warnings[0].contains("f4.pgm"), "{warnings:?}");
    write_pgm(&dir.path().join("f5.pgm"), 4, 4);
    let error = read(dir.path()).unwrap_err().to_string();
    assert!(error.contains("f4.pgm") && error.contains("3 bytes of pixels, expected 16"), "{error}");
}

#[test]
fn what_is_not_there_or_no_image_is_said_plainly() {
    let dir = tempfile::tempdir().unwrap();
    let error = |path: &Path| read(path).unwrap_err().to_string();
    assert!(error(&dir.path().join("none.png")).contains("no such file"));
    assert!(error(dir.path()).contains("holds no image files"));
    std::fs::create_dir(dir.path().join("img1")).unwrap();
    assert!(error(dir.path()).contains("perhaps"));
    std::fs::write(dir.path().join("empty.png"), b"").unwrap();
    assert!(error(&dir.path().join("empty.png")).contains("empty"));
    std::fs::write(dir.path().join("table.csv"), b"frame,x,y\n0,1,2\n").unwrap();
    assert!(error(&dir.path().join("table.csv")).contains("found text"));
}

#[test]
fn headers_that_claim_a_billion_pixels_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let mut bmp = std::fs::read(folder().join("rgb.bmp")).unwrap();
    bmp[18..26].copy_from_slice(&[0, 0x80, 0, 0, 0, 0x80, 0, 0]);
    let mut png = std::fs::read(folder().join("g8.png")).unwrap();
    png[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    // Width and height are the first and second entries of the directory at byte 8.
    let mut tif = std::fs::read(folder().join("g8.tif")).unwrap();
    for tag in [256u16, 257, 278] {
        let at = tif.windows(2).position(|w| w == tag.to_le_bytes()).unwrap();
        tif[at + 2..at + 12].copy_from_slice(&[4, 0, 1, 0, 0, 0, 0, 0, 1, 0]);
    }
    let files: [(&str, &[u8]); 5] = [
        ("a.bmp", &bmp),
        ("a.png", &png),
        ("a.tif", &tif),
        ("a.pgm", b"P5 65536 65536 255\n"),
        ("a.y4m", b"YUV4MPEG2 W65536 H65536 F25:1\nFRAME\n"),
    ];
    for (name, bytes) in files {
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let error = read(&path).unwrap_err().to_string();
        // A PNG's header has a checksum of its own, which the change breaks.
        assert!(
            error.contains("65536 x 65536") || error.contains("32768 x 32768") || name == "a.png",
            "{name}: {error}"
        );
    }
}

#[test]
fn what_the_fuzzer_found_is_refused_without_a_panic() {
    // A palette whose bytes are no multiple of three, at which the decoder panics.
    let error = read(&folder().join("damaged/palette_of_four_bytes.png")).unwrap_err().to_string();
    assert!(error.contains("a palette of 4 bytes"), "{error}");
}

/// Writes a stack of 8-bit pages with a description on the first; page p is filled with p.
fn write_stack(path: &Path, n: u8, description: &str) {
    let mut out = tiff::encoder::TiffEncoder::new(std::fs::File::create(path).unwrap()).unwrap();
    for page in 0..n {
        let mut image = out.new_image::<tiff::encoder::colortype::Gray8>(4, 3).unwrap();
        if page == 0 {
            image.encoder().write_tag(tiff::tags::Tag::ImageDescription, description).unwrap();
        }
        image.write_data(&[page; 12]).unwrap();
    }
}

/// First pixel of every frame, and the number of frames announced.
fn pages(path: &Path, options: &OpenOptions) -> (Vec<u8>, Option<u64>, Vec<String>) {
    let mut source = open(path, options).unwrap();
    let announced = source.info().n_frames;
    let mut values = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        let Pixels::Gray8(image) = &frame.pixels else { panic!("8-bit grey expected") };
        values.push(image.as_slice()[0]);
    }
    (values, announced, source.warnings().to_vec())
}

#[test]
fn one_channel_of_a_hyperstack_is_read_and_said() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("two channels.tif");
    write_stack(&path, 6, "ImageJ=1.53t\nimages=6\nchannels=2\nframes=3\nhyperstack=true\n");
    let plain = OpenOptions::default();
    let (values, announced, warnings) = pages(&path, &plain);
    assert_eq!((values, announced), (vec![0, 2, 4], Some(3)));
    assert!(warnings[0].contains("2 channels x 1 slices x 3 times"), "{warnings:?}");
    assert_eq!(pages(&path, &OpenOptions { first_page: 1, ..plain.clone() }).0, [1, 3, 5]);
    let every = pages(&path, &OpenOptions { page_step: Some(1), ..plain.clone() });
    assert_eq!((every.0, every.1, every.2), (vec![0, 1, 2, 3, 4, 5], Some(6), vec![]));
    assert_eq!(pages(&path, &OpenOptions { page_step: Some(4), first_page: 1, ..plain.clone() }).0, [1, 5]);
    write_stack(&path, 4, "ImageJ=1.53t\nimages=9\nslices=9\n");
    let (values, _, warnings) = pages(&path, &plain);
    assert_eq!(values, [0, 1, 2, 3]);
    assert!(warnings[0].contains("claims 9 pages, 4 are"), "{warnings:?}");
}

#[test]
fn frames_and_times_follow_the_numbers_where_files_are_missing() {
    let dir = tempfile::tempdir().unwrap();
    for k in [3, 4, 5, 9, 10] {
        std::fs::write(dir.path().join(format!("f_{k}.pgm")), b"P5 1 1 255\n7").unwrap();
    }
    let mut source = open(dir.path(), &OpenOptions { rate_hz: 10.0, ..OpenOptions::default() }).unwrap();
    let mut times = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        times.push((frame.index.0, frame.time.ns / 1_000_000));
    }
    // As in a truth that counts the files' numbers.
    assert_eq!(times, [(0, 0), (1, 100), (2, 200), (6, 600), (7, 700)]);
    assert!(source.warnings()[0].contains("3 numbers are missing"), "{:?}", source.warnings());
}
