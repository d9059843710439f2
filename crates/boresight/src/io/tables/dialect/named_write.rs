//! Writes CSV with named columns, in the names of boresight or of other programs.
//!
//! Every further column of the table is kept as it is. Columns that boresight's own names have are written where they say
//! anything; the other programs' tables have places for points only (and TrackMate's for a quality): what is lost is named.
//! TrackMate's table wants a label, a spot's number and three more header lines; they are made up where the table has none.

use super::named::Dialect;
use crate::io::tables::lost::{REGIONS, lost};
use crate::{Error, ErrorKind, Result, TrackTable};
use std::io::Write;

/// TrackMate's own columns beside those every table has.
const TRACKMATE: [&str; 4] = ["LABEL", "ID", "POSITION_Z", "POSITION_T"];

type Extra = (String, Vec<String>);

/// Writes a table; the names of what the dialect cannot hold are returned.
/// # Errors
/// What the writer fails with.
pub fn write(table: &TrackTable, dialect: Dialect, out: &mut impl Write) -> Result<Vec<String>> {
    let failed = |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be written").because(e);
    let dropped = dropped(table, dialect);
    let says = |column: &str| lost(table, &[REGIONS]).iter().any(|c| c == column);
    let sides: Vec<&str> = match dialect {
        Dialect::Plain => ["visibility", "truncation", "occlusion"].into_iter().filter(|c| says(c)).collect(),
        _ => Vec::new(),
    };
    let class = |r: usize| table.class_name(r).map_or_else(|| table.class.get(r).to_string(), String::from);
    let trackmate = dialect == Dialect::TrackMate;
    let extra: Vec<&Extra> = table.extra.iter().filter(|e| !(trackmate && TRACKMATE.contains(&e.0.as_str()))).collect();
    let own = TRACKMATE.map(|n| table.extra.iter().find(|e| trackmate && e.0 == n).map(|e| &e.1));
    let mut names: Vec<&str> = match dialect {
        Dialect::Plain if table.is_points => vec!["frame", "track_id", "x_px", "y_px", "score", "class"],
        Dialect::Plain => vec!["frame", "track_id", "x_px", "y_px", "width_px", "height_px", "score", "class"],
        Dialect::Trackpy => vec!["frame", "particle", "x", "y"],
        Dialect::TrackMate => {
            vec!["LABEL", "ID", "TRACK_ID", "QUALITY", "POSITION_X", "POSITION_Y", "POSITION_Z", "POSITION_T", "FRAME"]
        }
        Dialect::Btrack => vec!["ID", "t", "y", "x"],
        Dialect::Ultrack => vec!["track_id", "t", "y", "x"],
    };
    names.extend(&sides);
    names.extend(extra.iter().map(|e| e.0.as_str()));
    writeln!(out, "{}", names.join(",")).map_err(failed)?;
    if trackmate {
        let commas = ",".repeat(extra.len());
        let further: String = extra.iter().map(|e| format!(",{}", e.0)).collect();
        writeln!(out, "Label,Spot ID,Track ID,Quality,X,Y,Z,T,Frame{further}").map_err(failed)?;
        writeln!(out, "Label,Spot ID,Track ID,Quality,X,Y,Z,T,Frame{further}").map_err(failed)?;
        writeln!(out, ",,,(quality),(pixel),(pixel),(pixel),(frame),{commas}").map_err(failed)?;
    }
    for frame in 0..table.n_frames() {
        for r in table.rows(frame) {
            let e = table.extent(r);
            let (x, y) = (e.left_px + e.width_px / 2.0, e.top_px + e.height_px / 2.0);
            let (id, score) = (table.ids[table.tracks[r] as usize], table.score.get(r));
            match dialect {
                Dialect::Plain if table.is_points => write!(out, "{frame},{id},{x},{y},{score},{}", class(r)),
                Dialect::Plain => {
                    write!(out, "{frame},{id},{x},{y},{},{},{score},{}", e.width_px, e.height_px, class(r))
                }
                Dialect::Trackpy => write!(out, "{frame},{id},{x},{y}"),
                Dialect::TrackMate => {
                    let [label, spot, z, t] = own.map(|v| v.and_then(|v| v.get(r)).filter(|v| !v.is_empty()));
                    let made_up = (format!("ID{r}"), r.to_string(), "0".to_string(), frame.to_string());
                    let (label, spot) = (label.unwrap_or(&made_up.0), spot.unwrap_or(&made_up.1));
                    let (z, t) = (z.unwrap_or(&made_up.2), t.unwrap_or(&made_up.3));
                    write!(out, "{label},{spot},{id},{score},{x},{y},{z},{t},{frame}")
                }
                Dialect::Btrack | Dialect::Ultrack => write!(out, "{id},{frame},{y},{x}"),
            }
            .map_err(failed)?;
            for side in &sides {
                match *side {
                    "visibility" => write!(out, ",{}", table.visibility.get(r)),
                    "truncation" => write!(out, ",{}", table.truncation.get(r)),
                    _ => write!(out, ",{}", table.occlusion.get(r)),
                }
                .map_err(failed)?;
            }
            for (_, values) in &extra {
                write!(out, ",{}", values.get(r).map_or("", String::as_str)).map_err(failed)?;
            }
            writeln!(out).map_err(failed)?;
        }
    }
    Ok(dropped)
}

