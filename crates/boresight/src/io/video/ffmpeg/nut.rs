//! Reads the NUT container as the `ffmpeg` program writes it to a pipe: one stream of raw pictures with exact times.
//!
//! Source: *NUT Open Container Format* (nut.txt of the NUT project, version 3).
//! Why NUT: it is the one container of ffmpeg that carries raw pictures, their format and times of any clock through a
//! pipe. Symbols as in the specification: `v` a number of 7 bits a byte, `s` a signed one, `t` a time with its base.
//! Limits: one video stream, no elision headers longer than 256 bytes, packets below 16 MiB (frames: the caller's).

use std::io::{self, Read};

const MAIN: u64 = 0x4e4d_7a56_1f5f_04ad;
const STREAM: u64 = 0x4e53_1140_5bf2_f9db;
const SYNCPOINT: u64 = 0x4e4b_e4ad_eeca_4569;
const INDEX: u64 = 0x4e58_dd67_2f23_e64e;
const ID: &[u8; 25] = b"nut/multimedia container\0";

/// Numerators and denominators of a time base.
const CLOCK: std::ops::Range<u64> = 1..1 << 31;

const FLAG_CODED_PTS: u64 = 8;
const FLAG_STREAM_ID: u64 = 16;
const FLAG_SIZE_MSB: u64 = 32;
const FLAG_CHECKSUM: u64 = 64;
const FLAG_RESERVED: u64 = 128;
const FLAG_SIDE_DATA: u64 = 256;
const FLAG_HEADER_IDX: u64 = 1024;
const FLAG_MATCH_TIME: u64 = 2048;
const FLAG_CODED: u64 = 4096;
const FLAG_INVALID: u64 = 8192;

/// One row of the frame code table.
#[derive(Clone, Copy, Debug, Default)]
struct Code {
    flags: u64,
    pts_delta: i64,
    size_mul: u64,
    size_lsb: u64,
    reserved: u64,
    header: usize,
}

/// The stream's format.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Format {
    /// The name of the pixel format, four bytes.
    pub tag: Vec<u8>,
    pub width: u64,
    pub height: u64,
    /// Seconds of a tick: numerator, denominator.
    pub time_base: (u64, u64),
}

/// Head of one frame; its `size` bytes follow and must be read from [`Nut::reader`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Head {
    /// Presentation time, ticks.
    pub pts: i64,
    /// Bytes of the picture.
    pub size: u64,
}

/// A NUT stream being read.
pub(super) struct Nut<R> {
    pub reader: R,
    pub format: Format,
    codes: Vec<Code>,
    elisions: Vec<usize>,
    time_bases: Vec<(u64, u64)>,
    msb_pts_shift: u32,
    last_pts: i64,
    n_streams: u64,
}

fn bad(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what.to_string())
}

fn byte(r: &mut impl Read) -> io::Result<u8> {
    let mut b = [0];
    r.read_exact(&mut b)?;
    Ok(b[0])
}

fn v(r: &mut impl Read) -> io::Result<u64> {
    let mut value = 0u64;
    for _ in 0..10 {
        let b = byte(r)?;
        value = value.checked_mul(128).ok_or_else(|| bad("a number is too long"))? | u64::from(b & 127);
        if b & 128 == 0 {
            return Ok(value);
        }
    }
    Err(bad("a number is too long"))
}

fn s(r: &mut impl Read) -> io::Result<i64> {
    let t = v(r)?.wrapping_add(1);
    let half = (t >> 1) as i64;
    Ok(if t & 1 == 1 { -half } else { half })
}

