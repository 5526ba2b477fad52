//! Characters that wander about. All their choices follow from a seed.

use std::time::Duration;

use glam::Vec3;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tokio::time::Instant;
use troupe_client::{Act, Client, Locomotion, Pack, Performance, SessionOptions};
use troupe_proto::v1;
use troupe_proto::v1::Style;

use crate::failure::Failure;
use crate::plan::Live;

/// Side of the square in which characters stay, metres.
const SQUARE_M: f32 = 30.0;
/// Share of commands to stand.
const STANDS: f64 = 0.15;
/// Share of commands to face away from the direction of walking.
const LOOKS_ASIDE: f64 = 0.1;
/// Below this speed, a character counts as standing, m/s. It is above 0, because hips sway a
/// little.
const STANDS_BELOW_MPS: f32 = 0.15;
/// From this share of the commanded speed on, a character counts as moving.
const MOVES_FROM: f32 = 0.25;
/// Mean time between two sentences of a performer, seconds.
const SENTENCE_EVERY_S: f64 = 6.0;
/// Length of a performance, seconds.
const SENTENCE_S: f32 = 3.0;
/// Sentences to act out.
const SENTENCES: [&str; 4] = [
    "a person waves with the right hand",
    "a person walks in a circle",
    "someone dances",
    "a tired person sits down",
];
/// Weight of a new frame in the smoothed speed, 0 to 1.
const SMOOTHING: f32 = 0.5;

/// The styles of a pack that move from place to place: all of them, or those named in `wanted`.
pub(super) async fn styles(client: &Client, pack: &Pack, wanted: &[String]) -> Result<Vec<Style>, Failure> {
    let all = client.styles(pack).await?.styles;
    if let Some(unknown) = wanted.iter().find(|name| !all.iter().any(|s| s.name == **name)) {
        let names = all.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(Failure::option("--styles", format_args!("{unknown:?}"), names));
    }
    let chosen = all
        .into_iter()
        .filter(|s| !s.is_static && (wanted.is_empty() || wanted.contains(&s.name)))
        .collect::<Vec<_>>();
    if chosen.is_empty() {
        return Err(Failure::Input(
            "--styles has only styles that stay in place; allowed: at least one that moves".to_owned(),
        ));
    }
    Ok(chosen)
}

/// Whether character number `nth` of a crowd performs. Performers are spread evenly.
fn is_performer(nth: u32, share: f64) -> bool {
    let before = |count: u32| (f64::from(count) * share).floor();
    before(nth + 1) > before(nth)
}

/// A character that wanders about.
#[derive(Debug)]
pub(super) struct Walker {
    /// Id of its session.
    pub(super) id: String,
    random: ChaCha8Rng,
    style: String,
    speed_mps: f32,
    place: Vec3,
    heading: f32,
    velocity: Vec3,
    every_s: f64,
    /// Whether it acts out sentences after its first command to walk.
    performs: bool,
    decides_at: Option<Duration>,
    sequence: u64,
    setting_off: Option<SettingOff>,
}

/// The start of a character that stood when it got a command to walk.
#[derive(Debug)]
struct SettingOff {
    commanded: Instant,
    velocity: Vec3,
}

