//! A page to choose by looking: some moments of an input, once for each way to detect, with what it finds there and the command that runs it.
//!
//! One HTML file without anything from outside. Each picture is in it once, at most [`MOST_SIDE`] px long; what is found is drawn over it as SVG. A mark is never
//! smaller than [`LEAST_SHARE`] of the picture's width, so that it can be seen.

use super::picture::{Picture, block, means, png_url};
use super::text::{head, printable, short};
use crate::{Extent, Frame, Pixels, SourceInfo};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use nalgebra::Vector2;
use std::fmt::Write;

/// Longest side of a picture in the page, px.
const MOST_SIDE: usize = 480;
/// More marks than this on one picture are drawn as dots: boxes would hide it.
const CROWD: usize = 120;
/// Least size of a mark as a share of the picture's width.
const LEAST_SHARE: f64 = 0.02;

/// What a preview shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactSheet {
    /// Name of the input.
    pub input: String,
    /// What it is: size, rate, frames.
    pub facts: String,
    /// Which of it was looked at, a sentence.
    pub note: String,
    /// Size of its frames, px.
    pub size_px: [usize; 2],
    /// The moments.
    pub pictures: Vec<SheetPicture>,
    /// The ways to detect; the choice without options is the first.
    pub rows: Vec<SheetRow>,
}

/// One moment.
#[derive(Clone, Debug, PartialEq)]
pub struct SheetPicture {
    /// Number of its frame.
    pub frame: u64,
    /// Its time, s.
    pub time_s: f64,
    url: String,
}

/// A mark around something found, px: left, top, width and height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetMark(pub [f64; 4]);

/// One way to detect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SheetRow {
    /// Its number among all candidates, from 1.
    pub number: usize,
    /// Its word.
    pub name: String,
    /// What it is for.
    pub purpose: String,
    /// The command that runs it.
    pub command: String,
    /// Why it shows nothing.
    pub refusal: Option<String>,
    /// Mean number of detections a frame.
    pub per_frame: f64,
    /// Least and most of them in one.
    pub range: [usize; 2],
    /// Evidence that something moves: gain of its chains beyond that of the same frames in another order, nats.
    pub gain: Option<f64>,
    /// Whether that is more than chance.
    pub is_sure: bool,
    /// What is found in each picture.
    pub marks: Vec<Vec<SheetMark>>,
}

impl SheetPicture {
    /// The picture of a frame, made small; grey ones are stretched between their 0.5 % and 99.5 % levels.
    pub fn of(frame: &Frame) -> Self {
        let url = match &frame.pixels {
            Pixels::Rgb8(image) => {
                let n = block(image.width(), image.height(), MOST_SIDE);
                let channel = |c: usize| means(image, n, move |p: &[u8; 3]| f32::from(p[c]));
                let [r, g, b] = [0, 1, 2].map(channel);
                let levels = r.iter().zip(&g).zip(&b).flat_map(|((r, g), b)| [*r, *g, *b]);
                let samples: Vec<u8> = levels.map(|v| v.round() as u8).collect();
                let (w, h) = (image.width().div_ceil(n), image.height().div_ceil(n));
                png_url(w, h, png::ColorType::Rgb, &samples)
            }
            _ => Picture::of_frame_within(frame, MOST_SIDE).data_url(),
        };
        Self { frame: frame.index.0, time_s: frame.time.as_secs_f64(), url: url.unwrap_or_default() }
    }
}

impl SheetMark {
    /// The mark of a detection: its box, or a point where it has none.
    pub fn of(extent: &Extent, position: Vector2<f64>) -> Self {
        let (w, h) = (extent.width_px, extent.height_px);
        if w > 0.0 && h > 0.0 {
            Self([extent.left_px, extent.top_px, w, h])
        } else {
            Self([position.x, position.y, 0.0, 0.0])
        }
    }
}

impl ContactSheet {
    /// An empty sheet of an input.
    pub fn new(input: &str, info: &SourceInfo) -> Self {
        let rate = info.rate_hz.map_or(String::new(), |r| format!(", {} frames/s", short(r, 4)));
        let frames = info.n_frames.map_or(String::new(), |n| format!(", {n} frames"));
        Self {
            input: input.to_string(),
            facts: format!("{} x {} px{rate}{frames}", info.width, info.height),
            size_px: [info.width, info.height],
            ..Self::default()
        }
    }

