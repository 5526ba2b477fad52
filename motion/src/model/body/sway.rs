//! How the root of a walking body moves about its path.
//!
//! A root sways to the side with each stride, hurries and slows with each step, and turns with the
//! legs. A network that learned from captured roots reads the phase of the gait in it. A drawn path
//! has none of that, and feet slide on it. So the path gets the sway of the body's clips, in step
//! with the legs of the frames before.

use std::f32::consts::TAU;

use glam::Vec3;
use serde::Deserialize;

use super::error::BodyError;
use crate::features::FEATURES_PER_JOINT;
use crate::interpolate::smoothstep;
use crate::model::{KeyTensors, PathTask};
use crate::root::wrap_angle;
use crate::skeleton::Skeleton;

/// A sway has sines of the stride's rate and of multiples of it.
const HARMONICS: usize = 2;
/// Half the time over which speed and direction of a path are measured, seconds.
const CHORD_S: f32 = 0.27;
/// Time over which the path leads over from the root of the frames before, seconds.
const LEAD_S: f32 = 0.5;
/// A sway fades out over this time before given frames, seconds.
const END_S: f32 = 0.5;
/// Angles between heading and travel: up to the first the sway is whole, from the second on there
/// is none. Clips that go straight show it.
const ASIDE_RAD: [f32; 2] = [0.5, 1.0];
/// Phases that are compared with the frames before.
const PHASES: usize = 64;
/// Beyond the clips' speeds the stride's rate changes with this power of the speed.
const RATE_POWER: f32 = 0.5;

/// The table `[sway]` of a body's file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SwayDoc {
    /// The left and the right foot.
    feet: [String; 2],
    gaits: Vec<GaitDoc>,
}

/// The gait of a word. All lists have an entry for each speed.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct GaitDoc {
    /// None: the gait of styles whose words have none.
    word: Option<String>,
    speeds_mps: Vec<f32>,
    /// Strides a second.
    rates_hz: Vec<f32>,
    /// Cosine and sine of the phase, then of its multiples.
    left_m: Vec<Waves>,
    ahead_m: Vec<Waves>,
    heading_rad: Vec<Waves>,
    /// How far the left foot is ahead of the right one. Phase 0 is its greatest distance.
    stride_m: Vec<Waves>,
}

type Waves = [f32; 2 * HARMONICS];

/// The gaits of a body's clips.
#[derive(Debug, Clone, PartialEq)]
pub struct Sway {
    /// Joints of the left and the right foot.
    feet: [usize; 2],
    gaits: Vec<Gait>,
}

#[derive(Debug, Clone, PartialEq)]
struct Gait {
    /// Index of the pack's word.
    word: Option<usize>,
    /// By rising speed.
    at: Vec<Moment>,
}

/// A gait at a speed.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Moment {
    speed_mps: f32,
    rate_hz: f32,
    left_m: Waves,
    ahead_m: Waves,
    heading_rad: Waves,
    stride_m: Waves,
}

/// How a path goes at a frame.
#[derive(Debug, Clone, Copy)]
struct Travel {
    speed_mps: f32,
    /// Radians, like headings.
    direction_rad: f32,
}

impl Sway {
    /// Checks a table. `words` are the pack's.
    ///
    /// # Errors
    /// [`BodyError`] with the field and its range.
    pub fn new(doc: SwayDoc, skeleton: &Skeleton, words: &[String]) -> Result<Self, BodyError> {
        let mut feet = [0; 2];
        for (foot, name) in feet.iter_mut().zip(&doc.feet) {
            let found = skeleton.joint_index(name);
            *foot = found.ok_or_else(|| BodyError::field("sway.feet", name, "names of joints"))?;
        }
        let gaits = doc.gaits.into_iter().enumerate();
        let gaits: Result<Vec<Gait>, _> = gaits.map(|(index, gait)| gait.checked(index, words)).collect();
        let gaits = gaits?;
        let wordless = gaits.iter().filter(|gait| gait.word.is_none()).count();
        if wordless != 1 {
            let found = format!("{wordless} without a word");
            return Err(BodyError::field("sway.gaits", found, "one"));
        }
        if feet[0] == feet[1] {
            return Err(BodyError::field("sway.feet", "one joint", "two joints"));
        }
        Ok(Self { feet, gaits })
    }

