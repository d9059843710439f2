//! The server of the page: takes connections on threads of its own, within limits on everything that is read.

use super::access::Access;
use super::hub::Hub;
use super::page_output::PageOutput;
use super::routes::{Shared, router};
use crate::board::{Board, add};
use crate::output::LiveOutput;
use boresight::{Error, ErrorKind, Result};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio::sync::Semaphore;

/// How long a client may take for the head of a request.
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
}

impl PageOptions {
    /// The usual limits.
    pub fn at(address: SocketAddr) -> Self {
        Self { address, names: Vec::new(), most_viewers: 64, most_connections: 256 }
    }
}

/// A page that is served until this is dropped.
pub struct Page {
    runtime: Option<Runtime>,
    hub: Arc<Hub>,
    address: SocketAddr,
    token: Option<String>,
}

impl Page {
    /// Listens.
    /// # Errors
    /// An address that is taken or not this machine's.
    pub fn serve(options: &PageOptions, board: Arc<Board>) -> Result<Self> {
        let failed = |e: std::io::Error| {
            Error::new(ErrorKind::Output, "cannot be listened on")
                .at(options.address)
                .because(e)
                .hint("choose another port, or 127.0.0.1:0 for a free one")
        };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("live-page")
            .enable_all()
            .build()
            .map_err(failed)?;
        let listener = runtime.block_on(TcpListener::bind(options.address)).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let access = Arc::new(Access::to(address, &options.names)?);
        let token = access.token().map(ToString::to_string);
        let hub = Arc::new(Hub::new(board));
        let shared = Shared { hub: Arc::clone(&hub), access, most_viewers: options.most_viewers };
        runtime.spawn(accept(listener, shared, options.most_connections));
        Ok(Self { runtime: Some(runtime), hub, address, token })
    }

    /// The address that is listened on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The token that is asked for, if one is.
    pub fn token(&self) -> Option<&str> {
        self.token.as_deref()
    }

    /// What feeds the page.
    /// # Errors
    /// A system without threads.
    pub fn output(&self) -> Result<Box<dyn LiveOutput>> {
        Ok(Box::new(PageOutput::start(Arc::clone(&self.hub))?))
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

async fn accept(listener: TcpListener, shared: Shared, most: usize) {
    let places = Arc::new(Semaphore::new(most));
    let board = Arc::clone(&shared.hub.board);
    let service = TowerToHyperService::new(router(shared));
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // Too many open files, for instance: it passes.
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else {
            add(&board.counts.requests_refused, 1);
            continue;
        };
        let service = service.clone();
        tokio::spawn(async move {
            let _place = place;
            let _ = stream.set_nodelay(true);
            let mut http = http1::Builder::new();
            http.timer(TokioTimer::new()).header_read_timeout(HEAD_TIME).max_buf_size(HEAD_BYTES).max_headers(HEADERS);
            // A client that breaks off is its own affair.
            let _ = http.serve_connection(TokioIo::new(stream), service).with_upgrades().await;
        });
    }
}
