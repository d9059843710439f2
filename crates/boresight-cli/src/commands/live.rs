//! `boresight live`: a camera in, tracks out while it happens.

use super::stop::Stop;
use crate::console::{print, say};
use boresight::auto::DetectorKind;
use boresight::{Config, Error, ErrorKind};
use boresight_live::{
    Address, Board, LiveOutput, NamedSource, OneRun, Page, PageOptions, Pauses, Record, RecordOptions, RunOptions,
    Target, TlsFiles, latency, name_sources, publisher, run_all, soak,
};
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
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
  boresight live north=/dev/video0 south=rtsp://camera/stream --serve 127.0.0.1:8090 --record kept
      two cameras, each with its tracker; tables in kept/north and kept/south
  boresight live - --publish - < scans.jsonl
      detections as JSON lines in, events as JSON lines out
  boresight live --latency-test
      measures the time from a frame to its tracks on this machine";

/// Arguments of `boresight live`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A stream's address, a camera (/dev/video0), a file, or `-`: YUV4MPEG2, GIF or JSON lines of detections on standard input. Several run at once;
    /// `NAME=SOURCE` names one.
    #[arg(value_name = "SOURCE", required_unless_present_any = ["latency_test", "soak"])]
    sources: Vec<String>,
    /// Configuration file; without it everything is chosen by looking at the first seconds. `NAME=FILE` holds for the source of that name alone. Can be repeated.
    #[arg(short, long, value_name = "FILE")]
    config: Vec<String>,
    /// Detector, instead of the one chosen, with the tracker that fits it: isolated, cfar, integrate, bernoulli, moving, steadied, spot, local.
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
    /// Serve the page by TLS (https) with this certificate, or chain of them, as PEM.
    #[arg(long, value_name = "FILE", requires = "serve", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Private key of --tls-cert, as PEM.
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Let the page change a few parameters while the run goes on; each change is said, and shown as TOML to copy.
    #[arg(long, requires = "serve")]
    tune: bool,
    /// A name of this machine by which browsers may call the page, besides its numbers and localhost. Can be repeated.
    #[arg(long = "host", value_name = "NAME", requires = "serve")]
    hosts: Vec<String>,
    /// Publish events: `-` (JSON lines), udp://HOST:PORT, mqtt://[USER:PASSWORD@]HOST[:PORT]/TOPIC; zenoh/KEY by the program boresight-zenoh; nats://.. in a build with the feature `nats`; `?cbor` behind an address for CBOR. With `[world]` in the configuration cot+udp://HOST:PORT, cot+tcp://HOST:PORT (Cursor on Target), asterix+udp://HOST:PORT?sac=N&sic=N. Can be repeated.
    #[arg(long, value_name = "URL")]
    publish: Vec<String>,
    /// Updates of each track a second that are published, at most.
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = above_0)]
    updates_hz: f64,
    /// Record detections and tracks in rolling files in this folder; of several sources each in a folder of its own there.
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,
    /// Record the pictures too, as MP4 beside the tables: a tenth of a core at 1280 x 720 and 30 frames/s, more where pictures are noisy.
    #[arg(long, requires = "record")]
    record_video: bool,
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
    #[arg(long, conflicts_with = "sources")]
    latency_test: bool,
    /// Simulated cameras at once of `--latency-test`.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=16))]
    streams: u8,
    /// How long `--latency-test` measures, s.
    #[arg(long, value_name = "S", default_value_t = 20.0, value_parser = above_0)]
    seconds: f64,
    /// Measure the growth of memory over so many simulated hours, as fast as they go.
    #[arg(long, value_name = "HOURS", conflicts_with = "sources", value_parser = above_0)]
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
    let sources = name_sources(&args.sources)?;
    let is_single = sources.len() == 1;
    let options = sources.iter().map(|source| options(args, &source.name, &sources)).collect::<Result<Vec<_>, _>>()?;
    let targets = args.publish.iter().map(|url| Target::parse(url)).collect::<boresight::Result<Vec<_>>>()?;
    need_world(&targets, &options)?;
    let say = if args.quiet { warnings_only } else { line };
    let boards: Vec<_> = sources.iter().map(|source| Arc::new(Board::new(&source.name, say))).collect();
    let page = args.serve.as_deref().map(|address| serve(address, args, &boards)).transpose()?;
    let stop = Stop::on_signal()?;
    let mut runs = Vec::new();
    for (k, ((NamedSource { name, source }, mut options), board)) in
        sources.into_iter().zip(options).zip(boards).enumerate()
    {
        // A single one writes where it is told; several beside each other, under their names.
        let within = (!is_single).then_some(&*name);
        options.pauses.from_the_start = !is_single;
        let outputs = outputs(args, &targets, page.as_ref(), k, within, &board)?;
        let connect = Box::new(Address::new(&source, options.base.input.clone(), args.pace, args.rate_hz.is_some()));
        runs.push(OneRun { connect, options, board, outputs });
    }
    stop.run_begins();
    run_all(runs, &|| stop.go_on().is_break())?;
    Ok(if stop.go_on().is_break() { ExitCode::from(130) } else { ExitCode::SUCCESS })
}

