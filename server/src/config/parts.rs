//! What the parts of the server get of its configuration.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use super::Config;
use crate::api::{ApiLimits, Guard};
use crate::clients::{Share, Shares};
use crate::inbetween::RequestLimits;
use crate::traces::TraceOptions;
use troupe_batch::scheduler::Limits;
use troupe_engine::machine::{Machine, available_cores};
use troupe_engine::onnx::{Batching, Growth, NetworkPool, Runtime};
use troupe_engine::{CheckCache, EngineError, Selector, Workers};
use troupe_live::session::{SessionLimits, TenantOptions};
use troupe_live::world::Folders;

/// Shortest time for which InBetween calls stay behind live plans.
const MIN_AGEING: Duration = Duration::from_secs(2);
/// One of so many places of a batch goes to a call first.
const CALL_SHARE: usize = 8;

/// Memory for requests and answers on their way, where nothing is said.
const LEAST_TRANSFER_BYTES: u64 = 256 << 20;
const MOST_TRANSFER_BYTES: u64 = 2048 << 20;

/// Memory for networks of each pack, where nothing is said.
const NETWORK_BYTES: u64 = 180 << 20;

impl Config {
    /// Most characters in one batch of an engine.
    pub fn max_batch_of(&self, batching: Batching) -> usize {
        match self.max_batch {
            0 => batching.usual_most,
            most => most,
        }
    }

    /// The scheduler's limits, for one worker.
    pub fn batch_limits(&self, max_batch: usize) -> Limits {
        Limits {
            workers: 1,
            max_batch,
            call_rows: 0,
            max_batch_time: Duration::from_millis(self.max_batch_ms),
            max_queued: self.max_queued_characters,
            max_live: self.max_sessions,
            max_wait: Duration::from_millis(self.max_queue_ms),
            ageing: self.ageing(),
            call_share: CALL_SHARE,
        }
    }

    /// Where traces go. None where there are none.
    pub fn trace_options(&self) -> Option<TraceOptions> {
        self.otlp_endpoint.clone().map(|endpoint| TraceOptions {
            endpoint,
            sample_ratio: self.trace_sample_ratio,
        })
    }

    /// How long an idle worker spins before it parks.
    pub fn worker_spin(&self) -> Duration {
        Duration::from_micros(self.worker_spin_us)
    }

