//! MCAP for Foxglove and its kin: `/annotations`, what the image panel draws over a video, and `/tracks`, the numbers themselves.
//!
//! Source: Foxglove, *ImageAnnotations*, *PointsAnnotation*, *TextAnnotation* (schema names and fields; JSON). Their coordinates count
//! from the corner of the first pixel, 0.5 px more than boresight's; on `/tracks` positions count from its centre, as everywhere else.
//! A track is a box (a dot, if it has no size), the 95 % ellipse of its position and its number. A frame without tracks behind one with
//! tracks has an empty message, so that nothing stays drawn.

use super::mcap::{Channel, Mcap};
use super::paths::{Paths, centre, class, dropped};
use super::times::FrameTimes;
use crate::io::tables::COVARIANCE_COLUMNS;
use crate::io::tables::status_word;
use crate::{Error, ErrorKind, Result, TrackTable};
use serde_json::{Map, Value, json};
use std::io::Write;

/// From a place counted from the centre of the first pixel to one counted from its corner, px.
const SHIFT_PX: f64 = 0.5;
/// χ², 2 degrees of freedom, 95 %.
const CHI2_2_95: f64 = 5.991;
/// Corners of an ellipse.
const N_CORNERS: usize = 24;
/// Foxglove's numbers of ways to draw points.
const POINTS: u8 = 1;
const LINE_LOOP: u8 = 2;

/// Columns that `/tracks` holds beside positions and [`COVARIANCE_COLUMNS`].
const HELD: [&str; 10] = [
    "score",
    "class",
    "class names",
    "time_s",
    "status",
    "detection",
    "vx_px_per_s",
    "vy_px_per_s",
    "var_xy",
    "cov_xy_px2",
];

/// Writes the log; the names of what it cannot hold are returned.
/// # Errors
/// A track that stands twice in a frame; a time before 0; what the writer fails with.
pub(crate) fn write(table: &TrackTable, out: &mut impl Write) -> Result<Vec<String>> {
    Paths::new(table)?;
    let times = FrameTimes::new(table);
    let [annotations, tracks] = [annotations_schema(), tracks_schema()].map(|s| s.to_string());
    let channels = [
        Channel { topic: "/annotations", schema_name: "foxglove.ImageAnnotations", schema: annotations.as_bytes() },
        Channel { topic: "/tracks", schema_name: "boresight.Tracks", schema: tracks.as_bytes() },
    ];
    let mut log = Mcap::new(concat!("boresight ", env!("CARGO_PKG_VERSION")), &channels);
    for frame in times.frames_to_tell(table) {
        let ns = u64::try_from(times.ns(frame)).map_err(|_| {
            Error::new(ErrorKind::Unsupported, "a time before 0, which MCAP cannot hold").at(&table.label)
        })?;
        log.push(0, ns, drawn(table, frame, ns).to_string().as_bytes());
        log.push(1, ns, told(table, frame, ns).to_string().as_bytes());
    }
    out.write_all(&log.finish()).map_err(|e| Error::new(ErrorKind::Output, "cannot be written").because(e))?;
    let held = [&HELD[..], &COVARIANCE_COLUMNS].concat();
    Ok(dropped(table, &held).into_iter().chain(times.lost()).collect())
}

fn time(ns: u64) -> Value {
    json!({ "sec": ns / 1_000_000_000, "nsec": ns % 1_000_000_000 })
}

/// A colour of its own for each track: hues a golden angle apart.
fn colour(id: i64, alpha: f64) -> Value {
    let hue = (id as f64 * 137.508).rem_euclid(360.0) / 60.0;
    let part = |n: f64| {
        let k = (n + hue).rem_euclid(6.0);
        1.0 - 0.8 * k.min(4.0 - k).clamp(0.0, 1.0)
    };
    json!({ "r": part(5.0), "g": part(3.0), "b": part(1.0), "a": alpha })
}

