//! The configuration of each part of the server, derived from the options.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use super::{Config, WithoutKeys};
use crate::api::ApiLimits;
use crate::traces::TraceOptions;
use troupe_batch::scheduler::Limits;
use troupe_edge::clients::{Share, Shares};
use troupe_edge::guard::Guard;
use troupe_edge::port::{ConnectionLimits, TlsFiles};
use troupe_engine::gpu::GpuOptions;
use troupe_engine::machine::{Machine, available_cores};
use troupe_engine::onnx::{Batching, Growth, NetworkPool, Runtime};
use troupe_engine::{CheckCache, EngineError, Selector, Workers};
use troupe_live::records::RecordsError;
use troupe_live::records::shared::Place;
use troupe_live::session::{SessionLimits, TenantOptions};
use troupe_live::world::Folders;
use troupe_service::inbetween::RequestLimits;

/// Shortest time for which InBetween calls wait behind live plans.
const MIN_AGEING: Duration = Duration::from_secs(2);
/// One in this many places of a batch goes to a call first.
const CALL_SHARE: usize = 8;

/// Batches that may wait for each worker of a pack.
const QUEUED_BATCHES: usize = 16;
/// Characters that may wait for a pack, however few its workers are.
const LEAST_QUEUED: usize = 1024;
/// Characters of a batch for the length of the queue, if
/// [`Options::max_batch`](super::Options::max_batch) is 0.
const USUAL_BATCH: usize = 32;

/// Longest time of a batch while no live character plans, if calls may wait for ever. Eight plans
/// of networks of NVIDIA's size take 0.2 to 0.3 s of a core in bf16, about 0.6 of the time that
/// they take one by one.
const UNLIMITED_BATCH: Duration = Duration::from_millis(500);

/// Smallest memory for requests and answers in transfer if the option is 0, bytes.
const LEAST_TRANSFER_BYTES: u64 = 256 << 20;
const MOST_TRANSFER_BYTES: u64 = 2048 << 20;

/// Memory for the networks of one pack if the option is 0, bytes.
const NETWORK_BYTES: u64 = 180 << 20;

impl Config {
    /// Most characters in one batch of an engine.
    pub fn max_batch_of(&self, batching: Batching) -> usize {
        match self.max_batch {
            0 => batching.usual_most,
            most => most,
        }
    }

    /// Most characters of InBetween calls that may wait for a pack.
    pub fn max_queued_characters(&self) -> usize {
        let batch = match self.max_batch {
            0 => USUAL_BATCH,
            most => most,
        };
        let waiting = QUEUED_BATCHES * batch * self.workers().count;
        self.fixed
            .max_queued_characters
            .unwrap_or(waiting.max(LEAST_QUEUED))
    }

    /// Longest time of a batch while no live character plans: as long as a call may wait, because
    /// the last one waits for it, too.
    fn calls_batch_time(&self) -> Duration {
        let longest = self.fixed.max_batch_time;
        match (longest.is_zero(), self.max_queue_ms) {
            (true, _) => Duration::ZERO,
            (false, 0) => UNLIMITED_BATCH.max(longest),
            (false, ms) => Duration::from_millis(ms).max(longest),
        }
    }

    /// The scheduler's limits, for one worker.
    pub fn batch_limits(&self, max_batch: usize) -> Limits {
        Limits {
            workers: 1,
            max_batch,
            call_rows: 0,
            max_batch_time: self.fixed.max_batch_time,
            calls_batch_time: self.calls_batch_time(),
            shared_batch_time: self.fixed.shared_batch_time,
            max_queued: self.max_queued_characters(),
            max_live: self.max_sessions,
            max_wait: Duration::from_millis(self.max_queue_ms),
            ageing: self.ageing(),
            call_share: CALL_SHARE,
        }
    }

    /// The collector of traces and their share. None: no traces.
    pub fn trace_options(&self) -> Option<TraceOptions> {
        self.otlp_endpoint.clone().map(|endpoint| TraceOptions {
            endpoint,
            sample_ratio: self.trace_sample_ratio,
        })
    }

    /// Time after which waiting InBetween calls go ahead of live plans. It is longer than an
    /// admitted call should wait, so a flood of calls does not delay live characters. It is finite,
    /// so live characters do not starve calls.
    fn ageing(&self) -> Duration {
        let longest_wait_ms = match self.max_queue_ms {
            0 => self.request_timeout_ms / 4,
            limit => limit,
        };
        Duration::from_millis(longest_wait_ms * 2).max(MIN_AGEING)
    }

