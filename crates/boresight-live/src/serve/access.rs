//! Who may see the page: method, host, origin, token; everything else of a request is not looked at here.
//!
//! On a loopback address no token is asked for: the machine's own users may look, but a strange web page may not, so the host must be one of
//! the machine's own names (a foreign name that was made to lead here is refused) and the origin this server. On any other address a token is
//! asked for: 128 random bits, once in the address, then a cookie of its own. Secrets are compared in a time that does not depend on them.
//!
//! Where parameters may be changed, that is done by POST to `/api/config` alone, which must name this server as its origin (a browser always says it) and bring a token of its own,
//! on loopback too: only who may read `/api/config` knows it.

use axum::http::{HeaderMap, Method, StatusCode, Uri, header};
use boresight::{Error, ErrorKind, Result};
use std::net::{IpAddr, SocketAddr};

/// Longest header that is compared, bytes.
const LONGEST: usize = 1024;

/// What becomes of a request.
#[derive(Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is answered.
    Pass,
    /// It brought the token: it gets a cookie with this content.
    Welcome(String),
    /// It is refused.
    Refuse(StatusCode, &'static str),
}

/// Who may see the page.
pub struct Access {
    address: SocketAddr,
    names: Vec<String>,
    secrets: Option<Secrets>,
    /// The token that a change brings, where changes are allowed.
    change: Option<String>,
    /// Whether it is reached by TLS alone: the cookie then goes no other way.
    is_tls: bool,
}

/// The header with the token of a change.
pub const CHANGE_HEADER: &str = "x-boresight-change";
/// Where changes go.
pub const CHANGE_PATH: &str = "/api/config";

struct Secrets {
    token: String,
    cookie: String,
}

/// 128 random bits of the system, as text.
fn random() -> Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|e| {
        Error::new(ErrorKind::Output, "the system gives no random numbers for a token").because(e.to_string())
    })?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

/// Compares in a time that depends on the length of what was given only.
fn is_same(given: &[u8], secret: &[u8]) -> bool {
    let mut differs = given.len() ^ secret.len();
    for (k, b) in given.iter().enumerate() {
        differs |= usize::from(b ^ secret[k % secret.len().max(1)]);
    }
    std::hint::black_box(differs) == 0
}

fn only<'h>(headers: &'h HeaderMap, name: &header::HeaderName) -> Option<Option<&'h str>> {
    let mut all = headers.get_all(name).iter();
    let Some(first) = all.next() else { return Some(None) };
    let text = first.to_str().ok().filter(|t| t.len() <= LONGEST && all.next().is_none());
    text.map(Some)
}

/// A host's name without its port, in small letters.
fn name_of(host: &str) -> String {
    let colon = host.rfind(':').filter(|at| !host[*at..].contains(']'));
    host[..colon.unwrap_or(host.len())].to_ascii_lowercase()
}

impl Access {
    /// Access to an address; `names` are further names of this machine, as browsers call it.
    /// # Errors
    /// A system without randomness, where a token is needed.
    pub fn to(address: SocketAddr, names: &[String]) -> Result<Self> {
        let secrets = match address.ip().is_loopback() {
            true => None,
            false => Some(Secrets { token: random()?, cookie: random()? }),
        };
        Ok(Self {
            address,
            names: names.iter().map(|n| n.to_ascii_lowercase()).collect(),
            secrets,
            change: None,
            is_tls: false,
        })
    }

    /// The same, where parameters may be changed.
    /// # Errors
    /// A system without randomness.
    pub fn with_changes(self) -> Result<Self> {
        Ok(Self { change: Some(random()?), ..self })
    }

    /// The same, where the page is served by TLS.
    pub fn over_tls(self) -> Self {
        Self { is_tls: true, ..self }
    }

    /// The token that a change must bring, where changes are allowed.
    pub fn change_token(&self) -> Option<&str> {
        self.change.as_deref()
    }

