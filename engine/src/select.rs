//! Chooses the engine that serves a pack, and says why.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::accuracy::{Accuracy, Probe, compare, compare_paths, compare_planners, probe};
use super::checks::{self, CheckCache};
use super::generator::Generator;
use super::machine::Machine;
use super::onnx::vermo::OnnxVerMo;
use super::onnx::{
    Batching, Growth, NetworkPool, OnnxDenoiser, OnnxPlanner, OnnxStages, Runtime, SessionOptions,
    no_fixed_shapes,
};
use super::{AccuracyCheck, EngineChoice, EngineError, EngineKind, Pipeline, Stages, Workers};
use crate::gpu::{GpuOptions, GpuShare};
use crate::pack::{Family, Pack};
use crate::sonic_planner::SonicPlanner;
use crate::unimogen::UniMoGen;
use crate::vermo::VerMo;

/// The engine that serves a pack, with the reason.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Decision {
    /// What runs its networks.
    pub engine: EngineKind,
    /// Threads that run them.
    pub workers: Workers,
    /// How the engine takes batches.
    pub batching: Batching,
    /// Why this engine serves and no other; a text for logs and `doctor`.
    pub why: String,
    /// The accuracy check of the engine that was to be had beside the reference, if there was one.
    pub check: Option<Check>,
}

/// The result of comparing an engine with the reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// The engine that was compared with the reference, [`EngineKind::Cpu`].
    pub engine: EngineKind,
    /// Its distance from the reference.
    pub accuracy: Accuracy,
    /// Whether all distances are within their bounds.
    pub passed: bool,
    /// Duration of the check, loading included.
    pub took: Duration,
}

/// Chooses engines and loads networks.
#[derive(Clone)]
pub struct Selector {
    /// ONNX Runtime.
    pub runtime: Runtime,
    /// Cores and instructions of this computer.
    pub machine: Machine,
    /// The engine that the configuration asks for.
    pub choice: EngineChoice,
    /// What happens to engines that fail the accuracy check.
    pub accuracy_check: AccuracyCheck,
    /// Number and threads of each pack's workers.
    pub workers: Workers,
    /// Number of packs that are served: they share the memory.
    pub packs: usize,
    /// The GPU of engines that run on one.
    pub gpu: GpuOptions,
    /// See [`SessionOptions::spin`].
    pub spin: bool,
    /// Networks of fixed shapes.
    pub pool: NetworkPool,
    /// When the pool opens more of those networks.
    pub growth: Growth,
    /// Where results of accuracy checks are stored.
    pub cache: CheckCache,
}

impl Selector {
    /// Chooses the engine for `pack`. An engine other than the reference is checked for accuracy.
    ///
    /// # Errors
    /// [`EngineError::Unusable`] if the configuration names an engine that cannot serve, and errors
    /// of
    /// loading and running networks.
    pub fn choose(&self, pack: &Pack) -> Result<Decision, EngineError> {
        let family = known(pack)?;
        let missing = |engine| self.missing(engine);
        let check = |engine| self.kept_check(pack, engine);
        let (engine, mut why, check) = match self.choice.named() {
            _ if family == Family::VerMo => (EngineKind::Cpu, F32_ALONE.to_owned(), None),
            Some(engine) => named(engine, self.accuracy_check, missing, check)?,
            None => best(self.accuracy_check, &self.faster(), missing, check),
        };
        if engine != EngineKind::OpenvinoBf16 {
            self.pool.forget(pack);
        }
        let no_fixed_shapes = match engine {
            EngineKind::OpenvinoBf16 if family == Family::MotionBricks => self.no_fixed_shapes(pack),
            _ => None,
        };
        if let (EngineKind::OpenvinoBf16, Some(reason)) = (engine, &no_fixed_shapes) {
            why = format!("{why}; one network takes all shapes and is slower, because {reason}");
        }
        let decision = Decision {
            engine,
            workers: self.workers,
            batching: match family {
                Family::UniMoGen => Batching::of_unimogen(engine),
                Family::VerMo => Batching::of_vermo(),
                Family::SonicPlanner => Batching::of_sonic_planner(),
                Family::MotionBricks => Batching::of(engine, no_fixed_shapes.is_none()),
            },
            why,
            check,
        };
        if decision.check.as_ref().is_some_and(|check| !check.passed) {
            tracing::warn!(pack = pack.name(), "{}", decision.why);
        }
        let (name, engine) = (pack.name(), decision.engine.name());
        let Workers {
            count: workers,
            threads,
        } = decision.workers;
        tracing::info!(
            pack = name,
            engine,
            workers,
            threads,
            why = decision.why,
            "chose the engine"
        );
        if let Some(check) = &decision.check {
            for bar in check.accuracy.bars() {
                tracing::debug!(pack = name, engine = check.engine.name(), figure = %bar, "accuracy");
            }
        }
        Ok(decision)
    }

