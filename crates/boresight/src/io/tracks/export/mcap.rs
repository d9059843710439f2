//! MCAP: a log of messages in chunks, with an index by time, so that a player can begin anywhere.
//!
//! Source: *MCAP Format Specification*, version 0 (mcap.dev/spec): records are an operation code, a length and their content; numbers
//! are little-endian. Messages stand in chunks of about 1 MiB that are not compressed; the summary repeats schemas and channels and
//! holds the chunks' places and the counts. All sums of the standard are written.
//! Limits: 65 535 channels; all messages in memory.

use crc32fast::hash as crc32;

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Size from which a chunk is closed, bytes.
const CHUNK_BYTES: usize = 1 << 20;

const HEADER: u8 = 0x01;
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const MESSAGE_INDEX: u8 = 0x07;
const CHUNK_INDEX: u8 = 0x08;
const STATISTICS: u8 = 0x0b;
const SUMMARY_OFFSET: u8 = 0x0e;
const DATA_END: u8 = 0x0f;

/// What a channel's messages are.
pub(super) struct Channel<'a> {
    /// The channel's name.
    pub topic: &'a str,
    /// The schema's name, by which programs know it.
    pub schema_name: &'a str,
    /// The schema, as JSON Schema; messages are JSON.
    pub schema: &'a [u8],
}

/// A log that is being written.
pub(super) struct Mcap {
    bytes: Vec<u8>,
    /// Schemas and channels as records.
    declared: [Vec<u8>; 2],
    counts: Vec<u64>,
    /// First and last time, ns.
    span: Option<[u64; 2]>,
    chunk: Vec<u8>,
    chunk_span: Option<[u64; 2]>,
    /// Time and offset within the chunk of each message, by channel.
    places: Vec<Vec<u8>>,
    chunk_indexes: Vec<u8>,
    n_chunks: u32,
}

fn put_text(out: &mut Vec<u8>, text: &[u8]) {
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(text);
}

fn put_record(out: &mut Vec<u8>, code: u8, content: &[&[u8]]) {
    out.push(code);
    out.extend((content.iter().map(|c| c.len()).sum::<usize>() as u64).to_le_bytes());
    content.iter().for_each(|c| out.extend(*c));
}

fn widened(span: Option<[u64; 2]>, time_ns: u64) -> Option<[u64; 2]> {
    Some(span.map_or([time_ns; 2], |[a, b]| [a.min(time_ns), b.max(time_ns)]))
}

