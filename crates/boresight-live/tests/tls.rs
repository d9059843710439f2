//! The page by TLS: with a certificate of one's own, every wrong way in, and what becomes of clients that speak something else or nothing.

mod common;

use boresight_live::{Page, PageOptions, TlsFiles};
use common::{ask, board};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use tokio_rustls::rustls::crypto::ring::default_provider;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};

/// A certificate for this machine and its key, as files.
fn pair(dir: &Path, name: &str) -> TlsFiles {
    let made = rcgen::generate_simple_self_signed(vec!["localhost".to_string(), "127.0.0.1".to_string()]).unwrap();
    let files = TlsFiles { cert: dir.join(format!("{name}.pem")), key: dir.join(format!("{name}.key")) };
    std::fs::write(&files.cert, made.cert.pem()).unwrap();
    std::fs::write(&files.key, made.signing_key.serialize_pem()).unwrap();
    files
}

fn serve(address: &str, tls: TlsFiles) -> boresight::Result<Page> {
    Page::serve(&PageOptions { tls: Some(tls), ..PageOptions::at(address.parse().unwrap()) }, &[board()])
}

/// A client that believes this certificate alone.
fn client(to: SocketAddr, believes: &PathBuf) -> StreamOwned<ClientConnection, TcpStream> {
    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_file(believes).unwrap()).unwrap();
    let config = ClientConfig::builder_with_provider(Arc::new(default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let stream = TcpStream::connect(to).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    StreamOwned::new(
        ClientConnection::new(Arc::new(config), ServerName::try_from("localhost").unwrap()).unwrap(),
        stream,
    )
}

fn get(to: SocketAddr, believes: &PathBuf, path: &str) -> std::io::Result<String> {
    let mut stream = client(to, believes);
    write!(stream, "GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")?;
    let mut text = Vec::new();
    // A connection that is closed without a farewell has given what it had.
    let _ = stream.read_to_end(&mut text);
    Ok(String::from_utf8_lossy(&text).into_owned())
}

#[test]
fn the_page_is_served_and_a_stranger_is_not_believed() {
    let dir = tempfile::tempdir().unwrap();
    let (own, other) = (pair(dir.path(), "own"), pair(dir.path(), "other"));
    let page = serve("127.0.0.1:0", own.clone()).unwrap();
    let to = page.address();
    assert_eq!(page.scheme(), "https");
    let text = get(to, &own.cert, "/").unwrap();
    assert!(text.starts_with("HTTP/1.1 200") && text.contains("<!doctype html>"), "{text}");
    let refused = get(to, &other.cert, "/").unwrap_err().to_string();
    assert!(refused.contains("certificate"), "{refused}");
    // A viewer's connection is taken over by TLS too.
    let mut viewer = client(to, &own.cert);
    let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==";
    write!(viewer, "GET /api/view HTTP/1.1\r\nHost: localhost\r\nOrigin: https://localhost\r\n{upgrade}\r\n\r\n")
        .unwrap();
    let mut head = [0; 12];
    viewer.read_exact(&mut head).unwrap();
    assert_eq!(&head, b"HTTP/1.1 101");
}

#[test]
fn the_cookie_goes_by_tls_only() {
    let dir = tempfile::tempdir().unwrap();
    let own = pair(dir.path(), "own");
    let page = serve("0.0.0.0:0", own.clone()).unwrap();
    let to = SocketAddr::from(([127, 0, 0, 1], page.address().port()));
    let mut stream = client(to, &own.cert);
    let token = page.token().unwrap();
    write!(stream, "GET /?token={token} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n").unwrap();
    let mut text = Vec::new();
    let _ = stream.read_to_end(&mut text);
    let text = String::from_utf8_lossy(&text).to_ascii_lowercase();
    assert!(text.starts_with("http/1.1 303") && text.contains("; secure\r\n"), "{text}");
    assert!(get(to, &own.cert, "/").unwrap().starts_with("HTTP/1.1 401"), "and without the token nobody looks");
}

#[test]
fn whoever_speaks_plainly_is_told_and_one_who_says_nothing_holds_up_nobody() {
    let dir = tempfile::tempdir().unwrap();
    let own = pair(dir.path(), "own");
    let page = serve("127.0.0.1:0", own.clone()).unwrap();
    let to = page.address();
    let (code, _, body) = ask(to, "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
    assert!(code == 400 && body.contains("https"), "{code} {body}");
    // The first byte of a handshake, and then nothing or garbage.
    let mut silent = TcpStream::connect(to).unwrap();
    silent.write_all(&[22]).unwrap();
    let mut garbage = TcpStream::connect(to).unwrap();
    garbage.write_all(&[22, 3, 1, 255, 255, 1, 2, 3]).unwrap();
    let _nothing = TcpStream::connect(to).unwrap();
    assert!(get(to, &own.cert, "/").unwrap().starts_with("HTTP/1.1 200"));
    // And they are hung up on.
    silent.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let ended = silent.read_to_end(&mut Vec::new());
    assert!(ended.map_or_else(|e| e.kind() == std::io::ErrorKind::ConnectionReset, |_| true), "it is still open");
}

#[test]
fn wrong_files_are_named_with_what_is_wrong() {
    let dir = tempfile::tempdir().unwrap();
    let (own, other) = (pair(dir.path(), "own"), pair(dir.path(), "other"));
    let says = |cert: &Path, key: &Path| {
        let files = TlsFiles { cert: cert.to_path_buf(), key: key.to_path_buf() };
        serve("127.0.0.1:0", files).err().expect("refused").to_string()
    };
    let file = |name: &str, content: &[u8]| {
        std::fs::write(dir.path().join(name), content).unwrap();
        dir.path().join(name)
    };
    let mismatched = says(&own.cert, &other.key);
    assert!(mismatched.contains("other.key") && mismatched.contains("is not the key of"), "{mismatched}");
    assert!(says(&dir.path().join("none"), &own.key).contains("cannot be read"));
    assert!(says(&file("empty", b""), &own.key).contains("holds no certificate"));
    assert!(says(&own.key, &own.key).contains("holds no certificate"), "the files are exchanged");
    assert!(says(&own.cert, &own.cert).contains("holds no private key"));
    assert!(says(&own.cert, &file("garbage", &[255; 500])).contains("holds no private key"));
    assert!(says(&file("large", &vec![b'a'; 2 << 20]), &own.key).contains("is larger than"));
    let broken = "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";
    assert!(says(&file("broken", broken.as_bytes()), &own.key).contains("cannot be used"));
}
