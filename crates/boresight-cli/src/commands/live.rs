//! `boresight live`: a camera in, tracks out while it happens.

use super::stop::Stop;
use crate::console::{print, say};
use boresight::auto::DetectorKind;
use boresight::{Config, Error, ErrorKind};
use boresight_live::{
    Address, Board, LiveOutput, Page, PageOptions, Record, RecordOptions, RunOptions, Target, latency, publisher, run,
    soak,
};
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

const EXAMPLES: &str = "Examples:
  boresight live /dev/video0 --serve 127.0.0.1:8090
      a camera; pictures, tracks and curves on http://127.0.0.1:8090/
  boresight live rtsp://camera/stream --publish mqtt://broker/site/tracks --record kept
      anything an installed ffmpeg can read; events to a broker, tables to kept/
  boresight live flight.mp4 --pace --serve 0.0.0.0:8090
      a file played by the clock, on a page for others, who need the token that is printed
  boresight live - --publish - < scans.jsonl
      detections as JSON lines in, events as JSON lines out
  boresight live --latency-test
      measures the time from a frame to its tracks on this machine";

/// Arguments of `boresight live`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A stream's address, a camera (/dev/video0), a file, or `-`: YUV4MPEG2, GIF or JSON lines of detections on standard input.
    #[arg(value_name = "SOURCE", required_unless_present_any = ["latency_test", "soak"])]
    source: Option<String>,
    /// Configuration file; without it everything is chosen by looking at the first seconds.
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Detector, instead of the one chosen, with the tracker that fits it: isolated, cfar, integrate, moving, spot, local.
    #[arg(long, value_name = "NAME", conflicts_with = "config")]
    detector: Option<DetectorKind>,
    /// Change one key of the configuration, chosen or given: `tracker.coast-s=1`. Can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Rate of inputs without times of their own, frames/s.
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<f64>,
    /// Play a file, or standard input, by the clock; frames that come too fast for the machine are dropped, as a camera's are.
    #[arg(long)]
    pace: bool,
    /// Time of the first frames that are looked at to choose the configuration, s.
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = above_0)]
    learn_s: f64,
    /// Show a page at this address, such as 127.0.0.1:8090. Any but this machine's own address demands a token, which is printed.
    #[arg(long, value_name = "ADDRESS")]
    serve: Option<String>,
    /// A name of this machine by which browsers may call the page, besides its numbers and localhost. Can be repeated.
    #[arg(long = "host", value_name = "NAME", requires = "serve")]
    hosts: Vec<String>,
    /// Publish events: `-` (JSON lines), udp://HOST:PORT, mqtt://[USER:PASSWORD@]HOST[:PORT]/TOPIC. Can be repeated.
    #[arg(long, value_name = "URL")]
    publish: Vec<String>,
    /// Updates of each track a second that are published, at most.
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = above_0)]
    updates_hz: f64,
    /// Record detections and tracks in rolling files in this folder.
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,
    /// The oldest records go when all are larger than this, MB.
    #[arg(long, value_name = "MB", default_value_t = 8192, value_parser = clap::value_parser!(u64).range(1..))]
    record_mb: u64,
    /// Records older than this go, days.
    #[arg(long, value_name = "DAYS", default_value_t = 30.0, value_parser = above_0)]
    record_days: f64,
    /// A record's file is closed and the next one begun when it is this large, MB, or an hour old.
    #[arg(long, value_name = "MB", default_value_t = 64, value_parser = clap::value_parser!(u64).range(1..))]
    segment_mb: u64,
    /// Measure the time from a frame to its tracks on the wire, with simulated cameras of 1280 x 720 at 30 frames/s; with --config, of that one.
    #[arg(long, conflicts_with = "source")]
    latency_test: bool,
    /// Simulated cameras at once of `--latency-test`.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=16))]
    streams: u8,
    /// How long `--latency-test` measures, s.
    #[arg(long, value_name = "S", default_value_t = 20.0, value_parser = above_0)]
    seconds: f64,
    /// Measure the growth of memory over so many simulated hours, as fast as they go.
    #[arg(long, value_name = "HOURS", conflicts_with = "source", value_parser = above_0)]
    soak: Option<f64>,
    /// Say nothing but errors and warnings.
    #[arg(short, long)]
    quiet: bool,
}

fn above_0(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|v: &f64| *v > 0.0 && *v < 1e9).ok_or_else(|| "a number above 0".to_string())
}

fn line(words: &str) {
    say!("{words}");
}

fn warnings_only(words: &str) {
    if words.starts_with("warning") {
        say!("{words}");
    }
}

/// Runs the command.
pub fn run_live(args: &Args) -> anyhow::Result<ExitCode> {
    if args.latency_test {
        return measure_latency(args);
    }
    if let Some(hours) = args.soak {
        return measure_soak(hours);
    }
    let source = args.source.clone().unwrap_or_default();
    let options = options(args)?;
    let targets = args.publish.iter().map(|url| Target::parse(url)).collect::<boresight::Result<Vec<_>>>()?;
    let board = Arc::new(Board::new(shown_name(&source), if args.quiet { warnings_only } else { line }));
    let page = args.serve.as_deref().map(|address| serve(address, args, &board)).transpose()?;
    let mut outputs: Vec<Box<dyn LiveOutput>> = Vec::new();
    if let Some(dir) = &args.record {
        let limits = RecordOptions {
            segment_bytes: args.segment_mb << 20,
            most_bytes: args.record_mb << 20,
            most_age: Duration::from_secs_f64(args.record_days * 86_400.0),
            ..RecordOptions::default()
        };
        outputs.push(Box::new(Record::create(dir, limits)?));
    }
    for target in &targets {
        outputs.push(publisher(target, &board)?);
    }
    if let Some(page) = &page {
        outputs.push(page.output()?);
    }
    let stop = Stop::on_signal()?;
    let address = Address::new(&source, options.base.input.clone(), args.pace, args.rate_hz.is_some());
    stop.run_begins();
    run(Box::new(address), &options, &board, &mut outputs, &|| stop.go_on().is_break())?;
    Ok(if stop.go_on().is_break() { ExitCode::from(130) } else { ExitCode::SUCCESS })
}

