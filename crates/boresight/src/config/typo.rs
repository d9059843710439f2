//! Turns what the TOML reader says into what a person can mend: the line, what is wrong, the nearest known name.
//!
//! Source of the nearness: the Damerau-Levenshtein distance, at most a third of the word, as compilers do it.

use crate::{Error, ErrorKind};

/// Explains an error of the TOML reader; `lines` shows the line it stands in.
pub(super) fn explain(e: &toml::de::Error, lines: bool) -> Error {
    let message = e.message();
    let words: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let unknown = message.starts_with("unknown field") || message.starts_with("unknown variant");
    let (what, hint) = match words.split_first() {
        Some((wrong, known)) if unknown => {
            let kind = if message.starts_with("unknown field") { "key" } else { "choice" };
            let near = nearest(wrong, known).map_or(String::new(), |n| format!("; did you mean `{n}`?"));
            (format!("there is no {kind} `{wrong}` here{near}"), format!("there is: {}", known.join(", ")))
        }
        _ => (
            message.to_string(),
            "`boresight config` prints every key with its default, `boresight config --explain KEY` what it means"
                .into(),
        ),
    };
    let shown = e.to_string();
    let place = shown.trim_end().strip_suffix(message).and_then(|s| s.strip_prefix("TOML parse error at "));
    match place {
        Some(place) if lines => Error::new(ErrorKind::Config, format!("{place}{what}")).hint(hint),
        _ => Error::new(ErrorKind::Config, what).hint(hint),
    }
}

/// The known name that a misspelt one was meant to be, if one is near.
pub(super) fn nearest<'a>(wrong: &str, known: &[&'a str]) -> Option<&'a str> {
    let plain = |s: &str| s.to_lowercase().replace('_', "-");
    let wrong = plain(wrong);
    let near = known.iter().map(|k| (strsim::damerau_levenshtein(&wrong, &plain(k)), *k)).min_by_key(|(d, _)| *d);
    let starts = || known.iter().copied().find(|k| wrong.len() > 2 && plain(k).starts_with(&wrong));
    near.filter(|(d, k)| 3 * d <= wrong.len().max(k.len())).map(|(_, k)| k).or_else(starts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Config;

    #[test]
    fn a_misspelt_key_gets_the_nearest_one_and_its_line() {
        let e = Config::from_toml("[tracker]\ngate-probabilty = 0.9\n", "my.toml").unwrap_err().to_string();
        assert!(e.contains("line 2") && e.contains("did you mean `gate-probability`?"), "{e}");
        assert!(e.contains("hint: there is: filter"), "{e}");
    }

    #[test]
    fn a_misspelt_choice_gets_the_nearest_one_without_a_line_of_ours() {
        let e = Config::default().with("tracker.filter=fuzzy_srif").unwrap_err().to_string();
        assert!(e.contains("there is no choice `fuzzy_srif` here; did you mean `fuzzy-srif`?"), "{e}");
        assert!(!e.contains("line "), "{e}");
    }

    #[test]
    fn the_nearest_name_is_near_or_none() {
        let known = ["coast-s", "coast-scans", "gate-probability"];
        assert_eq!(nearest("coast_s", &known), Some("coast-s"));
        assert_eq!(nearest("gate", &known), Some("gate-probability"));
        assert_eq!(nearest("nonsense", &known), None);
    }
}
