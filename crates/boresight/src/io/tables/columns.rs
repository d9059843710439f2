//! Which column of a table means what: names given by the user, else the names that common programs write.
//!
//! Names are compared without case and punctuation: `POSITION_X`, `position x` and `positionX` are one. Known tables:
//! boresight, trackpy, TrackMate, btrack, scikit-image's `regionprops_table`, CellProfiler, ImageJ, and plain names.

use crate::{Error, ErrorKind, Result};
use serde::{Deserialize, Serialize};

/// What a column means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Field {
    Frame,
    TimeS,
    Id,
    X,
    Y,
    Left,
    Top,
    Right,
    Bottom,
    Width,
    Height,
    VarX,
    CovXy,
    VarY,
    StdX,
    StdY,
    Area,
    Peak,
    Sum,
    Score,
    Class,
    Visibility,
    Truncation,
    Occlusion,
    Status,
    Detection,
    Age,
    Vx,
    Vy,
    CovXVx,
    CovXVy,
    VarVx,
    CovVxY,
    CovVxVy,
    CovYVy,
    VarVy,
}

/// Number of [`Field`]s.
pub(crate) const N_FIELDS: usize = Field::VarVy as usize + 1;

impl Field {
    /// The velocity, px/s.
    pub const VELOCITY: [Self; 2] = [Self::Vx, Self::Vy];
    /// The covariance of `[x, vx, y, vy]`: its upper triangle, row by row.
    pub const COV: [Self; 10] = [
        Self::VarX,
        Self::CovXVx,
        Self::CovXy,
        Self::CovXVy,
        Self::VarVx,
        Self::CovVxY,
        Self::CovVxVy,
        Self::VarY,
        Self::CovYVy,
        Self::VarVy,
    ];

    /// What is expected in its cells.
    pub fn expected(self) -> &'static str {
        match self {
            Self::Frame => "a frame number",
            Self::TimeS | Self::Age => "a time in seconds",
            Self::Id => "a track id",
            Self::X => "a position x",
            Self::Y => "a position y",
            Self::Left => "a left edge",
            Self::Top => "a top edge",
            Self::Right => "a right edge",
            Self::Bottom => "a bottom edge",
            Self::Width => "a width",
            Self::Height => "a height",
            Self::Score => "a confidence",
            Self::Class => "a class",
            Self::Visibility => "a visible share",
            Self::Truncation => "a truncation",
            Self::Occlusion => "an occlusion",
            Self::Status => "a status",
            Self::Detection => "a detection's number",
            Self::Vx | Self::Vy => "a velocity",
            Self::VarX | Self::VarY | Self::VarVx | Self::VarVy => "a variance",
            Self::StdX | Self::StdY => "a standard deviation",
            Self::CovXy | Self::CovXVx | Self::CovXVy | Self::CovVxY | Self::CovVxVy | Self::CovYVy => "a covariance",
            Self::Area | Self::Peak | Self::Sum => "a number",
        }
    }
}

