//! The service behind all transports: finds the pack, checks the request, has it served, and makes
//! the answer. [`inbetween`] does this for single requests, `troupe-live` for live characters.

mod carried;
mod describe;
mod error;
mod gap;
mod generate;
pub mod inbetween;
mod life;
mod metrics;
mod own;
mod pack;
mod scenes;
mod sessions;
mod streamed;
#[cfg(feature = "testing")]
mod testing;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use troupe_proto::v1;

use crate::inbetween::{
    Plan, RequestLimits, count_in_between, finish_judged, prepare, refuse, refuse_keyframes,
};
use life::Life;
use metrics::ServiceMetrics;
use own::{OwnSegment, take_in_between};
use pack::describe;
use troupe_base::offload::{WorkerStopped, offload};
use troupe_base::telemetry::{RequestContext, Telemetry};
use troupe_base::tenant::Tenant;
use troupe_base::turns::{ClientId, Turns};
use troupe_batch::{Batcher, Order, Served, SubmitError, trace_served};
use troupe_character::{Path, Size};
use troupe_engine::EngineError;
use troupe_live::packs::{LoadedPack, PackTable};
use troupe_live::records::{RecordStore, RecordsError};
use troupe_live::session::{
    Backlog, Keeper, LivePacks, SessionError, Sessions, Space, Spaces, TenantOptions,
};
use troupe_live::skeleton::Worn;
use troupe_live::world::Store;
use troupe_motion::feasibility::Judge;
use troupe_motion::model::{Capability, KeyframeTask, Output, Rig};

pub use describe::Description;
pub use error::ServiceError;
pub use generate::Generation;
pub use life::{LifeError, Loading, Offer, PackChange, Shelf, Stock, by_age};
pub use streamed::Streamed;

/// Most characters of a request that is checked and finished on its own task. Larger requests go to
/// the pool for blocking work, so that they do not delay other connections.
const INLINE_CHARACTERS: usize = 4;

/// Target time from a request's arrival to its answer. It is the same for all requests, so they are
/// served in the order of arrival. Compared with plans of live characters, their class offset is
/// added.
const REQUEST_TARGET: Duration = Duration::from_millis(100);

/// The service of one tenant. It starts without packs, and serves after [`Service::open`] has
/// supplied them.
#[derive(Debug)]
pub struct Service {
    common: Arc<Common>,
    /// The tenant's packs, sessions, scenes and definitions. None for callers without a tenant.
    space: Option<Arc<Space>>,
}

/// State that all tenants share.
#[derive(Debug)]
struct Common {
    /// Packs, with the sessions, scenes and definitions that use them.
    spaces: OnceLock<Arc<Spaces>>,
    /// How far the store is behind. Empty without a store.
    backlog: OnceLock<Arc<Backlog>>,
    draining: AtomicBool,
    limits: RequestLimits,
    timeout: Duration,
    /// Sessions of callers without a tenant.
    sessions: Arc<Sessions>,
    metrics: ServiceMetrics,
    /// Packs that come and go while the server runs.
    life: Life,
    telemetry: Telemetry,
}

impl Service {
    /// A service that is not ready yet. An answer takes at most `timeout`.
    pub fn new(limits: RequestLimits, timeout: Duration, sessions: Sessions, telemetry: Telemetry) -> Self {
        Self {
            common: Arc::new(Common {
                spaces: OnceLock::new(),
                backlog: OnceLock::new(),
                draining: AtomicBool::new(false),
                limits,
                timeout,
                sessions: Arc::new(sessions),
                metrics: ServiceMetrics::new(&telemetry),
                life: Life::new(&telemetry),
                telemetry,
            }),
            space: None,
        }
    }

    /// Starts to serve, with the sessions of `records`. Returns the keeper that saves sessions from
    /// now on. Only the first call counts. This blocks.
    ///
    /// # Errors
    /// [`RecordsError`] if the records cannot be read.
    pub fn open(
        &self,
        packs: PackTable,
        store: Store,
        tenants: TenantOptions,
        records: Option<Box<dyn RecordStore>>,
    ) -> Result<Option<Keeper>, RecordsError> {
        let Common {
            sessions, telemetry, ..
        } = &*self.common;
        let packs = LivePacks::new(packs, telemetry);
        let spaces = Arc::new(Spaces::new(packs, Arc::new(store), sessions.clone(), tenants));
        let keeper = |records| Keeper::new(&spaces, records, telemetry);
        let keeper = records.map(keeper).transpose()?;
        if let Some(keeper) = &keeper {
            self.common.backlog.get_or_init(|| keeper.backlog().clone());
        }
        if self.common.spaces.set(spaces).is_err() {
            tracing::warn!("the service is open already");
        }
        Ok(keeper)
    }

