//! A headless Chromium that a test drives from the outside: its debugging protocol over two pipes, messages that end with a zero byte.
//!
//! Source: chromedevtools.github.io/devtools-protocol; `--remote-debugging-pipe` reads from descriptor 3 and writes to 4.

pub mod installed;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(60);

/// A browser with one page.
pub struct Browser {
    child: Child,
    to: ChildStdin,
    from: Receiver<Value>,
    n_asked: u64,
    session: Option<String>,
    /// What the page said that it should not: exceptions and errors on the console.
    pub complaints: Vec<String>,
}

impl Browser {
    /// Starts one with its profile in this folder.
    pub fn start(program: &Path, profile: &Path) -> Self {
        let mut command = Command::new("sh");
        // The shell lays the pipes where the browser looks for them.
        command.args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 2>/dev/null"]).arg(program);
        command.args(["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", "--no-first-run"]);
        command.arg(format!("--user-data-dir={}", profile.display())).arg("about:blank");
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let mut reader = BufReader::new(child.stdout.take().unwrap());
        let (send, from) = channel();
        std::thread::spawn(move || {
            let mut message = Vec::new();
            while reader.read_until(0, &mut message).unwrap_or(0) > 0 {
                message.pop();
                if send.send(serde_json::from_slice(&message).unwrap_or_default()).is_err() {
                    return;
                }
                message.clear();
            }
        });
        let to = child.stdin.take().unwrap();
        let mut new = Self { child, to, from, n_asked: 0, session: None, complaints: Vec::new() };
        let target = new.ask("Target.createTarget", json!({ "url": "about:blank" }));
        let attached =
            new.ask("Target.attachToTarget", json!({ "targetId": target["targetId"].clone(), "flatten": true }));
        new.session = Some(attached["sessionId"].as_str().unwrap().to_string());
        ["Runtime.enable", "Page.enable"].iter().for_each(|method| drop(new.ask(method, json!({}))));
        new
    }

    /// Asks the browser for something and waits for its answer.
    pub fn ask(&mut self, method: &str, params: Value) -> Value {
        self.answer(method, params).unwrap_or_else(|error| panic!("{method}: {error}"))
    }

    /// As [`Self::ask`], or what the browser has against it.
    fn answer(&mut self, method: &str, params: Value) -> Result<Value, Value> {
        self.n_asked += 1;
        let mut message = json!({ "id": self.n_asked, "method": method, "params": params });
        if let Some(session) = &self.session {
            message["sessionId"] = session.as_str().into();
        }
        let bytes = [message.to_string().as_bytes(), &[0]].concat();
        self.to.write_all(&bytes).unwrap();
        let end = Instant::now() + PATIENCE;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let answer = self.from.recv_timeout(left).unwrap_or_else(|_| panic!("no answer to {method}"));
            match answer["method"].as_str() {
                Some("Runtime.exceptionThrown") => self.complaints.push(answer["params"].to_string()),
                Some("Runtime.consoleAPICalled") if answer["params"]["type"] == "error" => {
                    self.complaints.push(answer["params"]["args"].to_string());
                }
                _ => {}
            }
            if answer["id"] == self.n_asked {
                let error = &answer["error"];
                return if error.is_null() { Ok(answer["result"].clone()) } else { Err(error.clone()) };
            }
        }
    }

    /// What an expression gives in the page; where the page is left while it is asked, in the one that comes.
    pub fn value(&mut self, expression: &str) -> Value {
        let params = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let end = Instant::now() + PATIENCE;
        let answer = loop {
            match self.answer("Runtime.evaluate", params.clone()) {
                Ok(answer) => break answer,
                Err(error) if is_left(&error) && Instant::now() < end => std::thread::sleep(Duration::from_millis(30)),
                Err(error) => panic!("{expression}: {error}"),
            }
        };
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true in the page.
    pub fn until(&mut self, expression: &str) {
        let end = Instant::now() + PATIENCE;
        while self.value(expression) != true {
            // Between two pages there is no body.
            let state = self.value("document.body?.innerText ?? null");
            assert!(Instant::now() < end, "never true: {expression}\nthe page says: {state}");
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Opens an address in a window of this size, px.
    pub fn open(&mut self, address: &str, [width, height]: [u32; 2]) {
        self.resize([width, height]);
        self.ask("Page.navigate", json!({ "url": address }));
    }

    /// Changes the size of the window, px.
    pub fn resize(&mut self, [width, height]: [u32; 2]) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600 });
        self.ask("Emulation.setDeviceMetricsOverride", size);
    }

    /// Clicks at a place of the window, px.
    pub fn click(&mut self, x: f64, y: f64) {
        for kind in ["mousePressed", "mouseReleased"] {
            let params = json!({ "type": kind, "x": x, "y": y, "button": "left", "clickCount": 1 });
            self.ask("Input.dispatchMouseEvent", params);
        }
    }

    /// Keeps a picture of the whole page in the folder that `BORESIGHT_SCREENSHOTS` names, if it does.
    pub fn picture(&mut self, name: &str) {
        let Some(dir) = std::env::var_os("BORESIGHT_SCREENSHOTS") else { return };
        let taken = self.ask("Page.captureScreenshot", json!({ "format": "png", "captureBeyondViewport": true }));
        let bytes = BASE64_STANDARD.decode(taken["data"].as_str().unwrap()).unwrap();
        std::fs::write(Path::new(&dir).join(name), bytes).unwrap();
    }
}

/// Whether the browser says that the page was left, and nothing else.
fn is_left(error: &Value) -> bool {
    let message = error["message"].as_str().unwrap_or_default();
    ["navigated or closed", "context was destroyed", "Cannot find context", "Cannot find default execution context"]
        .iter()
        .any(|said| message.contains(said))
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
