//! What this machine and the library offer, the engine of each pack and the reason for it, and its
//! speed.

mod render;
mod trial;

use std::path::PathBuf;

use serde::Serialize;

use crate::config::{Config, WorstCase};
use crate::server::load_packs;
use troupe_engine::machine::Machine;
use troupe_engine::onnx::Growth;
use troupe_engine::pack::Pack;
use troupe_engine::{CheckCache, Decision, EngineError, EngineKind, Selector, Workers};

pub use trial::{Speed, Trial};

/// Everything that the doctor found.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The server's version.
    pub version: &'static str,
    /// The processors and the memory of this machine.
    pub machine: Machine,
    /// Workers of each pack.
    pub workers: Workers,
    /// The ONNX Runtime library. None: it does not load.
    pub library: Option<Library>,
    /// Every engine, and why it cannot serve, if so.
    pub engines: Vec<Engine>,
    /// Every pack.
    pub packs: Vec<PackReport>,
    /// The most memory that the server may take.
    pub memory: WorstCase,
    /// What keeps the server from starting. Empty: it would start.
    pub problems: Vec<String>,
    /// What would make the server faster or safer.
    pub warnings: Vec<String>,
}

/// The ONNX Runtime library.
#[derive(Debug, Clone, Serialize)]
pub struct Library {
    /// Path of the file, with links resolved.
    pub path: PathBuf,
    /// Version, if the file's name contains it.
    pub version: Option<String>,
    /// Build information that the library reports.
    pub build: &'static str,
}

/// One engine.
#[derive(Debug, Clone, Serialize)]
pub struct Engine {
    /// The engine's name on the command line.
    pub engine: EngineKind,
    /// Whether the library was built with this engine.
    pub offered: bool,
    /// Why it cannot serve here, if so.
    pub missing: Option<String>,
    /// Whether the authors have ever run this engine.
    pub tested: bool,
}

/// One pack.
#[derive(Debug, Clone, Serialize)]
pub struct PackReport {
    /// Unique among the loaded packs.
    pub name: String,
    /// From the pack's manifest.
    pub version: String,
    /// Number of weights of all stages.
    pub parameters: u64,
    /// The engine that serves the pack, and the reason. None: none can.
    pub decision: Option<Decision>,
    /// The measured speed. None: not measured.
    pub trial: Option<Trial>,
}

impl Report {
    /// Examines everything that the server would serve with `config`. Takes a few seconds for each
    /// pack.
    pub fn examine(config: &Config) -> Self {
        let mut report = Self {
            version: env!("CARGO_PKG_VERSION"),
            machine: Machine::detect(),
            workers: config.workers(),
            library: None,
            engines: Vec::new(),
            packs: Vec::new(),
            memory: WorstCase {
                parts: Vec::new(),
                total_bytes: 0,
            },
            problems: Vec::new(),
            warnings: Vec::new(),
        };
        report.warn_of_sizes();
        let packs = load_packs(config).unwrap_or_else(|error| {
            report.problems.push(error.to_string());
            Vec::new()
        });
        report.look_at_memory(config, &packs);
        match config.selector(packs.len()) {
            Ok(mut selector) => {
                // Measure with all networks open, and show fresh results instead of cached ones.
                selector.growth = Growth::AtOnce;
                selector.cache = CheckCache::default();
                report.look_at_library(&selector);
                let decisions = selector.choose_all(&packs);
                for (pack, decision) in packs.iter().zip(decisions) {
                    report.look_at_pack(config, &selector, pack, decision);
                }
            }
            Err(error) => report.problems.push(error.to_string()),
        }
        report
    }

    /// Whether the server would start.
    pub fn serves(&self) -> bool {
        self.problems.is_empty()
    }

    fn warn_of_sizes(&mut self) {
        let (threads, cores) = (self.workers.count * self.workers.threads, self.machine.cores);
        if threads > cores {
            self.warnings.push(format!(
                "{threads} threads for {cores} cores: they get in each other's way; threads = 0 fits them"
            ));
        }
        if cfg!(debug_assertions) {
            self.warnings
                .push("this is a debug build of the server; build with --release".to_owned());
        }
    }

    fn look_at_memory(&mut self, config: &Config, packs: &[Pack]) {
        match crate::server::max_connections(config) {
            Ok(most) => self.memory = config.worst_case(packs, most),
            Err(error) => return self.problems.push(error.to_string()),
        }
        if let Err(problem) = self.memory.within(config.memory_limit_bytes()) {
            self.problems.push(problem);
        }
        let (worst, there_is) = (self.memory.total_bytes, self.machine.memory_bytes);
        if worst > there_is {
            self.warnings.push(format!(
                "clients may make the server take {} MiB, and this machine has {}; lower the options under Memory, and set \
                 memory_limit_mib",
                worst >> 20,
                there_is >> 20
            ));
        }
    }

    fn look_at_library(&mut self, selector: &Selector) {
        let runtime = &selector.runtime;
        self.library = Some(Library {
            path: runtime.library().to_owned(),
            version: runtime.version().map(str::to_owned),
            build: runtime.build(),
        });
        self.engines = EngineKind::ALL
            .into_iter()
            .map(|engine| Engine {
                engine,
                offered: runtime.offers(engine),
                missing: selector.missing(engine),
                tested: engine.is_tested(),
            })
            .collect();
        if let (Some(gpu), false) = (self.machine.gpus.first(), runtime.offers(EngineKind::Cuda)) {
            self.warnings.push(format!(
                "there is a GPU ({}), but this library does not offer CUDA: `TROUPE_RUNTIME=gpu make runtime` fetches one that does",
                gpu.name
            ));
        }
        if self.machine.has_bf16() && !runtime.offers(EngineKind::OpenvinoBf16) {
            self.warnings.push(
                "the CPU computes in bf16, but this library does not offer OpenVINO: `make runtime` fetches one that \
                 does and is much faster here"
                    .to_owned(),
            );
        }
    }

    fn look_at_pack(
        &mut self,
        config: &Config,
        selector: &Selector,
        pack: &Pack,
        decision: Result<Decision, EngineError>,
    ) {
        let name = pack.name();
        let mut problem = |error: &dyn std::fmt::Display| self.problems.push(format!("pack {name}: {error}"));
        let decision = decision.map_err(|error| problem(&error)).ok();
        let trial = decision.as_ref().and_then(|decision| {
            let max_batch = config.max_batch_of(decision.batching);
            Trial::run(selector, pack, decision.engine, max_batch)
                .map_err(|error| problem(&error))
                .ok()
        });
        if let Some(decision) = &decision {
            if decision.check.as_ref().is_some_and(|check| !check.passed) {
                self.warnings.push(format!("pack {name}: {}", decision.why));
            }
            if !decision.engine.is_tested() {
                let engine = decision.engine;
                self.warnings.push(format!(
                    "pack {name}: the authors had no machine for {engine} and never ran it"
                ));
            }
        }
        self.packs.push(PackReport {
            name: name.to_owned(),
            version: pack.manifest.version.clone(),
            parameters: pack.manifest.parameters,
            decision,
            trial,
        });
    }
}
