//! The bytes of one strip or tile, unpacked.

use crate::io::guard::damaged;
use crate::{Error, ErrorKind, Result};
use std::io::{Read, Seek, SeekFrom};

/// Reads and unpacks one strip or tile to exactly `expected` bytes.
pub(super) fn chunk_bytes(
    reader: &mut (impl Read + Seek),
    offset: u64,
    length: u64,
    compression: u32,
    expected: usize,
) -> Result<Vec<u8>> {
    let failed = |e: std::io::Error| damaged("not a whole TIFF", e);
    reader.seek(SeekFrom::Start(offset)).map_err(failed)?;
    // No coding makes sound data many times larger than the pixels themselves.
    let mut packed = Vec::new();
    reader.take(length.min(expected as u64 * 2 + 4096)).read_to_end(&mut packed).map_err(failed)?;
    let mut out = Vec::with_capacity(expected);
    match compression {
        1 => out = packed,
        5 => {
            let mut lzw = weezl::decode::Decoder::with_tiff_size_switch(weezl::BitOrder::Msb, 8);
            out.resize(expected, 0);
            let (mut read, mut written) = (0, 0);
            // The decoder may stop before the output is full: it goes on until it says that it has ended or has nothing left.
            while written < expected {
                let done = lzw.decode_bytes(&packed[read..], &mut out[written..]);
                let ended = !matches!(done.status.map_err(|e| damaged("not a whole TIFF", e))?, weezl::LzwStatus::Ok);
                (read, written) = (read + done.consumed_in, written + done.consumed_out);
                if ended || done.consumed_in + done.consumed_out == 0 {
                    break;
                }
            }
            out.truncate(written);
        }
        8 | 32946 => {
            flate2::read::ZlibDecoder::new(&packed[..]).take(expected as u64).read_to_end(&mut out).map_err(failed)?;
        }
        32773 => pack_bits(&packed, expected, &mut out),
        other => {
            return Err(Error::new(
                ErrorKind::Unsupported,
                format!("TIFF compression {other} with packed samples or a palette"),
            )
            .hint("rewrite it uncompressed, for example with tiffcp -c none"));
        }
    }
    if out.len() < expected {
        return Err(damaged(
            "not a whole TIFF",
            format!("a strip or tile of {} bytes, expected {expected}", out.len()),
        ));
    }
    out.truncate(expected);
    Ok(out)
}

/// PackBits (TIFF 6.0, section 9).
fn pack_bits(packed: &[u8], expected: usize, out: &mut Vec<u8>) {
    let mut rest = packed;
    while let Some((&head, tail)) = rest.split_first()
        && out.len() < expected
    {
        rest = tail;
        let n = head as i8;
        if n >= 0 {
            let take = (n as usize + 1).min(rest.len());
            out.extend_from_slice(&rest[..take]);
            rest = &rest[take..];
        } else if n != i8::MIN
            && let Some((&value, tail)) = rest.split_first()
        {
            out.extend(std::iter::repeat_n(value, 1 + usize::from(n.unsigned_abs())));
            rest = tail;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pack_bits_gives_the_example_of_the_standard() {
        // TIFF 6.0, section 9
        let packed = [0xfe, 0xaa, 0x02, 0x80, 0x00, 0x2a, 0xfd, 0xaa, 0x03, 0x80, 0x00, 0x2a, 0x22, 0xf7, 0xaa];
        let mut out = Vec::new();
        pack_bits(&packed, 24, &mut out);
        let mut want = vec![0xaa, 0xaa, 0xaa, 0x80, 0x00, 0x2a, 0xaa, 0xaa, 0xaa, 0xaa, 0x80, 0x00, 0x2a, 0x22];
        want.extend([0xaa; 10]);
        assert_eq!(out, want);
    }
}
