//! What stands behind the `?` of an address whose wire says places on Earth.

/// Longest type of an event, bytes.
const MAX_TYPE: usize = 64;

/// How Cursor on Target is written.
#[derive(Clone, Debug, PartialEq)]
pub struct CotOptions {
    /// Type of a track's events: `a-u-G` is a thing on the ground of unknown affiliation.
    pub kind: String,
    /// How long a state counts, s.
    pub stale_s: f64,
}

impl Default for CotOptions {
    fn default() -> Self {
        Self { kind: "a-u-G".into(), stale_s: 10.0 }
    }
}

/// Who says ASTERIX.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AsterixOptions {
    /// System area code: the country's.
    pub sac: u8,
    /// System identification code: of the first source; the next has the next number.
    pub sic: u8,
}

/// Splits `PLACE?KEY=VALUE&KEY=VALUE`.
pub(super) fn split(rest: &str) -> (&str, impl Iterator<Item = (&str, &str)>) {
    let (place, query) = rest.split_once('?').unwrap_or((rest, ""));
    (place, query.split('&').filter(|part| !part.is_empty()).map(|part| part.split_once('=').unwrap_or((part, ""))))
}

impl CotOptions {
    /// Reads `type` and `stale`.
    pub(super) fn parse<'a>(query: impl Iterator<Item = (&'a str, &'a str)>) -> Result<Self, &'static str> {
        let mut out = Self::default();
        for (key, value) in query {
            match key {
                "type" => {
                    let is_atom = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_alphanumeric());
                    if value.len() > MAX_TYPE || !value.split('-').all(is_atom) || !value.contains('-') {
                        return Err(
                            "expected a type of Cursor on Target, such as type=a-u-G (unknown, on the ground) or a-n-S-X",
                        );
                    }
                    out.kind = value.to_string();
                }
                "stale" => {
                    let seconds = value.parse().ok().filter(|s: &f64| *s > 0.0 && *s <= 86_400.0);
                    out.stale_s = seconds.ok_or("expected stale=S, how long a state counts, s, up to a day")?;
                }
                _ => return Err("expected type=TYPE or stale=S behind the ?"),
            }
        }
        Ok(out)
    }
}

impl AsterixOptions {
    /// Reads `sac` and `sic`.
    pub(super) fn parse<'a>(query: impl Iterator<Item = (&'a str, &'a str)>) -> Result<Self, &'static str> {
        const EXPECTED: &str = "expected ?sac=N&sic=N, the codes of this system, 0 to 255 each";
        let (mut sac, mut sic) = (None, None);
        for (key, value) in query {
            let number = value.parse().map_err(|_| EXPECTED)?;
            match key {
                "sac" => sac = Some(number),
                "sic" => sic = Some(number),
                _ => return Err(EXPECTED),
            }
        }
        Ok(Self { sac: sac.ok_or(EXPECTED)?, sic: sic.ok_or(EXPECTED)? })
    }
}
