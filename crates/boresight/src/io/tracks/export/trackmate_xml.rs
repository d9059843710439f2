//! TrackMate's own file: spots by frame, tracks as edges between spots.
//!
//! Source: J.-Y. Tinevez et al., *TrackMate: an open and extensible platform for single-particle tracking*, Methods 115, 2017; the file
//! format of version 7 (`TmXmlReader`). Lengths are pixels, times seconds where the table has them, else frames. A spot is a disc of the
//! area of its box; a point gets TrackMate's usual radius. A pause is an edge over several frames. Spots count from 0 in the table's order.

use super::paths::{Paths, centre, dropped};
use super::xml::escaped;
use crate::{Error, ErrorKind, Result, TrackTable};
use std::fmt::Write as _;
use std::io::Write;

/// Radius of a spot without a size, px.
const RADIUS_PX: f64 = 2.5;
/// Name, short name and dimension of each feature of a spot, and whether it is a whole number.
const FEATURES: [(&str, &str, &str, bool); 8] = [
    ("QUALITY", "Quality", "QUALITY", false),
    ("POSITION_X", "X", "POSITION", false),
    ("POSITION_Y", "Y", "POSITION", false),
    ("POSITION_Z", "Z", "POSITION", false),
    ("POSITION_T", "T", "TIME", false),
    ("FRAME", "Frame", "NONE", true),
    ("RADIUS", "R", "LENGTH", false),
    ("VISIBILITY", "Visibility", "NONE", true),
];

/// Writes the file; the names of what it cannot hold are returned.
/// # Errors
/// A track that stands twice in a frame; what the writer fails with.
pub(crate) fn write(table: &TrackTable, out: &mut impl Write) -> Result<Vec<String>> {
    let paths = Paths::new(table)?;
    let time_s = |r: usize| table.state(r).time.map(|t| t.as_secs_f64());
    let has_times = table.n_rows() > 0 && (0..table.n_rows()).all(|r| time_s(r).is_some());
    let units = if has_times { "sec" } else { "frame" };
    let mut xml = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<TrackMate version=\"7.11.1\">\n  \
         <Log>written by boresight {}</Log>\n  <Model spatialunits=\"pixel\" timeunits=\"{units}\">\n    <FeatureDeclarations>\n",
        env!("CARGO_PKG_VERSION")
    );
    xml.push_str("      <SpotFeatures>\n");
    for (name, short, dimension, is_int) in FEATURES {
        feature(&mut xml, name, short, dimension, is_int);
    }
    xml.push_str("      </SpotFeatures>\n      <EdgeFeatures>\n");
    feature(&mut xml, "SPOT_SOURCE_ID", "Source ID", "NONE", true);
    feature(&mut xml, "SPOT_TARGET_ID", "Target ID", "NONE", true);
    xml.push_str("      </EdgeFeatures>\n      <TrackFeatures>\n");
    feature(&mut xml, "TRACK_INDEX", "Index", "NONE", true);
    feature(&mut xml, "TRACK_ID", "ID", "NONE", true);
    xml.push_str("      </TrackFeatures>\n    </FeatureDeclarations>\n");
    let _ = writeln!(xml, "    <AllSpots nspots=\"{}\">", table.n_rows());
    for frame in (0..table.n_frames()).filter(|f| !table.rows(*f).is_empty()) {
        let _ = writeln!(xml, "      <SpotsInFrame frame=\"{frame}\">");
        for r in table.rows(frame) {
            let [x, y, width, height] = centre(table, r);
            let radius = if width * height > 0.0 { (width * height / std::f64::consts::PI).sqrt() } else { RADIUS_PX };
            let t = time_s(r).filter(|_| has_times).unwrap_or(frame as f64);
            let _ = writeln!(
                xml,
                "        <Spot ID=\"{r}\" name=\"ID{r}\" QUALITY=\"{}\" POSITION_X=\"{x}\" POSITION_Y=\"{y}\" POSITION_Z=\"0.0\" \
                 POSITION_T=\"{t}\" FRAME=\"{frame}\" RADIUS=\"{radius}\" VISIBILITY=\"1\" />",
                table.score.get(r)
            );
        }
        xml.push_str("      </SpotsInFrame>\n");
    }
    xml.push_str("    </AllSpots>\n    <AllTracks>\n");
    let tracks: Vec<usize> = (0..table.n_tracks()).filter(|t| paths.rows[*t].len() > 1).collect();
    for (index, &t) in tracks.iter().enumerate() {
        let id = table.ids[t];
        let _ = writeln!(xml, "      <Track name=\"Track_{id}\" TRACK_INDEX=\"{index}\" TRACK_ID=\"{id}\">");
        for pair in paths.rows[t].windows(2) {
            let _ = writeln!(xml, "        <Edge SPOT_SOURCE_ID=\"{}\" SPOT_TARGET_ID=\"{}\" />", pair[0], pair[1]);
        }
        xml.push_str("      </Track>\n");
    }
    xml.push_str("    </AllTracks>\n    <FilteredTracks>\n");
    for &t in &tracks {
        let _ = writeln!(xml, "      <TrackID TRACK_ID=\"{}\" />", table.ids[t]);
    }
    xml.push_str("    </FilteredTracks>\n  </Model>\n");
    settings(&mut xml, table, &paths, if has_times { &time_s } else { &|_| None });
    xml.push_str("</TrackMate>\n");
    out.write_all(xml.as_bytes()).map_err(|e| Error::new(ErrorKind::Output, "cannot be written").because(e))?;
    let mut lost = dropped(table, &["score", "time_s"]);
    if !table.is_points {
        lost.insert(0, "width, height (a disc of the same area)".to_string());
    }
    let alone = table.n_tracks() - tracks.len();
    if alone > 0 {
        lost.push(format!("{alone} tracks of one row (a spot without a track)"));
    }
    Ok(lost)
}