    /// The limits of all requests.
    pub fn api_limits(&self) -> ApiLimits {
        ApiLimits {
            timeout: self.request_timeout(),
            write_timeout: self.fixed.reader_timeout,
            message_bytes: self.fixed.max_message_bytes,
            characters: self.fixed.max_characters_per_request,
            sessions: self.fixed.max_sessions_per_request,
        }
    }

    /// Whether callers need a key or token.
    fn asks_for_keys(&self) -> bool {
        self.keys.is_some() || self.jwks.is_some() || self.without_keys == WithoutKeys::OneTimeKey
    }

    /// The shares that one client, all clients of an address, and all clients may take. With keys
    /// a key gets a quarter of memory and streams, and an address half. Without keys an address
    /// gets [`Fixed::keyless_share`](super::Fixed::keyless_share) of these and of sessions.
    pub fn shares(&self) -> Shares {
        let bytes = match self.transfer_memory_mib {
            0 => (Machine::detect().memory_bytes / 8).clamp(LEAST_TRANSFER_BYTES, MOST_TRANSFER_BYTES),
            mib => mib << 20,
        };
        let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
        let share = |bytes, streams, sessions| Share {
            bytes,
            streams,
            sessions,
        };
        let streams_of = |part: usize| {
            let streams = self.fixed.max_streams_per_client;
            streams.unwrap_or((self.max_streams / part).max(1))
        };
        // The limits of sessions count the streams and sessions of all clients.
        let all = share(bytes, usize::MAX, usize::MAX);
        if self.asks_for_keys() {
            let streams = streams_of(4);
            return Shares {
                client: share(bytes / 4, streams, usize::MAX),
                address: share(bytes / 2, streams.saturating_mul(2), usize::MAX),
                all,
            };
        }
        let part = self.fixed.keyless_share;
        let sessions = match part {
            1 => usize::MAX,
            part => (self.max_sessions / part).max(1),
        };
        let address = share(bytes / part, streams_of(part), sessions);
        Shares {
            client: address,
            address,
            all,
        }
    }

    /// Most connections of one address: half of `all`, like its share of streams and memory.
    pub fn connections_of_address(&self, all: usize) -> usize {
        self.fixed.max_connections_per_address.unwrap_or((all / 2).max(1))
    }

    /// Timeouts of connections, and the most calls on one connection.
    pub fn connection_limits(&self) -> ConnectionLimits {
        ConnectionLimits {
            request: self.request_timeout(),
            idle: self.fixed.idle_timeout,
            keepalive: self.fixed.keepalive,
            drain: self.drain_timeout(),
            max_calls: self.fixed.max_calls_per_connection,
        }
    }

    /// The files of TLS. None: the server speaks no TLS.
    pub fn tls_files(&self) -> Option<TlsFiles> {
        Some(TlsFiles {
            certificate: self.tls_certificate.clone()?,
            key: self.tls_key.clone()?,
            client_ca: self.tls_client_ca.clone(),
        })
    }

    /// The web pages and host names that a server on `address` answers.
    pub fn guard(&self, address: SocketAddr) -> Guard {
        Guard {
            origins: self.allowed_origins.clone(),
            hosts: self.allowed_hosts.clone(),
            local: address.ip().to_canonical().is_loopback(),
        }
    }

    /// The limits of an InBetween request.
    pub fn request_limits(&self) -> RequestLimits {
        RequestLimits {
            max_characters: self.fixed.max_characters_per_request,
        }
    }

    /// The limits of sessions and streams.
    pub fn session_limits(&self) -> SessionLimits {
        SessionLimits {
            sessions: self.max_sessions,
            per_request: self.fixed.max_sessions_per_request,
            per_stream: self.fixed.max_sessions_per_stream,
            streams: self.max_streams,
            ttl_ms: self.fixed.session_ttl_ms,
            stall_timeout: self.fixed.reader_timeout,
        }
    }

    /// The folders of scenes, object definitions and skeletons.
    pub fn world_folders(&self) -> Folders {
        Folders {
            scenes: self.scenes.clone().or_else(|| self.in_store("scenes")),
            objects: self.objects.clone().or_else(|| self.in_store("objects")),
            skeletons: self.in_store("skeletons"),
        }
    }

