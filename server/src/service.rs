//! The service behind both fronts: finds the pack, checks the request, has it served, and makes the answer.

mod describe;
mod generate;
mod scenes;
mod sessions;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use troupe_proto::v1;

use crate::api::ApiError;
use crate::batch::{Batcher, Order, PackMetrics, Served};
use crate::inbetween::{Plan, RequestLimits, finish, prepare};
use crate::session::{SessionMetrics, Sessions};
use crate::telemetry::Telemetry;
use crate::world::Store;
use describe::describe;
pub use generate::Generation;
use troupe_character::live::load::PlanLoad;
use troupe_character::style::StyleTable;
use troupe_engine::pack::Pack;
use troupe_motion::model::{Capability, Output, Rig};

/// Requests of up to this many characters are checked and finished on the task that received them; larger ones go to the
/// pool for blocking work, so that they do not hold up other connections.
const INLINE_CHARACTERS: usize = 4;

/// When the answer to a request should be there, from its arrival on. It is the same for all, so they are served in the
/// order of their arrival; beside the plans of live characters their class's handicap comes on top.
const REQUEST_TARGET: Duration = Duration::from_millis(100);

/// A pack and the way to its engine.
#[derive(Debug)]
pub struct LoadedPack {
    /// The pack.
    pub pack: Arc<Pack>,
    /// The way to its engine.
    pub batcher: Batcher,
    /// The engine's name.
    pub engine: &'static str,
    /// Its locomotion styles.
    pub styles: StyleTable,
    /// Its metrics.
    pub metrics: PackMetrics,
    /// The metrics of its sessions.
    pub sessions: SessionMetrics,
    /// How busy it is with their plans.
    pub load: PlanLoad,
}

impl LoadedPack {
    /// Checks that the pack can do what the request asks for; `field` names the pack in the request.
    ///
    /// # Errors
    /// [`ApiError::CannotDo`].
    pub fn require(&self, capability: Capability, field: &str) -> Result<(), ApiError> {
        let capabilities = self.pack.manifest.capabilities;
        match capabilities.has(capability) {
            true => Ok(()),
            false => Err(ApiError::CannotDo {
                pack: self.pack.name().to_owned(),
                wanted: capability,
                field: field.to_owned(),
                can: capabilities.list().collect(),
            }),
        }
    }
}

/// All packs of a server.
#[derive(Debug, Clone)]
pub struct PackTable {
    packs: BTreeMap<String, Arc<LoadedPack>>,
    default: String,
}

impl PackTable {
    /// A table whose default is `default`, one of the names of `packs`.
    pub fn new(packs: Vec<LoadedPack>, default: String) -> Self {
        let packs = packs
            .into_iter()
            .map(|loaded| (loaded.pack.name().to_owned(), Arc::new(loaded)))
            .collect();
        Self { packs, default }
    }

    /// The pack of that name, which the request gave in `field`; the default where it is empty.
    ///
    /// # Errors
    /// [`ApiError::UnknownPack`].
    pub fn find(&self, field: impl ToString, name: &str) -> Result<&Arc<LoadedPack>, ApiError> {
        let wanted = if name.is_empty() { &self.default } else { name };
        self.packs.get(wanted).ok_or_else(|| ApiError::UnknownPack {
            name: wanted.chars().take(64).collect(),
            field: field.to_string(),
            loaded: self.packs.keys().cloned().collect(),
        })
    }

    fn describe(&self, loaded: &LoadedPack) -> v1::Pack {
        describe(&loaded.pack, loaded.pack.name() == self.default, loaded.engine)
    }
}

/// The state that all requests share. It starts without packs and serves once [`Service::open`] has given it some.
#[derive(Debug)]
pub struct Service {
    /// Packs, and the scenes and definitions that go with them.
    opened: OnceLock<(PackTable, Arc<Store>)>,
    draining: AtomicBool,
    limits: RequestLimits,
    timeout: Duration,
    sessions: Arc<Sessions>,
    telemetry: Telemetry,
}

impl Service {
    /// A service that is not ready yet. Its callers do not wait for an answer longer than `timeout`.
    pub fn new(limits: RequestLimits, timeout: Duration, sessions: Sessions, telemetry: Telemetry) -> Self {
        Self {
            opened: OnceLock::new(),
            draining: AtomicBool::new(false),
            limits,
            timeout,
            sessions: Arc::new(sessions),
            telemetry,
        }
    }

    /// Starts to serve. Only the first call counts.
    pub fn open(&self, packs: PackTable, store: Store) {
        if self.opened.set((packs, Arc::new(store))).is_err() {
            tracing::warn!("the service is open already");
        }
    }

    /// Reports "not ready" from now on, so that no new work is sent here. Requests are still served; streams end.
    pub fn drain(&self) {
        self.draining.store(true, Ordering::Relaxed);
        self.sessions.drain();
    }

    /// The server's metrics.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }

