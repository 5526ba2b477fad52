//! The running server: loads packs while the port is open, accepts connections, and drains.

mod access;
#[cfg(test)]
mod drain_tests;
mod error;
mod folder;
mod gpus;
mod handle;
mod health_port;
mod keeping;
mod limits;
mod shelf;
#[cfg(feature = "testing")]
pub mod testing;
mod watching;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use futures_util::future::join_all;
use tokio::net::TcpListener;
use tokio::sync::{Notify, watch};
use tonic_health::server::HealthReporter;

use crate::api;
use crate::config::Config;
use access::Access;
use folder::FolderPacks;
use gpus::GpuMetrics;
use keeping::{Keeping, OpenRecords};
use shelf::ServerShelf;
use troupe_base::telemetry::Telemetry;
use troupe_batch::scheduler::Limits;
use troupe_batch::{Batcher, GeneratorFactory, PackMetrics};
use troupe_edge::clients::Clients;
use troupe_edge::port::{self, ConnectionSlots, Listen, Port, Tls, TlsError, TlsFiles};
use troupe_edge::reload::{self, Source};
use troupe_engine::generator::Generator;
use troupe_engine::gpu::{gpu_use, gpus};
use troupe_engine::machine::resident_bytes;
use troupe_engine::onnx::Batching;
use troupe_engine::pack::Pack;
use troupe_engine::{Decision, EngineError, Pipeline, Stages};
use troupe_live::packs::{LoadedPack, PackTable, load_skills, load_styles};
use troupe_live::session::{Executor, Sessions, TimeSource};
use troupe_live::world::Store;
use troupe_service::{Service, ServiceError};

pub use error::StartError;
pub use folder::{FilePrint, Provider, Seen, load_packs, packs_of};
pub use handle::{ServerHandle, Stopped};

/// Name of the pack that is the default if the configuration names none.
const USUAL_DEFAULT: &str = "human";
/// Name of an engine that the caller of [`serve_packs`] supplies.
const CALLERS_ENGINE: &str = "other";
/// Interval at which recorded samples are moved into their buckets.
const UPKEEP_INTERVAL: Duration = Duration::from_secs(5);
/// Extra time for streams to end, after the time for requests.
const FAREWELL: Duration = Duration::from_millis(500);
/// Interval at which it is asked whether the packs are loaded.
const START_INTERVAL: Duration = Duration::from_millis(100);
/// Interval at which expired sessions are removed. Sessions expire on time without this.
const SWEEP_INTERVAL: Duration = Duration::from_millis(500);

/// Makes the stages of a pack for one worker, on the worker's own thread.
pub type StagesFactory = Box<dyn Fn(&Pack) -> Result<Box<dyn Stages>, EngineError> + Send + Sync>;
/// Makes the generator of a pack for one worker, on the worker's own thread. The number is the most
/// jobs in a batch.
pub type MakeGenerator = Box<dyn Fn(&Pack, usize) -> Result<Box<dyn Generator>, EngineError> + Send + Sync>;

/// A pack and what runs it.
pub struct PackSource {
    /// The pack to serve, without its networks.
    pub pack: Pack,
    /// Number of workers, at least one. Each is a thread with its own generator.
    pub workers: usize,
    /// Makes the generator of one worker.
    pub generator: MakeGenerator,
    /// The engine that runs the networks, and the reason. None: the caller supplies it.
    pub decision: Option<Decision>,
}

impl PackSource {
    /// A pack that fills gaps. `stages` makes its three stages.
    pub fn of_stages(pack: Pack, workers: usize, stages: StagesFactory, decision: Option<Decision>) -> Self {
        let generator = move |pack: &Pack, max_batch| {
            let mut pipeline = Pipeline::new(pack.rig.dims, stages(pack)?, max_batch);
            pipeline.warm_up()?;
            Ok(pipeline.into_generator(max_batch))
        };
        Self {
            pack,
            workers,
            generator: Box::new(generator),
            decision,
        }
    }
}

/// Most connections of a server: those that `config` asks for, or as many as the system's limit of
/// open files allows. Raises that limit as far as possible.
///
/// # Errors
/// [`StartError::Files`] if the limit has no room for the connections that `config` asks for.
pub fn max_connections(config: &Config) -> Result<usize, StartError> {
    Ok(port::max_connections(config.max_connections)?)
}

