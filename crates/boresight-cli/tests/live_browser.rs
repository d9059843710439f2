//! The page of `boresight live` in a real browser, from the outside: it opens, tracks are drawn where the simulated targets are, a click shows the curves, a slow viewer gets fewer pictures,
//! H.264 is shown where it is decoded, and the page comes back when the server does.
//!
//! Needs Chromium (Debian: `apt-get install chromium`); without it the tests show as ignored. `BORESIGHT_SCREENSHOTS=DIR` keeps pictures of the page.

mod chromium;

use chromium::Browser;
use chromium::installed::trial;
use libtest_mimic::Arguments;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Two squares that cross the frame: starts and velocities, px and px/s.
const TARGETS: [([f64; 2], [f64; 2]); 2] = [([40.0, 60.0], [4.0, 1.5]), ([280.0, 180.0], [-3.0, -1.0])];

const CONFIG: &str = "[detector.threshold.band]\nlow = 110\nhigh = 190\n[detector.cluster]\nmin-area-px = 25\n";

fn made(dir: &Path) {
    let target = |(start, velocity): ([f64; 2], [f64; 2])| {
        format!(
            "[[targets]]\nstart-px = {start:?}\nvelocity-px-per-s = {velocity:?}\nshape.rectangle = {{ size-px = [9, 9], mean = 150.0, std = 3.0 }}\n"
        )
    };
    let head = "width-px = 320\nheight-px = 240\nrate-hz = 25.0\nn-frames = 1000\nbackground.white = { mean = 50.0, std = 5.0 }\n";
    std::fs::write(dir.join("scene.toml"), head.to_string() + &TARGETS.map(target).concat()).unwrap();
    std::fs::write(dir.join("band.toml"), CONFIG).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_boresight"));
    let command = command.current_dir(dir).args(["simulate", "scene.toml", "--format", "y4m", "-o", "sim"]);
    assert!(command.output().unwrap().status.success());
}

/// A run that dies with its test, and the address of its page.
struct Live(Child, String);

impl Live {
    fn start(dir: &Path, address: &str, sources: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_boresight"));
        command.current_dir(dir).args(["live", "--pace", "--config", "band.toml", "--serve", address]).args(sources);
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap()).lines();
        let page = said.by_ref().map(Result::unwrap).find_map(|l| l.strip_prefix("page: ").map(ToString::to_string));
        std::thread::spawn(move || said.for_each(drop));
        Self(child, page.expect("a page"))
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Where a target is at a time, px.
fn place(k: usize, time_s: f64) -> [f64; 2] {
    let (start, velocity) = TARGETS[k];
    [start[0] + velocity[0] * time_s, start[1] + velocity[1] * time_s]
}

/// Places of the canvas, in pixels of the frame, where colour was drawn; the pictures are grey.
const COLOURED: &str = r"(() => {
    const { width, height } = canvas, scale = width / extent(drawn.shot)[0];
    const pixels = canvas.getContext('2d').getImageData(0, 0, width, height).data, out = [];
    for (let k = 0; k < width * height; k++) {
        const [r, g, b] = pixels.subarray(4 * k, 4 * k + 3);
        if (Math.max(r, g, b) - Math.min(r, g, b) > 80) out.push([(k % width) / scale - 0.5, Math.floor(k / width) / scale - 0.5]);
    }
    return out;
})()";

/// Nothing of the page lies beyond the window.
const FITS: &str = "document.documentElement.scrollWidth <= innerWidth";

