//! ASTERIX category 062, system track data, as datagrams: a block for the events of a frame.
//!
//! Source: EUROCONTROL, *Specification for Surveillance Data Exchange, ASTERIX Part 9: Category 062, SDPS Track Messages*, edition 1.18.
//! Items: 010 SAC and SIC; 070 time of the frame's arrival, of the day in UTC, 1/128 s; 105 latitude and longitude, 180/2^25 degrees (6 mm to 0.6 m on the
//! ground); 185 velocity east and north, 0.25 m/s; 040 track number; 080 status: MON (one sensor), CNF confirmed, TSB and TSE first and last message,
//! CST coasting, SRC default height; 130 geometric altitude, 6.25 ft, where the height is known; 500 accuracies: APW (position), AGA (altitude), ATV (velocity).
//! Not sent: 100 (there is no plane of the system), 015. Numbers beyond an item's range are sent as its largest.
//! Track numbers: the run's modulo 65536, and if that is still a living track's the next that is free.
//! Limits: only tracks with a place are sent; the last message of one that had a place repeats it.

use super::datagrams::Datagrams;
use super::earth_address::AsterixOptions;
use super::unplaced::Unplaced;
use crate::board::Board;
use crate::event::{Event, TrackEvent, What};
use crate::output::{LiveOutput, Shown};
use boresight::Result;
use boresight::world::Place;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

const CATEGORY: u8 = 62;
/// Longest datagram, bytes: what a network carries in one piece.
const MAX_BLOCK: usize = 1400;
/// A degree in units of item 105, and of accuracies on a sphere of the earth's size, m.
const UNITS_PER_DEG: f64 = (1u64 << 25) as f64 / 180.0;
const M_PER_DEG: f64 = 111_195.0;
const M_PER_6_25_FT: f64 = 1.905;

/// Number of a track and the place that was sent last.
struct Sent {
    number: u16,
    place: Place,
}

/// Tracks to one address.
pub struct Asterix {
    datagrams: Datagrams,
    options: AsterixOptions,
    unplaced: Unplaced,
    living: BTreeMap<u64, Sent>,
    used: BTreeSet<u16>,
    block: Vec<u8>,
}

/// Rounded to units of this size, within this range.
fn units(value: f64, unit: f64, least: f64, most: f64) -> i32 {
    // A number that is none becomes 0.
    (value / unit).round().clamp(least, most) as i32
}

fn signed16(value: f64, unit: f64) -> [u8; 2] {
    (units(value, unit, -32_768.0, 32_767.0) as i16).to_be_bytes()
}

/// Writes a record of items by their field reference numbers, ascending.
fn record(items: &[(u8, Vec<u8>)], out: &mut Vec<u8>) {
    let n_octets = items.last().map_or(0, |(frn, _)| frn.div_ceil(7));
    for octet in 0..n_octets {
        let bits = items.iter().filter(|(frn, _)| (frn - 1) / 7 == octet).map(|(frn, _)| 0x80u8 >> ((frn - 1) % 7));
        out.push(bits.sum::<u8>() | u8::from(octet + 1 < n_octets));
    }
    items.iter().for_each(|(_, bytes)| out.extend_from_slice(bytes));
}

/// Item 080.
fn status(event: &TrackEvent, has_height: bool, is_first: bool) -> Vec<u8> {
    let (is_last, is_coasting) = (event.what == What::End, event.report.status == "coasting");
    // MON; default height as the source of the altitude; CNF 0: confirmed.
    let mut octets = vec![0x80 | if has_height { 6 << 2 } else { 0 }];
    if is_first || is_last || is_coasting {
        octets.push(u8::from(is_last) << 6 | u8::from(is_first) << 5);
    }
    if is_coasting {
        octets.extend([0, 0x80]);
    }
    let last = octets.len() - 1;
    octets[..last].iter_mut().for_each(|octet| *octet |= 1);
    octets
}

/// Item 500.
fn accuracies(place: &Place) -> Vec<u8> {
    let sd = |k: usize| place.cov[(k, k)].max(0.0).sqrt();
    let unsigned16 = |deg: f64| (units(deg * UNITS_PER_DEG, 1.0, 0.0, 65_535.0) as u16).to_be_bytes();
    let octet = |value: f64, unit: f64| units(value, unit, 0.0, 255.0) as u8;
    let has_altitude = place.height_m.is_some() && place.height_sd_m > 0.0;
    let mut out = vec![0b0010_0100 | u8::from(has_altitude) << 4];
    out.extend(unsigned16(sd(2) / M_PER_DEG));
    out.extend(unsigned16(sd(0) / (M_PER_DEG * place.latitude_deg.to_radians().cos().max(1e-6))));
    if has_altitude {
        out.push(octet(place.height_sd_m, M_PER_6_25_FT));
    }
    out.extend([octet(sd(1), 0.25), octet(sd(3), 0.25)]);
    out
}