    /// Whether the server should be sent requests.
    ///
    /// # Errors
    /// [`ApiError::Unavailable`] while it starts or drains, or where an engine has stopped.
    pub fn ready(&self) -> Result<(), ApiError> {
        if self.draining.load(Ordering::Relaxed) {
            return Err(ApiError::Unavailable("shutting down"));
        }
        match self
            .table()?
            .packs
            .values()
            .all(|loaded| loaded.batcher.is_running())
        {
            true => Ok(()),
            false => Err(ApiError::Unavailable("broken: an engine has stopped")),
        }
    }

    fn opened(&self) -> Result<&(PackTable, Arc<Store>), ApiError> {
        self.opened
            .get()
            .ok_or(ApiError::Unavailable("starting: its packs are not loaded yet"))
    }

    fn table(&self) -> Result<&PackTable, ApiError> {
        self.opened().map(|(packs, _)| packs)
    }

    /// The scenes and object definitions.
    ///
    /// # Errors
    /// [`ApiError::Unavailable`] while the server starts.
    pub fn store(&self) -> Result<&Arc<Store>, ApiError> {
        self.opened().map(|(_, store)| store)
    }

    /// `troupe.v1.Motion/ListPacks`.
    ///
    /// # Errors
    /// [`ApiError::Unavailable`] while the server starts.
    pub fn list_packs(&self) -> Result<v1::ListPacksResponse, ApiError> {
        let table = self.table()?;
        Ok(v1::ListPacksResponse {
            packs: table.packs.values().map(|pack| table.describe(pack)).collect(),
        })
    }

    /// `troupe.v1.Motion/GetPack`.
    ///
    /// # Errors
    /// [`ApiError::UnknownPack`], or [`ApiError::Unavailable`] while the server starts.
    pub fn get_pack(&self, name: &str) -> Result<v1::Pack, ApiError> {
        let table = self.table()?;
        Ok(table.describe(table.find("name", name)?))
    }

    /// `troupe.v1.Motion/InBetween`.
    ///
    /// # Errors
    /// [`ApiError`], for the whole request.
    pub async fn in_between(&self, request: v1::InBetweenRequest) -> Result<v1::InBetweenResponse, ApiError> {
        let arrived = Instant::now();
        let loaded = self.table()?.find("pack", &request.pack)?;
        loaded.require(Capability::Inbetween, "pack")?;
        let characters = request.characters.len();
        // One that is too large is told so, and not to come back.
        let most = self.limits.max_characters;
        if let Some(error) = loaded.batcher.refuse(characters.min(most)) {
            return Err(error.into());
        }
        let order = Order::request(arrived + REQUEST_TARGET).expiring(arrived + self.timeout);
        let (rig, limits) = (loaded.pack.rig.clone(), self.limits);
        let (items, plans) = offload(characters, INLINE_CHARACTERS, move || {
            prepare(&request, &rig, limits)
        })
        .await??;

        let served = loaded
            .batcher
            .submit(items.into_iter().map(Into::into).collect(), order)
            .await?;

        let mut timing = timing(&served);
        let copied = served.scatter;
        let scattering = Instant::now();
        let rig = loaded.pack.rig.clone();
        let results = offload(characters, INLINE_CHARACTERS, move || {
            finish_all(&served, &plans, &rig)
        })
        .await??;
        let made = scattering.elapsed();
        let frames: u32 = results
            .iter()
            .filter_map(|result| result.frames.as_ref())
            .map(|frames| frames.frame_count)
            .sum();
        loaded.metrics.scattered(made, frames as usize);
        timing.scatter_us = (copied + made).as_micros() as u64;
        timing.total_us = arrived.elapsed().as_micros() as u64;
        Ok(v1::InBetweenResponse {
            pack: loaded.pack.name().to_owned(),
            pack_version: loaded.pack.manifest.version.clone(),
            characters: results,
            timing: Some(timing),
        })
    }
}

fn finish_all(served: &Served, plans: &[Plan], rig: &Rig) -> Result<Vec<v1::CharacterResult>, ApiError> {
    let motions = served.outputs.iter().filter_map(|output| match output {
        Output::Motion(motion) => Some(motion),
        Output::Text(_) => None,
    });
    let pairs = motions.zip(plans);
    pairs
        .map(|(motion, plan)| finish(motion, plan, rig).map_err(ApiError::from))
        .collect()
}

fn timing(served: &Served) -> v1::Timing {
    v1::Timing {
        queue_us: served.queued.as_micros() as u64,
        assemble_us: served.assemble.as_micros() as u64,
        inference_us: served.inference.as_micros() as u64,
        batch_size: served.batch_size as u32,
        ..v1::Timing::default()
    }
}

/// Runs CPU work for a request: here where it is for at most `inline` characters, on the blocking pool where it is more.
pub(crate) async fn offload<T: Send + 'static>(
    characters: usize,
    inline: usize,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ApiError> {
    if characters <= inline {
        return Ok(work());
    }
    tokio::task::spawn_blocking(work)
        .await
        .map_err(|_| ApiError::Internal("a worker stopped before it was done".to_owned()))
}