    /// The same for a body with these feet, `size` times as large. Its speeds and the times of its
    /// strides grow with the root of the size (Froude).
    pub(super) fn scaled(&self, feet: [usize; 2], size: f32) -> Self {
        let mut gaits = self.gaits.clone();
        for moment in gaits.iter_mut().flat_map(|gait| &mut gait.at) {
            moment.speed_mps *= size.sqrt();
            moment.rate_hz /= size.sqrt();
            let lengths = [&mut moment.left_m, &mut moment.ahead_m, &mut moment.stride_m];
            lengths.into_iter().flatten().for_each(|length| *length *= size);
        }
        Self { feet, gaits }
    }

    /// The path of a task as the root of a walking body follows it: the same in the given frames
    /// at the end, through the roots of those at the begin. `start_rad` is the phase to begin in
    /// without given frames.
    pub fn path(&self, task: &PathTask, fps: f32, start_rad: f32) -> Box<[[f32; 3]]> {
        let gaits = self.gaits_of(&task.style);
        let past: Option<Vec<Given<'_>>> = task.context.iter().map(Given::of).collect();
        let past = past.unwrap_or_default();
        let mut path = task.path.clone();
        for (point, given) in path.iter_mut().zip(&past) {
            *point = given.root;
        }
        let now = past.len().saturating_sub(1);
        let travel = travel(&task.path[now..], fps);
        let Some(&first) = travel.first() else { return path };
        let first_moment = mixed(&gaits, first.speed_mps);
        let mut phase = match past.is_empty() {
            true => start_rad,
            false => self.phase(
                &past,
                &mixed(&gaits, first.speed_mps.max(slowest(&gaits))),
                first,
                fps,
            ),
        };
        // From the sway that the past is taken to have to the root as it is.
        let mut lead = [0.0; 3];
        if let Some(given) = past.last() {
            let is = task.path[now];
            let sways = first_moment.sway(phase, first, is[2]);
            lead = std::array::from_fn(|n| given.root[n] - is[n] - sways[n]);
            lead[2] = wrap_angle(lead[2]);
        }
        let end = path.len() - task.targets.len().min(path.len());
        let fade = (END_S * fps).min(end.saturating_sub(now + 1).max(1) as f32);
        for (frame, travel) in (now..end).zip(&travel) {
            let moment = mixed(&gaits, travel.speed_mps);
            if frame > now {
                phase += TAU * moment.rate_hz / fps;
            }
            if frame < past.len() {
                continue;
            }
            let point = &mut path[frame];
            let sways = moment.sway(phase, *travel, point[2]);
            let led = 1.0 - smoothstep(((frame - now) as f32 / (LEAD_S * fps)).min(1.0));
            let stays = match task.targets.is_empty() {
                true => 1.0,
                false => smoothstep(((end - frame) as f32 / fade).min(1.0)),
            };
            for ((value, sways), lead) in point.iter_mut().zip(sways).zip(lead) {
                *value += stays * (sways + led * lead);
            }
        }
        path
    }

    /// The gaits of a style with their shares. A style whose words have no gait has that of any
    /// word.
    fn gaits_of(&self, style: &[f32]) -> Vec<(f32, &Gait)> {
        let weight = |gait: &Gait| {
            gait.word
                .and_then(|word| style.get(word))
                .map_or(0.0, |&w| w.max(0.0))
        };
        let total: f32 = self.gaits.iter().map(weight).sum();
        let share = |gait: &Gait| match total > 0.0 {
            true => weight(gait) / total,
            false => f32::from(u8::from(gait.word.is_none())),
        };
        let shares = self.gaits.iter().map(|gait| (share(gait), gait));
        shares.filter(|(share, _)| *share > 0.0).collect()
    }