fn the_page_shows_the_targets_where_they_are(browser: &Path) {
    let dir = tempfile::tempdir().unwrap();
    made(dir.path());
    let live = Live::start(dir.path(), "127.0.0.1:0", &["sim/frames.y4m"]);
    let mut page = Browser::start(browser, &dir.path().join("profile"));
    page.open(&live.1, [1280, 900]);
    page.until("typeof held === 'object' && held.length > 30 && held.at(-1).shot.tracks.length === 2");
    assert_eq!(page.value("document.querySelectorAll('#tracks tr').length"), 2);
    assert_eq!(page.value("document.getElementById('state').textContent"), "running");

    // What is drawn, against the truth at that frame's time: boxes alone, of a picture that stands.
    page.value("pause(true); for (const id of ['trails', 'ellipses', 'dots']) document.getElementById(id).checked = false; show()");
    let time_s = page.value("drawn.shot.time_s").as_f64().unwrap();
    let coloured: Vec<[f64; 2]> = serde_json::from_value(page.value(COLOURED)).unwrap();
    let mut n = [0, 0];
    for p in &coloured {
        let far = [0, 1].map(|k| {
            let at = place(k, time_s);
            (p[0] - at[0]).abs().max((p[1] - at[1]).abs())
        });
        // A box of 9 px with its number above it.
        let k = usize::from(far[1] < far[0]);
        assert!(far[k] < 14.0, "colour at {p:?}, {} px from the next target", far[k]);
        n[k] += 1;
    }
    assert!(n[0] > 40 && n[1] > 40, "{n:?}");
    for k in 0..2 {
        // The box lies around the target: to the left, to the right and below of its centre within a pixel (the number stands above).
        let at = place(k, time_s);
        let own = || coloured.iter().filter(move |p| (p[0] - at[0]).abs() < 14.0 && (p[1] - at[1]).abs() < 14.0);
        let row = |p: &&[f64; 2]| (p[1] - at[1]).abs() < 2.0;
        let left = own().filter(row).map(|p| p[0]).fold(f64::INFINITY, f64::min);
        let right = own().filter(row).map(|p| p[0]).fold(f64::NEG_INFINITY, f64::max);
        let below = own().map(|p| p[1]).fold(f64::NEG_INFINITY, f64::max);
        let middle = (left + right) / 2.0;
        assert!(
            (middle - at[0]).abs() < 1.0 && (below - at[1] - 4.5).abs() < 1.5,
            "{left} {right} {below} around {at:?}"
        );
    }

    // A click on a target chooses its track and draws its curves.
    assert_eq!(page.value("document.getElementById('curves').hidden"), true);
    let corner: [f64; 3] = serde_json::from_value(page.value(
        "(() => { const b = canvas.getBoundingClientRect(); return [b.left, b.top, b.width / extent(drawn.shot)[0]]; })()",
    ))
    .unwrap();
    let at = place(1, time_s);
    page.click(corner[0] + (at[0] + 0.5) * corner[2], corner[1] + (at[1] + 0.5) * corner[2]);
    page.until("!document.getElementById('curves').hidden");
    let chosen = page.value("drawn.shot.tracks.find((t) => t.track === chosen).x_px").as_f64().unwrap();
    assert!((chosen - at[0]).abs() < 1.0, "the track that was clicked");
    for id in ["curve-x", "curve-y", "curve-speed", "curve-nis"] {
        let drawn = format!(
            "(() => {{ const c = document.getElementById('{id}'); return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v > 0); }})()"
        );
        assert_eq!(page.value(&drawn), true, "{id}");
    }
    page.value(
        "pause(false); for (const id of ['trails', 'ellipses']) document.getElementById(id).checked = true; show()",
    );
    assert_eq!(page.value(FITS), true);
    page.picture("live.png");
    page.resize([390, 844]);
    page.until("innerWidth === 390");
    assert_eq!(page.value(FITS), true, "a telephone");
    page.picture("live-phone.png");
    assert!(page.complaints.is_empty(), "{:#?}", page.complaints);
}

fn a_viewer_of_one_picture_a_second_gets_the_newest_and_slows_nothing(browser: &Path) {
    let dir = tempfile::tempdir().unwrap();
    made(dir.path());
    let live = Live::start(dir.path(), "127.0.0.1:0", &["sim/frames.y4m"]);
    let mut page = Browser::start(browser, &dir.path().join("profile"));
    page.open(&format!("{}?jpeg", live.1), [800, 600]);
    page.until("typeof held === 'object' && held.length > 5");
    page.value("window.requestAnimationFrame = (draw) => setTimeout(draw, 1000)");
    std::thread::sleep(Duration::from_millis(1500));
    let before: [u64; 3] =
        serde_json::from_value(page.value("[held.length, held.at(-1).shot.frame, held.at(-1).shot.dropped]")).unwrap();
    std::thread::sleep(Duration::from_secs(4));
    let after: [u64; 3] =
        serde_json::from_value(page.value("[held.length, held.at(-1).shot.frame, held.at(-1).shot.dropped]")).unwrap();
    let (pictures, frames) = (after[0] - before[0], after[1] - before[1]);
    assert!((2..=6).contains(&pictures) && frames > 60, "{pictures} pictures of {frames} frames");
    assert!(after[2] - before[2] < 10, "the tracker dropped {} frames", after[2] - before[2]);
}

