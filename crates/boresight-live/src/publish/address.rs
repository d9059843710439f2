//! Where events go, from what stands on the command line.

use boresight::{Error, ErrorKind, Result};

/// Longest topic, bytes.
const MAX_TOPIC: usize = 512;
/// The port of MQTT without TLS.
const MQTT_PORT: u16 = 1883;

/// A place for events.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// JSON lines on standard output.
    Standard,
    /// One datagram an event.
    Udp {
        /// Name or number of the host, and the port.
        address: String,
    },
    /// A broker.
    Mqtt(Broker),
}

/// A broker's address.
#[derive(Clone, PartialEq, Eq)]
pub struct Broker {
    /// Name or number of the host.
    pub host: String,
    /// Port.
    pub port: u16,
    /// Topic of the tracks' events; the state of the run goes to `TOPIC/status`.
    pub topic: String,
    /// User and password.
    pub user: Option<(String, String)>,
}

impl std::fmt::Debug for Broker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // The password stays unsaid.
        write!(f, "mqtt://{}:{}/{}", self.host, self.port, self.topic)
    }
}

impl Target {
    /// Reads `-`, `udp://HOST:PORT` or `mqtt://[USER:PASSWORD@]HOST[:PORT]/TOPIC`.
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
            error.hint("give -, udp://HOST:PORT or mqtt://[USER:PASSWORD@]HOST[:PORT]/TOPIC")
        };
        if text == "-" {
            return Ok(Self::Standard);
        }
        let Some((scheme, rest)) = text.split_once("://") else { return Err(wrong("expected an address")) };
        match scheme {
            "udp" => {
                let (host, port) =
                    host_and_port(rest.trim_end_matches('/'), None).ok_or_else(|| wrong("expected HOST:PORT"))?;
                Ok(Self::Udp { address: format!("{host}:{port}") })
            }
            "mqtt" => {
                let Some((place, topic)) = rest.split_once('/') else { return Err(wrong("the topic is missing")) };
                let bad = |c: char| c.is_control() || c == '#' || c == '+';
                if topic.is_empty() || topic.len() > MAX_TOPIC || topic.contains(bad) || topic.ends_with('/') {
                    return Err(wrong("expected a topic without wildcards (# and +), such as site/camera"));
                }
                let (user, place) = match place.rsplit_once('@') {
                    Some((user, place)) => {
                        let (name, password) = user.split_once(':').unwrap_or((user, ""));
                        (Some((name.to_string(), password.to_string())), place)
                    }
                    None => (None, place),
                };
                let (host, port) = host_and_port(place, Some(MQTT_PORT)).ok_or_else(|| wrong("expected HOST:PORT"))?;
                Ok(Self::Mqtt(Broker {
                    host: host.trim_matches(['[', ']']).to_string(),
                    port,
                    topic: topic.to_string(),
                    user,
                }))
            }
            other => Err(wrong(&format!("{other}:// is not spoken here"))),
        }
    }
}

impl Target {
    /// The same for one of several sources: its topics lie below that of the target, under its name.
    pub fn of_source(&self, name: &str) -> Self {
        match self {
            Self::Mqtt(broker) => Self::Mqtt(Broker { topic: format!("{}/{name}", broker.topic), ..broker.clone() }),
            Self::Standard | Self::Udp { .. } => self.clone(),
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
        assert_eq!(Target::parse("udp://[::1]:9").unwrap(), Target::Udp { address: "[::1]:9".into() });
        for bad in [
            "",
            "udp://h",
            "udp://:5",
            "udp://h:0",
            "mqtt://h",
            "mqtt://h/",
            "mqtt://h/a/#",
            "nats://h:1/x",
            "udp://h:70000",
        ] {
            assert!(Target::parse(bad).unwrap_err().to_string().contains("hint: give -"), "{bad}");
        }
        let said = format!(
            "{} {:?}",
            Target::parse("mqtt://u:secret@h").unwrap_err(),
            Target::parse("mqtt://u:secret@h/t").unwrap()
        );
        assert!(!said.contains("secret"), "{said}");
    }
}
