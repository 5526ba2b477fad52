//! A game server's loop: many characters that wander about, and how well it keeps its time.
//!
//! ```text
//! cargo run --release --package troupe-client --example crowd -- --count 200 --seconds 60
//! ```
//!
//! By default the loop keeps the time itself: at every tick it steps all characters by one frame.
//! With `--drive` the server does, and the loop takes ticks as they come. Ticks are timed from when
//! they were due, not from when the loop got round to them. Underruns are the server's own count: a
//! step waits for its plans, so that it has none, but comes late instead.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use clap::Parser;
use glam::Vec3;
use hdrhistogram::{CreationError, Histogram};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tokio::sync::mpsc;
use troupe_client::{
    Client, ClientError, Crowd, CrowdOptions, DriveEvent, DriveOptions, Encoding, FrameOptions, Locomotion,
    Pack, Rate, Session, SessionOptions,
};
use troupe_proto::v1::{SessionStats, Style};

/// Have a crowd wander about on a Troupe server.
#[derive(Debug, Parser)]
struct Arguments {
    /// Address of the server.
    #[arg(long, env = "TROUPE_SERVER", default_value = "http://127.0.0.1:8080")]
    server: String,
    /// Characters.
    #[arg(long, default_value_t = 200)]
    count: usize,
    /// How long.
    #[arg(long, default_value_t = 60)]
    seconds: u32,
    /// Ticks a second: 30, 50 or 60.
    #[arg(long, default_value_t = 30, value_parser = rate)]
    rate: u32,
    /// Let the server keep the time.
    #[arg(long)]
    drive: bool,
    /// 32-bit floats instead of compact frames.
    #[arg(long)]
    floats: bool,
    /// All random choices follow from it.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Styles to use, each by its name; without it all of the pack.
    #[arg(long, value_delimiter = ',')]
    styles: Vec<String>,
    /// Frames between the cursor and the point where a new plan takes over.
    #[arg(long)]
    look_ahead: Option<u32>,
    /// Watch from the middle of the square: priority falls with the distance, from 1 to 0.
    #[arg(long)]
    camera: bool,
}

fn rate(text: &str) -> Result<u32, String> {
    match text {
        "30" => Ok(30),
        "50" => Ok(50),
        "60" => Ok(60),
        other => Err(format!("{other} is not 30, 50 or 60")),
    }
}

/// The characters stay in a square of this side, metres.
const SQUARE_M: f32 = 30.0;

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments = Arguments::parse();
    let client = Client::connect(&arguments.server).await?;
    let pack = client.pack("").await?;
    let styles = styles(&client, &pack, &arguments.styles).await?;
    let wanderers = (0..arguments.count).map(|i| Wanderer::new(arguments.seed, i, &styles));
    let mut wanderers = wanderers.collect::<Vec<_>>();
    let options = wanderers.iter().zip(arguments.seed..);
    let options = options.map(|(wanderer, seed)| wanderer.options(seed, arguments.look_ahead));
    let sessions = client.open_sessions(&pack, &options.collect::<Vec<_>>()).await?;
    let ids = sessions.iter().map(|s| s.id().to_owned()).collect::<Vec<_>>();

    let (printer, seconds) = mpsc::channel(8);
    let printing = tokio::spawn(print_seconds(client.clone(), ids.clone(), seconds));
    let mut report = Report::new(frame_options(&arguments).rate, ids.len(), printer)?;
    if arguments.drive {
        drive(&client, &arguments, sessions, &mut wanderers, &mut report).await?;
    } else {
        step(&client, &pack, &arguments, sessions, &mut wanderers, &mut report).await?;
    }
    let stats = stats(&client, &ids).await?;
    client.close_sessions(ids).await?;
    report.print(&stats);
    drop(report);
    printing.await?;
    Ok(())
}

async fn styles(
    client: &Client,
    pack: &Pack,
    wanted: &[String],
) -> Result<Vec<Style>, Box<dyn std::error::Error>> {
    let mut styles = client.styles(pack).await?.styles;
    // Those that only stand do not wander.
    styles.retain(|s| !s.is_static && (wanted.is_empty() || wanted.contains(&s.name)));
    if styles.is_empty() {
        return Err("the pack has none of these styles".into());
    }
    Ok(styles)
}

/// How frames are taken.
fn frame_options(arguments: &Arguments) -> FrameOptions {
    FrameOptions {
        rate: match arguments.rate {
            50 => Rate::Hz50,
            60 => Rate::Hz60,
            _ => Rate::Hz30,
        },
        encoding: if arguments.floats {
            Encoding::F32
        } else {
            Encoding::Compact
        },
        positions: false,
    }
}

