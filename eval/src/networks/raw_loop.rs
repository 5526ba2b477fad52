//! `troupe-eval raw-loop`: how many plans a second the networks of a pack make on this machine. It
//! is the raw ONNX Runtime loop, by engine, workers, batch size and segment length. No server with
//! the same allocator can be faster.

use std::path::PathBuf;
use std::sync::Barrier;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use anyhow::ensure;
use clap::Args;
use serde::Serialize;
use troupe_engine::gpu::GpuShare;
use troupe_engine::onnx::{Growth, NetworkPool, OnnxStages, Runtime, SessionOptions, no_fixed_shapes};
use troupe_engine::pack::Pack;
use troupe_engine::{
    EngineChoice, EngineError, EngineKind, Pipeline, RawLoop, StageTimes, Stages, Workers, straight_walk,
};
use troupe_motion::model::Dims;
use troupe_motion::model::KeyframeTask;

use crate::figures::{ms, percentile};

/// Measure the networks of a pack in a loop.
#[derive(Debug, Args)]
pub(crate) struct RawLoops {
    /// Folder of the pack.
    #[arg(long, default_value = "models/human", value_name = "FOLDER")]
    pack: PathBuf,
    /// Engines; auto is every engine that runs here.
    #[arg(long, value_delimiter = ',', default_value = "auto", value_name = "ENGINE,..")]
    engine: Vec<EngineChoice>,
    /// Workers, each a thread with its own loop; 0 is the server's own number.
    #[arg(long, value_delimiter = ',', default_value = "0", value_name = "COUNT,..")]
    workers: Vec<usize>,
    /// Threads over all workers; 0 is the server's own number.
    #[arg(long, default_value_t = 0, value_name = "COUNT")]
    threads: usize,
    /// Batch sizes.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "1,8,16,32,64",
        value_name = "SIZE,.."
    )]
    batch: Vec<usize>,
    /// Frames of a segment. A live session plans 36. The most is 64 with the default pack.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "36,64",
        value_name = "FRAMES,.."
    )]
    frames: Vec<usize>,
    /// What the loop runs. raw: all networks on every worker. stages: root and pose on one worker,
    /// and the decoder, for the batch before, on the next. pipeline: the server's pipeline, which
    /// also fills and samples.
    #[arg(long = "loop", value_enum, default_value = "raw")]
    kind: LoopKind,
    /// Time of a measurement.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    seconds: f64,
    /// Measurements of each row, in turns; the median counts.
    #[arg(long, default_value_t = 1, value_name = "COUNT")]
    repeats: usize,
    /// Time that a worker sleeps before each call, which is not counted. It shows what the requests
    /// of a lone caller cost a core that is idle in between.
    #[arg(long, default_value_t = 0, value_name = "MICROSECONDS")]
    pause_us: u64,
    /// Let waiting threads of a worker spin.
    #[arg(long)]
    spin: bool,
    /// Print one JSON document instead of a table.
    #[arg(long)]
    json: bool,
}

/// If networks of fixed shapes take more than this, the pack has one network for all shapes, as in
/// the server.
const MOST_NETWORK_BYTES: u64 = 200 << 20;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
enum LoopKind {
    Raw,
    Stages,
    Pipeline,
}

#[derive(Serialize)]
struct Output {
    pack: String,
    version: String,
    library: PathBuf,
    cores: usize,
    rows: Vec<Row>,
}

/// A row of the table: medians over the repeats.
#[derive(Serialize)]
struct Row {
    engine: EngineKind,
    #[serde(rename = "loop")]
    kind: LoopKind,
    workers: Workers,
    batch: usize,
    frames: usize,
    /// Plans a second over all workers, each of `frames` frames.
    plans_per_s: f64,
    frames_per_s: f64,
    /// Plans a second of each repeat.
    repeats: Vec<f64>,
    /// Time of one call for one batch, milliseconds.
    call_ms_p50: f64,
    call_ms_p99: f64,
    /// Shares of the time in each network, 0 to 1. The rest is outside of the networks.
    root_share: f64,
    pose_share: f64,
    decoder_share: f64,
}

