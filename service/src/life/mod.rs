//! Packs that are loaded, unloaded and swapped while the server runs.
//!
//! Changes come one after another. Everything that can fail comes before the first tenant sees a
//! change. A pack that is no longer served leaves the memory with its last holder: a call under
//! way, or a live session of a pack that was unloaded.

mod error;
mod metrics;
mod shelf;

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Instant;

use tokio::sync::Semaphore;
use troupe_base::offload::WorkerStopped;
use troupe_base::telemetry::Telemetry;
use troupe_batch::{Leaving, PackMetrics};
use troupe_character::Path;
use troupe_engine::pack::Pack;
use troupe_live::packs::{LoadedPack, PackTable};
use troupe_live::session::{SessionError, Spaces};
use troupe_proto::v1;

use crate::{Common, Service, ServiceError};

pub use error::LifeError;
pub use metrics::PackChange;
use metrics::{LifeMetrics, Outcome};
pub use shelf::{Loading, Offer, Shelf, Stock, by_age};

/// Changes that may wait, with the one that is under way.
const MAX_CHANGES: usize = 16;
/// Most characters of a name or version that an error repeats.
const MAX_ECHO: usize = 64;

/// The packs that come and go.
#[derive(Debug)]
pub(crate) struct Life {
    shelf: OnceLock<Arc<dyn Shelf>>,
    /// Held during a change.
    one: tokio::sync::Mutex<()>,
    /// One permit for each change that may wait.
    places: Arc<Semaphore>,
    leaving: Mutex<Vec<Left>>,
    metrics: LifeMetrics,
}

/// A pack that is no longer served, and whose workers have not ended.
#[derive(Debug)]
struct Left {
    pack: Arc<Pack>,
    metrics: PackMetrics,
    workers: Leaving,
    since: Instant,
}

impl Left {
    /// A pack that is not served from now on.
    fn new(loaded: &LoadedPack) -> Self {
        Self {
            pack: loaded.pack.clone(),
            metrics: loaded.metrics.clone(),
            workers: loaded.batcher.leaving(),
            since: Instant::now(),
        }
    }
}

impl Life {
    pub(crate) fn new(telemetry: &Telemetry) -> Self {
        Self {
            shelf: OnceLock::new(),
            one: tokio::sync::Mutex::default(),
            places: Arc::new(Semaphore::new(MAX_CHANGES)),
            leaving: Mutex::default(),
            metrics: LifeMetrics::new(telemetry),
        }
    }

    fn leaving(&self) -> MutexGuard<'_, Vec<Left>> {
        self.leaving.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends the workers of packs that are no longer served after their running steps.
    pub(crate) fn stop(&self) {
        self.leaving().iter().for_each(|left| left.workers.stop());
    }

    /// Waits until `deadline` for the ends of those workers. Answers whether all have ended. This
    /// blocks.
    pub(crate) fn join(&self, deadline: Instant) -> bool {
        let left = self.leaving();
        left.iter().all(|left| left.workers.join(deadline))
    }

    /// Whether no pack is being loaded.
    pub(crate) fn is_quiet(&self) -> bool {
        self.one.try_lock().is_ok()
    }

    /// Drops what is kept of packs whose workers have ended. `table` has those that are served.
    fn sweep(&self, table: &PackTable) {
        let ended: Vec<Left> = {
            let mut leaving = self.leaving();
            let ended = leaving.extract_if(.., |left| left.workers.has_ended()).collect();
            self.metrics.leaving(leaving.len());
            ended
        };
        for Left {
            pack, metrics, since, ..
        } in ended
        {
            let version = &pack.manifest.version;
            tracing::info!(pack = pack.name(), version, held = ?since.elapsed(), "a pack has left the memory");
            let served = table.get(pack.name()).map(|loaded| &loaded.pack);
            // The metrics are those of its name and version.
            if served.is_none_or(|served| served.manifest.version != *version) {
                metrics.workers(0);
            }
            let is_same = |served: &&Arc<Pack>| {
                (&served.folder, &served.manifest.content_hash) == (&pack.folder, &pack.manifest.content_hash)
            };
            if let Some(shelf) = self.shelf.get().filter(|_| served.filter(is_same).is_none()) {
                shelf.forget(&pack);
            }
        }
    }