impl Mcap {
    /// Begins a log with these channels; `library` says who writes.
    pub fn new(library: &str, channels: &[Channel<'_>]) -> Self {
        let mut bytes = MAGIC.to_vec();
        let mut header = Vec::new();
        put_text(&mut header, b"");
        put_text(&mut header, library.as_bytes());
        put_record(&mut bytes, HEADER, &[&header]);
        let mut declared = [Vec::new(), Vec::new()];
        for (k, c) in channels.iter().enumerate() {
            // Schema 0 means none.
            let (id, schema_id) = ((k as u16).to_le_bytes(), (k as u16 + 1).to_le_bytes());
            let mut schema = schema_id.to_vec();
            [c.schema_name.as_bytes(), b"jsonschema", c.schema].iter().for_each(|t| put_text(&mut schema, t));
            put_record(&mut declared[0], SCHEMA, &[&schema]);
            let mut channel = [id, schema_id].concat();
            [c.topic.as_bytes(), b"json", b""].iter().for_each(|t| put_text(&mut channel, t));
            put_record(&mut declared[1], CHANNEL, &[&channel]);
        }
        let n = channels.len();
        Self {
            bytes,
            chunk: declared.concat(),
            declared,
            counts: vec![0; n],
            span: None,
            chunk_span: None,
            places: vec![Vec::new(); n],
            chunk_indexes: Vec::new(),
            n_chunks: 0,
        }
    }

    /// Adds a message to a channel.
    pub fn push(&mut self, channel: usize, time_ns: u64, message: &[u8]) {
        let time = time_ns.to_le_bytes();
        let place = (self.chunk.len() as u64).to_le_bytes();
        self.places[channel].extend([time, place].concat());
        let sequence = self.counts[channel] as u32;
        let content = [&(channel as u16).to_le_bytes()[..], &sequence.to_le_bytes(), &time, &time, message];
        put_record(&mut self.chunk, MESSAGE, &content);
        self.counts[channel] += 1;
        self.span = widened(self.span, time_ns);
        self.chunk_span = widened(self.chunk_span, time_ns);
        if self.chunk.len() > CHUNK_BYTES {
            self.close_chunk();
        }
    }

    fn close_chunk(&mut self) {
        let Some(span) = self.chunk_span.take() else { return };
        let span: Vec<u8> = span.iter().flat_map(|t| t.to_le_bytes()).collect();
        let begin = self.bytes.len() as u64;
        let size = (self.chunk.len() as u64).to_le_bytes();
        let no_compression = 0_u32.to_le_bytes();
        let head = [&span[..], &size, &crc32(&self.chunk).to_le_bytes(), &no_compression, &size].concat();
        put_record(&mut self.bytes, CHUNK, &[&head, &self.chunk]);
        let end = self.bytes.len() as u64;
        let mut of_channels = Vec::new();
        for (k, places) in self.places.iter_mut().enumerate().filter(|(_, p)| !p.is_empty()) {
            of_channels.extend((k as u16).to_le_bytes());
            of_channels.extend((self.bytes.len() as u64).to_le_bytes());
            let mut index = (k as u16).to_le_bytes().to_vec();
            put_text(&mut index, places);
            put_record(&mut self.bytes, MESSAGE_INDEX, &[&index]);
            places.clear();
        }
        let mut index = [&span[..], &begin.to_le_bytes(), &(end - begin).to_le_bytes()].concat();
        put_text(&mut index, &of_channels);
        index.extend((self.bytes.len() as u64 - end).to_le_bytes());
        index.extend([&no_compression[..], &size, &size].concat());
        put_record(&mut self.chunk_indexes, CHUNK_INDEX, &[&index]);
        self.chunk.clear();
        self.n_chunks += 1;
    }

    /// Ends the log: its bytes.
    pub fn finish(mut self) -> Vec<u8> {
        if self.n_chunks == 0 && self.chunk_span.is_none() {
            // Without a message the channels still stand in the log.
            self.bytes.extend(&self.chunk);
        }
        self.close_chunk();
        let sum = crc32(&self.bytes).to_le_bytes();
        put_record(&mut self.bytes, DATA_END, &[&sum]);
        let n = self.counts.len();
        let mut statistics = self.counts.iter().sum::<u64>().to_le_bytes().to_vec();
        statistics.extend((n as u16).to_le_bytes());
        // Channels, attachments, records of metadata, chunks.
        statistics.extend([n as u32, 0, 0, self.n_chunks].iter().flat_map(|v| v.to_le_bytes()));
        statistics.extend(self.span.unwrap_or_default().iter().flat_map(|v| v.to_le_bytes()));
        let counts = self.counts.iter().enumerate();
        let counts: Vec<u8> =
            counts.flat_map(|(k, c)| [&(k as u16).to_le_bytes()[..], &c.to_le_bytes()].concat()).collect();
        put_text(&mut statistics, &counts);
        let mut statistics_record = Vec::new();
        put_record(&mut statistics_record, STATISTICS, &[&statistics]);
        let begin = self.bytes.len();
        let [schemas, channels] = &self.declared;
        let groups = [
            (SCHEMA, schemas),
            (CHANNEL, channels),
            (STATISTICS, &statistics_record),
            (CHUNK_INDEX, &self.chunk_indexes),
        ];
        let mut offsets = Vec::new();
        for (code, group) in groups.into_iter().filter(|(_, g)| !g.is_empty()) {
            let place = [self.bytes.len() as u64, group.len() as u64].map(u64::to_le_bytes).concat();
            put_record(&mut offsets, SUMMARY_OFFSET, &[&[code], &place]);
            self.bytes.extend(group);
        }
        let of_offsets = self.bytes.len() as u64;
        self.bytes.extend(&offsets);
        // The footer's sum covers the summary and the footer up to it.
        self.bytes.push(FOOTER);
        self.bytes.extend([20, begin as u64, of_offsets].iter().flat_map(|v| v.to_le_bytes()));
        let sum = crc32(&self.bytes[begin..]).to_le_bytes();
        self.bytes.extend(sum);
        self.bytes.extend(MAGIC);
        self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Operation codes and lengths of the records, walked by their lengths.
    fn walk(bytes: &[u8]) -> Vec<(u8, usize)> {
        let mut at = 0;
        let mut found = Vec::new();
        while at < bytes.len() {
            let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
            found.push((bytes[at], length));
            at += 9 + length;
        }
        assert_eq!(at, bytes.len());
        found
    }

    #[test]
    fn records_fill_the_log_and_a_full_chunk_is_closed() {
        let channel = Channel { topic: "/t", schema_name: "s", schema: b"{}" };
        let mut log = Mcap::new("test", &[channel]);
        for k in 0..3 {
            log.push(0, 10 - k, &vec![b'x'; 600_000]);
        }
        let bytes = log.finish();
        assert!(bytes.starts_with(MAGIC) && bytes.ends_with(MAGIC));
        let codes: Vec<u8> = walk(&bytes[8..bytes.len() - 8]).iter().map(|r| r.0).collect();
        let (two_chunks, summary) = ([1, 6, 7, 6, 7, 15], [3, 4, 11, 8, 8, 14, 14, 14, 14, 2]);
        assert_eq!(codes, [&two_chunks[..], &summary].concat());
        let empty = Mcap::new("test", &[Channel { topic: "/t", schema_name: "s", schema: b"{}" }]).finish();
        let codes: Vec<u8> = walk(&empty[8..empty.len() - 8]).iter().map(|r| r.0).collect();
        assert_eq!(codes, [1, 3, 4, 15, 3, 4, 11, 14, 14, 14, 2]);
    }
}
