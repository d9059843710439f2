//! Names of the sources of a run: what stands in events, in the page's addresses, and, where there are several, in topics, folders and labels.
//!
//! `NAME=SOURCE` gives one. Else a single source is named by its address, without a password; several are named shortly by theirs (`/dev/video0` is `video0`,
//! `rtsp://yard.example/stream` is `yard-example-stream`), and the second of the same name gets `-2`.

use boresight::{Error, ErrorKind, Result};
use std::path::Path;

/// Longest name, bytes.
const LONGEST: usize = 64;

/// A source and its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedSource {
    /// The name.
    pub name: String,
    /// What is opened.
    pub source: String,
}

/// Whether these words can be a name in a topic, a folder and an address alike.
fn is_name(text: &str) -> bool {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b == b'-' || b == b'_';
    !text.is_empty() && text.len() <= LONGEST && !text.starts_with('-') && text.bytes().all(plain)
}

/// The source's address without the password that may stand in it.
fn shown(source: &str) -> String {
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

/// A short name made of the source's address; what follows `?` may be a password, and is no part of it.
fn short(source: &str) -> String {
    let shown = shown(source);
    let text = match shown.split_once("://") {
        Some((_, rest)) => rest.split(['?', '#']).next().unwrap_or_default().to_string(),
        None => Path::new(&shown).file_stem().map_or(shown.clone(), |stem| stem.to_string_lossy().into_owned()),
    };
    let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').filter(|word| !word.is_empty());
    let mut name = words.collect::<Vec<_>>().join("-");
    // Room for a number behind it.
    name.truncate(LONGEST - 8);
    let name = name.trim_end_matches('-');
    if name.is_empty() { "source".to_string() } else { name.to_string() }
}

/// Takes the sources as they stand on the command line.
/// # Errors
/// [`ErrorKind::Config`] for none, a name that is given twice, or standard input twice.
pub fn name_sources(arguments: &[String]) -> Result<Vec<NamedSource>> {
    let wrong = |what: &str, place: &str, hint: &str| Err(Error::new(ErrorKind::Config, what).at(place).hint(hint));
    let given = |argument: &String| match argument.split_once('=') {
        Some((name, source)) if is_name(name) && !source.is_empty() && !Path::new(argument).exists() => {
            (Some(name.to_string()), source.to_string())
        }
        _ => (None, argument.clone()),
    };
    let sources: Vec<(Option<String>, String)> = arguments.iter().map(given).collect();
    if sources.is_empty() {
        return wrong("expected a source", "live", "give a camera, a stream's address, a file, or -");
    }
    if sources.iter().filter(|(_, source)| source == "-").count() > 1 {
        return wrong("standard input is one source only", "-", "give the others as files, pipes or addresses");
    }
    let mut taken: Vec<String> = Vec::new();
    for name in sources.iter().filter_map(|(name, _)| name.as_ref()) {
        // Folders of some systems do not tell large letters from small ones.
        if taken.iter().any(|t| t.eq_ignore_ascii_case(name)) {
            return wrong("two sources have the same name", name, "give each its own: north=SOURCE south=SOURCE");
        }
        taken.push(name.clone());
    }
    let is_single = sources.len() == 1;
    let named = sources.into_iter().map(|(name, source)| {
        let name = name.unwrap_or_else(|| {
            if is_single {
                return shown(&source);
            }
            let first = short(&source);
            let numbered = (2..).map(|k| format!("{first}-{k}"));
            let is_free = |name: &String| !taken.iter().any(|t| t.eq_ignore_ascii_case(name));
            let name = std::iter::once(first.clone()).chain(numbered).find(is_free).unwrap_or(first);
            taken.push(name.clone());
            name
        });
        NamedSource { name, source }
    });
    Ok(named.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(arguments: &[&str]) -> Vec<String> {
        let arguments: Vec<String> = arguments.iter().map(ToString::to_string).collect();
        name_sources(&arguments).unwrap().into_iter().map(|n| n.name).collect()
    }

    #[test]
    fn a_password_in_an_address_is_not_shown() {
        assert_eq!(names(&["rtsp://me:secret@cam/stream@1"]), ["rtsp://cam/stream@1"]);
        assert_eq!(names(&["rtsp://cam/a@b"]), ["rtsp://cam/a@b"]);
        assert_eq!((names(&["-"]), names(&["a@b.mp4"])), (vec!["standard input".into()], vec!["a@b.mp4".into()]));
        let several = names(&["rtsp://me:secret@cam/s?user=me&pwd=secret", "x"]);
        assert_eq!(several, ["cam-s", "x"]);
    }

    #[test]
    fn several_sources_get_short_names_of_their_own() {
        let all = names(&["/dev/video0", "rtsp://yard.example:554/stream", "a/one.mp4", "b/one.mp4", "-", "::"]);
        assert_eq!(all, ["video0", "yard-example-554-stream", "one", "one-2", "standard-input", "source"]);
        let mixed = names(&["one.mp4", "one=rtsp://cam/a=b", "udp://h:1?a=b"]);
        assert_eq!(mixed, ["one-2", "one", "h-1"], "a given name goes before a made one");
        let long = names(&[&"x".repeat(300), &"x".repeat(300)]);
        assert!(long.iter().all(|n| is_name(n)) && long[0] != long[1], "{long:?}");
    }

    #[test]
    fn what_cannot_be_named_is_refused() {
        let why = |arguments: &[&str]| {
            let arguments: Vec<String> = arguments.iter().map(ToString::to_string).collect();
            name_sources(&arguments).unwrap_err().to_string()
        };
        assert!(why(&["a=x", "A=y"]).contains("same name"));
        assert!(why(&["-", "b=-"]).contains("one source only"));
        assert!(why(&[]).contains("expected a source"));
        // No name: it is the address itself.
        assert_eq!(names(&["../up=x", "b"]), ["up-x", "b"]);
    }
}
