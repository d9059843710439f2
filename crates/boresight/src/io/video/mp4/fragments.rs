//! Samples of fragmented files (`moof`): each fragment carries its own small table.
//!
//! Source: ISO/IEC 14496-12, 8.8 (`tfhd`, `tfdt`, `trun`, defaults from `trex`).
//! Fragments are placed by their own decoding time (`tfdt`), so that a lost fragment leaves a gap in time.
//! Damage is told by what does not add up: numbers of fragments (`mfhd`) that skip, tables of tracks that the file does not have,
//! media bytes that no table claims.

use super::boxes::{Cursor, be32, cut};
use super::sample::{Sample, damaged};
use crate::Result;

/// Defaults of one track for its fragments.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Defaults {
    track: u32,
    description: u32,
    duration: u32,
    size: u32,
    flags: u32,
}

/// Reads the `trex` boxes of `mvex`.
pub(super) fn track_defaults(mut mvex: Cursor<'_>) -> Vec<Defaults> {
    let mut all = Vec::new();
    while let Some((name, mut b)) = mvex.next_box() {
        if &name != b"trex" {
            continue;
        }
        let row = b.version_flags().and_then(|_| {
            Some(Defaults {
                track: b.u32()?,
                description: b.u32()?,
                duration: b.u32()?,
                size: b.u32()?,
                flags: b.u32()?,
            })
        });
        all.extend(row);
    }
    all
}

/// Appends the samples of one track, fragment by fragment.
#[derive(Debug)]
pub(super) struct Reader {
    track: u32,
    defaults: Defaults,
    next_dts: i64,
    file_len: u64,
    /// Bytes claimed by the samples so far.
    claimed: u64,
    first_offset: Option<i32>,
    /// Tracks that the file has, and whether a fragment's table names another one.
    tracks: Vec<u32>,
    strange: u32,
    /// Tables with more rows than they count.
    longer: u32,
    /// Number of the newest fragment, and how often the next one is not its successor.
    sequence: Option<u32>,
    skips: u32,
    /// Bytes claimed by the samples of all tracks.
    claimed_by_all: u64,
    /// Whether composition and decoding times differ by more than a constant.
    pub reordered: bool,
}

impl Reader {
    pub fn new(track: u32, defaults: &[Defaults], file_len: u64) -> Self {
        let tracks = defaults.iter().map(|d| d.track).collect();
        let defaults = defaults.iter().find(|d| d.track == track).copied().unwrap_or_default();
        Self {
            track,
            defaults,
            next_dts: 0,
            file_len,
            claimed: 0,
            first_offset: None,
            tracks,
            strange: 0,
            longer: 0,
            sequence: None,
            skips: 0,
            claimed_by_all: 0,
            reordered: false,
        }
    }

    /// What is lost as far as the fragments tell, of `media` bytes in the file.
    pub fn lost(&self, media: u64) -> Option<String> {
        // A few bytes are padding.
        let unclaimed = media.saturating_sub(self.claimed_by_all);
        let mut signs = Vec::new();
        if self.skips > 0 {
            signs.push(format!("the numbers of its fragments skip {} times", self.skips));
        }
        if self.strange > 0 {
            signs.push(format!("{} tables are of a track that the file does not have", self.strange));
        }
        if self.longer > 0 {
            signs.push(format!("{} tables hold more rows than they count", self.longer));
        }
        if unclaimed > 16 {
            signs.push(format!("{unclaimed} of {media} bytes of pictures and sound stand in no table"));
        }
        (!signs.is_empty()).then(|| format!("frames are missing: {}", signs.join(", ")))
    }

    /// Adds the samples of one `moof` box whose header starts at `moof_start`.
    pub fn add(&mut self, moof: &[u8], moof_start: u64, samples: &mut Vec<Sample>) -> Result<()> {
        if let (true, Some(last)) = (self.next_dts == 0, samples.last()) {
            self.next_dts = last.dts + i64::from(last.duration);
        }
        let mut children = Cursor::new(moof);
        // Without a base of its own, a track's data follow those of the track before it.
        let mut data_end = moof_start;
        while let Some((name, body)) = children.next_box() {
            match &name {
                b"traf" => self.add_track(body, moof_start, &mut data_end, samples)?,
                b"mfhd" => self.number(body),
                _ => {}
            }
        }
        Ok(())
    }

    /// Takes a fragment's number: it follows the one before, but where files were joined and it begins anew.
    fn number(&mut self, mut mfhd: Cursor<'_>) {
        let Some(number) = mfhd.version_flags().and_then(|_| mfhd.u32()) else { return };
        let follows = self.sequence.is_none_or(|last| number == last.wrapping_add(1) || number <= 1);
        self.skips += u32::from(!follows);
        self.sequence = Some(number);
    }