/// The work of one worker in the loop.
enum Work {
    Raw(Box<RawLoop>),
    /// Root and pose, whenever the decoder's worker has room for a batch.
    Front(Box<RawLoop>, Turns),
    Decoder(Box<RawLoop>, Turns),
    Pipeline(Box<Pipeline>, Vec<KeyframeTask>),
}

/// One end of the queue between two workers.
struct Turns {
    mine: Receiver<()>,
    theirs: Sender<()>,
}

impl Turns {
    /// Batches of root and pose that may wait for the decoder.
    const ROOM: usize = 2;

    /// Both ends: for root and pose, and for the decoder.
    fn pair() -> (Self, Self) {
        let ((made, to_decode), (freed, room)) = (channel(), channel());
        for _ in 0..Self::ROOM {
            // It cannot fail, because `room` is alive.
            let _ = freed.send(());
        }
        let front = Self {
            mine: room,
            theirs: made,
        };
        let decoder = Self {
            mine: to_decode,
            theirs: freed,
        };
        (front, decoder)
    }

    /// Runs `stages` once it is its turn. Gives none if that does not come within `patience`,
    /// because the other worker has ended.
    fn take(
        &self,
        patience: Duration,
        stages: impl FnOnce() -> Result<StageTimes, EngineError>,
    ) -> Result<Option<StageTimes>, EngineError> {
        if self.mine.recv_timeout(patience).is_err() {
            return Ok(None);
        }
        let times = stages()?;
        let _ = self.theirs.send(());
        Ok(Some(times))
    }
}

impl Work {
    /// The work of each worker of a loop.
    fn of(
        args: &RawLoops,
        dims: Dims,
        most: usize,
        workers: usize,
        mut stages: impl FnMut() -> anyhow::Result<Box<dyn Stages>>,
    ) -> anyhow::Result<Vec<Self>> {
        let raw = |stages| Box::new(RawLoop::new(&dims, stages, most, dims.max_frames()));
        let mut works = Vec::new();
        while works.len() < workers {
            match args.kind {
                LoopKind::Raw => works.push(Self::Raw(raw(stages()?))),
                LoopKind::Stages => {
                    let (front, decoder) = Turns::pair();
                    works.push(Self::Front(raw(stages()?), front));
                    works.push(Self::Decoder(raw(stages()?), decoder));
                }
                LoopKind::Pipeline => {
                    let pipeline = Pipeline::new(dims, stages()?, most);
                    works.push(Self::Pipeline(Box::new(pipeline), Vec::new()));
                }
            }
        }
        Ok(works)
    }

    /// Whether it runs the last network of a batch.
    fn ends_batches(&self) -> bool {
        !matches!(self, Self::Front(..))
    }

    /// Runs a batch. Gives none if no batch comes within `patience`.
    fn run(&mut self, patience: Duration) -> anyhow::Result<Option<StageTimes>> {
        match self {
            Self::Raw(raw) => Ok(Some(raw.run()?)),
            Self::Front(raw, turns) => Ok(turns.take(patience, || raw.run_front())?),
            Self::Decoder(raw, turns) => Ok(turns.take(patience, || raw.run_decoder())?),
            Self::Pipeline(pipeline, items) => {
                let (answers, times) = pipeline.run(items)?;
                for answer in answers {
                    answer?;
                }
                Ok(Some(times))
            }
        }
    }

    fn set_shape(&mut self, dims: &Dims, batch: usize, frames: usize) {
        match self {
            Self::Raw(raw) | Self::Front(raw, _) | Self::Decoder(raw, _) => {
                raw.set_shape(dims, batch, frames);
            }
            Self::Pipeline(_, items) => *items = vec![straight_walk(dims, frames); batch],
        }
    }
}