    /// [`Selector::choose`] for all packs that are served, in parallel: an accuracy check takes
    /// seconds,
    /// most of them on one core.
    pub fn choose_all(&self, packs: &[Pack]) -> Vec<Result<Decision, EngineError>> {
        std::thread::scope(|scope| {
            let choosing: Vec<_> = packs
                .iter()
                .map(|pack| scope.spawn(|| self.choose(pack)))
                .collect();
            let choices = choosing.into_iter().map(|choice| choice.join());
            choices
                .map(|choice| choice.unwrap_or(Err(EngineError::Stopped)))
                .collect()
        })
    }

    /// The generator of one worker, warmed up, for up to `max_batch` jobs at a time. The pack's
    /// family decides the generator.
    ///
    /// # Errors
    /// [`EngineError`] for a family that the engine does not know, and for networks that do not
    /// load or run.
    pub fn generator(
        &self,
        pack: &Pack,
        engine: EngineKind,
        max_batch: usize,
    ) -> Result<Box<dyn Generator>, EngineError> {
        match known(pack)? {
            Family::UniMoGen => {
                let denoiser = Box::new(self.load_denoiser(pack, engine)?);
                let mut generator = UniMoGen::new(pack, denoiser, max_batch)?;
                generator.warm_up(pack)?;
                Ok(Box::new(generator))
            }
            Family::VerMo => {
                let networks = Box::new(self.load_language(pack, engine)?);
                let mut generator = VerMo::new(pack, networks, max_batch)?;
                generator.warm_up()?;
                Ok(Box::new(generator))
            }
            Family::SonicPlanner => {
                let planner = Box::new(self.load_planner(pack, engine)?);
                let mut generator = SonicPlanner::new(pack, planner, max_batch)?;
                generator.warm_up(pack)?;
                Ok(Box::new(generator))
            }
            Family::MotionBricks => {
                let stages = self.load(pack, engine)?;
                let mut pipeline = Pipeline::new(pack.rig.dims, Box::new(stages), max_batch);
                pipeline.warm_up()?;
                Ok(pipeline.into_generator(max_batch))
            }
        }
    }

    /// Session options for networks that take every shape.
    fn any_shape(&self, pack: &Pack, engine: EngineKind) -> SessionOptions {
        SessionOptions {
            engine,
            threads: self.workers.threads,
            spin: self.spin,
            fixed_shapes: false,
            growth: Growth::None,
            gpu: self.gpu_share(pack),
        }
    }

    /// The part of a GPU that a worker of this pack has.
    fn gpu_share(&self, pack: &Pack) -> GpuShare {
        let size = |file: &&str| std::fs::metadata(pack.folder.join(file)).map_or(0, |file| file.len());
        let graph_bytes = pack.files().iter().map(size).sum();
        self.gpu.share(self.packs, self.workers.count, graph_bytes)
    }

    /// The network of one worker for a pack of the family UniMoGen.
    ///
    /// # Errors
    /// [`EngineError`] if it does not load.
    pub fn load_denoiser(&self, pack: &Pack, engine: EngineKind) -> Result<OnnxDenoiser, EngineError> {
        OnnxDenoiser::load(&self.runtime, pack, self.any_shape(pack, engine))
    }

    /// The graph of one worker for a pack of NVIDIA's planner.
    ///
    /// # Errors
    /// [`EngineError`] if it does not load.
    pub fn load_planner(&self, pack: &Pack, engine: EngineKind) -> Result<OnnxPlanner, EngineError> {
        OnnxPlanner::load(&self.runtime, pack, self.any_shape(pack, engine))
    }

    /// The networks of one worker for a pack with a language model.
    ///
    /// # Errors
    /// [`EngineError`] if they do not load.
    pub(crate) fn load_language(&self, pack: &Pack, engine: EngineKind) -> Result<OnnxVerMo, EngineError> {
        OnnxVerMo::load(&self.runtime, pack, self.any_shape(pack, engine))
    }

    /// The stages of one worker for a pack of the family MotionBricks.
    ///
    /// # Errors
    /// [`EngineError`] if they do not load.
    pub fn load(&self, pack: &Pack, engine: EngineKind) -> Result<OnnxStages, EngineError> {
        self.load_growing(pack, engine, self.growth)
    }