    /// The folder of styles beside the packs' own.
    pub fn styles_folder(&self) -> Option<PathBuf> {
        self.styles.clone().or_else(|| self.in_store("styles"))
    }

    fn in_store(&self, name: &str) -> Option<PathBuf> {
        self.store_folder().map(|folder| folder.join(name))
    }

    /// The folder of tenants and their number.
    pub fn tenant_options(&self) -> TenantOptions {
        TenantOptions {
            folder: self.in_store("tenants"),
            most: self.fixed.max_tenants,
        }
    }

    /// The folder of everything that outlives the server. The default folder is used only if it
    /// exists or can be made.
    pub fn store_folder(&self) -> Option<PathBuf> {
        let port = self.listen.port();
        let usual = || {
            let states = dirs::state_dir().or_else(dirs::data_local_dir)?;
            let folder = states.join("troupe").join(port.to_string());
            std::fs::create_dir_all(&folder).ok().map(|()| folder)
        };
        match &self.store {
            Some(_) if self.shared_store().is_some() => None,
            Some(folder) => Some(folder.clone()).filter(|folder| !folder.as_os_str().is_empty()),
            None if port == 0 => None,
            None => usual(),
        }
    }

    /// The store that servers share. `None`: this server has its own, or none. An error means that
    /// its address cannot be read.
    pub fn shared_store(&self) -> Option<Result<Place, RecordsError>> {
        let text = self.store.as_ref()?.to_str()?;
        Place::is_one(text).then(|| text.parse())
    }

    /// The workers of each pack, on the cores that this process may use within its container's
    /// limits.
    pub fn workers(&self) -> Workers {
        Workers::plan(self.workers, self.threads, available_cores())
    }

    /// Memory limit for the networks of all packs, bytes.
    pub(super) fn network_bytes(&self, packs: usize) -> u64 {
        match self.network_memory_mib {
            0 => (packs as u64 * NETWORK_BYTES).min(Machine::detect().memory_bytes / 2),
            mib => mib << 20,
        }
    }

    /// Time between two looks at the folder of packs. None: the packs are not watched.
    pub fn watch_packs(&self) -> Option<Duration> {
        (self.watch_packs_s > 0).then(|| Duration::from_secs(self.watch_packs_s))
    }

    /// The option `memory_limit_mib` in bytes. 0: no limit.
    pub fn memory_limit_bytes(&self) -> u64 {
        self.memory_limit_mib << 20
    }

    /// The selector of an engine for each of `packs` packs.
    ///
    /// # Errors
    /// [`EngineError::Library`] if the library does not load.
    pub fn selector(&self, packs: usize) -> Result<Selector, EngineError> {
        let machine = Machine::detect();
        Ok(Selector {
            runtime: Runtime::new(None)?,
            machine,
            choice: self.engine,
            accuracy_check: self.accuracy_check,
            workers: self.workers(),
            packs,
            gpu: GpuOptions {
                device: self.gpu_device,
                memory_bytes: self.gpu_memory_mib << 20,
            },
            // Idle inference threads sleep. Spinning is a little faster on an otherwise idle CPU,
            // and slower on any other.
            spin: false,
            pool: NetworkPool::new(self.network_bytes(packs)),
            growth: Growth::Background,
            cache: CheckCache::new(self.cache_folder()),
        })
    }

    /// The folder for results that speed up the next start. None: nothing is kept.
    fn cache_folder(&self) -> Option<PathBuf> {
        let usual = || dirs::cache_dir().map(|folder| folder.join("troupe"));
        let folder = self.cache.clone().or_else(usual);
        folder.filter(|folder| !folder.as_os_str().is_empty())
    }

    /// The option `request_timeout_ms` as a duration.
    pub fn request_timeout(&self) -> Duration {
        Duration::from_millis(self.request_timeout_ms)
    }

    /// The option `drain_delay_ms` as a duration.
    pub fn drain_delay(&self) -> Duration {
        Duration::from_millis(self.drain_delay_ms)
    }

    /// The option `drain_timeout_ms` as a duration.
    pub fn drain_timeout(&self) -> Duration {
        Duration::from_millis(self.drain_timeout_ms)
    }
}