/// The record of a track's event.
fn track_record(
    options: AsterixOptions,
    number: u16,
    place: &Place,
    event: &TrackEvent,
    is_first: bool,
    out: &mut Vec<u8>,
) {
    let day_s = event.when.arrived_unix_s.rem_euclid(86_400.0);
    // The last 1/256 s of the day is the day's last number.
    let time = units(day_s, 1.0 / 128.0, 0.0, 86_400.0 * 128.0 - 1.0);
    let degrees = |deg: f64| ((deg * UNITS_PER_DEG).round() as i32).to_be_bytes();
    let v = place.velocity_m_per_s;
    let mut items = vec![
        (1, vec![options.sac, options.sic]),
        (4, time.to_be_bytes()[1..].to_vec()),
        (5, [degrees(place.latitude_deg), degrees(place.longitude_deg)].concat()),
        (7, [signed16(v.x, 0.25), signed16(v.y, 0.25)].concat()),
        (12, number.to_be_bytes().to_vec()),
        (13, status(event, place.height_m.is_some(), is_first)),
    ];
    items.extend(place.height_m.map(|h| (18, signed16(h, M_PER_6_25_FT).to_vec())));
    items.push((27, accuracies(place)));
    record(&items, out);
}

impl Asterix {
    /// Finds the address and opens a socket.
    /// # Errors
    /// A name that is not known.
    pub fn open(address: &str, options: AsterixOptions, board: &Arc<Board>) -> Result<Self> {
        let shown = format!("asterix+udp://{address}");
        Ok(Self {
            datagrams: Datagrams::open(address, &shown)?,
            options,
            unplaced: Unplaced::new(Arc::clone(board), shown),
            living: BTreeMap::new(),
            used: BTreeSet::new(),
            block: Vec::new(),
        })
    }

    /// A number for a track, if one is free.
    fn number(&mut self, track: u64) -> Option<u16> {
        let first = track as u16;
        let number = (0..=u16::MAX).map(|k| first.wrapping_add(k)).find(|n| !self.used.contains(n))?;
        self.used.insert(number);
        Some(number)
    }

    /// Adds a track's event to the block.
    fn add(&mut self, event: &TrackEvent) {
        let track = event.report.track;
        let known = self.living.get(&track).map(|sent| (sent.number, sent.place));
        let is_last = event.what == What::End;
        let place = match (event.report.on_earth.0.place, known) {
            (Some(place), _) => place,
            (None, Some((_, place))) if is_last => place,
            _ => return self.unplaced.count("its place on Earth is not known"),
        };
        let number = match known {
            Some((number, _)) => number,
            None => match self.number(track) {
                Some(number) => number,
                None => return self.unplaced.count("there are 65536 tracks already"),
            },
        };
        let mut bytes = Vec::with_capacity(64);
        track_record(self.options, number, &place, event, known.is_none(), &mut bytes);
        if self.block.len() + bytes.len() > MAX_BLOCK {
            self.flush();
        }
        if self.block.is_empty() {
            self.block.extend([CATEGORY, 0, 0]);
        }
        self.block.extend(bytes);
        if is_last {
            self.living.remove(&track);
            self.used.remove(&number);
        } else {
            self.living.insert(track, Sent { number, place });
        }
    }

    /// Sends the block.
    fn flush(&mut self) {
        if self.block.is_empty() {
            return;
        }
        let length = (self.block.len() as u16).to_be_bytes();
        self.block[1..3].copy_from_slice(&length);
        self.datagrams.send(&self.block);
        self.block.clear();
    }
}

impl LiveOutput for Asterix {
    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        shown.events.iter().filter_map(|e| e.track.as_deref()).for_each(|track| self.add(track));
        self.flush();
        Ok(())
    }

    fn event(&mut self, event: &Event) {
        if let Some(track) = &event.track {
            self.add(track);
            self.flush();
        }
    }

    fn dropped(&self) -> u64 {
        self.datagrams.lost
    }
}
