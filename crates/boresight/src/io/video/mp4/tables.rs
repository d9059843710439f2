//! The sample tables of an unfragmented track (`stbl`): where each coded picture lies, and its times.
//!
//! Source: ISO/IEC 14496-12, 8.5 to 8.7; `avcC` from ISO/IEC 14496-15, 5.3.3.
//! Limits: the number of samples is bounded by the bytes that back it, so that a header cannot claim memory.

use super::boxes::{Cursor, be32, cut};
use super::sample::{Codec, Sample, damaged};
use crate::Result;

/// What the tables of a track hold.
#[derive(Debug, Default)]
pub(super) struct Table {
    pub codec: Option<Codec>,
    pub samples: Vec<Sample>,
    /// Whether composition and decoding times differ by more than a constant.
    pub reordered: bool,
    /// What does not add up: damage by which times or frames may be wrong or missing.
    pub odd: Vec<String>,
}

/// Other tables that may stand beside those that are read.
const OTHERS: [&[u8; 4]; 15] = [
    b"cslg", b"stsh", b"stz2", b"sdtp", b"stdp", b"padb", b"subs", b"sbgp", b"sgpd", b"saiz", b"saio", b"stps",
    b"free", b"skip", b"uuid",
];

/// Reads `stbl`.
pub(super) fn read(mut stbl: Cursor<'_>, file_len: u64) -> Result<Table> {
    let mut odd = Vec::new();
    let mut found: [Option<Cursor<'_>>; 8] = [None; 8];
    const NAMES: [&[u8; 4]; 8] = [b"stsd", b"stts", b"ctts", b"stss", b"stsc", b"stsz", b"stco", b"co64"];
    while let Some((name, body)) = stbl.next_box() {
        if let Some(i) = NAMES.iter().position(|n| **n == name) {
            found[i].get_or_insert(body);
        } else if !OTHERS.contains(&&name) {
            odd.push(format!("'{}' is no table of a video", String::from_utf8_lossy(&name).escape_default()));
        }
    }
    let [stsd, stts, ctts, stss, stsc, stsz, stco, co64] = found;
    let codec = stsd.map(|b| read_descriptions(b).ok_or_else(|| cut("stsd"))).transpose()?;
    let sizes = stsz.map(|b| read_sizes(b, file_len)).transpose()?.unwrap_or_default();
    let mut samples: Vec<Sample> = sizes
        .into_iter()
        .map(|size| Sample { offset: 0, size, cts: 0, dts: 0, duration: 0, sync: true, description: 0 })
        .collect();
    if samples.is_empty() {
        return Ok(Table { codec, odd, ..Table::default() });
    }
    let stts = stts.ok_or_else(|| damaged("its 'stts' box, the frames' times, is missing"))?;
    fill_times(&mut samples, stts).ok_or_else(|| cut("stts"))?;
    let mut reordered = false;
    if let Some(ctts) = ctts {
        reordered = fill_composition(&mut samples, ctts).ok_or_else(|| cut("ctts"))?;
        odd.extend(odd_composition(&samples, ctts));
    }
    if let Some(stss) = stss {
        fill_sync(&mut samples, stss).ok_or_else(|| cut("stss"))?;
    }
    let stsc = stsc.ok_or_else(|| damaged("its 'stsc' box, the frames of each chunk, is missing"))?;
    let chunks = match (stco, co64) {
        (Some(b), _) => read_offsets(b, 4),
        (None, Some(b)) => read_offsets(b, 8),
        (None, None) => return Err(damaged("its 'stco' box, where the frames lie, is missing")),
    }
    .ok_or_else(|| cut("stco"))?;
    let placed = fill_offsets(&mut samples, stsc, &chunks).ok_or_else(|| cut("stsc"))?;
    if placed < samples.len() {
        return Err(damaged(format!("its tables place {placed} of {} frames", samples.len())));
    }
    Ok(Table { codec, samples, reordered, odd })
}

/// Codec of each sample description; they must all be of one kind.
fn read_descriptions(mut stsd: Cursor<'_>) -> Option<Codec> {
    stsd.version_flags()?;
    let count = stsd.u32()?;
    let mut configurations = Vec::new();
    for _ in 0..count.min(1024) {
        let Some((name, mut body)) = stsd.next_box() else { break };
        if !matches!(&name, b"avc1" | b"avc3") {
            return Some(Codec::Other(String::from_utf8_lossy(&name).into_owned()));
        }
        // reserved 6, data reference 2, then 70 bytes of the visual sample entry
        body.skip(78)?;
        let mut configuration = None;
        while let Some((name, inner)) = body.next_box() {
            if &name == b"avcC" {
                configuration = Some(inner.rest().to_vec());
            }
        }
        configurations.push(configuration?);
    }
    (!configurations.is_empty()).then_some(Codec::H264(configurations))
}

fn read_sizes(mut stsz: Cursor<'_>, file_len: u64) -> Result<Vec<u32>> {
    let header = stsz.version_flags().and_then(|_| Some((stsz.u32()?, stsz.u32()?)));
    let (fixed, count) = header.ok_or_else(|| cut("stsz"))?;
    if fixed > 0 {
        // No bytes back such a table, but the frames themselves must.
        if u64::from(count) > file_len / u64::from(fixed) + 1 {
            return Err(damaged(format!("claims {count} frames of {fixed} bytes, more than the file can hold")));
        }
        return Ok(vec![fixed; count as usize]);
    }
    let rows = stsz.rows(count, 4).ok_or_else(|| cut("stsz"))?;
    Ok(rows.map(|r| be32(r, 0)).collect())
}

fn fill_times(samples: &mut [Sample], mut stts: Cursor<'_>) -> Option<()> {
    stts.version_flags()?;
    let count = stts.u32()?;
    let mut dts = 0i64;
    let mut rest = samples.iter_mut();
    let mut last = 0;
    for row in stts.rows(count, 8)? {
        // A delta with the top bit set is a negative one written by careless muxers; time never runs back here.
        last = i32::try_from(be32(row, 4)).unwrap_or(1) as u32;
        for s in rest.by_ref().take(be32(row, 0) as usize) {
            (s.dts, s.cts, s.duration) = (dts, dts, last);
            dts += i64::from(last);
        }
    }
    for s in rest {
        (s.dts, s.cts, s.duration) = (dts, dts, last);
        dts += i64::from(last);
    }
    Some(())
}

fn fill_composition(samples: &mut [Sample], mut ctts: Cursor<'_>) -> Option<bool> {
    ctts.version_flags()?;
    let count = ctts.u32()?;
    let mut rest = samples.iter_mut();
    let mut first = None;
    let mut reordered = false;
    for row in ctts.rows(count, 8)? {
        // Version 0 says unsigned, yet files with negative offsets in it exist and none needs more than 31 bits.
        let offset = i64::from(be32(row, 4) as i32);
        for s in rest.by_ref().take(be32(row, 0) as usize) {
            s.cts = s.dts + offset;
            reordered |= *first.get_or_insert(offset) != offset;
        }
    }
    Some(reordered)
}

/// What does not add up in the table of composition offsets: rows that count other frames than there are, two pictures at one time, a
/// picture shown later than any order of decoding explains (16 pictures can wait, ITU-T H.264, A.3.1).
fn odd_composition(samples: &[Sample], mut ctts: Cursor<'_>) -> Option<String> {
    ctts.version_flags()?;
    let count = ctts.u32()?;
    let n: u64 = ctts.rows(count, 8)?.map(|r| u64::from(be32(r, 0))).sum();
    if n != samples.len() as u64 {
        return Some(format!("'ctts', the order of the pictures, counts {n} of {} frames", samples.len()));
    }
    let mut times: Vec<i64> = samples.iter().map(|s| s.cts).collect();
    times.sort_unstable();
    let longest = samples.iter().map(|s| i64::from(s.duration)).max()?;
    let offset = || samples.iter().map(|s| s.cts - s.dts);
    let odd = times.windows(2).any(|w| w[0] == w[1]) || offset().max()? - offset().min()? > 17 * longest;
    odd.then(|| "'ctts', the order of the pictures, contradicts itself".to_string())
}

fn fill_sync(samples: &mut [Sample], mut stss: Cursor<'_>) -> Option<()> {
    stss.version_flags()?;
    let count = stss.u32()?;
    let rows = stss.rows(count, 4)?;
    samples.iter_mut().for_each(|s| s.sync = false);
    for row in rows {
        if let Some(s) = (be32(row, 0) as usize).checked_sub(1).and_then(|i| samples.get_mut(i)) {
            s.sync = true;
        }
    }
    Some(())
}

fn read_offsets(mut table: Cursor<'_>, row_len: usize) -> Option<Vec<u64>> {
    table.version_flags()?;
    let count = table.u32()?;
    let rows = table.rows(count, row_len)?;
    Some(
        rows.map(|r| {
            if row_len == 4 { u64::from(be32(r, 0)) } else { u64::from(be32(r, 0)) << 32 | u64::from(be32(r, 4)) }
        })
        .collect(),
    )
}

/// Walks chunks and samples together; returns the number of samples that have a place.
fn fill_offsets(samples: &mut [Sample], mut stsc: Cursor<'_>, chunks: &[u64]) -> Option<usize> {
    stsc.version_flags()?;
    let count = stsc.u32()?;
    let rows: Vec<[u32; 3]> = stsc.rows(count, 12)?.map(|r| [be32(r, 0), be32(r, 4), be32(r, 8)]).collect();
    let mut placed = 0;
    let mut run = 0;
    let mut rest = samples.iter_mut();
    for (i, &start) in chunks.iter().enumerate() {
        while rows.get(run + 1).is_some_and(|next| next[0] as usize <= i + 1) {
            run += 1;
        }
        let Some(&[_, per_chunk, description]) = rows.get(run) else { break };
        let mut offset = start;
        for s in rest.by_ref().take(per_chunk as usize) {
            s.offset = offset;
            s.description = description.saturating_sub(1).min(u32::from(u16::MAX)) as u16;
            offset = offset.saturating_add(u64::from(s.size));
            placed += 1;
        }
    }
    Some(placed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blank(n: usize) -> Vec<Sample> {
        vec![Sample { offset: 0, size: 10, cts: 0, dts: 0, duration: 0, sync: true, description: 0 }; n]
    }

    fn words(list: &[i32]) -> Vec<u8> {
        list.iter().flat_map(|w| w.to_be_bytes()).collect()
    }

    #[test]
    fn times_follow_the_runs_and_the_last_run_goes_on() {
        let mut s = blank(5);
        fill_times(&mut s, Cursor::new(&words(&[0, 2, 2, 100, 1, 50]))).unwrap();
        assert_eq!(s.iter().map(|s| s.dts).collect::<Vec<_>>(), [0, 100, 200, 250, 300]);
        let reordered = fill_composition(&mut s, Cursor::new(&words(&[0, 2, 1, 200, 1, -100]))).unwrap();
        assert!(reordered);
        assert_eq!(s.iter().map(|s| s.cts).collect::<Vec<_>>(), [200, 0, 200, 250, 300]);
    }

    #[test]
    fn chunks_of_different_size_place_every_sample() {
        let mut s = blank(5);
        let placed = fill_offsets(&mut s, Cursor::new(&words(&[0, 2, 1, 2, 1, 2, 3, 1])), &[100, 500]).unwrap();
        assert_eq!(placed, 5);
        assert_eq!(s.iter().map(|s| s.offset).collect::<Vec<_>>(), [100, 110, 500, 510, 520]);
    }

    #[test]
    fn a_table_that_claims_more_rows_than_bytes_is_refused() {
        assert!(fill_times(&mut blank(1), Cursor::new(&words(&[0, 1 << 30, 1, 1]))).is_none());
        let err = read_sizes(Cursor::new(&words(&[0, 1000, i32::MAX])), 5000).unwrap_err();
        assert!(err.to_string().contains("more than the file can hold"), "{err}");
    }
}