fn dropped(table: &TrackTable, dialect: Dialect) -> Vec<String> {
    let mut out = match dialect {
        Dialect::Plain => lost(table, &["score", "class", "class names", "visibility", "truncation", "occlusion"]),
        Dialect::TrackMate => lost(table, &["score"]),
        _ => lost(table, &[]),
    };
    if dialect != Dialect::Plain && !table.is_points {
        out.push("width, height".to_string());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::tracks::{BadRows, ReadOptions, read};

    fn read_text(text: &str, options: ReadOptions) -> Result<(TrackTable, BadRows)> {
        let f = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(f.path(), text).unwrap();
        read(f.path(), None, options, false).map(|f| (f.table, f.bad))
    }

    #[test]
    fn every_dialect_reads_back_what_it_wrote() {
        let (t, _) = read_text(
            "frame,track_id,x,y,width,height,score\n0,1,5,6,2,4,0.5\n1,1,6,6,2,4,0.25\n",
            ReadOptions::default(),
        )
        .unwrap();
        for d in [Dialect::Plain, Dialect::Trackpy, Dialect::TrackMate, Dialect::Btrack, Dialect::Ultrack] {
            let mut out = Vec::new();
            let dropped = write(&t, d, &mut out).unwrap();
            let (u, _) = read_text(std::str::from_utf8(&out).unwrap(), ReadOptions::default()).unwrap();
            let centre = |t: &TrackTable, r| {
                let e = t.extent(r);
                (e.left_px + e.width_px / 2.0, e.top_px + e.height_px / 2.0)
            };
            assert_eq!((centre(&t, 0), centre(&t, 1)), (centre(&u, 0), centre(&u, 1)), "{d:?}");
            assert_eq!(dropped.is_empty(), d == Dialect::Plain, "{d:?} {dropped:?}");
        }
    }

    #[test]
    fn a_trackmate_table_keeps_its_own_columns() {
        let text = "LABEL,ID,TRACK_ID,QUALITY,POSITION_X,POSITION_Y,POSITION_Z,POSITION_T,FRAME,RADIUS\n\
Label,Spot ID,Track ID,Quality,X,Y,Z,T,Frame,RADIUS\nLabel,Spot ID,Track ID,Quality,X,Y,Z,T,Frame,RADIUS\n\
,,,(quality),(pixel),(pixel),(pixel),(frame),,\nID44,44,3,0.5,1.5,2.5,7,0.2,2,4.5\n";
        let (t, _) = read_text(text, ReadOptions { keep_extra: true, ..ReadOptions::default() }).unwrap();
        let mut out = Vec::new();
        assert!(write(&t, Dialect::TrackMate, &mut out).unwrap().is_empty());
        assert_eq!(std::str::from_utf8(&out).unwrap(), text);
    }
}
