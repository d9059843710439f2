//! Events of `boresight live` on zenoh keys: JSON lines on standard input, each put as it comes.
//!
//! Tracks go to KEY, the state of the run to KEY/status, which is also answered to a query of that key (zenoh's retained state); the liveliness token KEY/alive
//! stands while this program is connected (its last will). When the lines end and the run has not said that it ended, the state `gone` is put in its place.
//! With `--connect` a line is put while somebody is connected, else it waits, and so does who writes the lines: `boresight live` then keeps the newest and counts the rest.
//! Limits: zenoh acknowledges nothing: what is on its way when a connection breaks is lost, and what nobody subscribes to is gone.

mod arguments;
mod state;

use arguments::Arguments;
use state::State;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::ExitCode;
use std::time::{Duration, Instant};
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;
use zenoh::{Config, Session, Wait};

/// Longest line, bytes: an event has less than one kB.
const MAX_LINE: u64 = 1 << 20;
/// How often one looks whether somebody is connected.
const LOOK_AROUND: Duration = Duration::from_millis(50);
/// How long somebody who has just connected may take to say what he wants to hear.
const SUBSCRIBES: Duration = Duration::from_secs(1);

type Outcome<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

fn config(arguments: &Arguments) -> Outcome<Config> {
    let mut config = match &arguments.config {
        Some(file) => {
            Config::from_file(file).map_err(|e| format!("{file} cannot be read as a configuration of zenoh: {e}"))?
        }
        None => Config::default(),
    };
    for (key, endpoints) in [("connect/endpoints", &arguments.connect), ("listen/endpoints", &arguments.listen)] {
        if !endpoints.is_empty() {
            let list = serde_json::to_string(endpoints)?;
            config
                .insert_json5(key, &list)
                .map_err(|e| format!("{list} are no endpoints such as tcp/HOST:PORT: {e}"))?;
        }
    }
    Ok(config)
}

/// Whom the lines wait for.
struct Others<'s> {
    session: &'s Session,
    /// Whether somebody must be there.
    needed: bool,
    were_there: bool,
    /// Who started this program.
    parent: u32,
}

/// The process that started this one; another where that one has ended.
fn parent() -> u32 {
    #[cfg(unix)]
    return std::os::unix::process::parent_id();
    #[cfg(not(unix))]
    0
}

impl Others<'_> {
    fn are_there(&self) -> bool {
        let info = self.session.info();
        info.routers_zid().wait().next().is_some() || info.peers_zid().wait().next().is_some()
    }

    /// Waits until somebody is connected, where that is needed, and a moment for his subscription if he is new; `false` once nobody is left whose lines they are.
    fn wait_for(&mut self, publisher: &Publisher<'_>) -> bool {
        while self.needed && !self.are_there() {
            if std::mem::take(&mut self.were_there) {
                eprintln!("nobody is connected; events wait");
            }
            if parent() != self.parent {
                return false;
            }
            std::thread::sleep(LOOK_AROUND);
        }
        if !std::mem::replace(&mut self.were_there, true) && self.needed {
            let until = Instant::now() + SUBSCRIBES;
            let is_heard = || publisher.matching_status().wait().is_ok_and(|status| status.matching());
            while Instant::now() < until && !is_heard() {
                std::thread::sleep(LOOK_AROUND);
            }
        }
        true
    }
}

fn form(line: &str, cbor: bool) -> Outcome<Vec<u8>> {
    if !cbor {
        return Ok(line.as_bytes().to_vec());
    }
    let value: serde_json::Value = serde_json::from_str(line)?;
    let mut out = Vec::with_capacity(line.len());
    ciborium::into_writer(&value, &mut out)?;
    Ok(out)
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let session = zenoh::open(config(arguments)?).wait()?;
    let encoding = if arguments.cbor { Encoding::APPLICATION_CBOR } else { Encoding::APPLICATION_JSON };
    let (key, status_key) = (arguments.key.clone(), format!("{}/status", arguments.key));
    let declare = |key: String| {
        let publisher = session.declare_publisher(key).encoding(encoding.clone());
        publisher.congestion_control(CongestionControl::Block).wait()
    };
    let (tracks, status) = (declare(key.clone())?, declare(status_key.clone())?);
    let _alive = session.liveliness().declare_token(format!("{key}/alive")).wait()?;
    let state = State::default();
    let (answers, answered_key, answered_form) = (state.clone(), status_key.clone(), encoding.clone());
    let _queryable = session
        .declare_queryable(status_key)
        .callback(move |query| {
            if let Some(bytes) = answers.newest() {
                // Who asked may have gone.
                let _ = query.reply(&answered_key, bytes).encoding(answered_form.clone()).wait();
            }
        })
        .wait()?;
    let mut others =
        Others { session: &session, needed: !arguments.connect.is_empty(), were_there: false, parent: parent() };
    let mut input = BufReader::new(std::io::stdin().lock());
    let (mut line, mut n_put) = (String::new(), 0u64);
    loop {
        line.clear();
        if input.by_ref().take(MAX_LINE).read_line(&mut line)? == 0 {
            break;
        }
        let text = line.trim_end();
        if !text.is_empty() {
            let is_status = state.is_status(text);
            match form(text, arguments.cbor) {
                Ok(bytes) => {
                    if is_status {
                        state.set(text, bytes.clone());
                    }
                    if !others.wait_for(&tracks) {
                        break;
                    }
                    (if is_status { &status } else { &tracks }).put(bytes).wait()?;
                }
                Err(e) => eprintln!("a line is no JSON and is left out: {e}"),
            }
        }
        n_put += 1;
        if arguments.acknowledge {
            let mut out = std::io::stdout().lock();
            writeln!(out, "{n_put}").and_then(|()| out.flush())?;
        }
    }
    if let Some(gone) = state.gone() {
        status.put(form(&gone, arguments.cbor)?).wait()?;
    }
    session.close().wait()?;
    Ok(())
}

fn main() -> ExitCode {
    let outcome = match Arguments::parse(std::env::args().skip(1)) {
        Ok(arguments) => run(&arguments).map_err(|e| e.to_string()),
        Err(e) => Err(e),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::FAILURE
        }
    }
}