    /// The token, if one is asked for.
    pub fn token(&self) -> Option<&str> {
        self.secrets.as_ref().map(|s| s.token.as_str())
    }

    /// Name of the cookie: cookies do not tell ports apart.
    fn cookie_name(&self) -> String {
        format!("boresight-{}", self.address.port())
    }

    fn knows(&self, host: &str) -> bool {
        let name = name_of(host);
        let bare = name.trim_start_matches('[').trim_end_matches(']');
        let number: Option<IpAddr> = bare.parse().ok();
        let own = match number {
            Some(ip) => ip.is_loopback() || self.secrets.is_some(),
            None => name == "localhost",
        };
        own || self.names.contains(&name)
    }

    /// Judges a request.
    pub fn judge(&self, method: &Method, uri: &Uri, headers: &HeaderMap) -> Verdict {
        let changes = self.change.as_deref().filter(|_| method == Method::POST && uri.path() == CHANGE_PATH);
        if method != Method::GET && method != Method::HEAD && changes.is_none() {
            return Verdict::Refuse(
                StatusCode::METHOD_NOT_ALLOWED,
                "nothing can be changed there: only GET is answered\n",
            );
        }
        let Some(Some(host)) = only(headers, &header::HOST) else {
            return Verdict::Refuse(StatusCode::BAD_REQUEST, "expected one Host header\n");
        };
        if !self.knows(host) {
            let why = "this machine is not known by that name; start it with --host NAME if it is its own\n";
            return Verdict::Refuse(StatusCode::MISDIRECTED_REQUEST, why);
        }
        let own = |origin: &str| {
            let place = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
            place.is_some_and(|place| place.eq_ignore_ascii_case(host))
        };
        if !only(headers, &header::ORIGIN).is_some_and(|origin| origin.is_none_or(own)) {
            return Verdict::Refuse(StatusCode::FORBIDDEN, "a page of another origin may not look\n");
        }
        let fetch = |name: &str| headers.get(name).and_then(|v| v.to_str().ok());
        if fetch("sec-fetch-site") == Some("cross-site") && fetch("sec-fetch-mode") != Some("navigate") {
            return Verdict::Refuse(StatusCode::FORBIDDEN, "a page of another origin may not look\n");
        }
        if let Some(token) = changes {
            let given = headers.get(CHANGE_HEADER).map(header::HeaderValue::as_bytes).unwrap_or_default();
            if !headers.contains_key(header::ORIGIN) || given.len() > LONGEST || !is_same(given, token.as_bytes()) {
                let why = "a change says its origin and brings the token of /api/config in x-boresight-change\n";
                return Verdict::Refuse(StatusCode::FORBIDDEN, why);
            }
        }
        let Some(secrets) = &self.secrets else { return Verdict::Pass };
        let cookies = headers.get_all(header::COOKIE).iter().filter_map(|c| c.to_str().ok()).flat_map(|c| c.split(';'));
        let name = self.cookie_name();
        let mut values = cookies.filter_map(|c| c.trim().split_once('=')).filter(|(n, _)| *n == name).map(|(_, v)| v);
        if values.any(|value| is_same(value.as_bytes(), secrets.cookie.as_bytes())) {
            return Verdict::Pass;
        }
        let bearer =
            headers.get(header::AUTHORIZATION).and_then(|v| v.to_str().ok()).and_then(|v| v.strip_prefix("Bearer "));
        if bearer.is_some_and(|token| is_same(token.as_bytes(), secrets.token.as_bytes())) {
            return Verdict::Pass;
        }
        let mut pairs = uri.query().unwrap_or("").split('&').filter_map(|pair| pair.split_once('='));
        let given = pairs.find(|(key, _)| *key == "token").map(|(_, value)| value);
        if uri.path() == "/" && given.is_some_and(|token| is_same(token.as_bytes(), secrets.token.as_bytes())) {
            let secure = if self.is_tls { "; Secure" } else { "" };
            return Verdict::Welcome(format!("{name}={}; Path=/; HttpOnly; SameSite=Strict{secure}", secrets.cookie));
        }
        Verdict::Refuse(StatusCode::UNAUTHORIZED, "a token is needed: open the address that was printed at the start\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judge(access: &Access, method: Method, uri: &str, headers: &[(&str, &str)]) -> Verdict {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.append(header::HeaderName::from_bytes(name.as_bytes()).unwrap(), value.parse().unwrap());
        }
        access.judge(&method, &uri.parse().unwrap(), &map)
    }

