//! Where events go, from what stands on the command line.

use super::earth_address::{AsterixOptions, CotOptions, split};
use super::zenoh_address::ZenohAddress;
use crate::cbor::Form;
use boresight::{Error, ErrorKind, Result};

/// Longest topic, bytes.
const MAX_TOPIC: usize = 512;
/// The ports of MQTT without TLS and of NATS.
const MQTT_PORT: u16 = 1883;
#[cfg(feature = "nats")]
const NATS_PORT: u16 = 4222;
/// What is understood.
const KNOWN: &str = if cfg!(feature = "nats") {
    "give -, udp://HOST:PORT, mqtt://[USER:PASSWORD@]HOST[:PORT]/TOPIC or nats://[USER:PASSWORD@]HOST[:PORT]/SUBJECT, ?cbor behind it for CBOR; zenoh/KEY?connect=tcp/HOST:PORT; with a [world] in the configuration cot+udp://HOST:PORT, cot+tcp://HOST:PORT or asterix+udp://HOST:PORT?sac=N&sic=N"
} else {
    "give -, udp://HOST:PORT or mqtt://[USER:PASSWORD@]HOST[:PORT]/TOPIC, ?cbor behind it for CBOR; zenoh/KEY?connect=tcp/HOST:PORT; with a [world] in the configuration cot+udp://HOST:PORT, cot+tcp://HOST:PORT or asterix+udp://HOST:PORT?sac=N&sic=N"
};

/// A place for events.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// JSON lines on standard output.
    Standard,
    /// One datagram an event.
    Udp {
        /// Name or number of the host, and the port.
        address: String,
        /// How events are written.
        form: Form,
    },
    /// An MQTT broker.
    Mqtt(Broker),
    /// A NATS server.
    #[cfg(feature = "nats")]
    Nats(Broker),
    /// A zenoh network, by a program of its own.
    Zenoh(ZenohAddress),
    /// Cursor on Target.
    Cot {
        /// Over TCP instead of as datagrams.
        is_tcp: bool,
        /// Name or number of the host, and the port.
        address: String,
        /// How events are written.
        options: CotOptions,
    },
    /// ASTERIX category 062, as datagrams.
    Asterix {
        /// Name or number of the host, and the port.
        address: String,
        /// Who says it.
        options: AsterixOptions,
    },
}

/// A broker's address.
#[derive(Clone, PartialEq, Eq)]
pub struct Broker {
    /// What it speaks: `mqtt` or `nats`.
    pub scheme: &'static str,
    /// Name or number of the host.
    pub host: String,
    /// Port.
    pub port: u16,
    /// Topic of the tracks' events; the state of the run goes to `status` below it.
    pub topic: String,
    /// User and password.
    pub user: Option<(String, String)>,
    /// How events are written.
    pub form: Form,
}

impl std::fmt::Debug for Broker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // The password stays unsaid.
        write!(f, "{}://{}:{}/{}", self.scheme, self.host, self.port, self.topic)
    }
}

impl Broker {
    /// Reads `[USER:PASSWORD@]HOST[:PORT]/TOPIC`.
    fn parse(
        scheme: &'static str,
        rest: &str,
        form: Form,
        port: u16,
        is_topic: impl Fn(&str) -> bool,
        expected: &'static str,
    ) -> std::result::Result<Self, &'static str> {
        let Some((place, topic)) = rest.split_once('/') else { return Err("the topic is missing") };
        if topic.is_empty() || topic.len() > MAX_TOPIC || !is_topic(topic) {
            return Err(expected);
        }
        let (user, place) = match place.rsplit_once('@') {
            Some((user, place)) => {
                let (name, password) = user.split_once(':').unwrap_or((user, ""));
                (Some((name.to_string(), password.to_string())), place)
            }
            None => (None, place),
        };
        let (host, port) = host_and_port(place, Some(port)).ok_or("expected HOST:PORT")?;
        let host = host.trim_matches(['[', ']']).to_string();
        Ok(Self { scheme, host, port, topic: topic.to_string(), user, form })
    }
}