pub(crate) fn run(args: &RawLoops) -> anyhow::Result<()> {
    let pack = Pack::load(&args.pack)?;
    let dims = pack.rig.dims;
    for &frames in &args.frames {
        let (low, high) = (dims.min_frames(), dims.max_frames());
        ensure!(
            (low..=high).contains(&frames),
            "--frames {frames}; allowed: {low} to {high}"
        );
    }
    ensure!(
        args.repeats > 0 && args.seconds > 0.0,
        "--repeats and --seconds: allowed is more than 0"
    );
    ensure!(
        args.batch.iter().all(|&batch| batch > 0),
        "--batch: allowed is more than 0"
    );
    let runtime = Runtime::new(None)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);

    let mut output = Output {
        pack: pack.name().to_owned(),
        version: pack.manifest.version.clone(),
        library: runtime.library().to_owned(),
        cores,
        rows: Vec::new(),
    };
    if !args.json {
        println!(
            "pack {} {}, {}",
            output.pack,
            output.version,
            output.library.display()
        );
        println!(
            "{:<14} {:>5} {:>7} {:>5} {:>6} {:>9} {:>9} {:>8} {:>8}   root pose decoder %",
            "engine", "workers", "threads", "batch", "frames", "plans/s", "frames/s", "ms p50", "ms p99"
        );
    }
    for engine in engines(&args.engine, &runtime) {
        for &workers in &args.workers {
            let workers = Workers::plan(workers, args.threads, cores);
            let options = SessionOptions {
                engine,
                threads: workers.threads,
                spin: args.spin,
                fixed_shapes: no_fixed_shapes(&runtime, &pack, MOST_NETWORK_BYTES).is_none(),
                growth: Growth::AtOnce,
                gpu: GpuShare::default(),
            };
            let pool = NetworkPool::new(u64::MAX);
            let most = args.batch.iter().copied().max().unwrap_or(1);
            ensure!(
                args.kind != LoopKind::Stages || workers.count.is_multiple_of(2),
                "--workers {}; allowed with --loop stages: an even number",
                workers.count
            );
            let mut works = Work::of(args, dims, most, workers.count, || {
                Ok(Box::new(OnnxStages::load(&runtime, &pack, options, &pool)?))
            })?;
            let first = output.rows.len();
            for repeat in 0..args.repeats {
                let shapes = args
                    .frames
                    .iter()
                    .flat_map(|&frames| args.batch.iter().map(move |&batch| (batch, frames)));
                for (index, (batch, frames)) in shapes.enumerate() {
                    let time = Duration::from_secs_f64(args.seconds);
                    let pause = Duration::from_micros(args.pause_us);
                    let run = measure(&mut works, &dims, (batch, frames), time, pause)?;
                    if repeat == 0 {
                        output
                            .rows
                            .push(run.row(engine, args.kind, workers, batch, frames));
                    } else {
                        output.rows[first + index].join(&run);
                    }
                }
            }
            if !args.json {
                output.rows[first..].iter().for_each(Row::print);
            }
        }
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&output)?);
    }
    Ok(())
}

fn engines(wanted: &[EngineChoice], runtime: &Runtime) -> Vec<EngineKind> {
    let mut engines: Vec<EngineKind> = Vec::new();
    for choice in wanted {
        let here = EngineKind::ALL
            .into_iter()
            .filter(|&engine| runtime.offers(engine));
        match choice.named() {
            Some(engine) => engines.push(engine),
            None => engines.extend(here),
        }
    }
    engines
}

/// Longest wait for a batch of the other worker: at first, when networks may have to be opened, and
/// while it measures.
const WARM_UP: Duration = Duration::from_secs(60);
const LAST_TURN: Duration = Duration::from_millis(50);

/// One measurement of one shape.
struct Run {
    plans_per_s: f64,
    /// Times of all calls on workers that end batches, with the wait for their turn, milliseconds.
    calls_ms: Vec<f64>,
    sum: StageTimes,
    busy: Duration,
}