    fn code(verdict: &Verdict) -> u16 {
        match verdict {
            Verdict::Refuse(code, _) => code.as_u16(),
            _ => 200,
        }
    }

    #[test]
    fn on_loopback_only_its_own_names_and_origin_pass() {
        let access = Access::to("127.0.0.1:80".parse().unwrap(), &["Pi.local".into()]).unwrap();
        let get = |headers: &[(&str, &str)]| code(&judge(&access, Method::GET, "/", headers));
        assert!(access.token().is_none());
        for host in ["localhost:80", "127.0.0.1", "[::1]:80", "pi.local:80"] {
            assert_eq!(get(&[("host", host)]), 200, "{host}");
        }
        assert_eq!(get(&[("host", "evil.example")]), 421);
        assert_eq!(get(&[("host", "10.0.0.7")]), 421);
        assert_eq!(get(&[]), 400);
        assert_eq!(get(&[("host", "localhost"), ("host", "localhost")]), 400);
        assert_eq!(get(&[("host", "localhost:80"), ("origin", "http://localhost:80")]), 200);
        for origin in ["http://evil.example", "http://localhost:81", "null", "localhost:80"] {
            assert_eq!(get(&[("host", "localhost:80"), ("origin", origin)]), 403, "{origin}");
        }
        assert_eq!(get(&[("host", "localhost"), ("sec-fetch-site", "cross-site"), ("sec-fetch-mode", "no-cors")]), 403);
        for method in [Method::POST, Method::PUT, Method::DELETE, Method::OPTIONS, Method::CONNECT] {
            assert_eq!(code(&judge(&access, method, "/", &[("host", "localhost")])), 405);
        }
    }

    #[test]
    fn elsewhere_a_token_is_asked_for_once_and_then_its_cookie() {
        let access = Access::to("0.0.0.0:8090".parse().unwrap(), &[]).unwrap();
        let token = access.token().unwrap().to_string();
        let host = ("host", "192.168.1.5:8090");
        let get = |uri: &str, header: (&str, &str)| judge(&access, Method::GET, uri, &[host, header]);
        let none = ("accept", "*/*");
        for uri in [
            "/",
            "/api/tracks",
            "/?token=",
            "/?token=0123",
            &format!("/api/tracks?token={token}"),
            &format!("/?token={token}0"),
        ] {
            assert_eq!(code(&get(uri, none)), 401, "{uri}");
        }
        let Verdict::Welcome(cookie) = get(&format!("/?token={token}"), none) else { panic!("the token is right") };
        assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict") && !cookie.contains(&token));
        let pair = cookie.split(';').next().unwrap();
        assert_eq!(get("/api/tracks", ("cookie", pair)), Verdict::Pass);
        assert_eq!(get("/metrics", ("authorization", &format!("Bearer {token}"))), Verdict::Pass);
        assert_eq!(code(&get("/", ("cookie", &format!("boresight-8090={token}")))), 401, "the token is no cookie");
        assert_eq!(code(&get("/", ("authorization", "Bearer "))), 401);
        assert_eq!(code(&judge(&access, Method::GET, &format!("/?token={token}"), &[("host", "evil.example")])), 421);
        assert_ne!(Access::to("0.0.0.0:1".parse().unwrap(), &[]).unwrap().token(), Some(token.as_str()));
    }
}
