//! Constants that no operator has to set.

use std::time::Duration;

/// Constants of a server, each with its reason. Tests change them, to reach limits and timeouts
/// quickly.
#[derive(Debug, Clone)]
pub struct Fixed {
    /// Time that an idle worker spins before it parks. A lone caller's next request then finds the
    /// core awake, which lowered its p50 by 11 %. The spinning worker yields to any other thread.
    pub worker_spin: Duration,
    /// Longest time of a batch, by the engine's measured speed, so that no plan of a live character
    /// waits long behind it: two frames. Zero: no limit.
    pub max_batch_time: Duration,
    /// Most of a batch for one client while another calls for little. Two clients with 256
    /// characters a call then do not delay a third client's single calls by more than this each.
    pub shared_batch_time: Duration,
    /// Most characters of InBetween calls that may wait for a pack. None: computed from the workers
    /// and [`max_batch`](super::Options::max_batch).
    pub max_queued_characters: Option<usize>,
    /// Most characters of a request. More would have no advantage, because batches are smaller.
    pub max_characters_per_request: usize,
    /// Most sessions of a request to create, resume or step sessions. Clients split larger crowds.
    pub max_sessions_per_request: usize,
    /// Most sessions of a stream: a tick of 4096 is 0.7 MB in the compact form.
    pub max_sessions_per_stream: usize,
    /// Time between two writes of sessions to the store. A killed server loses the changes since
    /// the last write. A character costs 0.15 ms of a core per second.
    pub snapshot_interval: Duration,
    /// Longest time in which a worker ends its running step when the server stops. A step takes
    /// milliseconds, on a slow machine seconds.
    pub last_step: Duration,
    /// Most connections of one address. None: half of all.
    pub max_connections_per_address: Option<usize>,
    /// Without keys, one address gets one in this many of all sessions and streams and of the
    /// memory in transfer. Eight addresses must then act together to fill a server. By default one
    /// gets 2,048 sessions and 128 streams, more characters than two cores can drive.
    pub keyless_share: usize,
    /// Most streams of one client. None: a share of all.
    pub max_streams_per_client: Option<usize>,
    /// Most tenants. Each keeps its folders and tables in memory once it has called.
    pub max_tenants: usize,
    /// Time to live of a session that names none, milliseconds. A client that sends nothing for a
    /// minute has most likely gone.
    pub session_ttl_ms: u32,
    /// Longest time in which a reader takes no bytes of an answer or a stream. Then the server
    /// drops it and frees its memory.
    pub reader_timeout: Duration,
    /// Most calls and streams at a time on one HTTP/2 connection; further ones wait in the client.
    /// A game server may have one connection for all its players.
    pub max_calls_per_connection: u32,
    /// Silence after which the server pings a connection. Routers forget connections that are
    /// silent for a minute or so.
    pub keepalive: Duration,
    /// Time without a call after which a connection is closed. Open streams are calls. Load
    /// balancers keep idle connections for a minute or so, and must be the first to close them.
    pub idle_timeout: Duration,
    /// How long a connection keeps its place without a call if others want it. A client that
    /// connects and then asks needs a fraction of that, and one that has asked connects again.
    pub spare_idle: Duration,
    /// Most bytes of a request, as protobuf or as JSON: twice the largest scene as text.
    pub max_message_bytes: usize,
}

impl Default for Fixed {
    fn default() -> Self {
        Self {
            worker_spin: Duration::from_micros(800),
            max_batch_time: Duration::from_millis(66),
            shared_batch_time: Duration::from_millis(8),
            max_queued_characters: None,
            max_characters_per_request: 256,
            max_sessions_per_request: 1024,
            max_sessions_per_stream: 4096,
            snapshot_interval: Duration::from_millis(250),
            last_step: Duration::from_secs(10),
            max_connections_per_address: None,
            keyless_share: 8,
            max_streams_per_client: None,
            max_tenants: 256,
            session_ttl_ms: 60_000,
            reader_timeout: Duration::from_secs(30),
            max_calls_per_connection: 1024,
            keepalive: Duration::from_secs(20),
            idle_timeout: Duration::from_secs(300),
            spare_idle: Duration::from_secs(2),
            max_message_bytes: 16 << 20,
        }
    }
}
