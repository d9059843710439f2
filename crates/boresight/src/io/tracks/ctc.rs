//! Cell Tracking Challenge: a folder of label images and a table of lineages (label, begin, end, parent).
//!
//! Source: M. Maška et al., *A benchmark for comparison of cell tracking algorithms*, Bioinformatics 30(11), 2014, and the
//! challenge's format description. Truth: `man_track.txt` and `man_trackTTT.tif`; result: `res_track.txt` and `maskTTT.tif`.
//! A pixel's value is its cell's label, 0 the background. Frames and pixels count from 0.
//! Limits: two dimensions; labels up to 65535.

use crate::io::tables::lexer::{Lines, Separator, split};
use crate::io::tables::number::parse_f64;
use crate::io::{OpenOptions, open};
use crate::{Error, ErrorKind, Image, PixelOrigin, Pixels, Result, TrackRow, TrackTable, TrackTableBuilder};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One line of the table of lineages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lineage {
    /// The label.
    pub label: u32,
    /// First frame.
    pub begin: u32,
    /// Last frame.
    pub end: u32,
    /// The label it came from; 0 for none.
    pub parent: u32,
}

/// A folder of label images.
#[derive(Clone, Debug)]
pub struct CtcFolder {
    /// Lineages by label.
    pub lineages: Vec<Lineage>,
    /// Label images by frame.
    pub images: BTreeMap<u32, PathBuf>,
}

/// Whether a folder holds a table of lineages.
pub fn is_ctc(folder: &Path) -> bool {
    folder.join("man_track.txt").is_file() || folder.join("res_track.txt").is_file()
}

impl CtcFolder {
    /// Opens a folder.
    /// # Errors
    /// No table of lineages; no label images; a malformed line.
    pub fn open(folder: &Path) -> Result<Self> {
        let truth = folder.join("man_track.txt").is_file();
        let (table, prefix) = if truth { ("man_track.txt", "man_track") } else { ("res_track.txt", "mask") };
        let lineages = read_lineages(&folder.join(table))?;
        let mut images = BTreeMap::new();
        let entries = std::fs::read_dir(folder)
            .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be opened").at(folder.display()).because(e))?;
        for entry in entries.flatten() {
            let path = entry.path();
            let is_tiff =
                path.extension().is_some_and(|e| e.eq_ignore_ascii_case("tif") || e.eq_ignore_ascii_case("tiff"));
            let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or("");
            if let (true, Some(Ok(frame))) = (is_tiff, stem.strip_prefix(prefix).map(str::parse)) {
                images.insert(frame, path);
            }
        }
        if images.is_empty() {
            return Err(Error::new(ErrorKind::NotFound, format!("no label images {prefix}000.tif beside {table}"))
                .at(folder.display()));
        }
        Ok(Self { lineages, images })
    }

    /// Number of frames.
    pub fn n_frames(&self) -> u32 {
        self.images.keys().next_back().map_or(0, |f| f + 1)
    }

    /// The label image of a frame; `None` where the folder has none.
    /// # Errors
    /// An image that cannot be read or is no grey image of whole numbers.
    pub fn labels(&self, frame: u32) -> Result<Option<Image<u16>>> {
        let Some(path) = self.images.get(&frame) else { return Ok(None) };
        let mut source = open(path, &OpenOptions::default())?;
        match source.next_frame()?.map(|f| f.pixels) {
            Some(Pixels::Gray16(image)) => Ok(Some(image)),
            Some(Pixels::Gray8(image)) => {
                let wide: Vec<u16> = image.as_slice().iter().map(|&v| u16::from(v)).collect();
                Ok(Image::from_vec(image.width(), image.height(), wide))
            }
            _ => {
                Err(Error::new(ErrorKind::Unsupported, "expected an 8 or 16 bit grey image of labels")
                    .at(path.display()))
            }
        }
    }

