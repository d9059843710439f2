//! TLS of the page: certificate and key from files, TLS 1.2 and 1.3, by `rustls`.
//!
//! Limits: 1 MB a file; PEM; one certificate for all names; a file that is renewed is read at the next start.

use boresight::{Error, ErrorKind, Result};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::crypto::ring::default_provider;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::{self, ServerConfig};

/// Largest file, bytes.
const MOST: u64 = 1 << 20;

/// Where certificate and key are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// The chain of certificates, that of this machine first, as PEM.
    pub cert: PathBuf,
    /// The private key of the first certificate, as PEM.
    pub key: PathBuf,
}

fn wrong(path: &Path, what: impl Into<String>) -> Error {
    Error::new(ErrorKind::Config, what).at(path.display())
}

fn read(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(MOST + 1).read_to_end(&mut bytes));
    read.map_err(|e| wrong(path, "cannot be read").because(e))?;
    match bytes.len() as u64 {
        0..=MOST => Ok(bytes),
        _ => Err(wrong(path, format!("is larger than {MOST} bytes: expected PEM"))),
    }
}

/// What speaks TLS with these files.
/// # Errors
/// [`ErrorKind::Config`] for files that are not there, hold something else, or do not belong together.
pub fn acceptor(files: &TlsFiles) -> Result<TlsAcceptor> {
    let (cert, key) = (&files.cert, &files.key);
    let made = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 365 -subj /CN=cam.example \
                -addext subjectAltName=DNS:cam.example -keyout key.pem -out cert.pem makes a pair";
    let chain: Vec<_> = CertificateDer::pem_slice_iter(&read(cert)?)
        .collect::<std::result::Result<_, _>>()
        .map_err(|e| wrong(cert, "is no PEM that can be read").because(e.to_string()))?;
    if chain.is_empty() {
        return Err(wrong(cert, "holds no certificate: expected -----BEGIN CERTIFICATE-----").hint(made));
    }
    let private = PrivateKeyDer::from_pem_slice(&read(key)?).map_err(|_| {
        wrong(key, "holds no private key that can be read: expected -----BEGIN PRIVATE KEY-----")
            .hint("one that is encrypted must be decrypted first: openssl pkey -in FILE -out key.pem")
    })?;
    let config = ServerConfig::builder_with_provider(Arc::new(default_provider()))
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, private));
    let mut config = config.map_err(|e| match e {
        rustls::Error::InconsistentKeys(_) => {
            wrong(key, format!("is not the key of the first certificate in {}", cert.display())).hint(made)
        }
        other => wrong(cert, "certificate and key cannot be used").because(other.to_string()).hint(made),
    })?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(TlsAcceptor::from(Arc::new(config)))
}
