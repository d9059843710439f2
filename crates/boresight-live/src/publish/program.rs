//! Events to a program that takes lines, without waiting for anybody.
//!
//! It gets an event a line on its standard input, and says on its standard output, a line each, how many it has taken so far. One that ends is started again with growing
//! pauses, and gets first what it had not acknowledged: each event at least once. Up to [`WAITING`] events wait for it, older ones go and are counted. What it says on its
//! standard error is said. It has a process group of its own: an interrupt from the keyboard ends the run, and the run ends it, by the end of its input.
//! Limits: the [`WINDOW`] of a program that holds on to its input is filled, not more.

use super::connection::again_and_again;
use super::last_words::wait_for;
use crate::board::Board;
use crate::event::Event;
use crate::output::{LiveOutput, Shown};
use crate::queue::{Closed, Queue};
use boresight::{Error, ErrorKind, Result};
use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdout, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Events that wait for a program that is away or slow.
const WAITING: usize = 4096;
/// Events that it may have without a word.
const WINDOW: usize = 256;
/// How long one waits before looking around.
const LOOK_AROUND: Duration = Duration::from_millis(50);
/// How long the end waits for the program.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// Longest line of a program that is read, bytes.
const MAX_LINE: u64 = 64 << 10;

/// What is started.
#[derive(Clone, Debug)]
pub(super) struct Command {
    /// The address, as it is said.
    pub name: String,
    pub program: String,
    pub words: Vec<String>,
    /// How a program that is not there is had.
    pub mend: &'static str,
}

impl Command {
    fn start(&self) -> io::Result<Child> {
        let mut command = std::process::Command::new(&self.program);
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command.args(&self.words).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()
    }
}

#[derive(Default)]
struct Running {
    child: Option<Child>,
    /// Lines that it has taken.
    taken: u64,
    /// Whether it says nothing more.
    over: bool,
    /// Its last words.
    words: String,
}

struct Shared {
    queue: Queue<Event>,
    abandoned: AtomicBool,
    running: Mutex<Running>,
    changed: Condvar,
}

impl Shared {
    fn running(&self) -> MutexGuard<'_, Running> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Leaves what has not been taken.
    fn abandon(&self) {
        self.abandoned.store(true, Ordering::SeqCst);
        if let Some(child) = &mut self.running().child {
            // One that has ended is as ended as it shall be.
            let _ = child.kill();
        }
    }
}

