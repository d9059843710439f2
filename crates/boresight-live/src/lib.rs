//! A camera in, tracks out while it happens: on a page, on a wire, in a record.
//!
//! The stages are those of `boresight track` ([`boresight::auto`], [`boresight::vision`], [`boresight::track`]); here stand what differs: a source that
//! may be lost, a clock, and outputs that must never keep the run waiting.

mod adapted;
mod board;
mod cbor;
mod choose;
mod eight_bits;
mod event;
mod histogram;
mod lives;
mod measure;
mod motion;
mod on_earth;
mod output;
mod publish;
mod queue;
mod record;
mod run;
mod run_all;
mod serve;
mod slot;
mod source;
mod stages;
mod timeline;
mod tune;

pub use board::{Board, Counts, Said, ScanNotes, State};
pub use cbor::Form;
pub use event::{Event, STATUS_SCHEMA, TRACK_SCHEMA, TrackEvent, TrackReport, What, When};
pub use histogram::Histogram;
pub use measure::{Latency, Sample, Soak, latency, soak};
pub use on_earth::OnEarth;
pub use output::{LiveOutput, Shown};
#[cfg(feature = "nats")]
pub use publish::Nats;
pub use publish::{
    Asterix, AsterixOptions, Broker, Cot, CotOptions, Lines, Mqtt, Target, Udp, ZenohAddress, publisher,
};
pub use record::{Record, RecordOptions};
pub use run::{RunOptions, run};
pub use run_all::{OneRun, run_all};
pub use serve::{Page, PageOptions, TlsFiles, resident_bytes};
pub use source::{Address, Connect, Content, Feed, Frames, NamedSource, Paced, Pauses, name_sources};
