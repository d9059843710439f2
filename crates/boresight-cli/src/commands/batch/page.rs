//! `index.html`: one page over all inputs of a batch, failures first, each with a link to its report; opens without a network.

use super::manifest::{Entry, Status};
use crate::commands::run_summary::RunSummary;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use std::path::Path;

const STYLE: &str = "body{font:15px/1.4 system-ui,sans-serif;margin:1.5em;color:#222;background:#fff}\
table{border-collapse:collapse}th,td{padding:.35em .7em;border-bottom:1px solid #ddd;text-align:left;vertical-align:top}\
th{position:sticky;top:0;background:#fff}td.n{text-align:right;font-variant-numeric:tabular-nums}\
img{width:160px;max-height:120px;object-fit:contain;display:block}.bad{color:#a00}.doubt{color:#850}\
pre{white-space:pre-wrap;margin:0;font:13px/1.35 ui-monospace,monospace}ul{margin:.2em 0;padding-left:1.2em}";

/// An address within the folder: what is no plain letter is written as its bytes.
fn address(folder: &str, file: &str) -> String {
    let mut out = String::new();
    for b in folder.bytes() {
        match b {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' => out.push(char::from(b)),
            _ => out.push_str(&format!("%{b:02X}")),
        }
    }
    format!("{out}/{file}")
}

fn row(dir: &Path, entry: &Entry) -> Markup {
    let has = |name: &str| entry.outputs.contains_key(name);
    let told = RunSummary::read(&dir.join(&entry.folder).join("summary.json"));
    let report = has("report.html").then(|| address(&entry.folder, "report.html"));
    let picture = has("thumbnail.png").then(|| address(&entry.folder, "thumbnail.png"));
    html! {
        tr {
            td {
                @if let Some(picture) = &picture {
                    @match &report {
                        Some(report) => a href=(report) { img src=(picture) alt="" loading="lazy"; },
                        None => img src=(picture) alt="" loading="lazy";,
                    }
                }
            }
            td {
                @match &report {
                    Some(report) => a href=(report) { (entry.input) },
                    None => (entry.input),
                }
            }
            @match &told {
                Some(s) => {
                    td.n { (s.frames) }
                    td.n { (format!("{:.1}", s.duration_s)) }
                    td.n { (s.confirmed_tracks) }
                    td.n { (s.most_at_once) }
                    td.n { (s.mean_nis.map_or("–".to_string(), |(mean, _)| format!("{mean:.2}"))) }
                }
                None => { td.n { "–" } td.n { "–" } td.n { "–" } td.n { "–" } td.n { "–" } }
            }
            td.n { (format!("{:.1}", entry.seconds)) }
            td {
                @if entry.status == Status::Failed {
                    pre.bad { "failed: " (entry.reason.as_deref().unwrap_or("for no reason that was said")) }
                }
                @if let Some(s) = &told {
                    span.doubt[s.is_doubtful] { @if s.is_doubtful { "doubtful: " } (s.verdict) }
                    @if let Some(next) = &s.next { br; "try next: " code { (next) } }
                    @if !s.warnings.is_empty() {
                        ul { @for w in &s.warnings { li { (w) } } }
                    }
                }
            }
        }
    }
}

/// The page.
pub fn page(dir: &Path, entries: &[Entry]) -> String {
    let failed = entries.iter().filter(|e| e.status == Status::Failed).count();
    let (bad, good): (Vec<&Entry>, Vec<&Entry>) = entries.iter().partition(|e| e.status == Status::Failed);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { "boresight batch" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (entries.len()) " inputs, " (failed) " failed" }
                p { "All tracks: " a href="tracks.csv" { "tracks.csv" } ". Hashes, configurations, versions: the manifest beside this page." }
                table {
                    thead { tr {
                        th {} th { "input" } th { "frames" } th { "length, s" } th { "tracks" } th { "most at once" }
                        th { "mean NIS" } th { "took, s" } th { "verdict" }
                    } }
                    tbody { @for entry in bad.into_iter().chain(good) { (row(dir, entry)) } }
                }
                p { "boresight " (env!("CARGO_PKG_VERSION")) }
            }
        }
    };
    page.into_string()
}

#[cfg(test)]
mod tests {
    use super::super::manifest::tests::entry;
    use super::*;

    #[test]
    fn failures_come_first_and_foreign_names_are_no_markup() {
        let dir = tempfile::tempdir().unwrap();
        let mut entries = [entry("good", 1), entry("<b>&", 2)];
        entries[1].status = Status::Failed;
        entries[1].reason = Some("is cut".into());
        entries[0].folder = "ü \"x\"".into();
        entries[0].outputs.insert("report.html".into(), String::new());
        let html = page(dir.path(), &entries);
        assert!(html.find("&lt;b&gt;&amp;").unwrap() < html.find(">good<").unwrap() && html.contains("failed: is cut"));
        assert!(html.contains("href=\"%C3%BC%20%22x%22/report.html\"") && html.contains("2 inputs, 1 failed"));
    }
}