/// The game's clock: a tick at every multiple of the period, late or not.
async fn step(
    client: &Client,
    pack: &Pack,
    arguments: &Arguments,
    sessions: Vec<Session>,
    wanderers: &mut [Wanderer],
    report: &mut Report,
) -> Result<(), ClientError> {
    let frames = frame_options(arguments);
    let options = CrowdOptions {
        frames,
        ..CrowdOptions::default()
    };
    let mut crowd = Crowd::new(client, pack, options);
    let members = sessions.into_iter().map(|s| crowd.adopt(s)).collect::<Vec<_>>();
    let begin = Instant::now() + Duration::from_millis(100);
    for tick in 0..arguments.seconds * arguments.rate {
        let due = begin + frames.rate.period() * tick;
        tokio::time::sleep_until(due.into()).await;
        for (wanderer, &member) in wanderers.iter_mut().zip(&members) {
            if let Some(intent) = crowd.intent_mut(member) {
                wanderer.decide(tick, arguments.rate, intent);
            }
            if arguments.camera {
                crowd.set_priority(member, wanderer.priority());
            }
        }
        let step = crowd.step(1).await?;
        for (member, frames) in step.characters() {
            if let Some(frame) = frames.last() {
                wanderers[member.index()].place = frame.root;
            }
        }
        report.tick(due.elapsed(), step.characters().count());
        for fault in step.faults() {
            eprintln!("{}: {}", fault.session, fault.problem);
        }
    }
    Ok(())
}

/// The server's clock: ticks as they come, timed from when the first had them due.
async fn drive(
    client: &Client,
    arguments: &Arguments,
    sessions: Vec<Session>,
    wanderers: &mut [Wanderer],
    report: &mut Report,
) -> Result<(), ClientError> {
    let frames = frame_options(arguments);
    let ids = sessions.iter().map(|s| s.id().to_owned()).collect::<Vec<_>>();
    let places = ids.iter().enumerate().map(|(nth, id)| (id.as_str(), nth));
    let places = places.collect::<HashMap<_, _>>();
    let options = DriveOptions {
        frames,
        ..DriveOptions::default()
    };
    let mut drive = client.drive(options).await?;
    drive.attach(sessions).await?;
    let mut first = None;
    let mut now = 0;
    while now < arguments.seconds * arguments.rate {
        for (wanderer, id) in wanderers.iter_mut().zip(&ids) {
            if let Some(intent) = drive.intent_mut(id) {
                wanderer.decide(now, arguments.rate, intent);
            }
            if arguments.camera {
                drive.set_priority(id, wanderer.priority());
            }
        }
        let Some(update) = drive.next().await? else { break };
        for event in &update.events {
            if !matches!(event, DriveEvent::Attached { .. }) {
                eprintln!("{event:?}");
            }
        }
        let Some(tick) = update.tick else { continue };
        let mut here = 0;
        for (id, frames) in tick.characters() {
            here += 1;
            if let (Some(&nth), Some(frame)) = (places.get(id), frames.last()) {
                wanderers[nth].place = frame.root;
            }
        }
        if first.is_none() && here < ids.len() {
            // Not all are on the stream yet.
            continue;
        }
        let (begin, number) = *first.get_or_insert((Instant::now(), tick.number()));
        now = u32::try_from(tick.number() - number).unwrap_or(u32::MAX);
        let due = begin + frames.rate.period() * now;
        report.tick(due.elapsed(), here);
        report.dropped = tick.dropped();
    }
    drive.close().await?;
    Ok(())
}

/// What sessions have done so far, added up.
async fn stats(client: &Client, ids: &[String]) -> Result<SessionStats, ClientError> {
    let open = client.list_sessions().await?;
    let ours = open.iter().filter(|s| ids.contains(&s.id));
    Ok(ours.filter_map(|s| s.stats.as_ref()).sum())
}

/// Somebody who wanders about.
struct Wanderer {
    random: ChaCha8Rng,
    style: String,
    speed_mps: f32,
    place: Vec3,
    heading: f32,
    decides_at: u32,
}

