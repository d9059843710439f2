//! The box structure of MP4 files: headers on disk, and a cursor over a box's bytes that never reads past its end.
//!
//! Source: ISO/IEC 14496-12, 4.2 (size 32 bit, 64 bit after size 1, to the end of the file for size 0).

use super::sample::damaged;
use crate::Error;
use std::io::{Read, Seek, SeekFrom};

/// A box's name.
pub(super) type FourCc = [u8; 4];

/// A box at the top level of a file.
#[derive(Debug)]
pub(super) struct TopBox {
    pub name: FourCc,
    /// First byte of the header.
    pub start: u64,
    /// First byte of the body.
    pub body: u64,
    /// Byte after the last one; beyond the file's end if the file is cut off.
    pub end: u64,
}

/// An error for a box that is shorter than it must be.
pub(super) fn cut(name: &str) -> Error {
    damaged(format!("its '{name}' box is shorter than what it claims to hold"))
}

/// Most boxes looked at on the top level (a fragmented file has two or three for each fragment).
const MAX_TOP_BOXES: usize = 4_000_000;

/// Lists the boxes of a file by hopping over their bodies; stops at bytes that are no box.
pub(super) fn top_boxes<R: Read + Seek>(file: &mut R, file_len: u64) -> std::io::Result<Vec<TopBox>> {
    let mut boxes = Vec::new();
    let mut start = 0u64;
    let mut header = [0u8; 16];
    while start.saturating_add(8) <= file_len && boxes.len() < MAX_TOP_BOXES {
        file.seek(SeekFrom::Start(start))?;
        file.read_exact(&mut header[..8])?;
        let [a, b, c, d, name @ ..] = header;
        let name: FourCc = [name[0], name[1], name[2], name[3]];
        let (head_len, len) = match u32::from_be_bytes([a, b, c, d]) {
            0 => (8, file_len - start),
            1 => {
                if start + 16 > file_len {
                    break;
                }
                file.read_exact(&mut header[8..])?;
                let mut long = [0; 8];
                long.copy_from_slice(&header[8..]);
                (16, u64::from_be_bytes(long))
            }
            n => (8, u64::from(n)),
        };
        if len < head_len || !name.iter().all(|c| (0x20..0x7f).contains(c) || *c == 0xa9) {
            break;
        }
        let end = start.saturating_add(len);
        boxes.push(TopBox { name, start, body: start + head_len, end });
        start = end;
    }
    Ok(boxes)
}

/// A place in a box's bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
}

impl<'a> Cursor<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    /// Bytes left.
    pub fn rest(&self) -> &'a [u8] {
        self.bytes
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.bytes.split_first_chunk::<N>()?;
        self.bytes = rest;
        Some(*head)
    }

    pub fn skip(&mut self, n: usize) -> Option<()> {
        self.bytes = self.bytes.get(n..)?;
        Some(())
    }

    pub fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_be_bytes)
    }

    pub fn i32(&mut self) -> Option<i32> {
        self.take().map(i32::from_be_bytes)
    }

    pub fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_be_bytes)
    }

    pub fn i64(&mut self) -> Option<i64> {
        self.take().map(i64::from_be_bytes)
    }

    pub fn four_cc(&mut self) -> Option<FourCc> {
        self.take()
    }

    /// Version and flags of a full box.
    pub fn version_flags(&mut self) -> Option<(u8, u32)> {
        let v = self.u32()?;
        Some(((v >> 24) as u8, v & 0x00ff_ffff))
    }

    /// The next box inside; a size beyond the end is cut to the end, nonsense ends the walk.
    pub fn next_box(&mut self) -> Option<(FourCc, Cursor<'a>)> {
        let whole = self.bytes;
        let size = self.u32()?;
        let name = self.four_cc()?;
        let (head_len, len) = match size {
            0 => (8, whole.len()),
            1 => (16, usize::try_from(self.u64()?).ok()?),
            n => (8, n as usize),
        };
        let len = len.min(whole.len());
        let body = whole.get(head_len..len)?;
        self.bytes = whole.get(len..)?;
        Some((name, Cursor::new(body)))
    }

    /// A table of `count` rows of `row_len` bytes: the rows, if all are there.
    pub fn rows(&self, count: u32, row_len: usize) -> Option<std::slice::ChunksExact<'a, u8>> {
        let len = (count as usize).checked_mul(row_len)?;
        Some(self.bytes.get(..len)?.chunks_exact(row_len))
    }
}

/// The big-endian number at `at` of a row (0 if the row is too short, which `rows` rules out).
pub(super) fn be32(row: &[u8], at: usize) -> u32 {
    row.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_be_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_that_claims_more_than_there_is_ends_where_the_bytes_end() {
        let bytes = [0, 0, 0, 200, b'a', b'b', b'c', b'd', 1, 2];
        let mut c = Cursor::new(&bytes);
        let (name, body) = c.next_box().unwrap();
        assert_eq!((&name, body.rest()), (b"abcd", &[1u8, 2][..]));
        assert!(c.next_box().is_none());
    }

    #[test]
    fn a_size_smaller_than_the_header_ends_the_walk() {
        assert!(Cursor::new(&[0, 0, 0, 4, b'a', b'b', b'c', b'd']).next_box().is_none());
        let mut file = std::io::Cursor::new([0, 0, 0, 4, b'a', b'b', b'c', b'd']);
        assert!(top_boxes(&mut file, 8).unwrap().is_empty());
    }

    #[test]
    fn sizes_of_64_bits_and_to_the_end_of_the_file_are_read() {
        let mut bytes = vec![0, 0, 0, 1, b'm', b'd', b'a', b't', 0, 0, 0, 0, 0, 0, 0, 18, 7, 7];
        bytes.extend([0, 0, 0, 0, b'f', b'r', b'e', b'e', 9]);
        let len = bytes.len() as u64;
        let boxes = top_boxes(&mut std::io::Cursor::new(bytes), len).unwrap();
        assert_eq!((boxes[0].body, boxes[0].end), (16, 18));
        assert_eq!((boxes[1].body, boxes[1].end), (26, 27));
    }
}
