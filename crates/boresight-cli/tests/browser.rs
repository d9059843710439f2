//! Every page that the command writes, opened in a browser at two widths: nothing said on the console, every picture shown, nothing wider than the window.
//!
//! Needs Chromium (Debian: `apt-get install chromium`); where there is none the tests show as ignored and say so. A page is looked at in a frame of the width that is
//! tried, since a browser's own window has a least width.

#[path = "chromium/installed.rs"]
mod installed;

use installed::trial;
use libtest_mimic::Arguments;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A monitor's and a telephone's, px.
const WIDTHS: [u32; 2] = [1280, 390];

const HARBOUR: &str = r#"
width-px = 600
height-px = 400
rate-hz = 1.0
n-frames = 60
background.white = { mean = 100.0, std = 2.0 }

[[targets]]
start-px = [30.0, 60.0]
velocity-px-per-s = [4.0, 1.0]
shape.spot = { sigma-px = 2.0, psf-sigma-px = 1.0, total = 20000.0 }

[[radars]]
name = "harbour"
position-px = [300.0, 200.0]
measures.range-azimuth = { range-std-px = 3.0, azimuth-std-deg = 1.0 }
clutter-per-scan = 3.0
range-px = [10.0, 400.0]
"#;

fn boresight(dir: &Path, line: &str) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_boresight"));
    let out = command.current_dir(dir).args(line.split_whitespace()).output().unwrap();
    assert!(out.status.success(), "{line}: {}", String::from_utf8_lossy(&out.stderr));
}

/// Makes a page in a folder by these commands, and returns its file.
fn made(dir: &Path, lines: &[&str], page: &str) -> PathBuf {
    std::fs::write(dir.join("harbour.toml"), HARBOUR).unwrap();
    lines.iter().for_each(|line| boresight(dir, line));
    dir.join(page)
}

/// What the console said of a page in a frame of this width, and what the page measured of itself: its width, that of its content, pictures, and those that are not shown.
fn look(browser: &Path, dir: &Path, page: &Path, width: u32, planted: &str) -> (Vec<String>, [u32; 4]) {
    let measured = r"addEventListener('load', () => setTimeout(async () => {
        const css = e => [...getComputedStyle(e).backgroundImage.matchAll(/url\(.(data:[^)]*).\)/g)].map(m => m[1]);
        const own = e => e.currentSrc || (e.href && e.href.baseVal && e.tagName === 'image' ? e.href.baseVal : '');
        const all = new Set([...document.querySelectorAll('*')].flatMap(e => [...css(e), own(e)]).filter(u => u));
        const shown = u => { const i = new Image(); i.src = u; return i.decode().then(() => 0, () => 1); };
        const broken = (await Promise.all([...all].map(shown))).reduce((a, b) => a + b, 0);
        console.log('measured ' + [innerWidth, document.documentElement.scrollWidth, all.size, broken].join(' '));
    }, 200));";
    let html = std::fs::read_to_string(page).unwrap();
    std::fs::write(dir.join("inner.html"), format!("{html}<script>{measured}{planted}</script>")).unwrap();
    let frame = format!(
        "<!doctype html><body style=margin:0><iframe src=inner.html style='border:0;width:{width}px;height:900px'></iframe>"
    );
    std::fs::write(dir.join("outer.html"), frame).unwrap();
    // The browser's clock runs ahead while pictures are decoded beside it: where the machine is busy it needs more.
    for budget_ms in [10_000u32, 100_000, 1_000_000, 10_000_000] {
        let mut command = Command::new(browser);
        command.args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom"]);
        command.args(["--window-size=1400,1000", &format!("--virtual-time-budget={budget_ms}")]);
        command.arg(format!("--user-data-dir={}", dir.join("profile").display()));
        let out = command.arg(format!("file://{}", dir.join("outer.html").display())).output().unwrap();
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        let said = text.lines().filter(|l| l.contains(":CONSOLE"));
        let (own, others): (Vec<&str>, Vec<&str>) = said.partition(|l| l.contains("\"measured "));
        let Some(own) = own.first() else { continue };
        let numbers = own.split("\"measured ").nth(1).and_then(|l| l.split('"').next()).unwrap();
        let numbers: Vec<u32> = numbers.split(' ').map(|n| n.parse().unwrap()).collect();
        return (others.into_iter().map(String::from).collect(), numbers.try_into().unwrap());
    }
    panic!("{} measures nothing", page.display());
}

fn check(browser: &Path, lines: &[&str], page: &str, least_pictures: u32) {
    let dir = tempfile::tempdir().unwrap();
    let page = made(dir.path(), lines, page);
    for width in WIDTHS {
        let (said, [inner, content, pictures, broken]) = look(browser, dir.path(), &page, width, "");
        assert!(said.is_empty(), "{width} px: {said:#?}");
        assert!(inner == width && content <= inner, "{width} px: the page is {content} px wide");
        assert!(pictures >= least_pictures && broken == 0, "{width} px: {broken} of {pictures} pictures are not shown");
    }
}

/// An error, a picture that is none and a wide line are noticed.
fn a_bad_page_is_noticed(browser: &Path) {
    let dir = tempfile::tempdir().unwrap();
    let page = dir.path().join("bad.html");
    std::fs::write(&page, "<!doctype html><div style='background-image:url(data:image/png;base64,AAAA)'></div><div style=width:2000px>x</div>")
        .unwrap();
    let (said, [_, content, pictures, broken]) = look(browser, dir.path(), &page, 390, "nobody.knows();");
    assert!(said.iter().any(|l| l.contains("nobody is not defined")), "{said:?}");
    assert!(content >= 2000 && (pictures, broken) == (1, 1), "{content} {pictures} {broken}");
}

/// Pages: a name, the commands that make it, its file, and how many pictures it has at least.
const PAGES: [(&str, &[&str], &str, u32); 6] = [
    (
        "the report of a clip",
        &[
            "simulate ds2 --frames 24 --format y4m -o sim",
            "track sim/frames.y4m --config sim/track.toml -o out --no-video -q",
        ],
        "out/report.html",
        1,
    ),
    (
        "the report of a radar",
        &["simulate harbour.toml -o sim", "track sim/harbour-polar.csv -o out -q"],
        "out/report.html",
        0,
    ),
    (
        "the page of an evaluation",
        &[
            "simulate ds2 --frames 24 --format y4m -o sim",
            "track sim/frames.y4m --config sim/track.toml -o out --no-video -q",
            "evaluate sim/gt.txt out/tracks.csv --html e.html",
        ],
        "e.html",
        0,
    ),
    (
        "a preview",
        &["simulate ds2 --frames 24 --format y4m -o sim", "preview sim/frames.y4m -q -o p.html"],
        "p.html",
        1,
    ),
    (
        "the page of a sensor",
        &["simulate ds2 --frames 24 --format y4m -o sim", "sensor sim/frames.y4m -o s.html"],
        "s.html",
        0,
    ),
    ("the page of reproduced papers", &["reproduce srif-1 --runs 2 -o out"], "out/index.html", 0),
];

fn main() -> std::process::ExitCode {
    let mut trials = vec![trial("a_bad_page_is_noticed", a_bad_page_is_noticed)];
    for (name, lines, page, least) in PAGES {
        let name = format!("{name} opens without errors at {} and {} px", WIDTHS[0], WIDTHS[1]);
        trials.push(trial(name, move |browser| check(browser, lines, page, least)));
    }
    libtest_mimic::run(&Arguments::from_args(), trials).exit_code()
}