fn skip(r: &mut impl Read, n: u64) -> io::Result<()> {
    let got = io::copy(&mut r.take(n), &mut io::sink())?;
    if got == n { Ok(()) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
}

impl<R: Read> Nut<R> {
    /// Reads up to the stream's header.
    pub fn open(mut reader: R) -> io::Result<Self> {
        let mut id = [0; ID.len()];
        reader.read_exact(&mut id)?;
        if &id != ID {
            return Err(bad("is not a NUT stream"));
        }
        let mut nut = Self {
            reader,
            format: Format::default(),
            codes: Vec::new(),
            elisions: vec![0],
            time_bases: Vec::new(),
            msb_pts_shift: 0,
            last_pts: 0,
            n_streams: 0,
        };
        while nut.format.tag.is_empty() {
            let mut start = [0; 8];
            nut.reader.read_exact(&mut start)?;
            nut.packet(u64::from_be_bytes(start))?;
        }
        Ok(nut)
    }

    /// Reads the next frame's head; `None` at the end.
    pub fn next_head(&mut self) -> io::Result<Option<Head>> {
        loop {
            let code = match byte(&mut self.reader) {
                Ok(b) => b,
                Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
                Err(e) => return Err(e),
            };
            if code != b'N' {
                return self.frame(code).map(Some);
            }
            let mut start = [b'N'; 8];
            self.reader.read_exact(&mut start[1..])?;
            if u64::from_be_bytes(start) == INDEX {
                io::copy(&mut self.reader, &mut io::sink())?;
                return Ok(None);
            }
            self.packet(u64::from_be_bytes(start))?;
        }
    }

    fn frame(&mut self, code: u8) -> io::Result<Head> {
        let c = *self.codes.get(usize::from(code)).ok_or_else(|| bad("a frame comes before the header"))?;
        let r = &mut self.reader;
        let mut flags = c.flags;
        if flags & FLAG_INVALID != 0 {
            return Err(bad("a frame has a code that the header forbids"));
        }
        if flags & FLAG_CODED != 0 {
            flags ^= v(r)?;
        }
        let (mut reserved, mut header, mut size) = (c.reserved, c.header, c.size_lsb);
        if flags & FLAG_STREAM_ID != 0 && v(r)? != 0 {
            return Err(bad("a frame belongs to a stream that is not there"));
        }
        let mut pts = self.last_pts.wrapping_add(c.pts_delta);
        if flags & FLAG_CODED_PTS != 0 {
            let coded = v(r)?;
            let range = 1u64 << self.msb_pts_shift;
            pts = if coded < range {
                // The low bits: the time nearest to the last one that ends in them.
                let delta = self.last_pts.wrapping_sub((range / 2) as i64);
                ((coded as i64).wrapping_sub(delta) & (range as i64 - 1)).wrapping_add(delta)
            } else {
                (coded - range) as i64
            };
        }
        if flags & FLAG_SIZE_MSB != 0 {
            size = v(r)?.checked_mul(c.size_mul).and_then(|m| m.checked_add(size)).ok_or_else(|| bad("frame size"))?;
        }
        if flags & FLAG_MATCH_TIME != 0 {
            s(r)?;
        }
        if flags & FLAG_HEADER_IDX != 0 {
            header = v(r)? as usize;
        }
        if flags & FLAG_RESERVED != 0 {
            reserved = v(r)?;
        }
        for _ in 0..reserved {
            v(r)?;
        }
        if flags & FLAG_CHECKSUM != 0 {
            skip(r, 4)?;
        }
        if flags & FLAG_SIDE_DATA != 0 || self.elisions.get(header) != Some(&0) {
            return Err(bad("a frame carries side data, which raw pictures never do"));
        }
        self.last_pts = pts;
        Ok(Head { pts, size })
    }

    fn packet(&mut self, start: u64) -> io::Result<()> {
        let len = v(&mut self.reader)?;
        if len > 4096 {
            skip(&mut self.reader, 4)?;
        }
        if !(4..1 << 24).contains(&len) {
            return Err(bad("a packet has an absurd length"));
        }
        let mut body = vec![0; len as usize];
        self.reader.read_exact(&mut body)?;
        let mut b = body.get(..len as usize - 4).unwrap_or_default();
        match start {
            MAIN => self.main(&mut b),
            STREAM => self.stream(&mut b),
            SYNCPOINT => {
                let t = v(&mut b)?;
                let n = self.time_bases.len().max(1) as u64;
                let from = self.time_bases.get((t % n) as usize).copied().unwrap_or((1, 1));
                let to = self.format.time_base;
                let scaled = i128::from(t / n) * i128::from(from.0) * i128::from(to.1);
                self.last_pts = (scaled / (i128::from(from.1) * i128::from(to.0)).max(1)) as i64;
                Ok(())
            }
            _ => Ok(()), // info and what may come later
        }
    }

    fn main(&mut self, b: &mut &[u8]) -> io::Result<()> {
        if v(b)? > 3 {
            return Err(bad("is a NUT version that is not read"));
        }
        self.n_streams = v(b)?;
        v(b)?; // largest distance of syncpoints
        let n = v(b)?;
        for _ in 0..n.min(64) {
            let base = (v(b)?, v(b)?);
            // The specification's bound; times a 64-bit tick it stays within 127 bits.
            if !(CLOCK.contains(&base.0) && CLOCK.contains(&base.1)) {
                return Err(bad("has an absurd clock"));
            }
            self.time_bases.push(base);
        }
        let mut row = Code { header: 0, size_mul: 1, ..Code::default() };
        self.codes.clear();
        while self.codes.len() < 256 {
            row.flags = v(b)?;
            let fields = v(b)?;
            row.size_lsb = 0;
            row.reserved = 0;
            if fields > 0 {
                row.pts_delta = s(b)?;
            }
            if fields > 1 {
                row.size_mul = v(b)?;
            }
            if fields > 2 {
                v(b)?; // stream
            }
            if fields > 3 {
                row.size_lsb = v(b)?;
            }
            if fields > 4 {
                row.reserved = v(b)?;
            }
            let count = if fields > 5 { v(b)? } else { row.size_mul.saturating_sub(row.size_lsb) };
            if fields > 6 {
                s(b)?;
            }
            if fields > 7 {
                row.header = v(b)? as usize;
            }
            for _ in 8..fields {
                v(b)?;
            }
            let lsb = row.size_lsb;
            let mut j = 0;
            while j < count && self.codes.len() < 256 {
                if self.codes.len() == usize::from(b'N') {
                    self.codes.push(Code { flags: FLAG_INVALID, ..row });
                } else {
                    self.codes.push(Code { size_lsb: lsb.saturating_add(j), ..row });
                    j += 1;
                }
            }
        }
        self.elisions = vec![0];
        for _ in 0..v(b)?.min(128) {
            let len = v(b)?;
            skip(b, len)?;
            self.elisions.push(len as usize);
        }
        Ok(())
    }

    fn stream(&mut self, b: &mut &[u8]) -> io::Result<()> {
        let (id, class) = (v(b)?, v(b)?);
        if id != 0 || class != 0 || self.n_streams != 1 {
            return Err(bad("holds more than one video stream"));
        }
        let len = v(b)?;
        let mut tag = vec![0; len.min(16) as usize];
        b.read_exact(&mut tag)?;
        let base = v(b)? as usize;
        self.format.time_base = *self.time_bases.get(base).ok_or_else(|| bad("names no time base"))?;
        self.msb_pts_shift = u32::try_from(v(b)?).unwrap_or(99);
        if self.msb_pts_shift > 48 {
            return Err(bad("has an absurd clock"));
        }
        v(b)?; // largest distance in time
        v(b)?; // decoding delay
        v(b)?; // stream flags
        let extra = v(b)?;
        skip(b, extra)?;
        self.format.width = v(b)?;
        self.format.height = v(b)?;
        self.format.tag = tag;
        Ok(())
    }
}

/// Reads every picture of a stream and throws it away; how many there were.
pub fn read_all(bytes: &[u8]) -> io::Result<u64> {
    const MOST_BYTES: u64 = 1 << 20;
    let mut nut = Nut::open(bytes)?;
    let mut n = 0;
    while let Some(head) = nut.next_head()? {
        let read = io::copy(&mut nut.reader.by_ref().take(head.size.min(MOST_BYTES)), &mut io::sink())?;
        if read < head.size {
            return Err(bad("a picture breaks off, or is larger than this reader takes"));
        }
        n += 1;
    }
    Ok(n)
}

#[cfg(test)]
mod tests;