    /// The packs in memory.
    fn in_memory(&self, table: &PackTable) -> Vec<Arc<Pack>> {
        let served = table.all().map(|loaded| loaded.pack.clone());
        let leaving = self.leaving();
        served
            .chain(leaving.iter().map(|left| left.pack.clone()))
            .collect()
    }

    fn leaving_messages(&self) -> Vec<v1::LeavingPack> {
        let leaving = self.leaving();
        let message = |left: &Left| v1::LeavingPack {
            name: left.pack.name().to_owned(),
            version: left.pack.manifest.version.clone(),
            held_ms: left.since.elapsed().as_millis() as u64,
        };
        leaving.iter().map(message).collect()
    }
}

/// The name and version of a pack that a call asks for.
#[derive(Debug, Clone)]
struct Wanted {
    name: String,
    /// Empty: any version.
    version: String,
}

impl Wanted {
    fn new(name: String, version: String) -> Result<Self, ServiceError> {
        match name.is_empty() {
            true => Err(Path::root()
                .field("name")
                .error("is empty", "the name of a pack")
                .into()),
            false => Ok(Self { name, version }),
        }
    }

    fn is(&self, version: &str) -> bool {
        self.version.is_empty() || self.version == version
    }

    /// For errors.
    fn text(&self) -> String {
        let cut = |text: &str| text.chars().take(MAX_ECHO).collect::<String>();
        match self.version.is_empty() {
            true => cut(&self.name),
            false => format!("{} {}", cut(&self.name), cut(&self.version)),
        }
    }
}

impl Service {
    /// Has packs change while the server runs. Only the first call counts.
    pub fn set_shelf(&self, shelf: Arc<dyn Shelf>) {
        if self.common.life.shelf.set(shelf).is_err() {
            tracing::warn!("the server has a folder of packs already");
        }
    }

    /// `troupe.v1.Motion/LoadPack`.
    ///
    /// # Errors
    /// [`ServiceError::Life`] if the pack is not loaded.
    pub async fn load_pack(&self, request: v1::LoadPackRequest) -> Result<v1::PackChange, ServiceError> {
        self.change(PackChange::Load, request.name, request.version).await
    }

    /// `troupe.v1.Motion/UnloadPack`.
    ///
    /// # Errors
    /// [`ServiceError::Life`] if the pack stays.
    pub async fn unload_pack(&self, request: v1::UnloadPackRequest) -> Result<v1::PackChange, ServiceError> {
        self.change(PackChange::Unload, request.name, request.version)
            .await
    }

    /// `troupe.v1.Motion/SwapPack`.
    ///
    /// # Errors
    /// [`ServiceError::Life`] if the version that is there stays.
    pub async fn swap_pack(&self, request: v1::SwapPackRequest) -> Result<v1::PackChange, ServiceError> {
        self.change(PackChange::Swap, request.name, request.version).await
    }

    /// Does a change when its turn comes. It goes on if its caller leaves: loading takes seconds,
    /// and a caller that asks again gets the same answer.
    async fn change(
        &self,
        change: PackChange,
        name: String,
        version: String,
    ) -> Result<v1::PackChange, ServiceError> {
        let wanted = Wanted::new(name, version)?;
        let busy = LifeError::Busy { most: MAX_CHANGES };
        let place = self
            .common
            .life
            .places
            .clone()
            .try_acquire_owned()
            .map_err(|_| busy)?;
        let common = self.common.clone();
        let task = tokio::spawn(async move {
            let _place = place;
            let _one = common.life.one.lock().await;
            let result = common.change(change, &wanted).await;
            common.report(change, &wanted, &result);
            result
        });
        task.await.map_err(|_| WorkerStopped)?
    }