impl Target {
    /// Reads `-`; or, with `?cbor` behind it where events shall be CBOR, `udp://HOST:PORT`, `mqtt://[USER:PASSWORD@]HOST[:PORT]/TOPIC` `zenoh/KEY` or, with the feature `nats`, `nats://..`.
    /// # Errors
    /// [`ErrorKind::Config`] for anything else.
    pub fn parse(text: &str) -> Result<Self> {
        // A password must not reach a log.
        let shown = match text.split_once('@') {
            Some((_, rest)) => format!("--publish ..@{rest}"),
            None => format!("--publish {text}"),
        };
        let wrong = |what: &str| {
            let error = Error::new(ErrorKind::Config, what).at(&shown);
            error.hint(KNOWN)
        };
        if text == "-" {
            return Ok(Self::Standard);
        }
        if let Some(rest) = text.strip_prefix("zenoh/") {
            return ZenohAddress::parse(rest).map(Self::Zenoh).map_err(wrong);
        }
        let Some((scheme, rest)) = text.split_once("://") else { return Err(wrong("expected an address")) };
        let only_place = |place: &str| -> Result<String> {
            let (host, port) =
                host_and_port(place.trim_end_matches('/'), None).ok_or_else(|| wrong("expected HOST:PORT"))?;
            Ok(format!("{host}:{port}"))
        };
        if let "cot+udp" | "cot+tcp" | "asterix+udp" = scheme {
            let (place, query) = split(rest);
            let address = only_place(place)?;
            return Ok(match scheme {
                "asterix+udp" => Self::Asterix { address, options: AsterixOptions::parse(query).map_err(wrong)? },
                _ => {
                    let options = CotOptions::parse(query).map_err(wrong)?;
                    Self::Cot { is_tcp: scheme == "cot+tcp", address, options }
                }
            });
        }
        let (rest, form) = match rest.strip_suffix("?cbor") {
            Some(rest) => (rest, Form::Cbor),
            None => (rest, Form::Json),
        };
        match scheme {
            "udp" => Ok(Self::Udp { address: only_place(rest)?, form }),
            "mqtt" => {
                let bad = |c: char| c.is_control() || c == '#' || c == '+';
                let is_topic = |topic: &str| !topic.contains(bad) && !topic.ends_with('/');
                let wildcards = "expected a topic without wildcards (# and +), such as site/camera";
                Ok(Self::Mqtt(Broker::parse("mqtt", rest, form, MQTT_PORT, is_topic, wildcards).map_err(wrong)?))
            }
            #[cfg(feature = "nats")]
            "nats" => {
                // A slash tells levels apart in an address, a dot in a subject.
                let bad = |c: char| c.is_control() || c.is_whitespace() || c == '*' || c == '>';
                let is_subject = |topic: &str| !topic.contains(bad) && topic.split(['.', '/']).all(|t| !t.is_empty());
                let wildcards = "expected a subject without wildcards (* and >) and spaces, such as site.camera";
                let mut broker = Broker::parse("nats", rest, form, NATS_PORT, is_subject, wildcards).map_err(wrong)?;
                broker.topic = broker.topic.replace('/', ".");
                Ok(Self::Nats(broker))
            }
            #[cfg(not(feature = "nats"))]
            "nats" => Err(Error::new(ErrorKind::Config, "this build does not speak nats://")
                .at(&shown)
                .hint("build it with: cargo install --path crates/boresight-cli --features nats")),
            "zenoh" => Err(wrong("a key of zenoh follows one slash: zenoh/site/camera")),
            other => Err(wrong(&format!("{other}:// is not spoken here"))),
        }
    }
}

