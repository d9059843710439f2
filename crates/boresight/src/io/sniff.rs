//! What a file holds, told by its first bytes and never by its name.

use std::io::Read;

/// Number of first bytes that [`sniff`] wants to see.
pub(crate) const SNIFF_BYTES: usize = 64;

/// A kind of content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Content {
    Png,
    /// An animated PNG: several frames in one file.
    Apng,
    Jpeg,
    Tiff,
    Bmp,
    Pnm,
    Gif,
    Y4m,
    Mp4,
    /// Text: a table, a list, a configuration.
    Text,
    /// Text in UTF-16, as some spreadsheets save it.
    Utf16,
    Empty,
    /// Anything else: left to ffmpeg.
    Other,
}

impl Content {
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Apng => "animated PNG",
            Self::Jpeg => "JPEG",
            Self::Tiff => "TIFF",
            Self::Bmp => "BMP",
            Self::Pnm => "PNM",
            Self::Gif => "GIF",
            Self::Y4m => "YUV4MPEG2",
            Self::Mp4 => "MP4",
            Self::Text => "text",
            Self::Utf16 => "UTF-16 text",
            Self::Empty => "an empty file",
            Self::Other => "unknown content",
        }
    }

    /// Whether a folder or a glob takes such files as its frames.
    pub fn is_image(self) -> bool {
        matches!(self, Self::Png | Self::Apng | Self::Jpeg | Self::Tiff | Self::Bmp | Self::Pnm)
    }
}

/// Reads up to `n` bytes, fewer at the end of the input.
pub(crate) fn read_up_to(reader: &mut impl Read, n: usize) -> std::io::Result<Vec<u8>> {
    let mut head = Vec::with_capacity(n);
    reader.by_ref().take(n as u64).read_to_end(&mut head)?;
    Ok(head)
}

/// Tells the content from the first bytes of a file.
pub(crate) fn sniff(head: &[u8]) -> Content {
    match head {
        [] => Content::Empty,
        [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n', ..] => {
            // The animation chunk stands right behind the header in every writer's files.
            if head.get(37..41) == Some(b"acTL") { Content::Apng } else { Content::Png }
        }
        [0xff, 0xd8, 0xff, ..] => Content::Jpeg,
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Content::Tiff,
        [b'G', b'I', b'F', b'8', b'7' | b'9', b'a', ..] => Content::Gif,
        [b'P', b'1'..=b'6' | b'f' | b'F', c, ..] if c.is_ascii_whitespace() || *c == b'#' => Content::Pnm,
        _ if head.starts_with(b"YUV4MPEG2") => Content::Y4m,
        // A bitmap's header has one of a few lengths, so that text which starts with "BM" is not taken for one.
        [b'B', b'M', ..] if matches!(head.get(14..18), Some([12 | 16 | 40 | 52 | 56 | 64 | 108 | 124, 0, 0, 0])) => {
            Content::Bmp
        }
        _ if matches!(head.get(4..8), Some(b"ftyp" | b"moov" | b"mdat" | b"wide" | b"free" | b"skip" | b"styp")) => {
            Content::Mp4
        }
        // Audio frames may begin with FF FE as well; Latin letters in UTF-16 leave every second byte 0.
        [0xff, 0xfe, rest @ ..] if rest.iter().skip(1).step_by(2).all(|b| *b == 0) => Content::Utf16,
        [0xfe, 0xff, rest @ ..] if rest.iter().step_by(2).all(|b| *b == 0) => Content::Utf16,
        _ if is_text(head) || is_damaged_table(head) => Content::Text,
        _ => Content::Other,
    }
}

fn is_text(head: &[u8]) -> bool {
    head.iter().all(|&b| b >= 0x20 && b != 0x7f || matches!(b, b'\n' | b'\r' | b'\t')) && !head.starts_with(b"#EXTM3U")
}

/// Whether it is a table with a few bytes that no text has: an error of its reader, not pictures for ffmpeg (which draws text).
fn is_damaged_table(head: &[u8]) -> bool {
    let n_odd = head.iter().filter(|b| !is_text(std::slice::from_ref(b))).count();
    let n_numbers = head.iter().filter(|b| b.is_ascii_digit() || b",;.-+ \t\r\n".contains(b)).count();
    n_odd * 8 <= head.len() && n_numbers * 2 > head.len() && head.iter().any(|b| b",;\t ".contains(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_is_told_by_its_first_bytes() {
        assert_eq!(sniff(b""), Content::Empty);
        assert_eq!(sniff(b"\x89PNG\r\n\x1a\n"), Content::Png);
        assert_eq!(sniff(b"II\x2b\0\x08\0\0\0"), Content::Tiff);
        assert_eq!(sniff(b"P5\n3 3"), Content::Pnm);
        assert_eq!(sniff(b"P5,a,b"), Content::Text);
        assert_eq!(sniff(b"BMW,x,y\n1,2,3\n4,5,6"), Content::Text);
        assert_eq!(sniff(b"\0\0\0\x20ftypisom"), Content::Mp4);
        assert_eq!(sniff(b"\xff\xfef\0r\0"), Content::Utf16);
        assert_eq!(sniff(b"\xfe\xff\0f\0r"), Content::Utf16);
        assert_eq!(sniff(b"1,1,3,3,5,5,1,-1,-1,-1\n2,1,3,3,\x005,5,1\n"), Content::Text, "a table with a hole in it");
        assert_eq!(sniff(b"\x1aE\xdf\xa3\x01\0\0\0\0\0\0\x23B\x86\x81\x01B\xf7"), Content::Other, "Matroska");
        assert_eq!(sniff(b"RIFF\0\0\0\0AVI "), Content::Other);
    }
}