/// Brightness of the canvas at a place of the frame: what lies below the boxes and points, which are left away.
const BRIGHT: &str = r"(x, y) => {
    const scale = canvas.width / extent(drawn.shot)[0];
    return canvas.getContext('2d').getImageData(Math.round((x + 0.5) * scale), Math.round((y + 0.5) * scale), 1, 1).data[1];
}";

fn pictures_come_as_h264_are_stepped_through_and_give_way_to_jpeg(browser: &Path) {
    let dir = tempfile::tempdir().unwrap();
    made(dir.path());
    let live = Live::start(dir.path(), "127.0.0.1:0", &["sim/frames.y4m"]);
    let mut page = Browser::start(browser, &dir.path().join("profile"));
    page.open(&live.1, [800, 600]);
    page.until("typeof held === 'object' && held.length > 60 && held.at(-1).size > 0");
    if page.value("held.at(-1).chunk === null") == true {
        assert_eq!(page.value("held.at(-1).jpeg !== null"), true);
        eprintln!("this Chromium decodes no H.264: JPEG is shown");
        return;
    }
    page.value("for (const id of ['boxes', 'trails', 'ellipses', 'dots']) document.getElementById(id).checked = false; pause(true)");
    page.until("drawn === held[at]");
    let shows_both = |page: &mut Browser| {
        let time_s = page.value("drawn.shot.time_s").as_f64().unwrap();
        for k in 0..2 {
            // The lower left of a target: the number stands above its box.
            let [x, y] = place(k, time_s);
            let [on, off] =
                [y + 2.0, y + 12.0].map(|y| page.value(&format!("({BRIGHT})({}, {y})", x - 2.0)).as_f64().unwrap());
            assert!(on > 110.0 && off < 90.0, "{on} on the target and {off} below it, at {time_s} s");
        }
    };
    shows_both(&mut page);
    // Back, over more than a key, and on by one: each is decoded after those that it needs.
    page.value("step(-40)");
    page.until("drawn === held[at]");
    shows_both(&mut page);
    page.value("step(1)");
    page.until("drawn === held[at]");
    shows_both(&mut page);
    page.value("pause(false)");
    page.until("drawn === held.at(-1) && !paused");

    // A slow one goes on at keys, and shows what is new.
    page.value("window.requestAnimationFrame = (draw) => setTimeout(draw, 1000)");
    std::thread::sleep(Duration::from_secs(2));
    let count = "[held.length, held.at(-1).shot.frame, held.at(-1).shot.dropped]";
    let before: [u64; 3] = serde_json::from_value(page.value(count)).unwrap();
    std::thread::sleep(Duration::from_secs(4));
    let after: [u64; 3] = serde_json::from_value(page.value(count)).unwrap();
    let (pictures, frames) = (after[0] - before[0], after[1] - before[1]);
    assert!((2..=14).contains(&pictures) && frames > 50, "{pictures} pictures of {frames} frames");
    assert!(after[2] - before[2] < 10, "the tracker dropped {} frames", after[2] - before[2]);
    page.value("window.requestAnimationFrame = (draw) => setTimeout(draw, 10)");

    // What cannot be decoded comes as JPEG.
    page.value("VideoDecoder.prototype.decode = () => { throw new Error('nothing is decoded here'); }");
    page.until("held.at(-1).jpeg !== null && drawn === held.at(-1)");
    assert_eq!(page.value("no_video"), true);
}

fn the_page_comes_back_with_the_server(browser: &Path) {
    let dir = tempfile::tempdir().unwrap();
    made(dir.path());
    let live = Live::start(dir.path(), "127.0.0.1:0", &["sim/frames.y4m"]);
    let address = live.1.clone();
    let mut page = Browser::start(browser, &dir.path().join("profile"));
    page.open(&address, [800, 600]);
    page.until("typeof held === 'object' && held.length > 30");
    page.value("window.same = 'page'");
    let newest = page.value("held.at(-1).shot.frame").as_u64().unwrap();
    drop(live);
    page.until("document.getElementById('state').className === 'away'");
    let at = address.trim_start_matches("http://").trim_end_matches('/');
    let _again = Live::start(dir.path(), at, &["sim/frames.y4m"]);
    page.until("document.getElementById('state').className === 'running'");
    page.until(&format!("held.at(-1).shot.frame < {newest} && held.at(-1).shot.tracks.length === 2"));
    assert_eq!(page.value("window.same"), "page", "nobody loaded it anew");
}

