//! The server of the page: takes connections on threads of its own, within limits on everything that is read.

use super::access::Access;
use super::hub::Hub;
use super::hubs::Hubs;
use super::page_output::PageOutput;
use super::routes::{Shared, router};
use super::tls::{TlsFiles, acceptor};
use crate::board::{Board, add};
use crate::output::LiveOutput;
use axum::Router;
use boresight::{Error, ErrorKind, Result};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::Runtime;
use tokio::sync::Semaphore;
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;

/// First byte of a TLS handshake (RFC 8446, 5.1).
const HANDSHAKE: u8 = 22;
const NOT_TLS: &[u8] = b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\nContent-Type: text/plain\r\nContent-Length: 34\r\n\r\nthis port speaks https: use that.\n";
/// How long a client may take for a handshake, and for the head of a request.
const HEAD_TIME: Duration = Duration::from_secs(10);
/// Largest head, bytes, and most headers.
const HEAD_BYTES: usize = 16 << 10;
const HEADERS: usize = 64;

/// How the page is served.
#[derive(Clone, Debug)]
pub struct PageOptions {
    /// Address to listen on; port 0 takes a free one.
    pub address: SocketAddr,
    /// Names of this machine besides its numbers and `localhost`.
    pub names: Vec<String>,
    /// Viewers at once.
    pub most_viewers: u64,
    /// Connections at once.
    pub most_connections: usize,
    /// Whether a few parameters may be changed from the page.
    pub tune: bool,
    /// Certificate and key: the page is served by TLS only.
    pub tls: Option<TlsFiles>,
}

impl PageOptions {
    /// The usual limits.
    pub fn at(address: SocketAddr) -> Self {
        Self { address, names: Vec::new(), most_viewers: 64, most_connections: 256, tune: false, tls: None }
    }
}

/// A page that is served until this is dropped.
pub struct Page {
    runtime: Option<Runtime>,
    hubs: Hubs,
    address: SocketAddr,
    token: Option<String>,
    scheme: &'static str,
}

impl Page {
    /// Listens, for the sources of these boards.
    /// # Errors
    /// An address that is taken or not this machine's; no source; a certificate and a key that cannot be used.
    pub fn serve(options: &PageOptions, boards: &[Arc<Board>]) -> Result<Self> {
        if boards.is_empty() {
            return Err(Error::new(ErrorKind::Config, "a page shows at least one source").at(options.address));
        }
        let failed = |e: std::io::Error| {
            Error::new(ErrorKind::Output, "cannot be listened on")
                .at(options.address)
                .because(e)
                .hint("choose another port, or 127.0.0.1:0 for a free one")
        };
        let tls = options.tls.as_ref().map(acceptor).transpose()?;
        let scheme = if tls.is_some() { "https" } else { "http" };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("live-page")
            .enable_all()
            .build()
            .map_err(failed)?;
        let listener = runtime.block_on(TcpListener::bind(options.address)).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let access = Access::to(address, &options.names)?;
        let access = if options.tune { access.with_changes()? } else { access };
        let access = Arc::new(if tls.is_some() { access.over_tls() } else { access });
        let token = access.token().map(ToString::to_string);
        let hubs = Hubs::new(boards.iter().map(|board| Arc::new(Hub::new(Arc::clone(board)))).collect());
        let shared =
            Shared { hubs: hubs.clone(), access, n_refused: Arc::default(), most_viewers: options.most_viewers };
        runtime.spawn(accept(listener, shared, options.most_connections, tls));
        Ok(Self { runtime: Some(runtime), hubs, address, token, scheme })
    }

    /// The address that is listened on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// How browsers call it: `http` or `https`.
    pub fn scheme(&self) -> &'static str {
        self.scheme
    }

    /// The token that is asked for, if one is.
    pub fn token(&self) -> Option<&str> {
        self.token.as_deref()
    }

    /// What feeds the page with a source, by its place among the boards.
    /// # Errors
    /// A place that there is not; a system without threads.
    pub fn output(&self, source: usize) -> Result<Box<dyn LiveOutput>> {
        let none = || Error::new(ErrorKind::Config, format!("the page has no source {source}"));
        let hub = self.hubs.all().get(source).ok_or_else(none)?;
        Ok(Box::new(PageOutput::start(Arc::clone(hub))?))
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

async fn accept(listener: TcpListener, shared: Shared, most: usize, tls: Option<TlsAcceptor>) {
    let places = Arc::new(Semaphore::new(most));
    let n_refused = Arc::clone(&shared.n_refused);
    let service = TowerToHyperService::new(router(shared));
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // Too many open files, for instance: it passes.
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else {
            add(&n_refused, 1);
            continue;
        };
        let (service, tls, n_refused) = (service.clone(), tls.clone(), Arc::clone(&n_refused));
        tokio::spawn(async move {
            let _place = place;
            let _ = stream.set_nodelay(true);
            match tls {
                None => converse(stream, service).await,
                Some(tls) => match timeout(HEAD_TIME, shake_hands(stream, &tls)).await {
                    Ok(Some(stream)) => converse(stream, service).await,
                    _ => add(&n_refused, 1),
                },
            }
        });
    }
}

/// A handshake; `None` of a client that speaks no TLS, or does not like the certificate.
async fn shake_hands(mut stream: TcpStream, tls: &TlsAcceptor) -> Option<TlsStream<TcpStream>> {
    let mut first = [0];
    if stream.peek(&mut first).await.ok()? == 1 && first[0] != HANDSHAKE {
        // Whoever forgot the s of https reads why.
        let _ = stream.write_all(NOT_TLS).await;
        let _ = stream.shutdown().await;
        return None;
    }
    tls.accept(stream).await.ok()
}

async fn converse<S>(stream: S, service: TowerToHyperService<Router>)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEAD_TIME).max_buf_size(HEAD_BYTES).max_headers(HEADERS);
    // A client that breaks off is its own affair.
    let _ = http.serve_connection(TokioIo::new(stream), service).with_upgrades().await;
}