    /// Drops what is kept of packs that have no holder any more.
    pub(crate) fn sweep_packs(&self) {
        if let Some(spaces) = self.common.spaces.get() {
            self.common.life.sweep(&spaces.common().packs.table());
        }
    }
}

impl Common {
    async fn change(&self, change: PackChange, wanted: &Wanted) -> Result<v1::PackChange, ServiceError> {
        self.check_running()?;
        let spaces = self.spaces.get().ok_or(ServiceError::Starting)?;
        let shelf = self.life.shelf.get().ok_or(LifeError::Fixed)?.clone();
        let table = spaces.common().packs.table();
        let loaded = table.get(&wanted.name);
        match (change, loaded) {
            (PackChange::Load, Some(loaded)) => match wanted.is(&loaded.pack.manifest.version) {
                true => Ok(self.unchanged(&loaded.pack)),
                false => Err(other_version(loaded).into()),
            },
            (PackChange::Unload, Some(loaded)) => self.unload(spaces, &table, loaded, wanted).await,
            (PackChange::Unload, None) => {
                // Unloaded before.
                let offer = self.offer(&shelf, &table, wanted).await?;
                let pack = v1::PackChange {
                    name: offer.name,
                    version: offer.version,
                    leaving: self.life.leaving_messages(),
                    ..v1::PackChange::default()
                };
                Ok(pack)
            }
            (PackChange::Load, None) => self.put(spaces, &shelf, &table, wanted).await,
            (PackChange::Swap, Some(_)) => self.put(spaces, &shelf, &table, wanted).await,
            (PackChange::Swap, None) => {
                self.offer(&shelf, &table, wanted).await?;
                Err(LifeError::NotLoaded {
                    name: wanted.name.clone(),
                    loaded: table.all().map(|loaded| loaded.pack.name().to_owned()).collect(),
                }
                .into())
            }
        }
    }

    /// While the server stops, its packs stay.
    fn check_running(&self) -> Result<(), ServiceError> {
        match self.draining.load(std::sync::atomic::Ordering::Relaxed) {
            true => Err(SessionError::ShuttingDown.into()),
            false => Ok(()),
        }
    }

    /// The pack in the folder that a call asks for.
    async fn offer(
        &self,
        shelf: &Arc<dyn Shelf>,
        table: &PackTable,
        wanted: &Wanted,
    ) -> Result<Offer, ServiceError> {
        let shelf = shelf.clone();
        let stock = blocking(move || shelf.stock())
            .await?
            .map_err(LifeError::Folder)?;
        if let Some(found) = stock.find(&wanted.name, &wanted.version) {
            return Ok(found?.clone());
        }
        let offers = stock.offers.iter().map(|offer| (&offer.name, &offer.version));
        let loaded = table
            .all()
            .map(|loaded| (&loaded.pack.manifest.name, &loaded.pack.manifest.version));
        let mut allowed: Vec<String> = offers
            .chain(loaded)
            .map(|(name, version)| format!("{name} {version}"))
            .collect();
        allowed.sort_unstable();
        allowed.dedup();
        Err(LifeError::Unknown {
            wanted: wanted.text(),
            allowed,
            unusable: stock.unusable,
        }
        .into())
    }