/// Runs batches of (rows, frames) on all workers for `time`, each after a `pause`. A first batch
/// does not count.
fn measure(
    works: &mut [Work],
    dims: &Dims,
    (batch, frames): (usize, usize),
    time: Duration,
    pause: Duration,
) -> anyhow::Result<Run> {
    let barrier = Barrier::new(works.len());
    let worker = |work: &mut Work| -> anyhow::Result<(Vec<f64>, StageTimes, Duration)> {
        work.set_shape(dims, batch, frames);
        let warm = work.run(WARM_UP);
        // Every worker must arrive here, even after an error.
        barrier.wait();
        warm?;
        let (mut calls, mut sum) = (Vec::new(), StageTimes::default());
        let started = Instant::now();
        while started.elapsed() < time {
            if !pause.is_zero() {
                std::thread::sleep(pause);
            }
            let call = Instant::now();
            let Some(times) = work.run(LAST_TURN)? else {
                continue;
            };
            if work.ends_batches() {
                calls.push(ms(call.elapsed()));
            }
            sum.root += times.root;
            sum.pose += times.pose;
            sum.decoder += times.decoder;
        }
        Ok((calls, sum, started.elapsed()))
    };
    let workers = std::thread::scope(|scope| {
        let threads: Vec<_> = works
            .iter_mut()
            .map(|work| scope.spawn(|| worker(work)))
            .collect();
        threads
            .into_iter()
            .map(|thread| thread.join().map_err(|_| anyhow::anyhow!("a worker panicked"))?)
            .collect::<anyhow::Result<Vec<_>>>()
    })?;
    let mut run = Run {
        plans_per_s: 0.0,
        calls_ms: Vec::new(),
        sum: StageTimes::default(),
        busy: Duration::ZERO,
    };
    for (calls, sum, took) in workers {
        run.plans_per_s += (calls.len() * batch) as f64 / took.as_secs_f64();
        run.calls_ms.extend(calls);
        run.sum.root += sum.root;
        run.sum.pose += sum.pose;
        run.sum.decoder += sum.decoder;
        run.busy += took;
    }
    Ok(run)
}

impl Run {
    fn row(&self, engine: EngineKind, kind: LoopKind, workers: Workers, batch: usize, frames: usize) -> Row {
        let share = |stage: Duration| stage.as_secs_f64() / self.busy.as_secs_f64();
        Row {
            engine,
            kind,
            workers,
            batch,
            frames,
            plans_per_s: self.plans_per_s,
            frames_per_s: self.plans_per_s * frames as f64,
            repeats: vec![self.plans_per_s],
            call_ms_p50: percentile(&self.calls_ms, 0.5),
            call_ms_p99: percentile(&self.calls_ms, 0.99),
            root_share: share(self.sum.root),
            pose_share: share(self.sum.pose),
            decoder_share: share(self.sum.decoder),
        }
    }
}

impl Row {
    /// Adds another measurement of the same shape. The other figures of the row come from the
    /// measurement nearest to the median.
    fn join(&mut self, run: &Run) {
        let other = run.row(self.engine, self.kind, self.workers, self.batch, self.frames);
        self.repeats.push(run.plans_per_s);
        let median = percentile(&self.repeats, 0.5);
        if (other.plans_per_s - median).abs() < (self.plans_per_s - median).abs() {
            *self = Row {
                repeats: std::mem::take(&mut self.repeats),
                ..other
            };
        }
    }

    fn print(&self) {
        println!(
            "{:<14} {:>5} {:>7} {:>5} {:>6} {:>9.1} {:>9.0} {:>8.2} {:>8.2}   {:>4.0} {:>4.0} {:>7.0}",
            self.engine.name(),
            self.workers.count,
            self.workers.threads,
            self.batch,
            self.frames,
            self.plans_per_s,
            self.frames_per_s,
            self.call_ms_p50,
            self.call_ms_p99,
            100.0 * self.root_share,
            100.0 * self.pose_share,
            100.0 * self.decoder_share,
        );
    }
}