/// What takes the tracks of the source with this number: record, wire, page. `within`: its name, where there are several.
fn outputs(
    args: &Args,
    targets: &[Target],
    page: Option<&Page>,
    source: usize,
    within: Option<&str>,
    board: &Arc<Board>,
) -> anyhow::Result<Vec<Box<dyn LiveOutput>>> {
    let mut outputs: Vec<Box<dyn LiveOutput>> = Vec::new();
    if let Some(dir) = &args.record {
        let dir = within.map_or_else(|| dir.clone(), |name| dir.join(name));
        let limits = RecordOptions {
            segment_bytes: args.segment_mb << 20,
            most_bytes: args.record_mb << 20,
            most_age: Duration::from_secs_f64(args.record_days * 86_400.0),
            ..RecordOptions::default()
        };
        let record = Record::create(dir, limits)?;
        outputs.push(Box::new(if args.record_video { record.with_video(board)? } else { record }));
    }
    for target in targets {
        let target = within.map_or_else(|| Ok(target.clone()), |name| target.of_source(name, source))?;
        outputs.push(publisher(&target, board)?);
    }
    if let Some(page) = page {
        outputs.push(page.output(source)?);
    }
    Ok(outputs)
}

/// The configuration file of a source: the one for its name, else the one for all.
fn config_file<'a>(given: &'a [String], name: &str, sources: &[NamedSource]) -> boresight::Result<Option<&'a Path>> {
    let split = |text: &'a str| match text.split_once('=') {
        Some((name, file)) if sources.iter().any(|s| s.name == name) => (Some(name), file),
        _ => (None, text),
    };
    let of = |who: Option<&str>| {
        let mut files = given.iter().map(|text| split(text)).filter(|(n, _)| *n == who).map(|(_, file)| file);
        match (files.next(), files.next()) {
            (first, None) => Ok(first.map(Path::new)),
            (_, Some(second)) => Err(Error::new(ErrorKind::Config, "two configurations are given for one source")
                .at(format!("--config {second}"))
                .hint("give one for all (--config FILE), or one for each by its name: --config NAME=FILE")),
        }
    };
    Ok(of(Some(name))?.or(of(None)?))
}

