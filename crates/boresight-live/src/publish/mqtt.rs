//! Events to an MQTT 3.1.1 broker: each at least once while there is a connection, the state of the run retained, a last will.
//!
//! Tracks go to TOPIC with quality of service 1, the state of the run to `TOPIC/status`, retained; the last will says `gone` there if the program ends
//! without a word. A broker that is away is connected again with growing pauses; up to [`WAITING`] events wait for it, older ones go and are counted.
//! What was sent and not acknowledged when a connection broke is sent again first.
//! Limits: no TLS.

use super::address::Broker;
use super::last_words::wait_for;
use crate::board::{Board, unix_s};
use crate::cbor::Form;
use crate::event::{Event, status_line};
use crate::output::{LiveOutput, Shown};
use crate::queue::Queue;
use boresight::{Error, ErrorKind, Result};
use rumqttc::{AsyncClient, EventLoop, LastWill, MqttOptions, Packet, QoS};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};
use tokio::sync::Notify;

/// Events that wait for a broker that is away.
pub const WAITING: usize = 4096;
/// Events sent and not yet acknowledged.
const WINDOW: usize = 64;
const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LONGEST_PAUSE: Duration = Duration::from_secs(10);
/// How long the end waits for the broker.
const LAST_WORDS: Duration = Duration::from_secs(2);

struct Shared {
    queue: Queue<Event>,
    changed: Notify,
    over: AtomicBool,
    abandoned: AtomicBool,
    sent: Mutex<Sent>,
}

/// What the connection holds.
#[derive(Default)]
struct Sent {
    connected: bool,
    unacknowledged: VecDeque<Event>,
    again: VecDeque<Event>,
    last_status: Option<Event>,
}

impl Shared {
    fn sent(&self) -> std::sync::MutexGuard<'_, Sent> {
        self.sent.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next event to send, if there is a connection and room in its window.
    fn next(&self) -> Option<Event> {
        let mut sent = self.sent();
        if !sent.connected || sent.unacknowledged.len() >= WINDOW {
            return None;
        }
        let event = sent.again.pop_front().or_else(|| self.queue.try_pop())?;
        if event.is_status {
            sent.last_status = Some(event.clone());
        }
        sent.unacknowledged.push_back(event.clone());
        Some(event)
    }

    fn connected(&self) {
        let mut sent = self.sent();
        sent.connected = true;
        // The broker has the last will in its place, or has forgotten everything.
        let status = sent.last_status.take();
        sent.again.extend(status);
    }

    fn broken(&self) {
        let mut sent = self.sent();
        sent.connected = false;
        let Sent { unacknowledged, again, .. } = &mut *sent;
        unacknowledged.extend(again.drain(..));
        std::mem::swap(unacknowledged, again);
    }

    fn is_done(&self) -> bool {
        let sent = self.sent();
        self.queue.is_closed() && sent.unacknowledged.is_empty() && sent.again.is_empty() && self.queue.is_empty()
    }
}