fn feature(xml: &mut String, name: &str, short: &str, dimension: &str, is_int: bool) {
    let _ = writeln!(
        xml,
        "        <Feature feature=\"{name}\" name=\"{short}\" shortname=\"{short}\" dimension=\"{dimension}\" isint=\"{is_int}\" />"
    );
}

/// The image as far as the table tells of it; TrackMate asks for the file where it is not found.
fn settings(xml: &mut String, table: &TrackTable, paths: &Paths, time_s: &dyn Fn(usize) -> Option<f64>) {
    let last = table.n_rows().wrapping_sub(1);
    let interval = (table.n_rows() > 1).then(|| Some((time_s(0)?, time_s(last)?))).flatten();
    let frames = table.n_rows().checked_sub(1).map_or(0, |last| paths.frames[last] - paths.frames[0]);
    let interval = interval.filter(|_| frames > 0).map_or(1.0, |(a, b)| (b - a) / f64::from(frames));
    let most = |k: usize| {
        (0..table.n_rows()).map(|r| centre(table, r)).map(|c| c[k] + c[k + 2] / 2.0).fold(1.0, f64::max).ceil()
    };
    let _ = writeln!(
        xml,
        "  <Settings>\n    <ImageData filename=\"{}\" folder=\"\" width=\"{}\" height=\"{}\" nslices=\"1\" nframes=\"{}\" \
         pixelwidth=\"1.0\" pixelheight=\"1.0\" voxeldepth=\"1.0\" timeinterval=\"{interval}\" />\n  </Settings>\n  \
         <GUIState state=\"ConfigureViews\" />",
        escaped(&table.label),
        most(0),
        most(1),
        table.n_frames()
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    #[test]
    fn a_track_is_its_edges_and_a_single_row_is_a_spot() {
        let row = |frame, id| TrackRow { frame, id, bbox: [0.0, 0.0, 2.0, 2.0], ..TrackRow::default() };
        let table = TrackTable::from_rows("t", PixelOrigin::Centre0, [row(0, 3), row(2, 3), row(2, 9)]).unwrap();
        let mut out = Vec::new();
        let lost = write(&table, &mut out).unwrap();
        assert!(lost.iter().any(|l| l.starts_with("1 tracks of one row")), "{lost:?}");
        let text = String::from_utf8(out).unwrap();
        assert_eq!((text.matches("<Spot ").count(), text.matches("<Edge ").count()), (3, 1), "{text}");
        let twice = TrackTable::from_rows("t", PixelOrigin::Centre0, [row(0, 3), row(0, 3)]).unwrap();
        assert!(write(&twice, &mut Vec::new()).unwrap_err().to_string().contains("stands twice in frame 0"));
        let empty = TrackTable::from_rows("t", PixelOrigin::Centre0, []).unwrap();
        write(&empty, &mut Vec::new()).unwrap();
    }
}