    fn add_track(&mut self, traf: Cursor<'_>, moof_start: u64, end: &mut u64, out: &mut Vec<Sample>) -> Result<()> {
        let mut d = self.defaults;
        let mut base = *end;
        let mut track = 0;
        let mut boxes = traf;
        while let Some((name, mut b)) = boxes.next_box() {
            match &name {
                b"tfhd" => {
                    (track, base) = read_header(&mut b, &mut d, moof_start, *end).ok_or_else(|| cut("tfhd"))?;
                }
                b"tfdt" if track == self.track => {
                    let version = b.version_flags().ok_or_else(|| cut("tfdt"))?.0;
                    let time = if version == 1 { b.i64() } else { b.u32().map(i64::from) };
                    self.next_dts = time.filter(|t| (0..1 << 62).contains(t)).ok_or_else(|| cut("tfdt"))?;
                }
                b"trun" => {
                    let mine = track == self.track;
                    *end = self.add_run(&mut b, &d, base, *end, mine.then_some(&mut *out))?;
                }
                _ => {}
            }
        }
        // Without a header it is of no track at all.
        let known = track == self.track || self.tracks.contains(&track);
        self.strange += u32::from(!known);
        Ok(())
    }

    /// Reads one run; returns the byte after its data.
    fn add_run(
        &mut self,
        b: &mut Cursor<'_>,
        d: &Defaults,
        base: u64,
        end: u64,
        mut out: Option<&mut Vec<Sample>>,
    ) -> Result<u64> {
        let (_, flags) = b.version_flags().ok_or_else(|| cut("trun"))?;
        let count = b.u32().ok_or_else(|| cut("trun"))?;
        let mut offset = end.max(base);
        if flags & 0x1 != 0 {
            let shift = b.i32().ok_or_else(|| cut("trun"))?;
            offset = base.saturating_add_signed(i64::from(shift));
        }
        let mut first_flags = None;
        if flags & 0x4 != 0 {
            first_flags = Some(b.u32().ok_or_else(|| cut("trun"))?);
        }
        let has = |bit: u32| usize::from(flags & bit != 0) * 4;
        let (dur, size, flg, cto) = (has(0x100), has(0x200), has(0x400), has(0x800));
        let row_len = dur + size + flg + cto;
        if size == 0 && (d.size == 0 || u64::from(count) > self.file_len / u64::from(d.size)) {
            return Err(damaged(format!("a fragment claims {count} frames of {} bytes", d.size)));
        }
        let rows = if row_len == 0 { &[][..] } else { b.rest() };
        if (count as usize).checked_mul(row_len).is_none_or(|need| need > rows.len()) {
            return Err(cut("trun"));
        }
        self.longer += u32::from(rows.len() >= (count as usize + 1) * row_len && row_len > 0);
        for i in 0..count as usize {
            let row = rows.get(i * row_len..(i + 1) * row_len).unwrap_or_default();
            let bytes = if size > 0 { be32(row, dur) } else { d.size };
            self.claimed_by_all = self.claimed_by_all.saturating_add(u64::from(bytes));
            if let Some(out) = out.as_deref_mut() {
                let duration = if dur > 0 { be32(row, 0) } else { d.duration };
                let row_flags = if flg > 0 { be32(row, dur + size) } else { d.flags };
                let sample_flags = if i == 0 { first_flags.unwrap_or(row_flags) } else { row_flags };
                let shift = if cto > 0 { be32(row, dur + size + flg) as i32 } else { 0 };
                self.reordered |= *self.first_offset.get_or_insert(shift) != shift;
                self.claimed = self.claimed.saturating_add(u64::from(bytes));
                if size == 0 && self.claimed > self.file_len {
                    return Err(damaged("its fragments claim more bytes than the file holds"));
                }
                out.push(Sample {
                    offset,
                    size: bytes,
                    cts: self.next_dts + i64::from(shift),
                    dts: self.next_dts,
                    duration,
                    // 8.8.3.1: bit 16 says that the sample is not a sync sample.
                    sync: sample_flags & 0x0001_0000 == 0,
                    description: d.description.saturating_sub(1).min(u32::from(u16::MAX)) as u16,
                });
                self.next_dts = self.next_dts.saturating_add(i64::from(duration));
            }
            offset = offset.saturating_add(u64::from(bytes));
        }
        Ok(offset)
    }
}

/// Reads `tfhd`: the track, and where its data start; overwrites the defaults that it names.
fn read_header(b: &mut Cursor<'_>, d: &mut Defaults, moof_start: u64, end: u64) -> Option<(u32, u64)> {
    let (_, flags) = b.version_flags()?;
    let track = b.u32()?;
    let mut base = if flags & 0x02_0000 != 0 { moof_start } else { end };
    if flags & 0x1 != 0 {
        base = b.u64()?;
    }
    for (bit, field) in [(0x2, &mut d.description), (0x8, &mut d.duration), (0x10, &mut d.size), (0x20, &mut d.flags)] {
        if flags & bit != 0 {
            *field = b.u32()?;
        }
    }
    Some((track, base))
}
