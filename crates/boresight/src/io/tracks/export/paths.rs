//! The rows of each track in the order of time, and where tracks come from.

use crate::io::tables::lost::lost;
use crate::{Error, ErrorKind, Result, TrackTable};

/// A table seen by its tracks.
pub(super) struct Paths {
    /// Frame of each row.
    pub frames: Vec<u32>,
    /// Rows of each track, in the order of time.
    pub rows: Vec<Vec<usize>>,
}

impl Paths {
    /// Sorts the rows by track.
    /// # Errors
    /// A track that stands twice in a frame.
    pub fn new(table: &TrackTable) -> Result<Self> {
        let mut paths = Self { frames: vec![0; table.n_rows()], rows: vec![Vec::new(); table.n_tracks()] };
        for frame in 0..table.n_frames() {
            for r in table.rows(frame) {
                let t = table.tracks[r] as usize;
                if let Some(&before) = paths.rows[t].last()
                    && paths.frames[before] as usize == frame
                {
                    let id = table.ids[t];
                    let what = format!("id {id} stands twice in frame {frame}: expected each id at most once a frame");
                    return Err(Error::new(ErrorKind::Damaged, what).at(&table.label));
                }
                paths.frames[r] = frame as u32;
                paths.rows[t].push(r);
            }
        }
        Ok(paths)
    }
}

/// The centre of a row, px, and its width and height.
pub(super) fn centre(table: &TrackTable, r: usize) -> [f64; 4] {
    let e = table.extent(r);
    [e.left_px + e.width_px / 2.0, e.top_px + e.height_px / 2.0, e.width_px, e.height_px]
}

/// Width and height that hold all rows, px: what stands for the frames' where the table does not tell them.
pub(super) fn reach(table: &TrackTable) -> [u64; 2] {
    let ends = |r: usize| {
        let e = table.extent(r);
        // From the centre of the first pixel to its corner.
        [e.left_px + e.width_px + 0.5, e.top_px + e.height_px + 0.5]
    };
    [0, 1].map(|k| (0..table.n_rows()).map(|r| ends(r)[k]).fold(1.0, f64::max).ceil() as u64)
}

/// The name of a row's class, or its number.
pub(super) fn class(table: &TrackTable, r: usize) -> String {
    table.class_name(r).map_or_else(|| table.class.get(r).to_string(), str::to_string)
}

/// What is lost of a table by a format that holds the named columns, those of `tracks.csv` among them.
pub(super) fn dropped(table: &TrackTable, held: &[&str]) -> Vec<String> {
    let extra = table.extra.iter().map(|e| e.0.as_str());
    let says = extra.filter(|n| !held.contains(n)).map(str::to_string);
    lost(table, held).into_iter().chain(says).collect()
}