/// What is drawn in a frame.
fn drawn(table: &TrackTable, frame: usize, ns: u64) -> Value {
    let (mut points, mut texts) = (Vec::new(), Vec::new());
    for r in table.rows(frame) {
        let id = table.ids[table.tracks[r] as usize];
        let [x, y, width, height] = centre(table, r);
        let (x, y) = (x + SHIFT_PX, y + SHIFT_PX);
        let about = json!([{ "key": "track_id", "value": id.to_string() }]);
        let mut shape = |kind: u8, corners: &[[f64; 2]], alpha: f64, thickness: f64| {
            let corners: Vec<Value> = corners.iter().map(|c| json!({ "x": c[0], "y": c[1] })).collect();
            points.push(json!({
                "timestamp": time(ns), "type": kind, "points": corners, "outline_color": colour(id, alpha), "outline_colors": [],
                "fill_color": { "r": 0.0, "g": 0.0, "b": 0.0, "a": 0.0 }, "thickness": thickness, "metadata": about,
            }));
        };
        let (w, h) = (0.5 * width, 0.5 * height);
        if table.is_points {
            shape(POINTS, &[[x, y]], 1.0, 3.0);
        } else {
            shape(LINE_LOOP, &[[x - w, y - h], [x + w, y - h], [x + w, y + h], [x - w, y + h]], 1.0, 1.5);
        }
        if let Some(l) = table.position_cov(r).and_then(nalgebra::Cholesky::new).map(|c| c.l()) {
            let corner = |k: usize| {
                let (sin, cos) = (std::f64::consts::TAU * k as f64 / N_CORNERS as f64).sin_cos();
                let s = CHI2_2_95.sqrt();
                [x + s * l[(0, 0)] * cos, y + s * (l[(1, 0)] * cos + l[(1, 1)] * sin)]
            };
            shape(LINE_LOOP, &(0..N_CORNERS).map(corner).collect::<Vec<_>>(), 0.6, 1.0);
        }
        texts.push(json!({
            "timestamp": time(ns), "position": { "x": x - w, "y": y - h }, "text": id.to_string(), "font_size": 12.0,
            "text_color": colour(id, 1.0), "background_color": { "r": 0.0, "g": 0.0, "b": 0.0, "a": 0.4 }, "metadata": about,
        }));
    }
    json!({ "timestamp": time(ns), "circles": [], "points": points, "texts": texts, "metadata": [] })
}

/// The rows of a frame as numbers.
fn told(table: &TrackTable, frame: usize, ns: u64) -> Value {
    let row = |r: usize| {
        let state = table.state(r);
        let [x, y, width, height] = centre(table, r);
        let mut m = Map::new();
        let mut put = |name: &str, value: Value| m.insert(name.to_string(), value);
        put("id", table.ids[table.tracks[r] as usize].into());
        put("x_px", x.into());
        put("y_px", y.into());
        if !table.is_points {
            put("width_px", width.into());
            put("height_px", height.into());
        }
        put("score", table.score.get(r).into());
        put("class", class(table, r).into());
        if let Some(status) = state.status {
            put("status", status_word(status).into());
        }
        if let Some([vx, vy]) = state.velocity {
            put("vx_px_per_s", vx.into());
            put("vy_px_per_s", vy.into());
        }
        if let Some(p) = table.state_cov(r) {
            put("covariance", p.iter().copied().collect::<Vec<f64>>().into());
        }
        if let Some(p) = table.position_cov(r) {
            put("position_covariance_px2", p.iter().copied().collect::<Vec<f64>>().into());
        }
        if let Some(detection) = state.detection {
            put("detection", detection.into());
        }
        Value::Object(m)
    };
    json!({ "timestamp": time(ns), "frame": frame, "tracks": table.rows(frame).map(row).collect::<Vec<_>>() })
}

fn object(fields: Value) -> Value {
    json!({ "type": "object", "properties": fields })
}

fn list(items: Value) -> Value {
    json!({ "type": "array", "items": items })
}

fn numbers(names: &[&str]) -> Value {
    object(names.iter().map(|n| (n.to_string(), json!({ "type": "number" }))).collect::<Map<_, _>>().into())
}

fn time_schema() -> Value {
    json!({ "type": "object", "title": "time", "properties": { "sec": { "type": "integer" }, "nsec": { "type": "integer" } } })
}