fn options(args: &Args, name: &str, sources: &[NamedSource]) -> anyhow::Result<RunOptions> {
    if args.detector == Some(DetectorKind::Colour) {
        return Err(Error::new(ErrorKind::Config, "a colour is learnt from a recording, not from a stream")
            .at("--detector colour")
            .hint("`boresight track --detector colour` on a recording writes a config.toml; give it by --config")
            .into());
    }
    let config = config_file(&args.config, name, sources)?.map(Config::from_file).transpose()?;
    let mut base = config.clone().unwrap_or_default();
    if let Some(rate) = args.rate_hz {
        base = base.with(&format!("input.rate-hz={rate}"))?;
    }
    for set in args.sets.iter().filter(|s| s.starts_with("input.") || s.starts_with("world")) {
        base = base.with(set)?;
    }
    Ok(RunOptions {
        config,
        base,
        sets: args.sets.clone(),
        detector: args.detector,
        learn_s: args.learn_s,
        updates_hz: args.updates_hz,
        pauses: Pauses::default(),
    })
}

/// Refuses a wire of places on Earth where a configuration does not say how they are found.
fn need_world(targets: &[Target], options: &[RunOptions]) -> boresight::Result<()> {
    match targets.iter().find_map(Target::needs_world) {
        Some(scheme) if options.iter().any(|o| o.base.world.is_none()) => {
            Err(Error::new(ErrorKind::Config, "places on Earth need a [world] in the configuration, and there is none")
                .at(format!("--publish {scheme}://"))
                .hint("say where the camera looks: [world.points], [world.plane] or [world.pinhole] in a file for --config, or --set 'world.pinhole={..}'; `boresight config --explain world.points` says what stands there"))
        }
        _ => Ok(()),
    }
}

fn serve(address: &str, args: &Args, boards: &[Arc<Board>]) -> anyhow::Result<Page> {
    let wrong = || {
        let error = Error::new(ErrorKind::Config, "expected an address of this machine and a port");
        error
            .at(format!("--serve {address}"))
            .hint("127.0.0.1:8090 for this machine alone, 0.0.0.0:8090 for others as well")
    };
    let found: SocketAddr = address.to_socket_addrs().ok().and_then(|mut all| all.next()).ok_or_else(wrong)?;
    let tls = args.tls_cert.clone().zip(args.tls_key.clone()).map(|(cert, key)| TlsFiles { cert, key });
    let options = PageOptions { names: args.hosts.clone(), tune: args.tune, tls, ..PageOptions::at(found) };
    let page = Page::serve(&options, boards)?;
    let scheme = page.scheme();
    match page.token() {
        None => say!("page: {scheme}://{}/", page.address()),
        // The one time that it is shown.
        Some(token) => {
            let (ip, port) = (page.address().ip(), page.address().port());
            // All addresses of this machine are none that a browser opens.
            let host = if ip.is_unspecified() { "THIS-MACHINE".to_string() } else { page.address().ip().to_string() };
            let host = if host.contains(':') { format!("[{host}]") } else { host };
            say!("page: {scheme}://{host}:{port}/?token={token}");
        }
    }
    Ok(page)
}

fn measure_latency(args: &Args) -> anyhow::Result<ExitCode> {
    let config = config_file(&args.config, "", &[])?.map(Config::from_file).transpose()?;
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
    fn a_source_takes_the_configuration_of_its_name_before_that_of_all() {
        let sources = name_sources(&["a=x".to_string(), "b=y".to_string()]).unwrap();
        let file = |given: &[&str], name: &str| {
            let given: Vec<String> = given.iter().map(ToString::to_string).collect();
            config_file(&given, name, &sources).map(|found| found.map(|p| p.display().to_string()))
        };
        assert_eq!(file(&["all.toml", "b=b.toml"], "a").unwrap().as_deref(), Some("all.toml"));
        assert_eq!(file(&["all.toml", "b=b.toml"], "b").unwrap().as_deref(), Some("b.toml"));
        assert_eq!(file(&["b=b.toml"], "a").unwrap(), None);
        assert_eq!(file(&["c=c.toml"], "a").unwrap().as_deref(), Some("c=c.toml"), "no source has that name");
        assert!(file(&["x.toml", "y.toml"], "a").unwrap_err().to_string().contains("NAME=FILE"));
    }
}
