//! MP4 and QuickTime files: from bytes on disk to a list of coded pictures with their true times.
//!
//! Source: ISO/IEC 14496-12 (base media file format), ISO/IEC 14496-15 (AVC in it), QuickTime File Format.
//! Why our own reader: times are what a tracker lives on. `re_mp4` shifts all times so that the first is zero, joins
//! fragments whose times leave a gap, reads the whole file into memory and panics on files without a chunk table.
//! Limits: one video track; no encryption, no external data, no compressed `moov`.

use super::boxes::{Cursor, FourCc, TopBox, cut, top_boxes};
use super::sample::{Codec, Sample, damaged};
use super::timeline::Step;
use super::{fragments, tables, timeline};
use crate::{Error, ErrorKind, Result};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Largest accepted `moov` or `moof` box, bytes (the tables of ten days at 60 frames/s).
const MAX_TABLES_BYTES: u64 = 1 << 29;

/// A video track ready to be read.
#[derive(Debug)]
pub(super) struct Movie {
    pub codec: Codec,
    /// Samples in decoding order.
    pub samples: Vec<Sample>,
    /// What to decode in which order, and when it is shown.
    pub steps: Vec<Step>,
    /// Ticks in a second.
    pub timescale: u32,
    /// Whether the file says that pictures are shown in another order than decoded.
    pub reordered: bool,
    /// Length of the file, bytes.
    pub file_len: u64,
    /// Things worth saying.
    pub warnings: Vec<String>,
}

/// What a `trak` box says, before its tables are joined.
#[derive(Debug, Default)]
struct Track {
    id: u32,
    timescale: u32,
    rotated: bool,
    codec: Option<Codec>,
    samples: Vec<Sample>,
    reordered: bool,
    odd: Vec<String>,
    edits: Vec<timeline::Edit>,
}

/// Reads the tables of the file's video track.
/// # Errors
/// When there is no movie, no video in it, or tables that contradict themselves.
pub(super) fn read_movie(file: &mut File, path: &Path) -> Result<Movie> {
    read_movie_inner(file).map_err(|e| e.at(path.display()))
}

fn read_movie_inner(file: &mut File) -> Result<Movie> {
    let io = |e: std::io::Error| Error::new(ErrorKind::Damaged, "cannot be read").because(e);
    let file_len = file.seek(SeekFrom::End(0)).map_err(io)?;
    if file_len == 0 {
        return Err(damaged("the file is empty (0 bytes)").hint("copy or record it again"));
    }
    let top = top_boxes(file, file_len).map_err(io)?;
    let mut warnings = Vec::new();
    let moov = top.iter().find(|b| b.name == *b"moov").ok_or_else(|| {
        if top.iter().any(|b| matches!(&b.name, b"ftyp" | b"mdat" | b"moof" | b"wide" | b"free" | b"skip")) {
            damaged("has no 'moov' box, the table that says where the frames are: the recording was cut short")
                .hint("record again, or rebuild the table with a repair tool such as `untrunc` and a sound file of the same camera")
        } else {
            Error::new(ErrorKind::Damaged, "is not an MP4 or MOV file: it holds none of the boxes that such a file starts with")
        }
    })?;
    let bytes = read_box(file, moov, file_len)?;
    let (mut movie_timescale, mut n_tracks) = (0, 0);
    let mut tracks = Vec::new();
    let mut defaults = Vec::new();
    let mut children = Cursor::new(&bytes);
    while let Some((name, mut body)) = children.next_box() {
        match &name {
            b"mvhd" => movie_timescale = header_timescale(&mut body).unwrap_or(0),
            b"trak" => {
                n_tracks += 1;
                if let Some(track) = read_track(body, file_len)? {
                    tracks.push(track);
                }
            }
            b"mvex" => defaults = fragments::track_defaults(body),
            b"cmov" => return Err(Error::new(ErrorKind::Unsupported, "its tables are compressed ('cmov')")),
            _ => {}
        }
    }
    if tracks.len() > 1 {
        warnings.push(format!("the file holds {} video tracks; the first is read", tracks.len()));
    }
    let mut track = tracks.into_iter().next().ok_or_else(|| {
        Error::new(ErrorKind::Unsupported, "holds no video track").hint("does the file hold sound only?")
    })?;
    if track.timescale == 0 {
        return Err(damaged("its video track has a clock of 0 ticks a second"));
    }
    let codec = track.codec.take().unwrap_or(Codec::Other("unknown".into()));
    let fragmented = top.iter().any(|b| b.name == *b"moof");
    let in_tables: u64 = track.samples.iter().map(|s| u64::from(s.size)).sum();
    if fragmented {
        let mut reader = fragments::Reader::new(track.id, &defaults, file_len);
        for moof in top.iter().filter(|b| b.name == *b"moof") {
            // A recording that was killed: what it had finished is whole, and what is lost is said below.
            if moof.end > file_len && !track.samples.is_empty() {
                break;
            }
            let bytes = read_box(file, moof, file_len)?;
            reader.add(&bytes, moof.start, &mut track.samples)?;
        }
        track.reordered |= reader.reordered;
        // Frames that the movie's own tables hold lie among the same bytes.
        let media = top.iter().filter(|b| b.name == *b"mdat").map(|b| b.end.min(file_len) - b.body).sum::<u64>();
        if in_tables == 0 || n_tracks == 1 {
            warnings.extend(reader.lost(media.saturating_sub(in_tables)));
        }
    }
    if track.samples.is_empty() {
        return Err(damaged("its video track holds no frames"));
    }
    if track.rotated {
        warnings.push(
            "the file asks for the picture to be turned for display; frames are given as they were recorded".into(),
        );
    }
    let steps = timeline::steps(&track.samples, &track.edits, track.timescale, movie_timescale, fragmented)?;
    // A damaged size can hide every fragment.
    if fragmented || !defaults.is_empty() {
        warnings.extend(not_understood(file, &top, file_len));
    }
    let odd =
        track.odd.iter().map(|o| format!("its tables are damaged, times and frames may be wrong or missing: {o}"));
    warnings.extend(odd);
    warnings.extend(timeline::hidden(&steps, &track.edits));
    let Track { samples, timescale, reordered, .. } = track;
    Ok(Movie { codec, samples, steps, timescale, reordered, file_len, warnings })
}