fn several_sources_are_chosen_by_name(browser: &Path) {
    let dir = tempfile::tempdir().unwrap();
    made(dir.path());
    let live = Live::start(dir.path(), "127.0.0.1:0", &["north=sim/frames.y4m", "south=sim/frames.y4m"]);
    let mut page = Browser::start(browser, &dir.path().join("profile"));
    page.open(&live.1, [1280, 900]);
    page.until("typeof held === 'object' && held.length > 5 && held.at(-1).shot.source === 'north'");
    page.picture("live-several.png");
    page.value("(() => { const s = document.getElementById('sources'); s.value = 'south'; s.dispatchEvent(new Event('change')); })()");
    page.until("typeof held === 'object' && held.length > 5 && held.at(-1).shot.source === 'south'");
    assert_eq!(page.value("document.getElementById('sources').value"), "south");
    assert!(page.complaints.is_empty(), "{:#?}", page.complaints);
}

fn sliders_change_the_run_and_show_it_as_toml(browser: &Path) {
    let dir = tempfile::tempdir().unwrap();
    made(dir.path());
    let live = Live::start(dir.path(), "127.0.0.1:0", &["sim/frames.y4m", "--tune"]);
    let mut page = Browser::start(browser, &dir.path().join("profile"));
    page.open(&live.1, [1280, 900]);
    page.until("document.querySelectorAll('#dials input').length >= 3 && held.at(-1).shot.tracks.length === 2");
    page.value("document.getElementById('tuning').open = true");
    let slide = |page: &mut Browser, key: &str, place: u32| {
        let script = format!(
            "(() => {{ const s = document.querySelector('#dials input[name=\"{key}\"]'); s.value = {place}; s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change')); }})()"
        );
        page.value(&script);
    };
    // As far as it goes: no target is so large.
    slide(&mut page, "detector.cluster.min-area-px", 1000);
    page.until("document.getElementById('toml').textContent === '[detector.cluster]\\nmin-area-px = 10000\\n'");
    page.until("held.at(-1).shot.tracks.length === 0");
    slide(&mut page, "detector.cluster.min-area-px", 350);
    page.until("held.at(-1).shot.tracks.length === 2");
    slide(&mut page, "tracker.coast-s", 500);
    page.until("document.getElementById('toml').textContent.includes('[tracker]\\ncoast-s = 1.73')");
    page.until("fetch('api/config').then((a) => a.json()).then((c) => c.toml.includes('coast-s = 1.73'))");
    assert_eq!(
        page.value("[...document.querySelectorAll('#dials .refused')].every((r) => r.textContent === '')"),
        true
    );
    // What is copied is a configuration.
    let toml = page.value("document.getElementById('toml').textContent");
    std::fs::write(dir.path().join("copied.toml"), toml.as_str().unwrap()).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_boresight"));
    let out = command.current_dir(dir.path()).args(["config", "--check", "copied.toml"]).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    assert_eq!(page.value(FITS), true);
    page.picture("live-tune.png");
    page.resize([390, 844]);
    page.until("innerWidth === 390");
    assert_eq!(page.value(FITS), true, "a telephone");
    page.picture("live-tune-phone.png");
    assert!(page.complaints.is_empty(), "{:#?}", page.complaints);
}

type Test = fn(&Path);

fn main() -> std::process::ExitCode {
    let tests: [(&str, Test); 6] = [
        (
            "pictures_come_as_h264_are_stepped_through_and_give_way_to_jpeg",
            pictures_come_as_h264_are_stepped_through_and_give_way_to_jpeg,
        ),
        ("sliders_change_the_run_and_show_it_as_toml", sliders_change_the_run_and_show_it_as_toml),
        ("the_page_shows_the_targets_where_they_are", the_page_shows_the_targets_where_they_are),
        (
            "a_viewer_of_one_picture_a_second_gets_the_newest_and_slows_nothing",
            a_viewer_of_one_picture_a_second_gets_the_newest_and_slows_nothing,
        ),
        ("the_page_comes_back_with_the_server", the_page_comes_back_with_the_server),
        ("several_sources_are_chosen_by_name", several_sources_are_chosen_by_name),
    ];
    let trials = tests.map(|(name, run)| trial(name, run));
    libtest_mimic::run(&Arguments::from_args(), trials.into()).exit_code()
}
