//! Cursor on Target, as TAK's programs read it: an XML event for each event of a track whose place, or at least direction, is known.
//!
//! Source: MITRE, *Cursor on Target: Event data model*, version 2.0 (Event-PUBLIC.xsd, released to the public), and its details `track`, `sensor` and `remarks`.
//! `point`: latitude, longitude, height above the WGS 84 ellipsoid; `ce` and `le` one standard deviation, m, of the position in its worst direction and of the
//! height; 9999999 is unknown. `how` is m-i: measured by a machine in an image. The last event of a track is stale at once.
//! A track of which only the direction is known is an event at the camera's own place, of type b-m-p-s-p-loc with the detail `sensor`: azimuth, elevation, and as
//! fields of view three deviations to each side. No place of the target is made up.
//! Nothing stands between the events of a connection: TAK's programs read to `</event>` and take what comes for the head of the next.
//! Times are those of the frames' arrival. `uid`: a number drawn at the start, the source, the track: stable for a track, never that of an earlier run.

use super::earth_address::CotOptions;
use super::unplaced::Unplaced;
use crate::event::{TrackEvent, What};
use boresight::Config;
use boresight::io::tracks::escaped_xml;
use boresight::world::{Bearing, Place, Site, WorldConfig};
use std::fmt::Write;
use std::time::{Duration, UNIX_EPOCH};

/// What stands for a number that is not known.
const UNKNOWN: &str = "9999999.0";
/// The type of a sensor's place.
const SENSOR: &str = "b-m-p-s-p-loc";
/// Narrowest field of view that is drawn, degrees.
const NARROWEST_DEG: f64 = 0.1;

/// Writes events of one source.
pub(super) struct CotWriter {
    prefix: String,
    source: String,
    options: CotOptions,
    camera: Option<Site>,
    unplaced: Unplaced,
}

/// A time, s since 1970, as XML has it.
fn time(unix_s: f64) -> humantime::Rfc3339Timestamp {
    // The years that the format can say.
    let s = if unix_s.is_finite() { unix_s.clamp(0.0, 253_402_300_799.0) } else { 0.0 };
    humantime::format_rfc3339_millis(UNIX_EPOCH + Duration::from_secs_f64(s))
}

/// A deviation, or that it is not known.
fn deviation(sd_m: f64) -> String {
    if sd_m > 0.0 && sd_m.is_finite() { format!("{sd_m:.2}") } else { UNKNOWN.to_string() }
}

impl CotWriter {
    /// For a source.
    pub fn new(source: &str, options: CotOptions, unplaced: Unplaced) -> Self {
        let mut id = [0; 4];
        // Without randomness the numbers are those of every run, which a map shows as one track that jumps.
        let _ = getrandom::fill(&mut id);
        let id: String = id.iter().map(|b| format!("{b:02x}")).collect();
        let source = escaped_xml(source);
        Self { prefix: format!("boresight-{id}-{source}"), source, options, camera: None, unplaced }
    }

    /// Takes the camera's place.
    pub fn configured(&mut self, config: &Config) {
        self.camera = config.world.as_ref().and_then(WorldConfig::camera);
    }

    /// The XML of an event; `None` where nothing is known of the place.
    pub fn xml(&mut self, event: &TrackEvent) -> Option<String> {
        let located = &event.report.on_earth.0;
        match (&located.place, &located.bearing, self.camera) {
            (Some(place), _, _) => Some(self.placed(event, place)),
            (None, Some(bearing), Some(camera)) => Some(self.seen(event, bearing, camera)),
            _ => {
                self.unplaced.count("its place on Earth is not known");
                None
            }
        }
    }

    /// Up to the point: `ending` of the uid, type.
    fn head(&self, event: &TrackEvent, ending: &str, kind: &str) -> String {
        let at = event.when.arrived_unix_s;
        let stale = if event.what == What::End { at } else { at + self.options.stale_s };
        let (prefix, track) = (&self.prefix, event.report.track);
        let (at, stale) = (time(at), time(stale));
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\"?>\n<event version=\"2.0\" uid=\"{prefix}-{track}{ending}\" type=\"{kind}\" how=\"m-i\" time=\"{at}\" start=\"{at}\" stale=\"{stale}\">"
        )
    }

    fn tail(&self, out: &mut String, event: &TrackEvent, what: &str) {
        let (source, track, status) = (&self.source, event.report.track, event.report.status);
        let status = if event.what == What::End { "ended" } else { status };
        let _ = write!(
            out,
            "<contact callsign=\"{source} {track}\"/><remarks>{source}: track {track}, {status}{what}</remarks></detail></event>"
        );
    }

    fn placed(&self, event: &TrackEvent, place: &Place) -> String {
        let mut out = self.head(event, "", &self.options.kind);
        let (lat, lon) = (place.latitude_deg, place.longitude_deg);
        let height = place.height_m.map_or(UNKNOWN.to_string(), |h| format!("{h:.2}"));
        let (ce, le) = (deviation(place.position_sd_m()), deviation(place.height_sd_m));
        let (course, speed) = (place.course_deg(), place.speed_m_per_s());
        let _ = write!(
            out,
            "<point lat=\"{lat:.8}\" lon=\"{lon:.8}\" hae=\"{height}\" ce=\"{ce}\" le=\"{le}\"/><detail><track course=\"{course:.2}\" speed=\"{speed:.2}\"/>"
        );
        self.tail(&mut out, event, "");
        out
    }

    fn seen(&self, event: &TrackEvent, bearing: &Bearing, camera: Site) -> String {
        let mut out = self.head(event, "-bearing", SENSOR);
        let Site { latitude_deg: lat, longitude_deg: lon, height_m } = camera;
        let (azimuth, elevation) = (bearing.azimuth_deg, bearing.elevation_deg);
        let wide = |sd: f64, most: f64| (6.0 * sd).clamp(NARROWEST_DEG, most);
        let (fov, vfov) = (wide(bearing.azimuth_sd_deg, 360.0), wide(bearing.elevation_sd_deg, 180.0));
        let _ = write!(
            out,
            "<point lat=\"{lat:.8}\" lon=\"{lon:.8}\" hae=\"{height_m:.2}\" ce=\"{UNKNOWN}\" le=\"{UNKNOWN}\"/><detail><sensor azimuth=\"{azimuth:.3}\" elevation=\"{elevation:.3}\" fov=\"{fov:.3}\" vfov=\"{vfov:.3}\"/>"
        );
        self.tail(&mut out, event, "; the point is the camera's: the range of the target is not known");
        out
    }
}