/// Boxes that stand on the top level of a fragmented file.
const TOP: [&[u8; 4]; 20] = [
    b"ftyp", b"styp", b"sidx", b"ssix", b"prft", b"emsg", b"moov", b"moof", b"mdat", b"mfra", b"free", b"skip",
    b"wide", b"uuid", b"meta", b"pdin", b"pnot", b"udta", b"imda", b"junk",
];

/// What follows the last box that is known: after a damaged size everything is read as what it is not. Zeros are padding.
fn not_understood(file: &mut File, top: &[TopBox], file_len: u64) -> Option<String> {
    let odd = top.iter().find(|b| !TOP.contains(&&b.name)).map(|b| b.start);
    if let (None, Some(last)) = (odd, top.last().filter(|b| b.end > file_len)) {
        let name = String::from_utf8_lossy(&last.name);
        let missing = last.end - file_len;
        return Some(format!(
            "its last '{name}' box claims {missing} bytes more than there are: frames in it or behind it are lost"
        ));
    }
    let from = odd.or_else(|| top.last().map(|b| b.end))?;
    let mut bytes = vec![0; usize::try_from(file_len.checked_sub(from)?).ok()?.min(1 << 16)];
    let read = file.seek(SeekFrom::Start(from)).and_then(|_| file.read_exact(&mut bytes));
    let padding = read.is_ok() && bytes.iter().all(|b| *b == 0);
    let n = file_len - from;
    (!padding)
        .then(|| format!("the last {n} bytes of the file are no part of it that is known: frames in them are lost"))
}

fn read_box(file: &mut File, b: &TopBox, file_len: u64) -> Result<Vec<u8>> {
    let name = String::from_utf8_lossy(&b.name).into_owned();
    if b.end > file_len {
        return Err(damaged(format!(
            "its '{name}' box, which says where the frames are, is cut off: {} bytes are missing",
            b.end - file_len
        ))
        .hint("copy the file again, or rebuild its table with a repair tool such as `untrunc`"));
    }
    let len = b.end - b.body;
    if len > MAX_TABLES_BYTES {
        return Err(damaged(format!("its '{name}' box claims {len} bytes, more than {MAX_TABLES_BYTES} are not read")));
    }
    let mut bytes = vec![0; len as usize];
    file.seek(SeekFrom::Start(b.body))
        .and_then(|_| file.read_exact(&mut bytes))
        .map_err(|e| damaged(format!("its '{name}' box cannot be read")).because(e))?;
    Ok(bytes)
}

/// The clock of `mvhd` or `mdhd`, ticks a second.
fn header_timescale(body: &mut Cursor<'_>) -> Option<u32> {
    let version = body.version_flags()?.0;
    body.skip(if version == 1 { 16 } else { 8 })?;
    body.u32()
}

/// Reads a `trak`; `None` if it is not video.
fn read_track(mut trak: Cursor<'_>, file_len: u64) -> Result<Option<Track>> {
    let mut track = Track::default();
    let mut media = None;
    while let Some((name, mut body)) = trak.next_box() {
        match &name {
            b"tkhd" => {
                if let Some((id, rotated)) = track_header(&mut body) {
                    (track.id, track.rotated) = (id, rotated);
                }
            }
            b"edts" => {
                while let Some((name, body)) = body.next_box() {
                    if &name == b"elst" {
                        track.edits = timeline::read_edits(body).ok_or_else(|| cut("elst"))?;
                    }
                }
            }
            b"mdia" => media = Some(body),
            _ => {}
        }
    }
    let Some(mut media) = media else { return Ok(None) };
    let (mut handler, mut info): (Option<FourCc>, _) = (None, None);
    while let Some((name, mut body)) = media.next_box() {
        match &name {
            b"mdhd" => track.timescale = header_timescale(&mut body).unwrap_or(0),
            b"hdlr" => handler = body.skip(8).and_then(|()| body.four_cc()),
            b"minf" => info = Some(body),
            _ => {}
        }
    }
    if handler != Some(*b"vide") {
        return Ok(None);
    }
    let Some(mut info) = info else { return Ok(None) };
    while let Some((name, body)) = info.next_box() {
        if &name == b"stbl" {
            let table = tables::read(body, file_len)?;
            track.codec = table.codec;
            track.samples = table.samples;
            track.reordered = table.reordered;
            track.odd = table.odd;
        }
    }
    Ok(Some(track))
}

/// Number of the track, and whether its matrix turns or mirrors the picture.
fn track_header(body: &mut Cursor<'_>) -> Option<(u32, bool)> {
    let version = body.version_flags()?.0;
    body.skip(if version == 1 { 16 } else { 8 })?;
    let id = body.u32()?;
    // reserved, duration, reserved (8), layer, group, volume, reserved
    body.skip(4 + if version == 1 { 8 } else { 4 } + 8 + 8)?;
    let (a, b) = (body.i32()?, body.i32()?);
    body.skip(4)?;
    let (c, d) = (body.i32()?, body.i32()?);
    Some((id, b != 0 || c != 0 || a < 0 || d < 0))
}
