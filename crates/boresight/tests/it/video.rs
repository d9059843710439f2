//! Broken video ends in words: cut files, absurd headers, mutations; nothing panics or hangs. Needs no program.

use boresight::ErrorKind;
use boresight::io::OpenOptions;
use boresight::io::video::open_mp4;
use std::path::{Path, PathBuf};

fn data_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/video")
}

/// Reads to the end or the first error, with frames of at most `max_pixels`.
fn drain(path: &Path, max_pixels: u64) -> Result<(usize, Vec<String>), boresight::Error> {
    let mut source = open_mp4(path, &OpenOptions { max_pixels, ..OpenOptions::default() })?;
    let (mut n, mut last) = (0, i64::MIN);
    while let Some(frame) = source.next_frame()? {
        assert!(frame.time.ns >= last, "times run backwards");
        (n, last) = (n + 1, frame.time.ns);
        assert!(n < 10_000, "no end");
    }
    Ok((n, source.warnings().to_vec()))
}

/// Sum of the lost frames that warnings speak of.
fn lost(text: &str) -> usize {
    let tail = text.lines().filter_map(|l| l.split_once("the last ")).map(|(_, rest)| rest);
    let middle = text.lines().filter(|l| l.contains("frames are damaged or depend"));
    tail.chain(middle).filter_map(|l| l.split(' ').next()?.parse::<usize>().ok()).sum()
}

#[test]
fn a_cut_file_gives_the_frames_before_the_cut_and_counts_the_lost() {
    let dir = tempfile::tempdir().unwrap();
    let whole = std::fs::read(data_folder().join("b_frames.mp4")).unwrap();
    let path = dir.path().join("cut.mp4");
    std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let err = drain(&path, 1 << 20).unwrap_err();
    assert_eq!(err.kind(), ErrorKind::Damaged);
    assert!(err.to_string().contains("moov"), "{err}");
    // With the tables in front (`faststart`), a file cut off in its data gives what there is.
    let n_tables = whole.len() - whole.windows(4).position(|w| w == b"moov").unwrap() + 4;
    let mut front = whole[..40].to_vec();
    let mut tables = whole[whole.len() - n_tables..].to_vec();
    let stco = tables.windows(4).position(|w| w == b"stco").unwrap() + 12;
    let moved = u32::from_be_bytes(tables[stco..stco + 4].try_into().unwrap()) + n_tables as u32;
    tables[stco..stco + 4].copy_from_slice(&moved.to_be_bytes());
    front.extend(&tables);
    front.extend(&whole[40..whole.len() - n_tables]);
    std::fs::write(&path, &front).unwrap();
    assert_eq!(drain(&path, 1 << 20).unwrap(), (25, Vec::new()));
    std::fs::write(&path, &front[..front.len() - 600]).unwrap();
    let (n, warnings) = drain(&path, 1 << 20).unwrap();
    let text = warnings.join("\n");
    assert!((5..25).contains(&n) && text.contains("the file ends before it"), "{n} {text}");
    assert_eq!(n + lost(&text), 25, "{n} {text}");
    // The tables stay whole, the data of the last frames are overwritten by nonsense lengths.
    let mut broken = whole.clone();
    let moov = whole.windows(4).position(|w| w == b"moov").unwrap();
    broken[moov - 650..moov - 4].fill(0xff);
    std::fs::write(&path, &broken).unwrap();
    let (n, warnings) = drain(&path, 1 << 20).unwrap();
    assert!((5..25).contains(&n), "{n}");
    let text = warnings.join("\n");
    assert_eq!(n + lost(&text), 25, "{n} {text}");
}

/// Boxes of these names: where each begins and ends, parents before their children.
fn boxes(bytes: &[u8], wanted: &[&[u8; 4]]) -> Vec<std::ops::Range<usize>> {
    let size = |at: usize| u32::from_be_bytes(bytes[at - 4..at].try_into().unwrap()) as usize;
    let named = (4..bytes.len() - 4).filter(|&at| wanted.iter().any(|w| bytes[at..].starts_with(*w)));
    named.map(|at| at - 4..at - 4 + size(at)).collect()
}

#[test]
fn one_damaged_byte_of_the_tables_never_loses_frames_in_silence() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("damaged.mp4");
    let tables: [&[u8; 4]; 6] = [b"moof", b"mfhd", b"traf", b"tfhd", b"trun", b"mdat"];
    for (name, tables) in
        [("fragmented.mp4", &tables[..]), ("fragmented_offset.mp4", &tables), ("b_frames.mp4", &[b"ctts"])]
    {
        let sound = std::fs::read(data_folder().join(name)).unwrap();
        std::fs::write(&path, &sound).unwrap();
        assert_eq!(drain(&path, 1 << 20).unwrap(), (25, Vec::new()), "{name}");
        let mut n_said = 0;
        for (k, found) in boxes(&sound, tables).into_iter().enumerate() {
            // Size, name, and the fields in front: what follows is alike, row by row.
            for at in found.start..found.end.min(found.start + 36) {
                let mut bytes = sound.clone();
                bytes[at] ^= [0x01, 0x10, 0x40][(at + k) % 3];
                std::fs::write(&path, &bytes).unwrap();
                match drain(&path, 1 << 16) {
                    Ok((n, warnings)) if warnings.is_empty() => {
                        assert_eq!(n, 25, "{name}, byte {at} (box {k}): frames are gone without a word");
                    }
                    _ => n_said += 1,
                }
            }
        }
        assert!(n_said > 5, "{name}: {n_said}");
    }
}

#[test]
fn headers_that_claim_absurd_sizes_are_refused() {
    let path = data_folder().join("b_frames.mp4");
    let err = drain(&path, 1000).unwrap_err();
    assert!(err.to_string().contains("64 x 48 pixels, more than is accepted"), "{err}");
    let dir = tempfile::tempdir().unwrap();
    let empty = dir.path().join("empty.mp4");
    std::fs::write(&empty, b"").unwrap();
    assert!(drain(&empty, 1 << 20).unwrap_err().to_string().contains("empty"));
    assert_eq!(drain(&dir.path().join("none.mp4"), 1).unwrap_err().kind(), ErrorKind::NotFound);
}

#[test]
fn no_mutation_of_a_clip_panics_or_hangs() {
    use rand::{Rng, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(20261121);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("mutant.mp4");
    let names = ["b_frames.mp4", "fragmented.mp4", "edit_list.mp4", "interlaced.mp4", "slices.mp4"];
    let (mut whole, mut refused) = (0, 0);
    for round in 0..150 {
        let clip = std::fs::read(data_folder().join(names[round % names.len()])).unwrap();
        let mut bytes = clip.clone();
        for _ in 0..=round % 8 {
            let (at, value) = (rng.next_u32() as usize % bytes.len(), rng.next_u32());
            match value % 4 {
                0 => bytes.truncate(at.max(1)),
                1 => bytes[at] = 0xff,
                2 => bytes[at] ^= 1 << (value >> 8 & 7),
                _ => bytes[at] = (value >> 8) as u8,
            }
        }
        std::fs::write(&path, &bytes).unwrap();
        // The pipe is not part of this: `open_mp4` hands over what is not H.264.
        match drain(&path, 1 << 16) {
            Ok(_) => whole += 1,
            Err(_) => refused += 1,
        }
    }
    assert!(whole > 20 && refused > 20, "{whole} read, {refused} refused: the mutations test nothing");
}