/// Starts a server on `listener` with the packs that `config` names. The port answers at once.
/// Requests are served after [`ServerHandle::ready`].
///
/// # Errors
/// [`StartError`] if the server cannot be set up. Packs load later, and [`ServerHandle::ready`]
/// returns their errors.
pub async fn serve(config: Config, listener: TcpListener) -> Result<ServerHandle, StartError> {
    let packs = Arc::new(FolderPacks::new(config.clone()));
    serve_from(config, listener, packs).await
}

/// [`serve`] with packs of a `provider`, which may be loaded, unloaded and swapped later.
///
/// # Errors
/// [`StartError`] if the server cannot be set up.
pub async fn serve_from(
    config: Config,
    listener: TcpListener,
    provider: Arc<dyn Provider>,
) -> Result<ServerHandle, StartError> {
    let (first, before) = (provider.clone(), resident_bytes());
    let mut handle = serve_packs(config.clone(), listener, move || first.first()).await?;
    let (service, telemetry) = (handle.service.clone(), handle.service.telemetry().clone());
    let max_connections = max_connections(&config)?;
    let shelf = ServerShelf::new(config.clone(), max_connections, telemetry, provider.clone());
    let shelf = Arc::new(shelf);
    service.set_shelf(shelf.clone());
    let every = config.watch_packs();
    handle.watching = Some(tokio::spawn(async move {
        let Some(table) = opened(&service).await else {
            return;
        };
        let packs = table.all().map(|loaded| &*loaded.pack);
        shelf.measured(packs, "", (before, resident_bytes()));
        drop(table);
        if let Some(every) = every {
            watching::watch(service, provider, every).await;
        }
    }));
    Ok(handle)
}

/// The packs, once the service has them.
async fn opened(service: &Service) -> Option<Arc<PackTable>> {
    loop {
        match service.table() {
            Ok(table) => return Some(table),
            Err(ServiceError::Starting) => tokio::time::sleep(START_INTERVAL).await,
            Err(_) => return None,
        }
    }
}

/// [`serve`] with packs and engines of the caller's choice. `packs` runs on the pool for blocking
/// work.
///
/// # Errors
/// [`StartError`] if the server cannot be set up.
pub async fn serve_packs(
    config: Config,
    listener: TcpListener,
    packs: impl FnOnce() -> Result<Vec<PackSource>, StartError> + Send + 'static,
) -> Result<ServerHandle, StartError> {
    serve_packs_at(config, listener, TimeSource::default(), packs).await
}

/// [`serve_packs`] with a clock for the expiry of sessions.
///
/// # Errors
/// [`StartError`] if the server cannot be set up.
pub async fn serve_packs_at(
    config: Config,
    listener: TcpListener,
    time: TimeSource,
    packs: impl FnOnce() -> Result<Vec<PackSource>, StartError> + Send + 'static,
) -> Result<ServerHandle, StartError> {
    let address = listener.local_addr().map_err(StartError::Listen)?;
    let around = Around {
        time,
        executor: Executor::new().map_err(|error| StartError::Internal(error.to_string()))?,
        records: keeping::records_of(&config, address),
    };
    serve_on(config, listener, address, around, packs).await
}

/// Everything that a server depends on, besides its port.
struct Around {
    /// The clock for the expiry of sessions.
    time: TimeSource,
    /// Runs the work of live characters.
    executor: Executor,
    /// Records that a previous server kept.
    records: OpenRecords,
}