    /// The page.
    pub fn html(&self) -> String {
        let name = self.input.trim_end_matches(['/', '\\']).rsplit(['/', '\\']).next().unwrap_or_default();
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                (head(&format!("{} - boresight preview", printable(name)), &(include_str!("contact_sheet.css").to_string() + &self.picture_css())))
                body {
                    main {
                        h1 { (printable(name)) }
                        p class="soft" { (self.facts) ". " (self.note) }
                        p {
                            "What each detector finds, drawn on the same moments. Take the one whose marks lie on your targets and on nothing else, and run its command. "
                            "A click makes a picture large."
                        }
                        (self.summary())
                        @for (k, row) in self.rows.iter().enumerate() { (self.row(k, row)) }
                        p class="soft" {
                            "Evidence is what the detections of short runs of frames gain, in nats, by being told as moving targets, beyond the same frames in another order: "
                            "more than 7 comes by chance once in a thousand. It tells what moves from what flickers or stands, not a target from another moving thing."
                        }
                    }
                    script { (PreEscaped(include_str!("contact_sheet.js"))) }
                }
            }
        };
        page.into_string() + "\n"
    }

    /// Each picture once, as the background of its class.
    fn picture_css(&self) -> String {
        let mut css = String::new();
        let [w, h] = self.size_px;
        let _ = writeln!(css, ".moment{{aspect-ratio:{} / {}}}", w.max(1), h.max(1));
        for (k, picture) in self.pictures.iter().enumerate() {
            let _ = writeln!(css, ".p{k}{{background-image:url({})}}", picture.url);
        }
        css
    }

    fn summary(&self) -> Markup {
        html! {
            div class="scroll" { table class="sums" {
                thead { tr {
                    th scope="col" { "Candidate" } th scope="col" class="number" { "Detections a frame" }
                    th scope="col" class="number" { "Evidence of motion" } th scope="col" class="use" { "For" }
                } }
                tbody { @for (k, row) in self.rows.iter().enumerate() {
                    tr {
                        th scope="row" { a href={ "#r" (k) } { (row.number) " " (row.name) } }
                        @if row.refusal.is_some() { td class="number soft" { "not shown" } td {} }
                        @else { td class="number" { (short(row.per_frame, 3)) } td class="number" { (gain(row)) } }
                        td class="use" { (printable(&row.purpose)) }
                    }
                } }
            } }
        }
    }

    fn row(&self, k: usize, row: &SheetRow) -> Markup {
        html! {
            section id={ "r" (k) } {
                h2 { (row.number) " " (row.name) @if !row.purpose.is_empty() { span class="for" { (printable(&row.purpose)) } } }
                @match &row.refusal {
                    Some(why) => p class="soft" { (printable(why)) },
                    None => {
                        p class="counts" {
                            (short(row.per_frame, 3)) " detections a frame (" (row.range[0]) " to " (row.range[1]) "), evidence of motion: " (gain(row))
                            @if row.gain.is_some() { " nats" @if !row.is_sure { ", no more than chance" } }
                        }
                        div class="sheet" { @for (i, picture) in self.pictures.iter().enumerate() { (self.cell(i, picture, row)) } }
                    }
                }
                div class="run" { code { (printable(&row.command)) } button type="button" class="copy" { "copy" } }
            }
        }
    }

    fn cell(&self, i: usize, picture: &SheetPicture, row: &SheetRow) -> Markup {
        let marks = row.marks.get(i).map_or(&[][..], Vec::as_slice);
        let [w, h] = self.size_px;
        let is_crowd = marks.len() > CROWD;
        let outline = if is_crowd { dots(marks) } else { outline(marks, w as f64) };
        html! {
            figure class="cell" {
                div class={ "moment p" (i) } role="img" aria-label={ "frame " (picture.frame) ", " (marks.len()) " detections" } {
                    svg class=[is_crowd.then_some("crowd")] viewBox={ "-0.5 -0.5 " (w) " " (h) } preserveAspectRatio="none" {
                        path class="under" d=(outline) {}
                        path class="over" d=(outline) {}
                    }
                }
                figcaption { span { (format!("{:.1}", picture.time_s)) " s" } span { (marks.len()) } }
            }
        }
    }
}

fn gain(row: &SheetRow) -> String {
    row.gain.map_or("none".to_string(), |g| if g.abs() < 0.5 { "0".to_string() } else { format!("{g:.0}") })
}