    /// The phase of the newest of these frames at which feet that go like `moment` are most like
    /// theirs.
    fn phase(&self, past: &[Given<'_>], moment: &Moment, travel: Travel, fps: f32) -> f32 {
        let (sin, cos) = travel.direction_rad.sin_cos();
        let ahead = Vec3::new(sin, 0.0, cos);
        let strides: Vec<f32> = past
            .iter()
            .map(|given| given.apart(self.feet).dot(ahead))
            .collect();
        let step = TAU * moment.rate_hz / fps;
        let off = |phase: f32| -> f32 {
            let each = strides.iter().rev().enumerate();
            each.map(|(back, stride)| (wave(&moment.stride_m, phase - back as f32 * step) - stride).powi(2))
                .sum()
        };
        let phases = (0..PHASES).map(|nth| nth as f32 / PHASES as f32 * TAU);
        phases.min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(0.0)
    }
}

impl GaitDoc {
    fn checked(self, index: usize, words: &[String]) -> Result<Gait, BodyError> {
        let place = |field: &str| format!("sway.gaits[{index}].{field}");
        let word = match &self.word {
            Some(word) => {
                let found = words.iter().position(|other| other == word);
                Some(found.ok_or_else(|| BodyError::field(place("word"), word, "words of the pack"))?)
            }
            None => None,
        };
        let count = self.speeds_mps.len();
        let lists = [&self.left_m, &self.ahead_m, &self.heading_rad, &self.stride_m];
        if count == 0 || self.rates_hz.len() != count || lists.iter().any(|list| list.len() != count) {
            let allowed = "one or more, as many as in each other list";
            return Err(BodyError::field(
                place("speeds_mps"),
                format!("{count} long"),
                allowed,
            ));
        }
        if !self.speeds_mps.is_sorted_by(|a, b| a < b) || self.speeds_mps[0] <= 0.0 {
            let found = format!("{:?}", self.speeds_mps);
            return Err(BodyError::field(
                place("speeds_mps"),
                found,
                "rising, more than 0",
            ));
        }
        if let Some(rate) = self.rates_hz.iter().find(|rate| **rate <= 0.0) {
            return Err(BodyError::field(place("rates_hz"), rate, "more than 0"));
        }
        let waves = lists.iter().flat_map(|list| list.iter().flatten());
        let all = waves.chain(&self.rates_hz).chain(&self.speeds_mps);
        if let Some(other) = all.copied().find(|number| !(-100.0..=100.0).contains(number)) {
            return Err(BodyError::field(place("numbers"), other, "-100 to 100"));
        }
        let at = (0..count).map(|nth| Moment {
            speed_mps: self.speeds_mps[nth],
            rate_hz: self.rates_hz[nth],
            left_m: self.left_m[nth],
            ahead_m: self.ahead_m[nth],
            heading_rad: self.heading_rad[nth],
            stride_m: self.stride_m[nth],
        });
        Ok(Gait {
            word,
            at: at.collect(),
        })
    }
}

impl Gait {
    /// The gait at a speed. Slower than its clips it sways less, and has longer strides in time.
    fn at(&self, speed_mps: f32) -> Moment {
        let after = self.at.partition_point(|moment| moment.speed_mps < speed_mps);
        let last = self.at.len() - 1;
        let (low, high) = (self.at[after.saturating_sub(1)], self.at[after.min(last)]);
        let gap = high.speed_mps - low.speed_mps;
        let share = match gap > 0.0 {
            true => (speed_mps - low.speed_mps) / gap,
            false => 0.0,
        };
        let mut moment = Moment::default();
        moment.add(1.0 - share, &low);
        moment.add(share, &high);
        let beyond = speed_mps / moment.speed_mps;
        moment.rate_hz *= beyond.clamp(0.25, 4.0).powf(RATE_POWER);
        moment.scaled(beyond.min(1.0))
    }
}

impl Moment {
    fn add(&mut self, share: f32, other: &Self) {
        self.speed_mps += share * other.speed_mps;
        self.rate_hz += share * other.rate_hz;
        for (own, other) in self.waves().into_iter().zip({ *other }.waves()) {
            own.iter_mut()
                .zip(other)
                .for_each(|(own, other)| *own += share * *other);
        }
    }