    /// The service of `tenant`. The first call reads the tenant's files.
    ///
    /// # Errors
    /// [`ServiceError::Starting`] and [`ServiceError::Space`].
    pub async fn of(self: &Arc<Self>, tenant: Tenant) -> Result<Arc<Self>, ServiceError> {
        if tenant.is_none() {
            return Ok(self.clone());
        }
        let spaces = self.common.spaces.get().ok_or(ServiceError::Starting)?.clone();
        let space = match spaces.known(&tenant) {
            Some(space) => space,
            None => tokio::task::spawn_blocking(move || spaces.of(&tenant))
                .await
                .map_err(|_| WorkerStopped)??,
        };
        Ok(Arc::new(Self {
            common: self.common.clone(),
            space: Some(space),
        }))
    }

    /// Reports "not ready" from now on, so that clients send new work elsewhere. Requests are still
    /// served.
    pub fn announce_stop(&self) {
        self.common.draining.store(true, Ordering::Relaxed);
    }

    /// [`announce_stop`](Self::announce_stop), and ends streams. Requests are still served.
    pub fn drain(&self) {
        self.announce_stop();
        self.common.sessions.drain();
    }

    /// The server's metrics.
    pub fn telemetry(&self) -> &Telemetry {
        &self.common.telemetry
    }

    /// Updates the metrics that no event updates. Call it every few seconds, and before metrics are
    /// read.
    pub fn look(&self) {
        if let Some(backlog) = self.common.backlog.get() {
            backlog.look();
        }
        self.sweep_packs();
        self.common
            .metrics
            .look(self.ready().is_ok(), self.common.spaces.get());
    }

    /// Whether the server takes requests.
    ///
    /// # Errors
    /// [`ServiceError`] while it starts or drains, if an engine has stopped, or if the store is too
    /// far behind.
    pub fn ready(&self) -> Result<(), ServiceError> {
        if self.common.draining.load(Ordering::Relaxed) {
            return Err(SessionError::ShuttingDown.into());
        }
        if !self.table()?.all().all(|loaded| loaded.batcher.is_running()) {
            return Err(SubmitError::Engine(EngineError::Stopped).into());
        }
        match self.common.backlog.get() {
            Some(backlog) if !backlog.is_shared() => Ok(backlog.check()?),
            _ => Ok(()),
        }
    }

    /// Ends the workers of all packs, and waits for their running steps until `deadline`. Answers
    /// whether all have ended, and no pack is being loaded. This blocks.
    pub fn end_workers(&self, deadline: Instant) -> bool {
        let Some(spaces) = self.common.spaces.get() else {
            return true;
        };
        let table = spaces.common().packs.table();
        let batchers = || table.all().map(|loaded| &loaded.batcher);
        batchers().for_each(Batcher::stop);
        self.common.life.stop();
        let ended = batchers().all(|batcher| batcher.join(deadline));
        ended && self.common.life.join(deadline) && self.common.life.is_quiet()
    }

    /// The tenant's packs, sessions, scenes and definitions.
    ///
    /// # Errors
    /// [`ServiceError::Starting`] while the server starts.
    pub fn space(&self) -> Result<&Arc<Space>, ServiceError> {
        match (&self.space, self.common.spaces.get()) {
            (Some(space), _) => Ok(space),
            (None, Some(spaces)) => Ok(spaces.common()),
            (None, None) => Err(ServiceError::Starting),
        }
    }

    /// The place in the queue of the current caller's request, which arrived at `arrived`.
    pub fn order(&self, arrived: Instant) -> Order {
        streamed::order(arrived, self.common.timeout, Turns::current().client())
    }

    /// Most characters of a request.
    pub fn max_characters(&self) -> usize {
        self.common.limits.max_characters
    }

    /// The packs as they are now.
    ///
    /// # Errors
    /// [`ServiceError::Starting`] while the server starts.
    pub fn table(&self) -> Result<Arc<PackTable>, ServiceError> {
        self.space().map(|space| space.packs.table())
    }

    /// The pack that the field `pack` of a request names. It stays in memory for as long as the
    /// caller has it.
    fn pack(&self, name: &str) -> Result<Arc<LoadedPack>, ServiceError> {
        Ok(self.table()?.find("pack", name)?.clone())
    }

    /// The scenes and object definitions.
    ///
    /// # Errors
    /// [`ServiceError::Starting`] while the server starts.
    pub fn store(&self) -> Result<&Arc<Store>, ServiceError> {
        self.space().map(|space| &space.store)
    }

    /// `troupe.v1.Motion/ListPacks`.
    ///
    /// # Errors
    /// [`ServiceError::Starting`] while the server starts.
    pub fn list_packs(&self) -> Result<v1::ListPacksResponse, ServiceError> {
        let table = self.table()?;
        Ok(v1::ListPacksResponse {
            packs: table.all().map(|pack| summary(described(&table, pack))).collect(),
        })
    }

    /// `troupe.v1.Motion/GetPack`.
    ///
    /// # Errors
    /// [`ServiceError::UnknownPack`], or [`ServiceError::Starting`] while the server starts.
    pub fn get_pack(&self, name: &str) -> Result<v1::Pack, ServiceError> {
        let table = self.table()?;
        Ok(described(&table, table.find("name", name)?))
    }

    /// Why the queue of a pack would refuse a client's call with one character of usual work now.
    /// None: it has room, or there is no such pack.
    pub fn refusal_of(&self, pack: &str, client: ClientId) -> Option<ServiceError> {
        let loaded = self.pack(pack).ok()?;
        let order = streamed::order(Instant::now(), self.common.timeout, client);
        loaded.batcher.refuse(&order, 1).map(Into::into)
    }