/// The middles of the marks as one path of SVG.
fn dots(marks: &[SheetMark]) -> String {
    let mut path = String::new();
    for SheetMark([left, top, w, h]) in marks.iter().filter(|m| m.0.iter().all(|v| v.is_finite())) {
        let _ = write!(path, "M{:.1} {:.1}h0", left + w / 2.0, top + h / 2.0);
    }
    path
}

/// The marks as one path of SVG.
fn outline(marks: &[SheetMark], width_px: f64) -> String {
    let least = LEAST_SHARE * width_px;
    let mut path = String::new();
    for SheetMark([left, top, w, h]) in marks {
        if ![left, top, w, h].iter().all(|v| v.is_finite()) {
            continue;
        }
        let (x, y) = (left + w / 2.0, top + h / 2.0);
        // A little larger than what is marked, so that it stays in sight.
        let (w, h) = ((w + 0.004 * width_px).max(least), (h + 0.004 * width_px).max(least));
        let _ = write!(path, "M{:.1} {:.1}h{w:.1}v{h:.1}h-{w:.1}z", x - w / 2.0, y - h / 2.0);
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Image, PixelKind, Timestamp};

    fn sheet(name: &str) -> ContactSheet {
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: 64,
            height: 48,
            kind: PixelKind::Gray8,
            n_frames: Some(2),
            rate_hz: Some(25.0),
            true_times: true,
        };
        let frame = |k: u64| Frame {
            index: FrameIndex(k),
            time: Timestamp::from_ns(k as i64 * 40_000_000),
            pixels: if k == 0 {
                Pixels::Gray8(Image::filled(64, 48, 9))
            } else {
                Pixels::Rgb8(Image::filled(64, 48, [9, 8, 7]))
            },
        };
        let mut sheet = ContactSheet::new(name, &info);
        sheet.pictures = (0..2).map(|k| SheetPicture::of(&frame(k))).collect();
        let mark =
            SheetMark::of(&Extent { left_px: 9.5, top_px: 19.5, width_px: 10.0, height_px: 6.0 }, Vector2::zeros());
        sheet.rows = vec![
            SheetRow {
                name: "isolated".into(),
                command: format!("boresight track '{name}'"),
                per_frame: 0.5,
                range: [0, 1],
                gain: Some(12.3),
                is_sure: true,
                marks: vec![vec![mark], vec![]],
                ..SheetRow::default()
            },
            SheetRow { name: "colour".into(), refusal: Some("no colour".into()), ..SheetRow::default() },
        ];
        sheet
    }

    #[test]
    fn each_picture_stands_once_in_a_page_that_needs_nothing_from_outside() {
        let html = sheet("a/clip.mp4").html();
        assert_eq!(html.matches("data:image/png;base64,").count(), 2);
        assert_eq!(html.matches("http").count(), 0, "no address");
        assert_eq!(html.matches("<figure").count(), 2, "a row without a result has no pictures");
        assert!(html.contains("<h1>clip.mp4</h1>") && html.contains("0.5 detections a frame (0 to 1)"));
        assert!(html.contains("evidence of motion: 12 nats") && html.contains("no colour"));
    }

    #[test]
    fn a_mark_lies_around_its_box_and_a_point_can_be_seen() {
        let around = outline(&[SheetMark([9.5, 19.5, 10.0, 6.0])], 64.0);
        assert_eq!(around, "M9.4 19.4h10.3v6.3h-10.3z");
        let point = outline(&[SheetMark([30.0, 20.0, 0.0, 0.0]), SheetMark([f64::NAN; 4])], 1000.0);
        assert_eq!(point, "M20.0 10.0h20.0v20.0h-20.0z");
    }

    #[test]
    fn many_marks_are_dots_so_that_the_picture_stays_in_sight() {
        let mut many = sheet("a.mp4");
        assert!(!many.html().contains("class=\"crowd\""));
        many.rows[0].marks[0] = vec![SheetMark([10.0, 20.0, 4.0, 2.0]); CROWD + 1];
        assert!(many.html().contains("class=\"crowd\"") && many.html().contains("M12.0 21.0h0M12.0 21.0h0"));
    }

    #[test]
    fn text_of_an_input_stays_text() {
        let html = sheet("</script><img src=x onerror=alert(1)>").html();
        assert!(!html.contains("<img") && html.matches("</script>").count() == 1);
    }
}