/// Events to a program.
pub(super) struct Program {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Program {
    /// Starts the program, and the thread that feeds it.
    /// # Errors
    /// [`ErrorKind::NotFound`] for a program that is not there; a system without threads.
    pub fn start(command: Command, board: Arc<Board>) -> Result<Self> {
        let mut first = Some(command.start().map_err(|e| {
            let what = match e.kind() {
                io::ErrorKind::NotFound => format!("the program {} is not on the path", command.program),
                _ => format!("the program {} cannot be started", command.program),
            };
            Error::new(ErrorKind::NotFound, what)
                .at(format!("--publish {}", command.name))
                .because(e)
                .hint(command.mend)
        })?);
        let (queue, abandoned) = (Queue::new(WAITING), AtomicBool::new(false));
        let shared = Arc::new(Shared { queue, abandoned, running: Mutex::default(), changed: Condvar::new() });
        let here = Arc::clone(&shared);
        let work = move || {
            let mut unanswered = VecDeque::new();
            again_and_again(&command.name, WAITING, &board, &here.abandoned, |stands| {
                let child = first.take().map_or_else(|| command.start(), Ok)?;
                serve(&here, child, &command.name, &board, &mut unanswered, stands)
            });
        };
        let thread = std::thread::Builder::new().name("live-program".into()).spawn(work);
        let thread = thread.map_err(|e| Error::new(ErrorKind::Output, "no thread can be started").because(e))?;
        Ok(Self { shared, thread: Some(thread) })
    }
}

/// Feeds the program until there is nothing more; events that it has not taken stay in `unanswered`.
fn serve(
    shared: &Arc<Shared>,
    mut child: Child,
    name: &str,
    board: &Board,
    unanswered: &mut VecDeque<Event>,
    stands: &mut dyn FnMut(),
) -> io::Result<()> {
    let (stdin, stdout, stderr) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
    *shared.running() = Running { child: Some(child), ..Running::default() };
    let outcome = std::thread::scope(|scope| {
        // Both end with the program.
        let reads = |name: &str| std::thread::Builder::new().name(name.into());
        let begun = stdout.map(|out| reads("live-program-out").spawn_scoped(scope, move || listen(shared, out)));
        let begun = begun.transpose().and_then(|_| {
            stderr
                .map(|out| reads("live-program-err").spawn_scoped(scope, move || hear(shared, out, name, board)))
                .transpose()
        });
        let outcome = begun.and_then(|_| stdin.map_or(Ok(()), |stdin| feed(shared, stdin, unanswered, stands)));
        end(shared, outcome.is_ok());
        outcome
    });
    let Running { child, words, .. } = std::mem::take(&mut *shared.running());
    let status = child.map(|mut child| child.wait()).transpose()?;
    match outcome {
        Err(_) if !words.is_empty() => Err(io::Error::other(words)),
        Err(_) => Err(io::Error::other(status.map_or_else(String::new, |s| format!("the program has ended: {s}")))),
        Ok(()) => Ok(()),
    }
}

/// Writes events; returns when all are taken, or with the error of a program that has ended.
fn feed(
    shared: &Shared,
    mut stdin: impl Write,
    unanswered: &mut VecDeque<Event>,
    stands: &mut dyn FnMut(),
) -> io::Result<()> {
    let (mut n_taken, mut n_written) = (0, 0u64);
    let mut line = String::new();
    while !shared.abandoned.load(Ordering::SeqCst) {
        let (taken, over) = {
            let running = shared.running();
            (running.taken.min(n_written), running.over)
        };
        if taken > n_taken {
            stands();
        }
        unanswered.drain(..((taken - n_taken) as usize).min(unanswered.len()));
        n_taken = taken;
        if over {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let waits = match unanswered.get((n_written - n_taken) as usize) {
            Some(event) => {
                line.clear();
                line.push_str(&event.json);
                line.push('\n');
                stdin.write_all(line.as_bytes())?;
                n_written += 1;
                false
            }
            None if unanswered.len() < WINDOW => match shared.queue.pop(LOOK_AROUND) {
                Ok(event) => {
                    unanswered.extend(event);
                    false
                }
                Err(Closed) if unanswered.is_empty() => return Ok(()),
                Err(Closed) => true,
            },
            None => true,
        };
        if waits {
            let running = shared.running();
            let nothing = |r: &mut Running| r.taken.min(n_written) == n_taken && !r.over;
            drop(shared.changed.wait_timeout_while(running, LOOK_AROUND, nothing));
        }
    }
    Ok(())
}

/// Ends the program: after good feeding it may take a moment, its input has ended.
fn end(shared: &Shared, in_peace: bool) {
    let until = Instant::now() + if in_peace { LAST_WORDS } else { Duration::ZERO };
    loop {
        let mut running = shared.running();
        let Some(child) = &mut running.child else { return };
        if !matches!(child.try_wait(), Ok(None)) {
            return;
        }
        if Instant::now() >= until || shared.abandoned.load(Ordering::SeqCst) {
            let _ = child.kill();
            return;
        }
        drop(running);
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The next line of a program, if it is one.
fn next_line(reader: &mut impl BufRead, line: &mut String) -> bool {
    line.clear();
    matches!(reader.by_ref().take(MAX_LINE).read_line(line), Ok(n) if n > 0)
}

/// Takes its acknowledgements.
fn listen(shared: &Shared, out: ChildStdout) {
    let (mut reader, mut line) = (BufReader::new(out), String::new());
    while next_line(&mut reader, &mut line) {
        if let Ok(n) = line.trim().parse::<u64>() {
            let mut running = shared.running();
            running.taken = n.max(running.taken);
            shared.changed.notify_all();
        }
    }
    shared.running().over = true;
    shared.changed.notify_all();
}

/// Says what it says, and keeps an error for its end.
fn hear(shared: &Shared, out: impl Read, name: &str, board: &Board) {
    let (mut reader, mut line) = (BufReader::new(out), String::new());
    while next_line(&mut reader, &mut line) {
        match line.trim().strip_prefix("error: ") {
            Some(why) => shared.running().words = why.to_string(),
            None => board.say(&format!("warning: {name}: {}", line.trim())),
        }
    }
}

impl LiveOutput for Program {
    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        shown.events.iter().for_each(|event| self.event(event));
        Ok(())
    }

    fn event(&mut self, event: &Event) {
        self.shared.queue.push(event.clone());
    }

    fn finish(&mut self) {
        self.shared.queue.close();
        wait_for(&mut self.thread, LAST_WORDS);
        self.shared.abandon();
    }

    fn dropped(&self) -> u64 {
        self.shared.queue.dropped()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.shared.queue.close();
        self.shared.abandon();
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::path::Path;

    const PATIENCE: Duration = Duration::from_secs(30);
    /// Takes lines into the file `$0`, and acknowledges them.
    const TAKES: &str = "n=0; while read -r l; do echo \"$l\" >> \"$0\"; n=$((n+1)); echo $n; done";

    fn shell(script: &str, file: &Path) -> Command {
        let words = ["-c".into(), script.into(), file.display().to_string()].to_vec();
        Command { name: "zenoh/test".into(), program: "sh".into(), words, mend: "install a shell" }
    }

    fn event(k: u64) -> Event {
        Event::line(false, format!("{{\"k\":{k}}}"))
    }

    fn taken(file: &Path) -> Vec<u64> {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        text.lines().filter_map(|l| l.strip_prefix("{\"k\":")?.strip_suffix('}')?.parse().ok()).collect()
    }

    fn until(what: &str, is: impl Fn() -> bool) {
        let end = Instant::now() + PATIENCE;
        while !is() {
            assert!(Instant::now() < end, "never: {what}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    static SAID: Mutex<Vec<String>> = Mutex::new(Vec::new());

    fn board() -> Arc<Board> {
        Arc::new(Board::new("cam", |words| SAID.lock().unwrap().push(words.to_string())))
    }

    #[test]
    fn a_program_takes_every_event_in_order_and_ends_with_its_input() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("a");
        let script = format!("{TAKES}; echo over >> \"$0\"");
        let mut program = Program::start(shell(&script, &file), board()).unwrap();
        (0..1000).for_each(|k| program.event(&event(k)));
        program.finish();
        assert_eq!(taken(&file), (0..1000).collect::<Vec<_>>());
        assert!(std::fs::read_to_string(&file).unwrap().ends_with("over\n"));
        assert_eq!(program.dropped(), 0);
    }

    #[test]
    fn one_that_ends_in_the_middle_is_started_again_and_misses_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("a");
        // Ends behind 100 lines, the last of which it has not acknowledged.
        let script = "n=0; while read -r l; do echo \"$l\" >> \"$0\"; n=$((n+1)); [ $n = 100 ] && { echo 'error: enough' >&2; exit 3; }; echo $n; done";
        let mut program = Program::start(shell(script, &file), board()).unwrap();
        (0..250).for_each(|k| program.event(&event(k)));
        until("the last event", || taken(&file).contains(&249));
        program.finish();
        let mut all = taken(&file);
        let n = all.len();
        all.dedup();
        assert_eq!(all, (0..250).collect::<Vec<_>>(), "in order");
        assert!((251..260).contains(&n), "only what was not acknowledged comes twice: {n}");
        let said = SAID.lock().unwrap().join("\n");
        assert!(said.contains("warning: zenoh/test: enough; events wait, at most 4096"), "{said}");
        assert!(said.contains("zenoh/test: connected again"), "{said}");
    }

    #[test]
    fn one_that_takes_nothing_holds_up_nobody_and_what_waits_is_bounded() {
        let dir = tempfile::tempdir().unwrap();
        let mut program = Program::start(shell("sleep 1000", &dir.path().join("a")), board()).unwrap();
        let began = Instant::now();
        (0..6000).for_each(|k| program.event(&event(k)));
        assert!(began.elapsed() < Duration::from_secs(1));
        let dropped = program.dropped();
        assert!((6000 - WAITING - WINDOW..=6000 - WAITING).contains(&(dropped as usize)), "{dropped}");
        program.finish();
        assert!(began.elapsed() < Duration::from_secs(10), "the end waits for its last words only");
    }

    #[test]
    fn one_that_is_not_there_is_said_with_its_mend() {
        let command = Command { program: "no-such-program-here".into(), ..shell("", Path::new("a")) };
        let said = Program::start(command, board()).err().unwrap().to_string();
        assert!(said.contains("not on the path") && said.contains("hint: install a shell"), "{said}");
    }
}