impl Wanderer {
    fn new(seed: u64, nth: usize, styles: &[Style]) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(nth as u64));
        let style = &styles[nth % styles.len()];
        let mut coordinate = || (random.random::<f32>() - 0.5) * SQUARE_M;
        let place = Vec3::new(coordinate(), 0.0, coordinate());
        Self {
            heading: random.random_range(-3.0..3.0),
            style: style.name.clone(),
            speed_mps: style.default_speed,
            place,
            decides_at: random.random_range(0..60),
            random,
        }
    }

    fn options(&self, seed: u64, look_ahead: Option<u32>) -> SessionOptions {
        let options = SessionOptions::new()
            .seed(seed)
            .style(&self.style)
            .at(self.place, self.heading);
        match look_ahead {
            Some(frames) => options.look_ahead_frames(frames),
            None => options,
        }
    }

    /// By the distance from the middle, in tenths: every change is a command.
    fn priority(&self) -> f32 {
        let far = self.place.length() / (SQUARE_M / 2.0);
        ((1.0 - far.min(1.0)) * 10.0).round() / 10.0
    }

    /// Every second to four of them, something else: mostly to go somewhere, sometimes to stand or
    /// to look elsewhere than where it goes.
    fn decide(&mut self, tick: u32, rate: u32, intent: &mut Locomotion) {
        if tick < self.decides_at {
            return;
        }
        self.decides_at = tick + self.random.random_range(rate..4 * rate);
        if self.random.random_bool(0.15) {
            *intent = Locomotion::stand();
            return;
        }
        // Back towards the middle where the edge is near.
        let out = self.place.length() > SQUARE_M / 2.0;
        self.heading = if out {
            (-self.place.x).atan2(-self.place.z)
        } else {
            self.heading + self.random.random_range(-1.5..1.5)
        };
        let speed = self.speed_mps * self.random.random_range(0.7..1.2);
        let way = Vec3::new(self.heading.sin(), 0.0, self.heading.cos());
        *intent = Locomotion::walk(way * speed);
        if self.random.random_bool(0.1) {
            *intent =
                Locomotion::walk(way * speed).facing(self.heading + self.random.random_range(-0.8..0.8));
        }
    }
}

/// Ticks as they are done.
struct Report {
    rate: Rate,
    count: usize,
    second: Histogram<u64>,
    all: Histogram<u64>,
    late: u64,
    late_before: u64,
    missing: u64,
    dropped: u64,
    printer: mpsc::Sender<Second>,
}

/// A second's ticks.
struct Second {
    p50: u64,
    p99: u64,
    max: u64,
    late: u64,
}

impl Report {
    fn new(rate: Rate, count: usize, printer: mpsc::Sender<Second>) -> Result<Self, CreationError> {
        // From a microsecond to a minute, three digits.
        let histogram = || Histogram::new_with_bounds(1, 60_000_000, 3);
        Ok(Self {
            rate,
            count,
            second: histogram()?,
            all: histogram()?,
            late: 0,
            late_before: 0,
            missing: 0,
            dropped: 0,
            printer,
        })
    }

    /// A tick that was done so long after it was due, with so many characters.
    fn tick(&mut self, after: Duration, characters: usize) {
        let micros = u64::try_from(after.as_micros()).unwrap_or(u64::MAX);
        self.second.saturating_record(micros);
        self.all.saturating_record(micros);
        self.late += u64::from(after > self.rate.period());
        self.missing += (self.count - characters.min(self.count)) as u64;
        if self.second.len() >= u64::from(self.rate.hz()) {
            let second = Second {
                p50: self.second.value_at_quantile(0.5),
                p99: self.second.value_at_quantile(0.99),
                max: self.second.max(),
                late: self.late - self.late_before,
            };
            // A second that cannot be printed yet is only missing on the screen.
            let _ = self.printer.try_send(second);
            self.second.reset();
            self.late_before = self.late;
        }
    }

    fn print(&self, stats: &SessionStats) {
        println!(
            "{} characters at {} Hz, {} ticks: p50 {} ms, p99 {} ms, most {} ms after they were due; {} later than a period, \
             {} dropped, {} character frames missing",
            self.count,
            self.rate.hz(),
            self.all.len(),
            in_ms(self.all.value_at_quantile(0.5)),
            in_ms(self.all.value_at_quantile(0.99)),
            in_ms(self.all.max()),
            self.late,
            self.dropped,
            self.missing,
        );
        println!(
            "plans: {} for commands, {} for a low buffer, {} after the interval; {} late, {} failed\nunderruns: {}",
            stats.plans_for_command,
            stats.plans_for_low_buffer,
            stats.plans_for_interval,
            stats.late_plans,
            stats.failed_plans,
            stats.underruns,
        );
    }
}

/// Prints a line each second. It asks the server for its figures, beside the loop so as not to hold
/// it up.
async fn print_seconds(client: Client, ids: Vec<String>, mut seconds: mpsc::Receiver<Second>) {
    println!(
        "second  tick p50     p99     max ms  late  plans: command  low buffer  interval  late  underruns"
    );
    let mut before = SessionStats::default();
    let mut nth = 0;
    while let Some(second) = seconds.recv().await {
        let Ok(stats) = stats(&client, &ids).await else {
            return;
        };
        nth += 1;
        println!(
            "{nth:>6}  {:>8} {:>7} {:>7}     {:>4}  {:>14}  {:>10}  {:>8}  {:>4}  {:>9}",
            in_ms(second.p50),
            in_ms(second.p99),
            in_ms(second.max),
            second.late,
            stats.plans_for_command - before.plans_for_command,
            stats.plans_for_low_buffer - before.plans_for_low_buffer,
            stats.plans_for_interval - before.plans_for_interval,
            stats.late_plans - before.late_plans,
            stats.underruns - before.underruns,
        );
        before = stats;
    }
}

fn in_ms(micros: u64) -> String {
    format!("{:.1}", micros as f64 / 1e3)
}
