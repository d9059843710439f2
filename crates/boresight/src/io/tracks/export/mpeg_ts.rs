//! MPEG transport stream with one stream of KLV metadata, in step with the frames (synchronous carriage).
//!
//! Source: ISO/IEC 13818-1 (H.222.0), 2.4.3 packets, 2.4.4 tables, 2.12.4 metadata access units; MISB ST 1402, *MPEG-2 Transport Stream for
//! Class 1/Class 2 Motion Imagery, Audio and Metadata*: stream type 0x15, stream id 0xfc, format `KLVA`.
//! Tables stand at the beginning and every half second, the clock in the first packet of each access unit; the clock runs 0.5 s before the
//! presentation times, which count from the first frame. Limits: an access unit of 65 000 bytes; where frames follow each other by more
//! than 0.1 s, so do the clock's values. There is no video in the stream: a multiplexer joins it to one.

const PACKET: usize = 188;
const PAT: u16 = 0;
const PMT: u16 = 0x20;
const KLV: u16 = 0x100;
/// Ticks a second of presentation times.
pub(super) const CLOCK_HZ: i64 = 90_000;
/// How far the clock runs before the presentation times, ticks.
const LEAD: u64 = CLOCK_HZ as u64 / 2;
/// Ticks between two repetitions of the tables.
const TABLES_EVERY: u64 = CLOCK_HZ as u64 / 2;
/// Largest access unit, bytes; a packet of the elementary stream holds 65 535 with its head.
pub(super) const MOST_BYTES: usize = 65_000;

/// CRC of the tables: polynomial 0x04c1_1db7, not reflected, begun with ones (13818-1, annex A).
fn crc32_mpeg2(bytes: &[u8]) -> u32 {
    bytes.iter().fold(!0, |crc, b| {
        (0..8).fold(crc ^ u32::from(*b) << 24, |c, _| if c >> 31 == 1 { c << 1 ^ 0x04c1_1db7 } else { c << 1 })
    })
}

/// A table: its number, what it numbers, its content.
fn section(table_id: u8, id: u16, content: &[u8]) -> Vec<u8> {
    let length = 5 + content.len() as u16 + 4;
    let mut s = vec![table_id];
    s.extend((0xb000 | length).to_be_bytes());
    s.extend(id.to_be_bytes());
    // Version 0, valid now; section 0 of 0.
    s.extend([0xc1, 0, 0]);
    s.extend(content);
    s.extend(crc32_mpeg2(&s).to_be_bytes());
    s
}

/// A transport stream that is being written.
pub(super) struct MpegTs {
    bytes: Vec<u8>,
    /// Continuity counters of the three streams of packets.
    counters: [u8; 3],
    tables_at: Option<u64>,
    n_units: u8,
}

impl MpegTs {
    /// An empty stream.
    pub fn new() -> Self {
        Self { bytes: Vec::new(), counters: [0; 3], tables_at: None, n_units: 0 }
    }

    /// Writes a packet with as much of `payload` as fits; how much that was. `clock` puts the clock into it.
    fn packet(&mut self, pid: u16, starts: bool, clock: Option<u64>, payload: &[u8]) -> usize {
        let counter = &mut self.counters[usize::from(pid == PMT) + 2 * usize::from(pid == KLV)];
        let field = if clock.is_some() { 8 } else { 0 };
        let n = payload.len().min(PACKET - 4 - field);
        // What is left over is filled within the adaptation field, whose length does not count itself.
        let room = PACKET - 4 - n;
        self.bytes.push(0x47);
        self.bytes.extend((u16::from(starts) << 14 | pid).to_be_bytes());
        self.bytes.push(if room > 0 { 0x30 } else { 0x10 } | *counter & 0x0f);
        *counter = counter.wrapping_add(1);
        if room > 0 {
            let begin = self.bytes.len();
            self.bytes.push((room - 1) as u8);
            if room > 1 {
                self.bytes.push(if clock.is_some() { 0x10 } else { 0 });
            }
            if let Some(ticks) = clock {
                let base = ticks & ((1 << 33) - 1);
                // 33 bits, six reserved ones, 9 bits of a finer clock that stay 0.
                self.bytes.extend(&((base << 15 | 0x7e00).to_be_bytes()[2..]));
            }
            self.bytes.resize(begin + room, 0xff);
        }
        self.bytes.extend(&payload[..n]);
        n
    }