    /// The cells as a table: the box of each label in each frame; `parents` keeps the parents' labels as a column `parent`.
    /// # Errors
    /// As [`CtcFolder::labels`]; two images of different sizes.
    pub fn table(&self, label: impl Into<String>, parents: bool) -> Result<TrackTable> {
        let mut b = TrackTableBuilder::new(label, PixelOrigin::Centre0);
        let parents = parents && self.lineages.iter().any(|l| l.parent != 0);
        if parents {
            b.add_extra("parent");
        }
        let mut size = None;
        for &frame in self.images.keys() {
            let Some(image) = self.labels(frame)? else { continue };
            let here = (image.width(), image.height());
            let first = *size.get_or_insert(here);
            if here != first {
                let what = format!("is {} x {} px, those before {} x {}", here.0, here.1, first.0, first.1);
                let place = self.images.get(&frame).map_or(String::new(), |p| p.display().to_string());
                return Err(Error::new(ErrorKind::Damaged, what).at(place));
            }
            let mut bounds: BTreeMap<u16, [usize; 4]> = BTreeMap::new();
            for y in 0..image.height() {
                for (x, &v) in image.row(y).iter().enumerate().filter(|(_, v)| **v != 0) {
                    let e = bounds.entry(v).or_insert([x, y, x, y]);
                    *e = [e[0].min(x), e[1].min(y), e[2].max(x), e[3].max(y)];
                }
            }
            for (v, [x0, y0, x1, y1]) in bounds {
                let bbox = [x0 as f64 - 0.5, y0 as f64 - 0.5, (x1 - x0 + 1) as f64, (y1 - y0 + 1) as f64];
                b.push(&TrackRow { frame, id: i64::from(v), bbox, ..TrackRow::default() })?;
                if parents {
                    let known = self.lineages.iter().find(|l| l.label == u32::from(v) && l.parent != 0);
                    b.push_extra(0, &known.map_or(String::new(), |l| l.parent.to_string()));
                }
            }
        }
        b.finish(self.n_frames() as usize)
    }
}

/// Reads a table of lineages.
/// # Errors
/// A missing file; a malformed line; a label twice; an end before its begin.
pub fn read_lineages(path: &Path) -> Result<Vec<Lineage>> {
    let (mut out, mut cells) = (Vec::new(), Vec::new());
    let mut lines = Lines::open(path)?;
    while let Some(line) = lines.next_line()? {
        let damaged =
            |what: String| Error::new(ErrorKind::Damaged, what).at(format!("{} line {}", path.display(), line.number));
        let separator = Separator::of(line.text);
        split(line.text, separator, &mut cells);
        let mut v = [0_u32; 4];
        let expected = ["a label", "a first frame", "a last frame", "a parent's label"];
        for (k, (v, what)) in v.iter_mut().zip(expected).enumerate() {
            let text = cells.get(k).map_or(&b""[..], |c| &line.text[c.0 as usize..c.1 as usize]);
            let number = parse_f64(text, false).filter(|n| n.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(n));
            *v = number.ok_or_else(|| {
                let found = String::from_utf8_lossy(text);
                let found: String = found.chars().take(30).collect();
                damaged(format!("column {}: expected {what} (a whole number from 0), found \"{found}\"", k + 1))
            })? as u32;
        }
        let [label, begin, end, parent] = v;
        if end < begin {
            return Err(damaged(format!("ends in frame {end} before it begins in {begin}")));
        }
        out.push(Lineage { label, begin, end, parent });
    }
    out.sort_unstable_by_key(|l| l.label);
    if let Some(w) = out.windows(2).find(|w| w[0].label == w[1].label) {
        return Err(Error::new(ErrorKind::Damaged, format!("label {} stands twice", w[0].label)).at(path.display()));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lineages_are_read_and_a_reversed_life_is_refused() {
        let f = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(f.path(), "2 5 9 1\n1 0 4 0\n").unwrap();
        let l = read_lineages(f.path()).unwrap();
        assert_eq!(l[1], Lineage { label: 2, begin: 5, end: 9, parent: 1 });
        std::fs::write(f.path(), "1 4 0 0\n").unwrap();
        assert!(
            read_lineages(f.path()).unwrap_err().to_string().contains("line 1: ends in frame 0 before it begins in 4")
        );
    }
}