/// Foxglove's fields, as far as they are written.
fn annotations_schema() -> Value {
    let (number, text, colour, place) = (
        json!({ "type": "number" }),
        json!({ "type": "string" }),
        numbers(&["r", "g", "b", "a"]),
        numbers(&["x", "y"]),
    );
    let pairs = list(object(json!({ "key": text, "value": text })));
    let points = object(json!({
        "timestamp": time_schema(), "type": { "type": "integer" }, "points": list(place.clone()), "outline_color": colour,
        "outline_colors": list(colour.clone()), "fill_color": colour, "thickness": number, "metadata": pairs,
    }));
    let circles = object(json!({
        "timestamp": time_schema(), "position": place, "diameter": number, "thickness": number, "fill_color": colour,
        "outline_color": colour, "metadata": pairs,
    }));
    let texts = object(json!({
        "timestamp": time_schema(), "position": place, "text": text, "font_size": number, "text_color": colour,
        "background_color": colour, "metadata": pairs,
    }));
    let mut schema = object(json!({
        "timestamp": time_schema(), "circles": list(circles), "points": list(points), "texts": list(texts), "metadata": pairs,
    }));
    schema["title"] = "foxglove.ImageAnnotations".into();
    schema
}

fn tracks_schema() -> Value {
    let (number, integer, text) =
        (json!({ "type": "number" }), json!({ "type": "integer" }), json!({ "type": "string" }));
    let matrix = |what: &str| json!({ "type": "array", "items": number, "description": what });
    let track = object(json!({
        "id": integer, "x_px": number, "y_px": number, "width_px": number, "height_px": number, "vx_px_per_s": number,
        "vy_px_per_s": number, "score": number, "class": text, "status": text, "detection": integer,
        "covariance": matrix("of [x, vx, y, vy], 4 x 4 (px, px/s)"), "position_covariance_px2": matrix("of [x, y], 2 x 2"),
    }));
    let mut schema = object(json!({ "timestamp": time_schema(), "frame": integer, "tracks": list(track) }));
    schema["title"] = "boresight.Tracks".into();
    schema
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, RowState, TrackRow, TrackTableBuilder};

    #[test]
    fn a_box_counts_from_the_corner_and_the_ellipse_holds_its_variance() {
        let mut b = TrackTableBuilder::new("t", PixelOrigin::Centre0);
        let row = TrackRow { frame: 0, id: 3, bbox: [4.0, 3.0, 2.0, 4.0], ..TrackRow::default() };
        b.push_with_state(&row, &RowState { position_cov: Some([4.0, 0.0, 9.0]), ..RowState::default() }).unwrap();
        let table = b.finish(0).unwrap();
        let message = drawn(&table, 0, 1_500_000_000);
        assert_eq!(message["timestamp"], json!({ "sec": 1, "nsec": 500_000_000 }));
        assert_eq!(message["points"][0]["points"][0], json!({ "x": 4.5, "y": 3.5 }));
        assert_eq!(message["points"][0]["points"][2], json!({ "x": 6.5, "y": 7.5 }));
        let ellipse = message["points"][1]["points"].as_array().unwrap();
        let reach = ellipse.iter().map(|p| p["y"].as_f64().unwrap() - 5.5).fold(0.0, f64::max);
        assert!((reach - 3.0 * CHI2_2_95.sqrt()).abs() < 1e-9, "{reach}");
        let mut bytes = Vec::new();
        let lost = write(&table, &mut bytes).unwrap();
        assert_eq!(lost, ["times (the table has none: 25 frames/s)"]);
        write(&TrackTable::from_rows("t", PixelOrigin::Centre0, []).unwrap(), &mut bytes).unwrap();
        let old = RowState { time: Some(crate::Timestamp::from_ns(-1)), ..RowState::default() };
        let mut b = TrackTableBuilder::new("t", PixelOrigin::Centre0);
        b.push_with_state(&TrackRow::default(), &old).unwrap();
        assert!(write(&b.finish(0).unwrap(), &mut bytes).unwrap_err().to_string().contains("before 0"));
    }
}