/// Events to a broker.
pub struct Mqtt {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Mqtt {
    /// Starts the thread that connects; a broker that is not there yet is waited for by it alone.
    /// # Errors
    /// A system without threads.
    pub fn start(broker: &Broker, board: Arc<Board>) -> Result<Self> {
        let failed = |e: std::io::Error| Error::new(ErrorKind::Output, "no thread can be started").because(e);
        let queue = Queue::new(WAITING);
        let shared = Arc::new(Shared {
            queue,
            changed: Notify::new(),
            over: AtomicBool::new(false),
            abandoned: AtomicBool::new(false),
            sent: Mutex::default(),
        });
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
        let (client, events) = AsyncClient::new(options(broker, &board), 2 * WINDOW);
        let (topic, form, name) = (broker.topic.clone(), broker.form, format!("{broker:?}"));
        let here = Arc::clone(&shared);
        let work = move || {
            runtime.block_on(async {
                let feeding = feed(&here, &client, &topic, form);
                tokio::select! {
                    () = poll(&here, events, &board, &name) => {}
                    () = feeding => {}
                }
            });
        };
        let thread = std::thread::Builder::new().name("live-mqtt".into()).spawn(work).map_err(failed)?;
        Ok(Self { shared, thread: Some(thread) })
    }
}

fn options(broker: &Broker, board: &Board) -> MqttOptions {
    let mut id = [0; 6];
    // Without randomness the id is that of one program for one source, which serves as well.
    let _ = getrandom::fill(&mut id);
    let id: String = id.iter().map(|b| format!("{b:02x}")).collect();
    let mut options = MqttOptions::new(format!("boresight-{id}"), &broker.host, broker.port);
    options.set_keep_alive(Duration::from_secs(10)).set_inflight(WINDOW as u16).set_clean_session(true);
    let gone = status_line(&board.source, "gone", "the program ended without a word", unix_s(SystemTime::now()));
    options.set_last_will(LastWill::new(
        format!("{}/status", broker.topic),
        broker.form.bytes(&gone).into_owned(),
        QoS::AtLeastOnce,
        true,
    ));
    if let Some((user, password)) = &broker.user {
        options.set_credentials(user, password);
    }
    options
}

/// Hands events to the client while there is room.
async fn feed(shared: &Shared, client: &AsyncClient, topic: &str, form: Form) {
    let status = format!("{topic}/status");
    loop {
        while let Some(event) = shared.next() {
            let to = if event.is_status { &status } else { topic };
            // There is room: the client's queue is twice the window. Were it full all the same, the next connection sends it again.
            let _ = client.try_publish(to, QoS::AtLeastOnce, event.is_status, form.bytes(&event.json).into_owned());
        }
        if shared.over.load(Ordering::SeqCst) && shared.is_done() {
            let _ = client.try_disconnect();
            tokio::time::sleep(Duration::from_millis(50)).await;
            return;
        }
        if shared.abandoned.load(Ordering::SeqCst) {
            return;
        }
        shared.changed.notified().await;
    }
}

/// Drives the connection.
async fn poll(shared: &Shared, mut events: EventLoop, board: &Board, name: &str) {
    let mut pause = FIRST_PAUSE;
    let mut said = false;
    loop {
        match events.poll().await {
            Ok(rumqttc::Event::Incoming(Packet::ConnAck(_))) => {
                shared.connected();
                if std::mem::take(&mut said) {
                    board.say(&format!("{name}: connected again"));
                }
                pause = FIRST_PAUSE;
            }
            Ok(rumqttc::Event::Incoming(Packet::PubAck(_))) => {
                shared.sent().unacknowledged.pop_front();
            }
            Ok(_) => continue,
            Err(e) => {
                shared.broken();
                events.clean();
                // They are sent again from our own list, which a broker that has forgotten the session does not shorten.
                events.pending.clear();
                // Behind the last word the broker closes: that is no loss.
                let has_parted = shared.over.load(Ordering::SeqCst) && shared.is_done();
                if !has_parted && !std::mem::replace(&mut said, true) {
                    board.say(&format!("warning: {name}: {e}; events wait, at most {WAITING}"));
                }
                tokio::time::sleep(pause).await;
                pause = (pause * 2).min(LONGEST_PAUSE);
            }
        }
        shared.changed.notify_one();
    }
}

impl LiveOutput for Mqtt {
    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        shown.events.iter().for_each(|event| self.event(event));
        Ok(())
    }

    fn event(&mut self, event: &Event) {
        self.shared.queue.push(event.clone());
        self.shared.changed.notify_one();
    }

    fn finish(&mut self) {
        self.shared.queue.close();
        self.shared.over.store(true, Ordering::SeqCst);
        self.shared.changed.notify_one();
        wait_for(&mut self.thread, LAST_WORDS);
    }

    fn dropped(&self) -> u64 {
        self.shared.queue.dropped()
    }
}

impl Drop for Mqtt {
    /// Without [`LiveOutput::finish`] the connection breaks off, and the broker says the last will.
    fn drop(&mut self) {
        self.shared.abandoned.store(true, Ordering::SeqCst);
        self.shared.changed.notify_one();
    }
}
