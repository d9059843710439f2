//! COCO's detections: a list of results, or a whole data set with images, annotations and categories.
//!
//! Source: T.-Y. Lin et al., *Microsoft COCO*, arXiv 1405.0312; the data format at cocodataset.org. `bbox` is left, top, width, height (px)
//! from the corner of the first pixel. Frames are a data set's images in the natural order of their names, from 0; in a list of results
//! the number of the image is the frame. Classes are the names of the categories, else their numbers. `track_id`, where every
//! annotation has one, is the track.
//! It becomes a table with named columns, a row an annotation, for the reader of all tables.

use crate::io::natural::natural_order;
use crate::{Error, ErrorKind, Result};
use serde::Deserialize;
use std::collections::HashMap;
use std::fmt::Write;

/// One detection.
#[derive(Deserialize)]
struct Annotation {
    image_id: u64,
    bbox: [f64; 4],
    category_id: Option<i64>,
    score: Option<f64>,
    track_id: Option<i64>,
}

#[derive(Deserialize)]
struct Picture {
    id: u64,
    #[serde(default)]
    file_name: String,
}

#[derive(Deserialize)]
struct Category {
    id: i64,
    name: String,
}

/// A data set; of others than COCO's the lists would be missing.
#[derive(Deserialize)]
struct DataSet {
    images: Vec<Picture>,
    annotations: Vec<Annotation>,
    #[serde(default)]
    categories: Vec<Category>,
}

/// Whether a text is JSON rather than a table: it begins with a bracket.
pub(super) fn looks_like(head: &[u8]) -> bool {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    matches!(text.trim_ascii_start().first(), Some(b'[' | b'{'))
}

/// The annotations as a table with named columns.
/// # Errors
/// What is not COCO's, with the line; an annotation of no image.
pub(super) fn as_table(text: &[u8], label: &str) -> Result<String> {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let wrong = |e: serde_json::Error| {
        Error::new(ErrorKind::Unsupported, format!("is JSON, but not COCO's detections: {e}"))
            .at(label)
            .hint("known are a list of {image_id, category_id, bbox, score} and a data set with images and annotations")
    };
    let set = if text.trim_ascii_start().first() == Some(&b'[') {
        let annotations = serde_json::from_slice(text).map_err(wrong)?;
        DataSet { images: Vec::new(), annotations, categories: Vec::new() }
    } else {
        serde_json::from_slice(text).map_err(wrong)?
    };
    let mut pictures: Vec<&Picture> = set.images.iter().collect();
    pictures.sort_by(|a, b| natural_order(&a.file_name, &b.file_name).then(a.id.cmp(&b.id)));
    let frames: HashMap<u64, u64> = pictures.iter().zip(0..).map(|(p, k)| (p.id, k)).collect();
    let names: HashMap<i64, &str> = set.categories.iter().map(|c| (c.id, c.name.as_str())).collect();
    let has_tracks = !set.annotations.is_empty() && set.annotations.iter().all(|a| a.track_id.is_some());
    let mut out = String::from("frame,left,top,width,height,score,class");
    out.push_str(if has_tracks { ",track_id\n" } else { "\n" });
    for (k, a) in set.annotations.iter().enumerate() {
        let frame = match frames.get(&a.image_id) {
            Some(frame) => *frame,
            None if pictures.is_empty() => a.image_id,
            None => {
                let what =
                    format!("annotation {k}: image_id {}: expected one of the {} images", a.image_id, pictures.len());
                return Err(Error::new(ErrorKind::Damaged, what).at(label));
            }
        };
        let [left, top, width, height] = a.bbox;
        let _ = write!(out, "{frame},{left},{top},{width},{height},{},", a.score.unwrap_or(1.0));
        match a.category_id.map(|id| (id, names.get(&id))) {
            Some((_, Some(name))) => {
                let _ = write!(out, "\"{}\"", name.replace('"', "\"\"").replace(['\n', '\r'], " "));
            }
            Some((id, None)) => {
                let _ = write!(out, "{id}");
            }
            None => {}
        }
        if let Some(id) = a.track_id.filter(|_| has_tracks) {
            let _ = write!(out, ",{id}");
        }
        out.push('\n');
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_and_data_sets_become_the_same_rows() {
        let results =
            r#"[{"image_id": 1, "category_id": 3, "bbox": [0, 2.5, 4, 6], "score": 0.5, "segmentation": []}]"#;
        assert_eq!(
            as_table(results.as_bytes(), "t").unwrap(),
            "frame,left,top,width,height,score,class\n1,0,2.5,4,6,0.5,3\n"
        );
        let set = r#"{"info": {}, "images": [{"id": 70, "file_name": "f10.png"}, {"id": 71, "file_name": "f9.png"}],
            "annotations": [{"id": 1, "image_id": 70, "category_id": 3, "bbox": [0, 2.5, 4, 6], "track_id": 8}],
            "categories": [{"id": 3, "name": "small \"x\""}]}"#;
        assert_eq!(
            as_table(set.as_bytes(), "t").unwrap(),
            "frame,left,top,width,height,score,class,track_id\n1,0,2.5,4,6,1,\"small \"\"x\"\"\",8\n"
        );
    }

    #[test]
    fn other_json_is_refused_with_its_place() {
        for (text, said) in [
            ("{\"frame\": 1}\n{\"frame\": 2}\n", "missing field `images`"),
            ("[1, 2]", "line 1"),
            ("[{\"image_id\": 1, \"bbox\": [1, 2, 3]}]", "invalid length 3"),
            ("{\"images\": [{\"id\": 1}], \"annotations\": [{\"image_id\": 2, \"bbox\": [1, 2, 3, 4]}]}", "image_id 2"),
            ("[", "EOF"),
        ] {
            let e = as_table(text.as_bytes(), "t.json").unwrap_err().to_string();
            assert!(e.contains(said) && e.contains("t.json"), "{e}");
        }
        assert!(looks_like(b"\xef\xbb\xbf [") && looks_like(b"\n{") && !looks_like(b"frame,x") && !looks_like(b""));
    }
}