    fn load_growing(
        &self,
        pack: &Pack,
        engine: EngineKind,
        growth: Growth,
    ) -> Result<OnnxStages, EngineError> {
        let options = SessionOptions {
            engine,
            threads: self.workers.threads,
            spin: self.spin,
            fixed_shapes: engine == EngineKind::OpenvinoBf16 && self.no_fixed_shapes(pack).is_none(),
            growth,
            gpu: self.gpu_share(pack),
        };
        OnnxStages::load(&self.runtime, pack, options, &self.pool)
    }

    /// Why this pack has no networks of fixed shapes in its share of the pool. None if it has them.
    fn no_fixed_shapes(&self, pack: &Pack) -> Option<String> {
        let memory_bytes = self.pool.budget_bytes() / self.packs.max(1) as u64;
        no_fixed_shapes(&self.runtime, pack, memory_bytes)
    }

    /// The engines that `auto` tries before the reference. CUDA is one where the library is for
    /// GPUs, so that others hear nothing of it.
    fn faster(&self) -> Vec<EngineKind> {
        let cuda = self.runtime.offers(EngineKind::Cuda).then_some(EngineKind::Cuda);
        cuda.into_iter().chain([EngineKind::OpenvinoBf16]).collect()
    }

    /// What an engine needs and the machine or the library lacks. None if the engine can run.
    pub fn missing(&self, engine: EngineKind) -> Option<String> {
        if engine == EngineKind::OpenvinoBf16 && !self.machine.has_bf16() {
            return Some("the CPU has neither AVX512-BF16 nor AMX".to_owned());
        }
        if self.runtime.offers(engine) {
            return self.missing_for_gpu(engine);
        }
        let (library, get) = match engine {
            EngineKind::OpenvinoBf16 => ("OpenVINO", "`make runtime` fetches one that does"),
            EngineKind::Cuda | EngineKind::Tensorrt => (
                engine.name(),
                "`TROUPE_RUNTIME=gpu make runtime` fetches one that does",
            ),
            EngineKind::Cpu => ("CPUs", "set ORT_DYLIB_PATH to another"),
        };
        let path = self.runtime.library().display();
        Some(format!("the library {path} does not offer {library}; {get}"))
    }

    /// What an engine on a GPU needs and the machine lacks: shared libraries, or the GPU itself.
    fn missing_for_gpu(&self, engine: EngineKind) -> Option<String> {
        if !matches!(engine, EngineKind::Cuda | EngineKind::Tensorrt) {
            return None;
        }
        if let Err(missing) = self.runtime.load_needed(engine) {
            return Some(missing);
        }
        let (gpus, device) = (&self.machine.gpus, self.gpu.device);
        if gpus.is_empty() {
            return Some("NVIDIA's driver shows no GPU; `nvidia-smi` should list one".to_owned());
        }
        // CUDA_VISIBLE_DEVICES may leave fewer. CUDA itself says so at the first network.
        (device as usize >= gpus.len()).then(|| {
            let last = gpus.len() - 1;
            format!("gpu_device is {device}, and the machine's GPUs have the numbers 0 to {last}")
        })
    }

    /// [`Selector::check`], or its result if that was kept.
    fn kept_check(&self, pack: &Pack, engine: EngineKind) -> Result<Check, EngineError> {
        let (threads, library) = (self.workers.threads, self.runtime.library());
        let file = self.cache.file(pack, engine, threads, &self.machine, library);
        if let Some(check) = file.as_deref().and_then(checks::read) {
            return Ok(check);
        }
        let check = self.check(pack, engine)?;
        if let Some(file) = file {
            checks::write(&file, &check);
        }
        Ok(check)
    }

    /// Compares an engine, with the options of a server, with the reference.
    ///
    /// # Errors
    /// [`EngineError`] if a network of either does not load or run.
    pub fn check(&self, pack: &Pack, engine: EngineKind) -> Result<Check, EngineError> {
        let started = Instant::now();
        let reference = SessionOptions {
            engine: EngineKind::Cpu,
            // This pack's share of all threads: other packs are checked at the same time, and
            // nothing else runs.
            threads: (self.workers.threads * self.workers.count / self.packs.max(1)).max(1),
            spin: false,
            fixed_shapes: false,
            growth: Growth::None,
            gpu: GpuShare::default(),
        };
        let accuracy = match known(pack)? {
            Family::VerMo => {
                let reason = F32_ALONE.to_owned();
                return Err(EngineError::Unusable { engine, reason });
            }
            Family::UniMoGen => {
                let reference = OnnxDenoiser::load(&self.runtime, pack, reference)?;
                let candidate = self.load_denoiser(pack, engine)?;
                compare_paths(pack, Box::new(reference), Box::new(candidate))?
            }
            Family::SonicPlanner => {
                let reference = OnnxPlanner::load(&self.runtime, pack, reference)?;
                let candidate = self.load_planner(pack, engine)?;
                compare_planners(pack, Box::new(reference), Box::new(candidate))?
            }
            Family::MotionBricks => self.compare_stages(pack, reference, engine)?,
        };
        Ok(Check {
            engine,
            accuracy,
            passed: accuracy.passes(),
            took: started.elapsed(),
        })
    }