    fn waves(&mut self) -> [&mut Waves; 4] {
        [
            &mut self.left_m,
            &mut self.ahead_m,
            &mut self.heading_rad,
            &mut self.stride_m,
        ]
    }

    fn scaled(mut self, factor: f32) -> Self {
        self.waves()
            .into_iter()
            .flatten()
            .for_each(|number| *number *= factor);
        self
    }

    /// World x, z and heading of the sway at a phase.
    fn sway(&self, phase: f32, travel: Travel, heading: f32) -> [f32; 3] {
        let aside = wrap_angle(heading - travel.direction_rad).abs();
        let [near, far] = ASIDE_RAD;
        let whole = 1.0 - smoothstep(((aside - near) / (far - near)).clamp(0.0, 1.0));
        let (sin, cos) = travel.direction_rad.sin_cos();
        let [left, ahead, turn] =
            [&self.left_m, &self.ahead_m, &self.heading_rad].map(|waves| whole * wave(waves, phase));
        [left * cos + ahead * sin, ahead * cos - left * sin, turn]
    }
}

/// The mean of gaits at a speed.
fn mixed(gaits: &[(f32, &Gait)], speed_mps: f32) -> Moment {
    let mut moment = Moment::default();
    for (share, gait) in gaits {
        moment.add(*share, &gait.at(speed_mps));
    }
    moment
}

/// The lowest speed at which all of these gaits are whole.
fn slowest(gaits: &[(f32, &Gait)]) -> f32 {
    let speeds = gaits.iter().map(|(_, gait)| gait.at[0].speed_mps);
    speeds.fold(0.0, f32::max)
}

fn wave(waves: &Waves, phase: f32) -> f32 {
    let pairs = waves.chunks_exact(2).zip(1_u8..);
    pairs
        .map(|(pair, n)| {
            let (sin, cos) = (f32::from(n) * phase).sin_cos();
            pair[0] * cos + pair[1] * sin
        })
        .sum()
}

/// How a path goes, frame by frame. At a halt the direction is the heading.
fn travel(path: &[[f32; 3]], fps: f32) -> Vec<Travel> {
    let half = (CHORD_S * fps).round().max(1.0) as usize;
    let at = |frame: usize| {
        let (from, to) = (frame.saturating_sub(half), (frame + half).min(path.len() - 1));
        let ([x, z, _], [to_x, to_z, _]) = (path[from], path[to]);
        let (x, z) = (to_x - x, to_z - z);
        let way = x.hypot(z);
        Travel {
            speed_mps: way * fps / (to - from).max(1) as f32,
            direction_rad: match way > 1e-4 {
                true => x.atan2(z),
                false => path[frame][2],
            },
        }
    };
    (0..path.len()).map(at).collect()
}

/// A given frame with root and pose.
struct Given<'a> {
    /// World x, z and heading.
    root: [f32; 3],
    pose: &'a [f32],
}

impl<'a> Given<'a> {
    fn of(key: &'a KeyTensors) -> Option<Self> {
        let [x, _, z, cos, sin] = key.global_root?;
        Some(Self {
            root: [x, z, sin.atan2(cos)],
            pose: key.pose.as_deref()?,
        })
    }

    /// From the right foot to the left one.
    fn apart(&self, feet: [usize; 2]) -> Vec3 {
        let [left, right] = feet.map(|foot| {
            let place = self.pose.get(foot * FEATURES_PER_JOINT..);
            place
                .filter(|place| place.len() >= 3)
                .map_or(Vec3::ZERO, Vec3::from_slice)
        });
        left - right
    }
}

#[cfg(test)]
#[path = "sway_tests.rs"]
mod tests;