impl Walker {
    /// Makes character number `nth` of a crowd.
    pub(super) fn new(seed: u64, nth: u32, styles: &[Style], live: &Live) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(u64::from(nth));
        let style = &styles[nth as usize % styles.len().max(1)];
        let mut coordinate = || (random.random::<f32>() - 0.5) * SQUARE_M;
        let place = Vec3::new(coordinate(), 0.0, coordinate());
        let every_s = live.command_every_s;
        // The first commands are spread over time. Otherwise all characters would always plan at
        // the same time.
        let first = random.random_range(0.0..if every_s > 0.0 { every_s } else { 1.0 });
        Self {
            id: String::new(),
            heading: random.random_range(-3.0..3.0),
            style: style.name.clone(),
            speed_mps: style.default_speed,
            place,
            velocity: Vec3::ZERO,
            every_s,
            performs: is_performer(nth, live.performers),
            decides_at: Some(Duration::from_secs_f64(first)),
            sequence: 0,
            setting_off: None,
            random,
        }
    }

    /// Options of the character's session.
    pub(super) fn options(&self, seed: u64) -> SessionOptions {
        SessionOptions::new()
            .seed(seed)
            .style(&self.style)
            .at(self.place, self.heading)
    }

    /// The next command, if one is due. `at` is the time since the start of the load.
    pub(super) fn decide(&mut self, at: Duration, now: Instant) -> Option<v1::Command> {
        if at < self.decides_at? {
            return None;
        }
        if self.performs && self.sequence > 0 {
            return Some(self.perform(at));
        }
        let every_s = if self.performs {
            SENTENCE_EVERY_S
        } else {
            self.every_s
        };
        self.decides_at = (every_s > 0.0).then(|| at + self.wait(every_s));
        let intent = self.intent();
        let standing = self.velocity.length() < STANDS_BELOW_MPS;
        self.setting_off = (standing && intent.velocity != Vec3::ZERO).then_some(SettingOff {
            commanded: now,
            velocity: intent.velocity,
        });
        self.sequence += 1;
        Some(v1::Command {
            session_id: self.id.clone(),
            sequence: self.sequence,
            intent: Some(v1::command::Intent::Locomote(intent.to_message())),
            ..v1::Command::default()
        })
    }

    /// A random time with this mean, seconds.
    fn wait(&mut self, mean_s: f64) -> Duration {
        Duration::from_secs_f64(mean_s * self.random.random_range(0.5..1.5))
    }

    /// The command to act out a sentence.
    fn perform(&mut self, at: Duration) -> v1::Command {
        // The next sentence begins only after this one has ended.
        let rest = SENTENCE_EVERY_S - f64::from(SENTENCE_S);
        self.decides_at = Some(at + Duration::from_secs_f32(SENTENCE_S) + self.wait(rest));
        self.setting_off = None;
        self.sequence += 1;
        let sentence = SENTENCES[self.random.random_range(0..SENTENCES.len())];
        let performance = Performance::of(sentence).seconds(SENTENCE_S);
        v1::Command {
            session_id: self.id.clone(),
            sequence: self.sequence,
            intent: Some(Act::from(performance).into()),
            ..v1::Command::default()
        }
    }

    /// A random decision: mostly to walk, sometimes to stand or to face aside while walking.
    fn intent(&mut self) -> Locomotion {
        if self.every_s > 0.0 && self.random.random_bool(STANDS) {
            return Locomotion::stand();
        }
        // Beyond the edge it turns back towards the middle.
        self.heading = if self.place.length() > SQUARE_M / 2.0 {
            (-self.place.x).atan2(-self.place.z)
        } else {
            self.heading + self.random.random_range(-1.5..1.5)
        };
        let speed = self.speed_mps * self.random.random_range(0.7..1.2);
        let way = Vec3::new(self.heading.sin(), 0.0, self.heading.cos()) * speed;
        if self.random.random_bool(LOOKS_ASIDE) {
            return Locomotion::walk(way).facing(self.heading + self.random.random_range(-0.8..0.8));
        }
        Locomotion::walk(way)
    }

    /// Takes the character's position, `seconds` after the frame before. After a command to a
    /// standing character, it returns once the time from the command to the motion.
    pub(super) fn seen(&mut self, place: Vec3, seconds: f32, now: Instant) -> Option<Duration> {
        let step = (place - self.place) / seconds;
        self.place = place;
        self.velocity += (Vec3::new(step.x, 0.0, step.z) - self.velocity) * SMOOTHING;
        let off = self.setting_off.as_ref()?;
        if self.velocity.dot(off.velocity) < MOVES_FROM * off.velocity.length_squared() {
            return None;
        }
        let commanded = off.commanded;
        self.setting_off = None;
        Some(now.saturating_duration_since(commanded))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walker(seed: u64, nth: u32) -> Walker {
        let style = Style {
            name: "walk".to_owned(),
            default_speed: 1.5,
            ..Style::default()
        };
        let live = Live {
            characters: 1,
            streams: 1,
            rate_hz: 30,
            compact: true,
            pack: String::new(),
            skeleton: None,
            styles: Vec::new(),
            command_every_s: 2.0,
            look_ahead: None,
            spread_priorities: false,
            performers: 0.0,
            verify_every: 0,
        };
        Walker::new(seed, nth, &[style], &live)
    }

    fn commands(walker: &mut Walker, seconds: u32) -> Vec<v1::Command> {
        let now = Instant::now();
        let ticks = (0..seconds * 30).map(|tick| Duration::from_secs(1) * tick / 30);
        ticks.filter_map(|at| walker.decide(at, now)).collect()
    }

    #[test]
    fn choices_follow_from_the_seed() {
        let of = |seed, nth| commands(&mut walker(seed, nth), 20);
        assert_eq!(of(1, 2), of(1, 2));
        assert_ne!(of(1, 2), of(1, 3));
        assert_ne!(of(1, 2), of(2, 2));
    }

    #[test]
    fn commands_come_at_the_mean_time_with_numbers_that_count_up() {
        let commands = commands(&mut walker(5, 0), 400);
        assert!((170..230).contains(&commands.len()), "{}", commands.len());
        assert!(commands.iter().zip(1..).all(|(c, nth)| c.sequence == nth));
    }

    #[test]
    fn a_share_of_the_crowd_performs_and_walks_between() {
        let count = |share| (0..100).filter(|&nth| is_performer(nth, share)).count();
        assert_eq!([0.0, 0.25, 0.5, 1.0].map(count), [0, 25, 50, 100]);
        let mut performer = walker(3, 0);
        performer.performs = true;
        let commands = commands(&mut performer, 300);
        assert!((40..60).contains(&commands.len()), "{}", commands.len());
        for (command, nth) in commands.iter().zip(1..) {
            assert_eq!(command.sequence, nth);
            let performs = matches!(command.intent, Some(v1::command::Intent::Perform(_)));
            assert_eq!(performs, nth > 1, "{command:?}");
        }
    }

    #[test]
    fn the_time_from_command_to_motion_is_measured_once() {
        let mut walker = walker(1, 0);
        let commanded = Instant::now();
        walker.setting_off = Some(SettingOff {
            commanded,
            velocity: Vec3::Z,
        });
        let mut place = walker.place;
        let mut seen = Vec::new();
        for tick in 1..40_u32 {
            // It starts after ten frames.
            place.z += if tick > 10 { 1.0 / 30.0 } else { 0.0 };
            let now = commanded + Duration::from_secs(1) * tick / 30;
            seen.extend(
                walker
                    .seen(place, 1.0 / 30.0, now)
                    .map(|after| (after.as_secs_f64() * 30.0).round()),
            );
        }
        assert_eq!(seen, [11.0]);
    }
}