    /// As [`Service::refusal_of`] of the default pack, for a call that may be for any pack: none if
    /// one has room.
    pub fn refusal_of_all(&self, client: ClientId) -> Option<ServiceError> {
        let order = streamed::order(Instant::now(), self.common.timeout, client);
        let table = self.table().ok()?;
        let mut packs = table.all();
        match packs.any(|loaded| loaded.batcher.has_room(&order, 1)) {
            true => None,
            false => self.refusal_of("", client),
        }
    }

    /// `troupe.v1.Motion/InBetween`.
    ///
    /// # Errors
    /// [`ServiceError`], for the whole request.
    pub async fn in_between(
        &self,
        request: v1::InBetweenRequest,
    ) -> Result<v1::InBetweenResponse, ServiceError> {
        let arrived = Instant::now();
        let loaded = &*self.pack(&request.pack)?;
        loaded.require(Capability::Inbetween, "pack")?;
        if !request.skeleton.is_empty() {
            count_in_between(&request, &loaded.pack.rig.dims)?;
        }
        let worn = self.worn(&request.skeleton, (loaded, 0)).await?;
        let characters = request.characters.len();
        // A request over the size limit gets its own error, without a retry hint.
        let most = self.common.limits.max_characters;
        let order = self.order(arrived);
        if let Some(error) = loaded.batcher.refuse(&order, characters.min(most)) {
            return Err(error.into());
        }
        let (rig, limits, wears) = (loaded.pack.rig.clone(), self.common.limits, worn.clone());
        let (items, plans, own) = offload(characters, INLINE_CHARACTERS, move || {
            prepared(request, &rig, limits, wears.as_deref())
        })
        .await??;

        let asked = Instant::now();
        let served = loaded
            .batcher
            .submit(items.into_iter().map(Into::into).collect(), order)
            .await?;
        if let Some(trace) = RequestContext::current_trace() {
            trace_served(&trace, asked, &served);
        }

        let mut timing = timing(&served);
        let copied = served.scatter;
        let scattering = Instant::now();
        let rig = loaded.pack.rig.clone();
        let results = offload(characters, INLINE_CHARACTERS, move || {
            let mut results = finish_all(&served, &plans, &rig)?;
            if let Some(worn) = &worn {
                let pairs = own.iter().zip(&mut results);
                pairs.for_each(|(own, result)| own.finish(worn, result, rig.fps));
            }
            Ok::<_, ServiceError>(results)
        })
        .await??;
        let made = scattering.elapsed();
        let frames: u32 = results
            .iter()
            .filter_map(|result| result.frames.as_ref())
            .map(|frames| frames.frame_count)
            .sum();
        loaded.metrics.scattered(made, frames as usize);
        RequestContext::part("finish", scattering, Vec::new);
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

/// The tasks of a request's characters, how their answers are finished, and what answers on a
/// skeleton of the user's own need.
type Prepared = (Vec<KeyframeTask>, Vec<Plan>, Vec<OwnSegment>);

/// A request as the batcher takes it. With a skeleton of the user's own, also what the answer needs
/// of each character.
fn prepared(
    mut request: v1::InBetweenRequest,
    rig: &Rig,
    limits: RequestLimits,
    worn: Option<&Worn>,
) -> Result<Prepared, ServiceError> {
    let own = worn.map(|worn| take_in_between(&mut request, worn));
    let own = own.transpose()?.unwrap_or_default();
    let root = Path::root().sized(worn.map_or_else(Size::default, Worn::size));
    let (items, plans) = prepare(&root, &request, rig, limits)?;
    refuse_keyframes(&plans, rig)?;
    Ok((items, plans, own))
}

/// The pack without the skeletons of its bodies.
fn summary(mut pack: v1::Pack) -> v1::Pack {
    for body in &mut pack.bodies {
        body.joints.clear();
        body.robot = None;
    }
    pack
}

fn described(table: &PackTable, loaded: &LoadedPack) -> v1::Pack {
    describe(
        &loaded.pack,
        &loaded.skills,
        table.is_default(loaded),
        loaded.engine,
    )
}

fn finish_all(served: &Served, plans: &[Plan], rig: &Rig) -> Result<Vec<v1::CharacterResult>, ServiceError> {
    let motions = served.outputs.iter().filter_map(|output| match output {
        Output::Motion(motion) => Some(motion),
        Output::Motions(_) | Output::Text(_) | Output::Audio(_) => None,
    });
    let mut judge = Judge::new(rig);
    let pairs = motions.zip(plans).enumerate();
    pairs
        .map(|(index, (motion, plan))| {
            let (result, found) = finish_judged(motion, plan, rig, judge.as_mut())?;
            if let Some(found) = found {
                let frames = result
                    .frames
                    .as_ref()
                    .map_or(0, |frames| frames.frame_count as usize);
                refuse(index, plan, rig, &found, frames)?;
            }
            Ok::<_, ServiceError>(result)
        })
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