impl Target {
    /// The same for one of several sources, the `k`-th, from 0: its topics lie below that of the target, under its name; of ASTERIX it has a SIC of its own.
    /// # Errors
    /// [`ErrorKind::Config`] where there is no SIC for it.
    pub fn of_source(&self, name: &str, k: usize) -> Result<Self> {
        Ok(match self {
            Self::Mqtt(broker) => Self::Mqtt(Broker { topic: format!("{}/{name}", broker.topic), ..broker.clone() }),
            #[cfg(feature = "nats")]
            Self::Nats(broker) => Self::Nats(Broker { topic: format!("{}.{name}", broker.topic), ..broker.clone() }),
            Self::Asterix { address, options } => {
                let sic = u8::try_from(k).ok().and_then(|k| options.sic.checked_add(k)).ok_or_else(|| {
                    let e = Error::new(ErrorKind::Config, "the sources' codes go beyond 255: each has the next one");
                    e.at(format!("--publish asterix+udp://{address}")).hint("give a smaller sic")
                })?;
                Self::Asterix { address: address.clone(), options: AsterixOptions { sic, ..*options } }
            }
            Self::Zenoh(address) => Self::Zenoh(address.below(name)),
            Self::Standard | Self::Udp { .. } | Self::Cot { .. } => self.clone(),
        })
    }

    /// The scheme of a wire that says places on Earth alone, and so needs a configuration with `[world]`.
    pub fn needs_world(&self) -> Option<&'static str> {
        match self {
            Self::Cot { is_tcp: true, .. } => Some("cot+tcp"),
            Self::Cot { .. } => Some("cot+udp"),
            Self::Asterix { .. } => Some("asterix+udp"),
            _ => None,
        }
    }
}