    /// Loads a pack and serves it, perhaps in the place of another version.
    async fn put(
        &self,
        spaces: &Arc<Spaces>,
        shelf: &Arc<dyn Shelf>,
        table: &PackTable,
        wanted: &Wanted,
    ) -> Result<v1::PackChange, ServiceError> {
        let offer = self.offer(shelf, table, wanted).await?;
        let named = format!("{} {}", offer.name, offer.version);
        let refused = |reason: String| LifeError::Refused {
            wanted: named.clone(),
            reason,
        };
        let (reader, to_read) = (shelf.clone(), offer.clone());
        let pack = blocking(move || reader.read(&to_read)).await?.map_err(refused)?;
        let key = |pack: &Pack| (pack.manifest.version.clone(), pack.manifest.content_hash.clone());
        let served = table
            .get(&offer.name)
            .filter(|served| key(&served.pack) == key(&pack));
        if let Some(served) = served {
            return Ok(self.unchanged(&served.pack));
        }
        spaces
            .check_shape(&pack)
            .map_err(|error| refused(error.to_string()))?;
        let there = self.life.in_memory(table);
        let estimate = shelf
            .estimate(&pack, &there)
            .map_err(|reason| LifeError::Memory {
                wanted: named.clone(),
                reason,
            })?;
        let loaded = shelf.load(pack, there.len()).await.map_err(refused)?;
        let unused = Left::new(&loaded);
        let served = match self.check_running() {
            Ok(()) => {
                let changing = spaces.clone();
                let served = blocking(move || changing.serve(loaded)).await;
                let served = served.map_err(ServiceError::from);
                served.and_then(|served| served.map_err(|error| refused(error.to_string()).into()))
            }
            Err(error) => Err(error),
        };
        let before = served.inspect_err(|_| self.life.leaving().push(unused))?;
        self.life.leaving().extend(before.as_deref().map(Left::new));
        let replaced_version = before.map(|before| before.pack.manifest.version.clone());
        Ok(v1::PackChange {
            name: offer.name,
            version: offer.version,
            changed: true,
            replaced_version,
            estimated_bytes: estimate,
            leaving: self.life.leaving_messages(),
        })
    }

    async fn unload(
        &self,
        spaces: &Arc<Spaces>,
        table: &PackTable,
        loaded: &Arc<LoadedPack>,
        wanted: &Wanted,
    ) -> Result<v1::PackChange, ServiceError> {
        if !wanted.is(&loaded.pack.manifest.version) {
            return Err(other_version(loaded).into());
        }
        let name = loaded.pack.name().to_owned();
        if table.is_default(loaded) {
            return Err(LifeError::Default { name }.into());
        }
        let changing = spaces.clone();
        if let Some(ended) = blocking(move || changing.end(&name)).await? {
            self.life.leaving().push(Left::new(&ended));
        }
        Ok(v1::PackChange {
            changed: true,
            ..self.unchanged(&loaded.pack)
        })
    }

    /// The answer to a call that asks for what is so already.
    fn unchanged(&self, pack: &Pack) -> v1::PackChange {
        v1::PackChange {
            name: pack.name().to_owned(),
            version: pack.manifest.version.clone(),
            leaving: self.life.leaving_messages(),
            ..v1::PackChange::default()
        }
    }

    /// Counts a change and logs it.
    fn report(&self, change: PackChange, wanted: &Wanted, result: &Result<v1::PackChange, ServiceError>) {
        let (pack, what) = (wanted.text(), change.name());
        let outcome = match result {
            Ok(done) if done.changed => {
                let (version, replaced) = (&done.version, &done.replaced_version);
                tracing::info!(pack = done.name, version, replaced, "pack: {what} done");
                Outcome::Done
            }
            Ok(done) => {
                tracing::info!(
                    pack = done.name,
                    version = done.version,
                    "pack: {what} changes nothing"
                );
                Outcome::Unchanged
            }
            Err(error) => {
                tracing::warn!(pack, %error, "pack: {what} refused");
                Outcome::Refused
            }
        };
        self.life.metrics.count(change, outcome);
        self.life.metrics.leaving(self.life.leaving().len());
    }
}

fn other_version(loaded: &LoadedPack) -> LifeError {
    LifeError::OtherVersion {
        name: loaded.pack.name().to_owned(),
        loaded: loaded.pack.manifest.version.clone(),
    }
}

/// Runs work that reads files.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, WorkerStopped> {
    tokio::task::spawn_blocking(work).await.map_err(|_| WorkerStopped)
}