    fn compare_stages(
        &self,
        pack: &Pack,
        reference: SessionOptions,
        engine: EngineKind,
    ) -> Result<Accuracy, EngineError> {
        let reference = OnnxStages::load(&self.runtime, pack, reference, &self.pool)?;
        let Probe {
            batches,
            mut reference,
        } = probe(pack, Box::new(reference))?;
        let mut candidate: Box<dyn Stages> = Box::new(self.load_growing(pack, engine, Growth::None)?);
        compare(pack, &mut *reference, &mut *candidate, &batches)
    }
}

/// Why a VerMo pack has only one engine.
const F32_ALONE: &str = "networks of VerMo packs run only in f32";

/// The family of a pack. Fails if the engine does not run it.
pub(crate) fn known(pack: &Pack) -> Result<Family, EngineError> {
    pack.manifest.family().ok_or_else(|| EngineError::UnknownFamily {
        family: pack.manifest.family.clone(),
    })
}

/// An engine, the reason for it, and its accuracy check.
type Choice = (EngineKind, String, Option<Check>);

/// The engine that the configuration names. Fails if it cannot serve.
fn named(
    engine: EngineKind,
    mode: AccuracyCheck,
    missing: impl Fn(EngineKind) -> Option<String>,
    check: impl FnOnce(EngineKind) -> Result<Check, EngineError>,
) -> Result<Choice, EngineError> {
    let unusable = |reason: String| EngineError::Unusable { engine, reason };
    if let Some(missing) = missing(engine) {
        return Err(unusable(missing));
    }
    if engine == EngineKind::Cpu {
        return Ok((engine, "the configuration names it".to_owned(), None));
    }
    let check = check(engine).map_err(|error| unusable(error.to_string()))?;
    let why = match (check.passed, mode) {
        (true, _) => "the configuration names it, and it passes the accuracy check".to_owned(),
        (false, AccuracyCheck::Report) => format!(
            "the configuration names it, and it serves although it fails the accuracy check: {}",
            check.accuracy.failures()
        ),
        (false, AccuracyCheck::Enforce) => {
            return Err(unusable(format!(
                "it fails the accuracy check: {}. With accuracy_check = \"report\" it serves nevertheless",
                check.accuracy.failures()
            )));
        }
    };
    Ok((engine, why, Some(check)))
}

/// The first of some engines that can serve, else the reference.
fn best(
    mode: AccuracyCheck,
    faster: &[EngineKind],
    missing: impl Fn(EngineKind) -> Option<String>,
    check: impl Fn(EngineKind) -> Result<Check, EngineError>,
) -> Choice {
    let mut why_not = Vec::new();
    let mut last = None;
    for &engine in faster {
        if let Some(missing) = missing(engine) {
            why_not.push(format!("{engine} cannot serve: {missing}"));
            continue;
        }
        let check = match check(engine) {
            Ok(check) => check,
            Err(error) => {
                why_not.push(format!("{engine} cannot serve: {error}"));
                continue;
            }
        };
        let failures = check.accuracy.failures();
        let serves = match (check.passed, mode) {
            (true, _) => Some("passes the accuracy check".to_owned()),
            (false, AccuracyCheck::Report) => {
                Some(format!("serves although it fails the accuracy check: {failures}"))
            }
            (false, AccuracyCheck::Enforce) => None,
        };
        if let Some(serves) = serves {
            let has = match engine {
                EngineKind::Cpu | EngineKind::OpenvinoBf16 => "the CPU computes in bf16",
                EngineKind::Cuda | EngineKind::Tensorrt => "there is a GPU",
            };
            why_not.insert(0, format!("{has}, and the engine {serves}"));
            return (engine, why_not.join("; "), Some(check));
        }
        why_not.push(format!("{engine} fails the accuracy check: {failures}"));
        last = Some(check);
    }
    (EngineKind::Cpu, why_not.join("; "), last)
}

#[cfg(test)]
#[path = "select_tests.rs"]
mod tests;