fn host_and_port(text: &str, default: Option<u16>) -> Option<(String, u16)> {
    let colon = text.rfind(':').filter(|at| !text[*at..].contains(']'));
    let (host, port) = match colon {
        Some(at) => (&text[..at], text[at + 1..].parse().ok().filter(|p| *p != 0)?),
        None => (text, default?),
    };
    (!host.is_empty() && !host.contains(['/', ' '])).then(|| (host.to_string(), port))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_understood_and_a_password_is_never_said() {
        let broker = |text: &str| match Target::parse(text) {
            Ok(Target::Mqtt(b)) => (b.host, b.port, b.topic, b.user),
            other => panic!("{other:?}"),
        };
        assert_eq!(broker("mqtt://b/a/c"), ("b".into(), 1883, "a/c".into(), None));
        assert_eq!(broker("mqtt://u:p@[::1]:99/t"), ("::1".into(), 99, "t".into(), Some(("u".into(), "p".into()))));
        assert_eq!(
            Target::parse("udp://[::1]:9").unwrap(),
            Target::Udp { address: "[::1]:9".into(), form: Form::Json }
        );
        for bad in [
            "",
            "udp://h",
            "udp://:5",
            "udp://h:0",
            "mqtt://h",
            "mqtt://h/",
            "mqtt://h/a/#",
            "ftp://h:1/x",
            "udp://h:70000",
        ] {
            assert!(Target::parse(bad).unwrap_err().to_string().contains("hint: give -"), "{bad}");
        }
        let Target::Mqtt(cbor) = Target::parse("mqtt://b/a?cbor").unwrap() else { panic!("mqtt") };
        assert_eq!((cbor.topic.as_str(), cbor.form), ("a", Form::Cbor));
        let Target::Mqtt(north) = Target::parse("mqtt://b/a").unwrap().of_source("north", 0).unwrap() else {
            panic!("mqtt")
        };
        assert_eq!(north.topic, "a/north");
        let said = format!(
            "{} {:?}",
            Target::parse("mqtt://u:secret@h").unwrap_err(),
            Target::parse("mqtt://u:secret@h/t").unwrap()
        );
        assert!(!said.contains("secret"), "{said}");
    }

    #[test]
    fn a_key_of_zenoh_and_how_its_network_is_found() {
        let zenoh = |text: &str| match Target::parse(text) {
            Ok(Target::Zenoh(address)) => address.command().words,
            other => panic!("{other:?}"),
        };
        assert_eq!(zenoh("zenoh/site/cam"), ["site/cam", "--acknowledge"]);
        assert_eq!(
            zenoh("zenoh/a?connect=tcp/10.0.0.1:7447&cbor&config=z.json5"),
            ["a", "--acknowledge", "--connect", "tcp/10.0.0.1:7447", "--cbor", "--config", "z.json5"]
        );
        let Target::Zenoh(north) = Target::parse("zenoh/a?cbor").unwrap().of_source("north", 0).unwrap() else {
            panic!("zenoh")
        };
        assert_eq!(north.command().words, ["a/north", "--acknowledge", "--cbor"]);
        for bad in
            ["zenoh/", "zenoh//a", "zenoh/a/", "zenoh/a/*", "zenoh/-a", "zenoh/a?fast", "zenoh/a?connect=", "zenoh://a"]
        {
            assert!(Target::parse(bad).unwrap_err().to_string().contains("zenoh/"), "{bad}");
        }
    }

    #[test]
    fn wires_of_places_on_earth_say_what_they_miss() {
        let cot = |text: &str| match Target::parse(text) {
            Ok(Target::Cot { is_tcp, address, options }) => (is_tcp, address, options.kind, options.stale_s),
            other => panic!("{other:?}"),
        };
        assert_eq!(cot("cot+udp://239.2.3.1:6969"), (false, "239.2.3.1:6969".into(), "a-u-G".into(), 10.0));
        assert_eq!(cot("cot+tcp://tak:8087?type=a-n-S-X&stale=3"), (true, "tak:8087".into(), "a-n-S-X".into(), 3.0));
        let asterix = Target::parse("asterix+udp://[::1]:8600?sac=25&sic=201").unwrap();
        let Target::Asterix { address, options } = asterix.of_source("south", 2).unwrap() else { panic!("asterix") };
        assert_eq!((address.as_str(), options.sac, options.sic), ("[::1]:8600", 25, 203));
        assert!(asterix.of_source("last", 55).unwrap_err().to_string().contains("smaller sic"));
        for (bad, why) in [
            ("cot+udp://h", "HOST:PORT"),
            ("cot+udp://h:1?type=<x>", "type=a-u-G"),
            ("cot+udp://h:1?type=a--G", "type=a-u-G"),
            ("cot+tcp://h:1?stale=-1", "stale=S"),
            ("cot+tcp://h:1?cbor", "behind the ?"),
            ("asterix+udp://h:1", "?sac=N&sic=N"),
            ("asterix+udp://h:1?sac=1&sic=256", "0 to 255"),
            ("cot://h:1", "cot+udp://"),
        ] {
            let said = Target::parse(bad).unwrap_err().to_string();
            assert!(said.contains(why), "{bad}: {said}");
        }
        assert_eq!((asterix.needs_world(), Target::Standard.needs_world()), (Some("asterix+udp"), None));
    }

    #[test]
    #[cfg(feature = "nats")]
    fn a_subject_has_dots_and_no_wildcards() {
        let broker = |text: &str| match Target::parse(text) {
            Ok(Target::Nats(b)) => (b.host, b.port, b.topic, b.user),
            other => panic!("{other:?}"),
        };
        assert_eq!(broker("nats://b/a/c.d"), ("b".into(), 4222, "a.c.d".into(), None));
        assert_eq!(broker("nats://t@b:9/a"), ("b".into(), 9, "a".into(), Some(("t".into(), String::new()))));
        for bad in
            ["nats://h", "nats://h/", "nats://h/a.", "nats://h/a..b", "nats://h/a.*", "nats://h/>", "nats://h/a b"]
        {
            assert!(Target::parse(bad).unwrap_err().to_string().contains("nats://"), "{bad}");
        }
        let Target::Nats(north) = Target::parse("nats://b/a").unwrap().of_source("north", 0).unwrap() else {
            panic!("nats")
        };
        assert_eq!((north.topic.as_str(), format!("{north:?}").as_str()), ("a.north", "nats://b:4222/a.north"));
    }

    #[test]
    #[cfg(not(feature = "nats"))]
    fn what_was_not_built_is_said_with_its_mend() {
        assert!(Target::parse("nats://h/a").unwrap_err().to_string().contains("--features nats"));
    }
}