/// [`serve_packs_at`] on any listener, including one without a port of the system.
async fn serve_on(
    config: Config,
    listener: impl Listen,
    address: SocketAddr,
    around: Around,
    packs: impl FnOnce() -> Result<Vec<PackSource>, StartError> + Send + 'static,
) -> Result<ServerHandle, StartError> {
    let internal = |error: &dyn std::fmt::Display| StartError::Internal(error.to_string());
    let mut access = Access::new(&config, address)?;
    let mut sources = std::mem::take(&mut access.sources);
    let tls = match config.tls_files() {
        None => None,
        Some(files) => {
            let (tls, source) = tls(files)?;
            sources.push(source);
            Some(tls)
        }
    };
    let mut telemetry = Telemetry::new().map_err(|error| internal(&error))?;
    if let Some(options) = config.trace_options() {
        telemetry = telemetry.traced(options.exporter()?, options.sample_ratio);
    }
    let Around {
        time,
        executor,
        records,
    } = around;
    let sessions = Sessions::new(config.session_limits(), time, executor, &telemetry);
    let service = Arc::new(Service::new(
        config.request_limits(),
        config.request_timeout(),
        sessions,
        telemetry.clone(),
    ));
    let health = HealthReporter::new();
    api::set_serving(&health, false).await;
    let clients = Arc::new(Clients::new(config.shares(), &telemetry));
    let routes = api::routes(
        &service,
        &health,
        &clients,
        &config.api_limits(),
        config.guard(address),
        access.credentials.clone(),
        &config.docs,
    )
    .map_err(|error| internal(&error))?;

    let (stop, stopping) = watch::channel(false);
    let health_port = match config.health_listen {
        Some(address) => {
            Some(health_port::open(address, &config, &service, &health, stopping.clone()).await?)
        }
        None => None,
    };
    let max_connections = max_connections(&config)?;
    limits::show(&config, max_connections, &telemetry);
    let slots = ConnectionSlots::new(
        max_connections,
        config.connections_of_address(max_connections),
        config.fixed.spare_idle,
        &telemetry,
    );
    let connections = listener.spawn(Port {
        routes,
        clients,
        tls: tls.clone(),
        limits: config.connection_limits(),
        slots,
        stopping,
    });
    let (drain_delay, drain_timeout) = (config.drain_delay(), config.drain_timeout());
    let last_step = config.fixed.last_step;
    let gpus = Arc::new(GpuMetrics::new(&gpus(), &telemetry));
    let upkeep = tokio::spawn(upkeep(service.clone(), gpus));
    let reload = Arc::new(Notify::new());
    let (reloads, reloading) = (!sources.is_empty(), reload::watch(sources, reload.clone()));
    let starting = tokio::spawn(start(
        config,
        max_connections,
        service.clone(),
        health.clone(),
        records,
        packs,
    ));
    Ok(ServerHandle {
        address,
        service,
        health,
        stop,
        starting: Some(starting),
        keeping: None,
        connections,
        health_port,
        upkeep,
        watching: None,
        reloading: tokio::spawn(reloading),
        reload,
        reloads,
        secure: tls.is_some(),
        access,
        drain_delay,
        drain_timeout,
        last_step,
    })
}

/// TLS with the certificates in `files`, and the source that reads them again.
fn tls(files: TlsFiles) -> Result<(Arc<Tls>, Source), TlsError> {
    let paths = files.paths();
    let seen = reload::fingerprint(&paths);
    let tls = Arc::new(Tls::load(files)?);
    let again = tls.clone();
    Ok((
        tls,
        Source::new("TLS certificates", paths, seen, move || again.reload()),
    ))
}

/// Does the periodic work of a server.
async fn upkeep(service: Arc<Service>, gpus: Arc<GpuMetrics>) {
    let mut metrics = tokio::time::interval(UPKEEP_INTERVAL);
    let mut sweeps = tokio::time::interval(SWEEP_INTERVAL);
    loop {
        tokio::select! {
            _ = metrics.tick() => {
                service.look();
                service.telemetry().run_upkeep();
                let gpus = gpus.clone();
                // The driver may take milliseconds. The answer is read at the next scrape.
                tokio::task::spawn_blocking(move || gpus.look(gpu_use));
            }
            _ = sweeps.tick() => {
                let expired = service.sessions().sweep();
                if expired > 0 {
                    tracing::debug!(expired, "sessions expired");
                }
            }
        }
    }
}

