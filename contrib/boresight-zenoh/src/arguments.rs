//! The command line: a key, and how the network is found.

/// How the program is called.
pub const USAGE: &str = "usage: boresight-zenoh KEY [--cbor] [--connect ENDPOINT].. [--listen ENDPOINT].. [--config FILE] [--acknowledge]
  reads events of `boresight live` as JSON lines from standard input and puts those of tracks on KEY, the run's state on KEY/status
  --cbor          put them as CBOR
  --connect       a router or peer, tcp/HOST:PORT; without one peers are looked for in the local network
  --listen        where others may connect to, tcp/ADDRESS:PORT
  --config        a configuration of zenoh (JSON5): certificates, users, scouting
  --acknowledge   say on standard output how many lines were put so far";

/// Longest key, bytes.
const MAX_KEY: usize = 512;

/// What was asked for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Arguments {
    /// The key of the tracks.
    pub key: String,
    /// Whether events become CBOR.
    pub cbor: bool,
    /// Where to connect to.
    pub connect: Vec<String>,
    /// Where to listen.
    pub listen: Vec<String>,
    /// A configuration of zenoh.
    pub config: Option<String>,
    /// Whether the number of lines that were put is said.
    pub acknowledge: bool,
}

impl Arguments {
    /// Reads the words behind the program's name.
    /// # Errors
    /// What is not understood, for people.
    pub fn parse(words: impl IntoIterator<Item = String>) -> Result<Self, String> {
        let (mut out, mut key) = (Self::default(), None);
        let mut words = words.into_iter();
        while let Some(word) = words.next() {
            let mut value = || words.next().ok_or_else(|| format!("{word} needs a value\n{USAGE}"));
            match word.as_str() {
                "--cbor" => out.cbor = true,
                "--acknowledge" => out.acknowledge = true,
                "--connect" => out.connect.push(value()?),
                "--listen" => out.listen.push(value()?),
                "--config" => out.config = Some(value()?),
                odd if odd.starts_with("--") => return Err(format!("{odd} is not known\n{USAGE}")),
                _ if key.is_none() => key = Some(word),
                _ => return Err(format!("one key is enough: {word} is a second one\n{USAGE}")),
            }
        }
        out.key = key.ok_or_else(|| format!("the key is missing\n{USAGE}"))?;
        if !is_key(&out.key) {
            return Err(format!(
                "{:?} is no key: expected words between slashes, without * $ ? #, such as site/camera",
                out.key
            ));
        }
        Ok(out)
    }
}

/// Whether this is a key, not an expression of several, in zenoh's canonical form.
fn is_key(key: &str) -> bool {
    let bad = |c: char| c.is_control() || "*$?#".contains(c);
    key.len() <= MAX_KEY && !key.contains(bad) && key.split('/').all(|word| !word.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Arguments, String> {
        Arguments::parse(text.split_whitespace().map(ToString::to_string))
    }

    #[test]
    fn a_key_and_its_network_are_understood() {
        let found = parse(
            "--connect tcp/a:1 site/cam --cbor --connect tcp/b:2 --listen tcp/[::]:3 --config z.json5 --acknowledge",
        );
        let text = |words: &[&str]| words.iter().map(ToString::to_string).collect::<Vec<_>>();
        let expected = Arguments {
            key: "site/cam".into(),
            cbor: true,
            connect: text(&["tcp/a:1", "tcp/b:2"]),
            listen: text(&["tcp/[::]:3"]),
            config: Some("z.json5".into()),
            acknowledge: true,
        };
        assert_eq!(found, Ok(expected));
    }

    #[test]
    fn what_is_not_understood_is_said() {
        for (bad, why) in [
            ("", "key is missing"),
            ("a b", "second"),
            ("a --fast", "--fast is not known"),
            ("a --connect", "needs a value"),
            ("/a", "no key"),
            ("a/", "no key"),
            ("a//b", "no key"),
            ("a/*", "no key"),
            ("a?b", "no key"),
        ] {
            assert!(parse(bad).unwrap_err().contains(why), "{bad}");
        }
    }
}