/// Field, its key in [`Columns`] (empty: only by its own name), and the names it goes by in the order of preference.
///
/// Units: px, px², s (or m, in a radar's tables); velocities and their covariances are taken only from columns that name px (or m) and s, for in other programs'
/// tables they count per frame. Other units are told by the user or the program's own lines (TrackMate).
const KNOWN: [(Field, &str, &[&str]); N_FIELDS] = [
    (
        Field::Frame,
        "frame",
        &[
            "frame",
            "frameindex",
            "frameidx",
            "frameid",
            "frameno",
            "framenr",
            "framenumber",
            "imagenumber",
            "timepoint",
            "slice",
            "t",
        ],
    ),
    (
        Field::TimeS,
        "time",
        &["times", "timeseconds", "timesec", "seconds", "positiont", "time", "timestamp", "timestamps", "ts", "t"],
    ),
    (Field::Id, "id", &["trackid", "particle", "id", "track", "objectid", "targetid", "trackobjectslabel"]),
    (
        Field::X,
        "x",
        &[
            "xpx",
            "x",
            "positionx",
            "posx",
            "xpos",
            "xcenter",
            "centerx",
            "xcentre",
            "centrex",
            "cx",
            "xc",
            "xcentroid",
            "centroidx",
            "centroid1",
            "locationcenterx",
            "xm",
            "xpixel",
            "xpixels",
        ],
    ),
    (
        Field::Y,
        "y",
        &[
            "ypx",
            "y",
            "positiony",
            "posy",
            "ypos",
            "ycenter",
            "centery",
            "ycentre",
            "centrey",
            "cy",
            "yc",
            "ycentroid",
            "centroidy",
            "centroid0",
            "locationcentery",
            "ym",
            "ypixel",
            "ypixels",
        ],
    ),
    (
        Field::Left,
        "left",
        &["leftpx", "left", "bbleft", "bboxleft", "boxleft", "xmin", "x1", "bboxxmin", "bboxx", "bbox1", "leftm"],
    ),
    (
        Field::Top,
        "top",
        &["toppx", "top", "bbtop", "bboxtop", "boxtop", "ymin", "y1", "bboxymin", "bboxy", "bbox0", "topm"],
    ),
    (Field::Right, "right", &["right", "bbright", "bboxright", "xmax", "x2", "bboxxmax", "bbox3"]),
    (Field::Bottom, "bottom", &["bottom", "bbbottom", "bboxbottom", "ymax", "y2", "bboxymax", "bbox2"]),
    (Field::Width, "width", &["widthpx", "width", "w", "bbwidth", "bboxwidth", "boxwidth", "bboxw", "widthm"]),
    (Field::Height, "height", &["heightpx", "height", "h", "bbheight", "bboxheight", "boxheight", "bboxh", "heightm"]),
    (Field::VarX, "var-x", &["varxpx2", "varx", "covxx", "varxm2"]),
    (Field::CovXy, "cov-xy", &["covxypx2", "covxy", "covxym2"]),
    (Field::VarY, "var-y", &["varypx2", "vary", "covyy", "varym2"]),
    (Field::StdX, "std-x", &["stdxpx", "stdx", "sigmax", "xstd", "xerr", "xerror", "ep", "epx"]),
    (Field::StdY, "std-y", &["stdypx", "stdy", "sigmay", "ystd", "yerr", "yerror", "ep", "epy"]),
    (Field::Area, "area", &["areapx", "area", "areapixels", "areashapearea", "npixels", "aream"]),
    (Field::Peak, "peak", &["peak", "signal", "maxintensity", "intensitymax", "max"]),
    (Field::Sum, "sum", &["sum", "mass", "totalintensity", "integratedintensity", "totalintensitych1", "rawintden"]),
    (Field::Score, "score", &["score", "conf", "confidence", "prob", "probability", "quality"]),
    (Field::Class, "class", &["class", "classid", "classname", "category", "categoryid"]),
    (Field::Visibility, "", &["visibility"]),
    (Field::Truncation, "", &["truncation"]),
    (Field::Occlusion, "", &["occlusion"]),
    (Field::Status, "", &["status"]),
    (Field::Detection, "", &["detection"]),
    (Field::Age, "", &["ages"]),
    (Field::Vx, "", &["vxpxpers", "vxmpers"]),
    (Field::Vy, "", &["vypxpers", "vympers"]),
    (Field::CovXVx, "", &["covxvxpx2pers", "covxvxm2pers"]),
    (Field::CovXVy, "", &["covxvypx2pers", "covxvym2pers"]),
    (Field::VarVx, "", &["varvxpx2pers2", "varvxm2pers2"]),
    (Field::CovVxY, "", &["covvxypx2pers", "covvxym2pers"]),
    (Field::CovVxVy, "", &["covvxvypx2pers2", "covvxvym2pers2"]),
    (Field::CovYVy, "", &["covyvypx2pers", "covyvym2pers"]),
    (Field::VarVy, "", &["varvypx2pers2", "varvym2pers2"]),
];

/// Column names given by the user; what is not given is found by common names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Columns {
    /// Pairs of meaning and column, for example `x=cx` or `frame=1` (a number counts columns from 1). Meanings: frame,
    /// time (s), id, x, y, left, top, right, bottom, width, height, var-x, cov-xy, var-y, std-x, std-y, area, peak, sum,
    /// score, class.
    pub names: Vec<String>,
}

impl Columns {
    /// Reads `x=cx,y=cy,frame=t`.
    /// # Errors
    /// As [`Columns::validate`].
    pub fn parse(text: &str) -> Result<Self> {
        let names = text.split(',').map(str::trim).filter(|p| !p.is_empty()).map(String::from).collect();
        let columns = Self { names };
        columns.validate("columns")?;
        Ok(columns)
    }

    /// Checks that every pair has the form `meaning=column`.
    /// # Errors
    /// [`ErrorKind::Config`] with the pair that is wrong.
    pub fn validate(&self, at: &str) -> Result<()> {
        for pair in &self.names {
            let known =
                pair.split_once('=').is_some_and(|(k, v)| !v.trim().is_empty() && field_of_key(k.trim()).is_some());
            if !known {
                let keys: Vec<_> = KNOWN.iter().map(|(_, key, _)| *key).filter(|key| !key.is_empty()).collect();
                return Err(Error::new(ErrorKind::Config, "expected meaning=column, such as x=cx")
                    .at(format!("{at} = {pair}"))
                    .hint(format!("meanings: {}", keys.join(", "))));
            }
        }
        Ok(())
    }
}

/// The names that a field goes by, best first.
#[cfg(test)]
pub(crate) fn names_of(field: Field) -> &'static [&'static str] {
    KNOWN[field as usize].2
}

fn field_of_key(key: &str) -> Option<Field> {
    KNOWN.iter().find(|(_, k, _)| !k.is_empty() && *k == key).map(|(field, _, _)| *field)
}

/// A name without case and punctuation.
fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// The column of each field in one table.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layout {
    at: [Option<usize>; N_FIELDS],
    /// Factor from the time column to seconds.
    pub time_scale: Option<f64>,
}

