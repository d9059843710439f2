//! Tests of `nut`.

use super::*;
use rand::{RngExt, SeedableRng};

#[test]
fn numbers_follow_the_specifications_form() {
    assert_eq!(v(&mut &[0x83, 0xdc, 0xeb, 0x94, 0x00][..]).unwrap(), 1_000_000_000);
    assert_eq!(s(&mut &[0][..]).unwrap(), 0);
    assert_eq!(s(&mut &[1][..]).unwrap(), 1);
    assert_eq!(s(&mut &[2][..]).unwrap(), -1);
    assert!(v(&mut &[255; 20][..]).is_err());
}

/// A number as the stream writes it.
fn number(mut n: u64, out: &mut Vec<u8>) {
    let mut bytes = vec![(n & 127) as u8];
    while n >> 7 != 0 {
        n >>= 7;
        bytes.push((n & 127) as u8 | 128);
    }
    out.extend(bytes.iter().rev());
}

/// A stream that is a main header with these numbers.
fn main_header(numbers: &[u64]) -> Vec<u8> {
    let mut body = Vec::new();
    numbers.iter().for_each(|n| number(*n, &mut body));
    let mut out = ID.to_vec();
    out.extend(MAIN.to_be_bytes());
    number(body.len() as u64 + 4, &mut out);
    out.extend(body);
    out.extend([0; 4]);
    out
}

#[test]
fn clocks_beyond_the_specification_are_refused() {
    for clock in [[0, 1], [1, 0], [1 << 31, 1], [1, u64::MAX]] {
        let error = Nut::open(&main_header(&[3, 1, 0, 1, clock[0], clock[1]])[..]).err().unwrap();
        assert!(error.to_string().contains("clock"), "{error}");
    }
}

#[test]
fn frame_sizes_at_the_end_of_the_numbers_do_not_overflow() {
    // One row of 256 codes: flags, fields, pts, size_mul, stream, size_lsb, reserved, count; then no elisions.
    let bytes = main_header(&[3, 1, 0, 1, 1, 25, 0, 6, 0, 1, 0, u64::MAX, 0, 255, 0]);
    assert_eq!(Nut::open(&bytes[..]).err().map(|e| e.kind()), Some(io::ErrorKind::UnexpectedEof));
}

#[test]
fn garbage_is_an_error_and_not_a_panic() {
    assert!(Nut::open(&b"RIFF1234AVI LIST and much more than this"[..]).is_err());
    let mut bytes = ID.to_vec();
    bytes.extend(MAIN.to_be_bytes());
    bytes.extend([255; 64]);
    assert!(Nut::open(&bytes[..]).is_err());
}

#[test]
fn damaged_streams_are_survived() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/video/gray.nut");
    let sound = std::fs::read(path).unwrap();
    assert_eq!(read_all(&sound).unwrap(), 3, "three pictures of 16 x 8 px");
    let mut rng = rand_chacha::ChaCha8Rng::from_seed([5; 32]);
    let mut refused = 0;
    for _ in 0..4000 {
        let mut bytes = sound.clone();
        for _ in 0..rng.random_range(1..5) {
            let at = rng.random_range(0..bytes.len().min(300));
            match rng.random_range(0..4) {
                0 => bytes[at] = rng.random(),
                1 => bytes[at] ^= 1 << rng.random_range(0..8),
                2 => bytes.truncate(at.max(1)),
                _ => bytes[at] = 0xff,
            }
        }
        refused += u32::from(read_all(&bytes).is_err());
    }
    assert!(refused > 400, "{refused}");
}