    fn tables(&mut self) {
        // A table's payload begins with where the table begins.
        let pat = section(0x00, 1, &[&1_u16.to_be_bytes()[..], &(0xe000 | PMT).to_be_bytes()].concat());
        // General metadata, format by its four letters, service 0.
        let metadata = [&[0x26, 9, 0x01, 0x00, 0xff][..], b"KLVA", &[0, 0x0f]].concat();
        // Leak in of 6.8 Mbit/s (in 400 bit/s), a buffer of 64 KiB and no leak out, each behind two reserved ones.
        let rates = [0x27, 9, 0xc0, 0x42, 0x68, 0xc0, 0x00, 0x40, 0xc0, 0x00, 0x00];
        let about = [&metadata[..], &rates].concat();
        let mut content = (0xe000 | KLV).to_be_bytes().to_vec();
        content.extend([0xf0, 0x00, 0x15]);
        content.extend((0xe000 | KLV).to_be_bytes());
        content.extend((0xf000 | about.len() as u16).to_be_bytes());
        content.extend(about);
        for (pid, table) in [(PAT, pat), (PMT, section(0x02, 1, &content))] {
            let mut payload = [&[0][..], &table].concat();
            payload.resize(PACKET - 4, 0xff);
            self.packet(pid, true, None, &payload);
        }
    }

    /// Adds an access unit (at most [`MOST_BYTES`]) that belongs to a time, ticks from the first frame.
    pub fn push(&mut self, ticks: u64, unit: &[u8]) {
        if self.tables_at.is_none_or(|t| ticks >= t + TABLES_EVERY) {
            self.tables();
            self.tables_at = Some(ticks);
        }
        let pts = (ticks + LEAD) & ((1 << 33) - 1);
        let unit = &unit[..unit.len().min(MOST_BYTES)];
        let mut pes = vec![0, 0, 1, 0xfc];
        pes.extend((8 + 5 + unit.len() as u16).to_be_bytes());
        // Aligned data; a presentation time of five bytes follows: 3, 15 and 15 bits, each with a one behind.
        pes.extend([0x84, 0x80, 5]);
        pes.push(0x21 | (pts >> 29) as u8 & 0x0e);
        pes.extend(((pts >> 14) as u16 | 1).to_be_bytes());
        pes.extend(((pts << 1) as u16 | 1).to_be_bytes());
        // One whole cell of service 0, at which a reader may begin.
        pes.extend([0, self.n_units, 0xdf]);
        pes.extend((unit.len() as u16).to_be_bytes());
        pes.extend(unit);
        self.n_units = self.n_units.wrapping_add(1);
        let mut at = 0;
        while at < pes.len() {
            let clock = (at == 0).then_some(ticks);
            at += self.packet(KLV, at == 0, clock, &pes[at..]);
        }
    }

    /// The stream's bytes.
    pub fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_have_their_size_and_carry_the_unit_unchanged() {
        // The check value of CRC-32/MPEG-2 in every catalogue.
        assert_eq!(crc32_mpeg2(b"123456789"), 0x0376_e6e7);
        for n in [0, 1, 100, 156, 157, 158, 159, 342, 70_000] {
            let unit: Vec<u8> = (0..n).map(|k| k as u8).collect();
            let mut ts = MpegTs::new();
            ts.push(3, &unit);
            let bytes = ts.finish();
            let mut pes = Vec::new();
            for (k, packet) in bytes.chunks(PACKET).enumerate() {
                assert!(packet.len() == PACKET && packet[0] == 0x47, "{n}: packet {k}");
                if u16::from_be_bytes([packet[1] & 0x1f, packet[2]]) == KLV {
                    let field = if packet[3] & 0x20 == 0 { 0 } else { 1 + usize::from(packet[4]) };
                    pes.extend(&packet[4 + field..]);
                }
            }
            assert_eq!(pes[19..], unit[..n.min(MOST_BYTES)], "{n}");
            assert_eq!(usize::from(u16::from_be_bytes([pes[4], pes[5]])), pes.len() - 6, "{n}");
        }
    }
}