fn options(args: &Args) -> anyhow::Result<RunOptions> {
    if args.detector == Some(DetectorKind::Colour) {
        return Err(Error::new(ErrorKind::Config, "a colour is learnt from a recording, not from a stream")
            .at("--detector colour")
            .hint("`boresight track --detector colour` on a recording writes a config.toml; give it by --config")
            .into());
    }
    let config = args.config.as_deref().map(Config::from_file).transpose()?;
    let mut base = config.clone().unwrap_or_default();
    if let Some(rate) = args.rate_hz {
        base = base.with(&format!("input.rate-hz={rate}"))?;
    }
    for set in args.sets.iter().filter(|s| s.starts_with("input.")) {
        base = base.with(set)?;
    }
    Ok(RunOptions {
        config,
        base,
        sets: args.sets.clone(),
        detector: args.detector,
        learn_s: args.learn_s,
        updates_hz: args.updates_hz,
        ..RunOptions::default()
    })
}

/// The source's name without the password that may stand in an address.
fn shown_name(source: &str) -> String {
    match (source, source.split_once("://")) {
        ("-", _) => "standard input".to_string(),
        (_, Some((scheme, rest))) => {
            let place = rest.find('/').unwrap_or(rest.len());
            let from = rest[..place].rfind('@').map_or(0, |at| at + 1);
            format!("{scheme}://{}", &rest[from..])
        }
        _ => source.to_string(),
    }
}

fn serve(address: &str, args: &Args, board: &Arc<Board>) -> anyhow::Result<Page> {
    let wrong = || {
        let error = Error::new(ErrorKind::Config, "expected an address of this machine and a port");
        error
            .at(format!("--serve {address}"))
            .hint("127.0.0.1:8090 for this machine alone, 0.0.0.0:8090 for others as well")
    };
    let found: SocketAddr = address.to_socket_addrs().ok().and_then(|mut all| all.next()).ok_or_else(wrong)?;
    let page = Page::serve(&PageOptions { names: args.hosts.clone(), ..PageOptions::at(found) }, Arc::clone(board))?;
    match page.token() {
        None => say!("page: http://{}/", page.address()),
        // The one time that it is shown.
        Some(token) => {
            let (ip, port) = (page.address().ip(), page.address().port());
            // All addresses of this machine are none that a browser opens.
            let host = if ip.is_unspecified() { "THIS-MACHINE".to_string() } else { page.address().ip().to_string() };
            let host = if host.contains(':') { format!("[{host}]") } else { host };
            say!("page: http://{host}:{port}/?token={token}");
        }
    }
    Ok(page)
}

fn measure_latency(args: &Args) -> anyhow::Result<ExitCode> {
    let config = args.config.as_deref().map(Config::from_file).transpose()?;
    let measured = latency(args.streams.into(), args.seconds, config)?;
    let mut text = String::from("stream  frames  arrived  dropped   p50 ms   p99 ms  longest ms\n");
    for (k, m) in measured.iter().enumerate() {
        let [made, arrived] = m.frames;
        let ms = [m.p50_s, m.p99_s, m.longest_s].map(|s| 1e3 * s);
        text += &format!(
            "{:>6}  {made:>6}  {arrived:>7}  {:>7}  {:>7.1}  {:>7.1}  {:>10.1}\n",
            k + 1,
            m.dropped,
            ms[0],
            ms[1],
            ms[2]
        );
    }
    print(text.as_bytes())?;
    Ok(ExitCode::SUCCESS)
}

fn measure_soak(hours: f64) -> anyhow::Result<ExitCode> {
    let folder = std::env::temp_dir().join(format!("boresight-soak-{}", std::process::id()));
    let measured = soak(hours, &folder);
    // A folder in the system's own place for such things; what stays there is cleared by the system.
    let _ = std::fs::remove_dir_all(&folder);
    let m = measured?;
    let mb = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let mut text = String::from("hours  memory MB\n");
    for s in &m.samples {
        text += &format!("{:>5.1}  {:>9.2}\n", s.hours, mb(s.bytes));
    }
    text += &format!(
        "{} frames, {} tracks, {} events; growth {:.2} MB\n",
        m.frames,
        m.tracks,
        m.events,
        mb(m.growth_bytes())
    );
    print(text.as_bytes())?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_in_an_address_is_not_shown() {
        assert_eq!(shown_name("rtsp://me:secret@cam/stream@1"), "rtsp://cam/stream@1");
        assert_eq!(shown_name("rtsp://cam/a@b"), "rtsp://cam/a@b");
        assert_eq!((shown_name("-"), shown_name("a@b.mp4")), ("standard input".into(), "a@b.mp4".into()));
    }
}