/// Loads and warms up all packs, then opens the service.
async fn start(
    config: Config,
    max_connections: usize,
    service: Arc<Service>,
    health: HealthReporter,
    records: OpenRecords,
    packs: impl FnOnce() -> Result<Vec<PackSource>, StartError> + Send + 'static,
) -> Result<Option<Keeping>, StartError> {
    let gone = |_| StartError::Internal("a task that loads files has stopped".to_owned());
    let folders = config.world_folders();
    let scene_bytes = config.max_scene_memory_mib.saturating_mul(1 << 20);
    let for_limit = config.clone();
    let read = move || -> Result<_, StartError> {
        let sources = packs()?;
        for_limit
            .worst_case(sources.iter().map(|source| &source.pack), max_connections)
            .within(for_limit.memory_limit_bytes())
            .map_err(StartError::Memory)?;
        let store = Store::load(
            folders,
            scene_bytes,
            sources.iter().map(|source| &*source.pack.rig),
        )?;
        Ok((sources, store))
    };
    let (sources, store) = tokio::task::spawn_blocking(read).await.map_err(gone)??;
    let default = default_pack(&config, &sources)?;
    let loading = sources
        .into_iter()
        .map(|source| load(&config, service.telemetry(), source));
    // Wait for all of them: the library must not be unloaded while workers of another pack still
    // use it.
    let loaded = join_all(loading).await.into_iter().collect::<Result<_, _>>()?;
    let opening = service.clone();
    let (interval, tenants) = (config.fixed.snapshot_interval, config.tenant_options());
    let open = move || -> Result<_, StartError> {
        let records = records(opening.telemetry())?;
        Ok(opening.open(PackTable::new(loaded, default), store, tenants, records)?)
    };
    let keeper = tokio::task::spawn_blocking(open).await.map_err(gone)??;
    api::set_serving(&health, true).await;
    Ok(keeper.map(|keeper| Keeping::start(keeper, interval)))
}

fn default_pack(config: &Config, sources: &[PackSource]) -> Result<String, StartError> {
    let names: Vec<&str> = sources.iter().map(|source| source.pack.name()).collect();
    let list = names.join(", ");
    match &config.default_pack {
        Some(wanted) if names.contains(&wanted.as_str()) => Ok(wanted.clone()),
        Some(wanted) => Err(StartError::Packs(format!(
            "default_pack is {wanted}; allowed: {list}"
        ))),
        None if names.contains(&USUAL_DEFAULT) => Ok(USUAL_DEFAULT.to_owned()),
        None => names
            .iter()
            .min()
            .map(|name| (*name).to_owned())
            .ok_or_else(|| StartError::Packs("no pack to serve".to_owned())),
    }
}

/// Starts the workers of a pack.
async fn load(config: &Config, telemetry: &Telemetry, source: PackSource) -> Result<LoadedPack, StartError> {
    let PackSource {
        pack,
        workers,
        generator,
        decision,
    } = source;
    let metrics = PackMetrics::new(telemetry, pack.name(), &pack.manifest.version);
    let pack = Arc::new(pack);
    let (for_styles, folder) = (pack.clone(), config.styles_folder());
    let read = move || Ok::<_, StartError>((load_styles(&for_styles, folder)?, load_skills(&for_styles)?));
    let (styles, skills) = tokio::task::spawn_blocking(read).await.map_err(|_| {
        StartError::Internal("the task that loads styles and skills has stopped".to_owned())
    })??;
    let batching = decision
        .as_ref()
        .map_or(Batching::UNKNOWN, |decision| decision.batching);
    let max_batch = config.max_batch_of(batching);
    let (for_engine, engine_metrics) = (pack.clone(), metrics.clone());
    let factory: GeneratorFactory = Arc::new(move |worker| {
        let loading = Instant::now();
        let generator = generator(&for_engine, max_batch)?;
        let load = loading.elapsed();
        engine_metrics.loaded(load);
        tracing::info!(pack = for_engine.name(), worker, ?load, "pack ready");
        Ok(generator)
    });
    let limits = Limits {
        workers,
        call_rows: batching.call_rows,
        ..config.batch_limits(max_batch)
    };
    let batcher = Batcher::start(
        pack.name(),
        limits,
        config.fixed.worker_spin,
        metrics.clone(),
        factory,
    )
    .await
    .map_err(|error| StartError::Engine {
        pack: pack.name().to_owned(),
        error,
    })?;
    if let Some(decision) = &decision {
        metrics.engine_chosen(decision);
    }
    Ok(LoadedPack {
        pack,
        batcher,
        engine: decision.map_or(CALLERS_ENGINE, |decision| decision.engine.name()),
        styles,
        skills,
        metrics,
    })
}