    /// What InBetween calls wait for before they go in front of live plans: longer than any
    /// admitted one should have to wait, so that a flood of calls does not take live characters'
    /// turns, and yet calls are not starved by characters.
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
            write_timeout: Duration::from_millis(self.write_timeout_ms),
            message_bytes: self.max_message_bytes,
            characters: self.max_characters_per_request,
            sessions: self.max_sessions_per_request,
        }
    }

    /// What a client may have at a time, the clients of an address, and all.
    pub fn shares(&self) -> Shares {
        let bytes = match self.transfer_memory_mib {
            0 => (Machine::detect().memory_bytes / 8).clamp(LEAST_TRANSFER_BYTES, MOST_TRANSFER_BYTES),
            mib => mib << 20,
        };
        let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
        let share = |bytes, streams| Share { bytes, streams };
        let streams = self.max_streams_per_client;
        Shares {
            client: share(bytes / 4, streams),
            address: share(bytes / 2, streams.saturating_mul(2)),
            // `max_streams` is the limit of all.
            all: share(bytes, usize::MAX),
        }
    }

    /// Which web pages and names a server that listens on `address` answers.
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
            max_characters: self.max_characters_per_request,
        }
    }

    /// The limits of sessions and streams.
    pub fn session_limits(&self) -> SessionLimits {
        SessionLimits {
            sessions: self.max_sessions,
            per_request: self.max_sessions_per_request,
            per_stream: self.max_sessions_per_stream,
            streams: self.max_streams,
            ttl_ms: self.session_ttl_ms,
            stall_timeout: Duration::from_millis(self.drive_stall_timeout_ms),
        }
    }

    /// The folders of scenes and object definitions.
    pub fn world_folders(&self) -> Folders {
        Folders {
            scenes: self.scenes.clone().or_else(|| self.in_store("scenes")),
            objects: self.objects.clone().or_else(|| self.in_store("objects")),
        }
    }

    /// The folder of styles beside the packs' own.
    pub fn styles_folder(&self) -> Option<PathBuf> {
        self.styles.clone().or_else(|| self.in_store("styles"))
    }

    fn in_store(&self, name: &str) -> Option<PathBuf> {
        self.store_folder().map(|folder| folder.join(name))
    }

    /// What tenants have, and how many there may be.
    pub fn tenant_options(&self) -> TenantOptions {
        TenantOptions {
            folder: self.in_store("tenants"),
            most: self.max_tenants,
        }
    }

    /// The folder of what outlives the server. The usual one only where it is there, or can be
    /// made.
    pub fn store_folder(&self) -> Option<PathBuf> {
        let port = self.listen.port();
        let usual = || {
            let states = dirs::state_dir().or_else(dirs::data_local_dir)?;
            let folder = states.join("troupe").join(port.to_string());
            std::fs::create_dir_all(&folder).ok().map(|()| folder)
        };
        match &self.store {
            Some(folder) => Some(folder.clone()).filter(|folder| !folder.as_os_str().is_empty()),
            None if port == 0 => None,
            None => usual(),
        }
    }

    /// How often sessions are written to the store.
    pub fn snapshot_interval(&self) -> Duration {
        Duration::from_millis(self.snapshot_interval_ms)
    }

    /// The workers of each pack, on the cores that this process may use: container limits count,
    /// the host does not.
    pub fn workers(&self) -> Workers {
        Workers::plan(self.workers, self.threads, available_cores())
    }

    /// Most memory of the networks of so many packs, bytes.
    pub(super) fn network_bytes(&self, packs: usize) -> u64 {
        match self.network_memory_mib {
            0 => (packs as u64 * NETWORK_BYTES).min(Machine::detect().memory_bytes / 2),
            mib => mib << 20,
        }
    }

    /// [`Config::memory_limit_mib`] in bytes; 0 for none.
    pub fn memory_limit_bytes(&self) -> u64 {
        self.memory_limit_mib << 20
    }

    /// What chooses the engine of each of `packs` packs.
    ///
    /// # Errors
    /// [`EngineError::Library`] where the library does not load.
    pub fn selector(&self, packs: usize) -> Result<Selector, EngineError> {
        let machine = Machine::detect();
        Ok(Selector {
            runtime: Runtime::new(self.onnx_runtime.as_deref())?,
            machine,
            choice: self.engine,
            accuracy_check: self.accuracy_check,
            workers: self.workers(),
            packs,
            spin: self.spin,
            pool: NetworkPool::new(self.network_bytes(packs)),
            growth: Growth::Background,
            cache: CheckCache::new(self.cache_folder()),
        })
    }

    /// The folder of what is kept for the next start. None where nothing is.
    fn cache_folder(&self) -> Option<PathBuf> {
        let usual = || dirs::cache_dir().map(|folder| folder.join("troupe"));
        let folder = self.cache.clone().or_else(usual);
        folder.filter(|folder| !folder.as_os_str().is_empty())
    }

    /// [`Config::request_timeout_ms`] as a duration.
    pub fn request_timeout(&self) -> Duration {
        Duration::from_millis(self.request_timeout_ms)
    }

    /// [`Config::drain_delay_ms`] as a duration.
    pub fn drain_delay(&self) -> Duration {
        Duration::from_millis(self.drain_delay_ms)
    }

    /// [`Config::drain_timeout_ms`] as a duration.
    pub fn drain_timeout(&self) -> Duration {
        Duration::from_millis(self.drain_timeout_ms)
    }

    /// [`Config::idle_timeout_ms`] as a duration.
    pub fn idle_timeout(&self) -> Duration {
        Duration::from_millis(self.idle_timeout_ms)
    }

    /// [`Config::keepalive_ms`] as a duration.
    pub fn keepalive(&self) -> Duration {
        Duration::from_millis(self.keepalive_ms)
    }
}