impl Default for Layout {
    fn default() -> Self {
        Self { at: [None; N_FIELDS], time_scale: None }
    }
}

impl Layout {
    /// Columns in a fixed order.
    pub fn fixed(columns: impl IntoIterator<Item = (Field, usize)>) -> Self {
        let mut layout = Self::default();
        for (field, at) in columns {
            layout.at[field as usize] = Some(at);
        }
        layout
    }

    /// Finds the columns by their header.
    pub fn of_header(header: &[String], columns: &Columns) -> Result<Self> {
        let names: Vec<String> = header.iter().map(|h| plain(h)).collect();
        let mut layout = Self::default();
        for pair in &columns.names {
            let Some((key, name)) = pair.split_once('=') else { continue };
            let Some(field) = field_of_key(key.trim()) else { continue };
            let name = name.trim();
            let by_name = header.iter().position(|h| h.trim() == name);
            let by_number = name.parse::<usize>().ok().and_then(|n| n.checked_sub(1)).filter(|n| *n < header.len());
            let at = by_name.or(by_number).ok_or_else(|| {
                Error::new(ErrorKind::Config, format!("there is no column '{name}'"))
                    .hint(format!("the columns are {}", header.join(", ")))
            })?;
            layout.at[field as usize] = Some(at);
        }
        for (field, _, known) in KNOWN {
            if layout.at[field as usize].is_some() {
                continue;
            }
            // `t` is the frame unless another column is: then it is the time.
            let taken = |i: usize| field == Field::TimeS && layout.at[Field::Frame as usize] == Some(i);
            layout.at[field as usize] =
                known.iter().find_map(|k| names.iter().position(|n| n == k).filter(|i| !taken(*i)));
        }
        if layout.column(Field::TimeS).is_none() {
            for (name, scale) in
                [("timems", 1e-3), ("timestampms", 1e-3), ("timeus", 1e-6), ("timens", 1e-9), ("timestampns", 1e-9)]
            {
                if let Some(at) = names.iter().position(|n| n == name) {
                    layout.at[Field::TimeS as usize] = Some(at);
                    layout.time_scale = Some(scale);
                }
            }
        }
        Ok(layout)
    }

    /// The column of a field.
    pub fn column(&self, field: Field) -> Option<usize> {
        self.at.get(field as usize).copied().flatten()
    }

    /// Whether all of these fields are there.
    pub fn has(&self, fields: &[Field]) -> bool {
        fields.iter().all(|f| self.column(*f).is_some())
    }

    /// Whether rows are states of a filter: identity, status, position, velocity, the whole covariance, and a box.
    pub fn has_states(&self) -> bool {
        use Field::{Frame, Height, Id, Status, TimeS, Width, X, Y};
        self.has(&[Frame, TimeS, Id, Status, X, Y, Width, Height])
            && self.has(&Field::VELOCITY)
            && self.has(&Field::COV)
    }

    /// Whether rows say where things are: centre or box.
    pub fn has_position(&self) -> bool {
        self.has(&[Field::X, Field::Y])
            || (self.has(&[Field::Left, Field::Top])
                && (self.has(&[Field::Width, Field::Height]) || self.has(&[Field::Right, Field::Bottom])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(header: &str, columns: &str) -> Result<Layout> {
        let header: Vec<String> = header.split(',').map(String::from).collect();
        Layout::of_header(&header, &Columns::parse(columns)?)
    }

    #[test]
    fn tables_of_common_programs_are_understood() {
        let at = |header: &str, field| layout(header, "").unwrap().column(field);
        let trackmate = "LABEL,ID,TRACK_ID,QUALITY,POSITION_X,POSITION_Y,POSITION_Z,POSITION_T,FRAME,RADIUS";
        assert_eq!(at(trackmate, Field::X), Some(4));
        assert_eq!(at(trackmate, Field::Frame), Some(8));
        assert_eq!(at(trackmate, Field::TimeS), Some(7));
        assert_eq!(at(trackmate, Field::Id), Some(2));
        let btrack = "t,x,y,z,states,label";
        assert_eq!(at(btrack, Field::Frame), Some(0));
        assert_eq!(at(btrack, Field::TimeS), None);
        assert_eq!(at("frame,t,x,y", Field::TimeS), Some(1));
        assert_eq!(at("label,centroid-0,centroid-1,bbox-0,bbox-1", Field::X), Some(2));
        assert_eq!(at("frame,particle,x,y,mass,size,ecc,signal,ep", Field::StdY), Some(8));
    }

    #[test]
    fn names_given_by_the_user_win_and_wrong_ones_are_refused() {
        let given = layout("n,u,v,x,y", "frame=n,x=u,y=3").unwrap();
        assert_eq!([Field::Frame, Field::X, Field::Y].map(|f| given.column(f)), [Some(0), Some(1), Some(2)]);
        assert!(layout("n,u,v", "x=w").unwrap_err().to_string().contains("n, u, v"));
        assert!(Columns::parse("speed=v").is_err());
        assert!(Columns::parse("x").is_err());
    }
}
