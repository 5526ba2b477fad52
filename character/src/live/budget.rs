//! The crowd's budget: how often each character is planned for, and how far ahead, when the
//! networks cannot serve everybody as often as usual. Pure: time comes in as a number.
//!
//! [`Controller`] turns the delay of plans into one number, the **pressure**. At 0 the networks
//! keep up. At 1 everybody plans once a second. At [`MOST_PRESSURE`] every plan is as long as the
//! pack allows and is used to its end. [`stretch`] is a character's share of the pressure, by its
//! priority; [`Pace::new`] turns that into frames:
//!
//! 1. Intervals grow from the style's to the time that a plan of the usual length lasts.
//! 2. Plans grow token by token to the length that lasts a second, and each is used to its end.
//! 3. Once that holds for everybody, plans grow further, up to the pack's longest.
//!
//! In each step the characters of lowest priority go first. At pressure 0 nothing here has any
//! effect. A character on its caller's clock is exempt, so that its frames do not depend on the
//! load.

use super::CONTEXT_FRAMES;
use super::buffer::CROSSFADE_FRAMES;
use crate::primitives::recipe::HORIZON_S;
use troupe_motion::model::Dims;

/// Highest pressure.
pub const MOST_PRESSURE: f32 = 2.0;
/// Pressure up to this has no effect, so that a short delay changes nothing.
const SLIGHT_PRESSURE: f32 = 0.03;
/// How much sooner priority 0 feels the pressure than priority 1, relative to the pressure that
/// leads from the first interval to the last. At 1, the highest priority begins when the lowest has
/// come to the end.
const PRIORITY_SPREAD: f32 = 1.0;
/// Frames of a plan that are left when the next takes over under pressure: two fewer than the fade
/// takes. The missing two are drawn out. They have 4 and 13 % of the weight, which makes a
/// millimetre or two in a walk, and every plan lasts two frames longer.
pub(super) const LEFT_FRAMES: u32 = CROSSFADE_FRAMES as u32 - 2;

/// Frames by which plans are asked for further ahead at a [`stretch`] of 1, and of 2.
const LEAD_FRAMES: (f32, f32) = (8.0, 24.0);
/// The look-ahead that delays are compared with, frames.
const LOOK_AHEAD_FRAMES: f32 = 4.0;
/// Share of that look-ahead that plans may take on average.
const LEAD_USED: f32 = 0.5;

/// Priority of a character that names none.
pub const MIDDLE_PRIORITY: f32 = 0.5;

/// A character's priority among those of its stream, whose mean is `mean`. So a stream whose
/// characters are all of high priority takes nothing from other streams.
pub fn own_priority(priority: f32, mean: f32) -> f32 {
    (MIDDLE_PRIORITY + priority - mean).clamp(0.0, 1.0)
}

/// A character's share of the pressure, 0 to 2. Up to 1 it leads to a plan a second.
///
/// It grows with the pressure and falls with the priority, both at a slope of at most 2.
pub fn stretch(pressure: f32, priority: f32) -> f32 {
    let step =
        |pressure: f32| (pressure * (1.0 + PRIORITY_SPREAD) - PRIORITY_SPREAD * priority).clamp(0.0, 1.0);
    step(pressure) + step(pressure - 1.0)
}

/// How often a character is planned for, and how far ahead, if that is not as usual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pace {
    /// Frames between plans.
    pub interval_frames: u32,
    /// Frames of a plan, context included.
    pub plan_frames: u32,
    /// Frames by which plans are asked for further ahead than the look-ahead, so that they can wait
    /// in the queue.
    pub lead_frames: u32,
}

impl Pace {
    /// The pace of a character of a pack at a [`stretch`]; none if it is as usual.
    /// `interval_frames` is the style's. It is none for a style that stands still: that plans for a
    /// low buffer only, so long plans cost it nothing. `phase` is any number, best a different one
    /// for each character. Between two steps it decides who takes which, so that demand has no
    /// jumps.
    pub fn new(
        stretch: f32,
        interval_frames: Option<u32>,
        phase: u64,
        dims: &Dims,
        fps: f32,
    ) -> Option<Self> {
        if stretch <= 0.0 {
            return None;
        }
        let steps = Steps::new(dims, fps);
        let longest = steps.longest();
        let frames = match interval_frames {
            None => between(steps.lasts(steps.usual_tokens) as f32, longest, stretch),
            Some(usual) => {
                let second = between(usual as f32, steps.second(), stretch);
                between(second, longest, stretch - 1.0)
            }
        };
        let least = interval_frames.unwrap_or_default();
        let (interval_frames, plan_frames) = steps.pace(least, frames.min(longest), part(phase));
        Some(Self {
            interval_frames,
            plan_frames,
            lead_frames: lead_frames(stretch).round() as u32,
        })
    }
}

fn lead_frames(stretch: f32) -> f32 {
    let (second, longest) = LEAD_FRAMES;
    second * stretch.min(1.0) + (longest - second) * (stretch - 1.0).clamp(0.0, 1.0)
}

/// Interpolates from `a` to `b` in equal ratios; at least `a`.
fn between(a: f32, b: f32, part: f32) -> f32 {
    a * (b / a).max(1.0).powf(part.clamp(0.0, 1.0))
}

/// A number from 0 to 1. Consecutive phases are spread evenly too.
fn part(phase: u64) -> f32 {
    (phase.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f32 / (1u32 << 24) as f32
}

/// The lengths that plans of a pack may have.
struct Steps {
    frames_per_token: u32,
    usual_frames: u32,
    usual_tokens: u32,
    max_tokens: u32,
    fps: f32,
}

impl Steps {
    fn new(dims: &Dims, fps: f32) -> Self {
        let frames_per_token = dims.frames_per_token as u32;
        let usual_frames = CONTEXT_FRAMES as u32 + (HORIZON_S * fps).round() as u32;
        let usual_frames = usual_frames.clamp(dims.min_frames() as u32, dims.max_frames() as u32);
        Self {
            frames_per_token,
            usual_frames,
            usual_tokens: usual_frames.div_ceil(frames_per_token),
            max_tokens: dims.max_tokens as u32,
            fps,
        }
    }

    /// Frames for which a plan of `frames` frames lasts.
    fn lasts_frames(frames: u32) -> u32 {
        frames.saturating_sub(CONTEXT_FRAMES as u32 + LEFT_FRAMES).max(1)
    }

    fn lasts(&self, tokens: u32) -> u32 {
        Self::lasts_frames(tokens * self.frames_per_token)
    }

    /// Frames that the longest plan lasts which is made again within a second. Everybody reaches it
    /// before anybody takes a longer one.
    fn second(&self) -> f32 {
        let fits = |tokens: &u32| self.lasts(*tokens) as f32 <= self.fps;
        let tokens = (self.usual_tokens..=self.max_tokens).rev().find(fits);
        self.lasts(tokens.unwrap_or(self.usual_tokens)) as f32
    }

    fn longest(&self) -> f32 {
        self.lasts(self.max_tokens) as f32
    }

    /// Interval (at least `least`) and plan length nearest to a wanted interval. Up to the usual
    /// number of tokens the interval is any whole number of frames. Beyond it, an interval is what
    /// a whole number of tokens lasts: anything shorter would mean more work.
    fn pace(&self, least: u32, interval: f32, part: f32) -> (u32, u32) {
        let usual = self.lasts(self.usual_tokens);
        if interval <= usual as f32 {
            let interval_frames = ((interval + part) as u32).min(usual);
            let enough = interval_frames <= Self::lasts_frames(self.usual_frames);
            let plan_frames = match enough {
                true => self.usual_frames,
                false => self.usual_tokens * self.frames_per_token,
            };
            return (interval_frames, plan_frames);
        }
        let more = (interval - usual as f32) / self.frames_per_token as f32;
        let enough = |tokens: &u32| self.lasts(*tokens) >= least;
        let first = (self.usual_tokens..self.max_tokens).find(enough);
        let tokens = (self.usual_tokens + (more + part) as u32)
            .clamp(first.unwrap_or(self.max_tokens), self.max_tokens);
        (self.lasts(tokens), tokens * self.frames_per_token)
    }
}

/// Time from request to answer at which the pressure stays as it is, seconds: within the usual
/// look-ahead of four frames. A batch takes `c / (1 - load)` on networks that are never idle. A
/// plan waits for one batch and travels in another.
const WANTED_DELAY_S: f32 = 0.09;
/// `c` above, for both batches, as a middle between engines: it derives a load from a delay. An
/// error in it only makes the pressure move faster or slower by that factor.
const LEAST_DELAY_S: f32 = 0.015;
/// Change of the pressure in a second for a load that is off by 1.
const SPEED: f32 = 1.0;
/// Change of the pressure in a second for each unit of urgency.
const URGENT_SPEED: f32 = 1.0;
/// Lowest load that counts: an idle engine lowers the pressure to 0 in about two seconds.
const LEAST_LOAD: f32 = -0.2;
/// Delays between which urgency grows from 0 to its maximum, seconds. Urgency acts at once.
const URGENT_DELAY_S: (f32, f32) = (0.14, 0.5);
/// Shares of the engine's time that plans take. Below the first, other work is the cause of the
/// delay, and longer plans would not help. Above the second, plans are the only cause.
const OWN_SHARE: (f32, f32) = (0.3, 0.5);
/// If other work delays plans, they are asked for this many times their delay ahead.
const LEAD_MARGIN: f32 = 1.5;
/// Time constant for smoothing readings, seconds.
const SMOOTHING_S: f32 = 0.3;
/// Longest time between two readings that counts, seconds.
const MAX_STEP_S: f32 = 0.5;

/// A reading of a pack's engine and queue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// How long plans took recently from request to answer, or would take now: the longer, seconds.
    pub delay_s: f32,
    /// Share of the engine's time that plans took recently, 0 to 1.
    pub share: f32,
}

/// Turns readings into pressure: an integral for lasting load, and a part for urgency.
#[derive(Debug, Clone, Default)]
pub struct Controller {
    lasting: f32,
    urgent: f32,
    share: f32,
    delay_s: f32,
    own: f32,
}

impl Controller {
    /// Takes a reading, `passed_s` seconds after the one before.
    pub fn observe(&mut self, passed_s: f32, reading: Reading) {
        let passed_s = passed_s.clamp(0.0, MAX_STEP_S);
        let weight = 1.0 - (-passed_s / SMOOTHING_S).exp();
        self.share += (reading.share - self.share) * weight;
        self.delay_s += (reading.delay_s - self.delay_s) * weight;
        let (from, to) = OWN_SHARE;
        let own = ((self.share - from) / (to - from)).clamp(0.0, 1.0);

        // Under pressure, plans are asked for further ahead and may take that much longer.
        let longer = 1.0 + LEAD_USED * lead_frames(self.pressure()) / LOOK_AHEAD_FRAMES;
        let (from, to) = URGENT_DELAY_S;
        let urgent = ((self.delay_s - from * longer) / (to - from)).clamp(0.0, 1.0);
        self.urgent = urgent * own * MOST_PRESSURE;

        let load = |delay_s: f32| (1.0 - LEAST_DELAY_S / delay_s.max(1e-6)).max(LEAST_LOAD);
        let off = load(self.delay_s / longer) - load(WANTED_DELAY_S);
        let off = if off > 0.0 { off * own } else { off };
        let change = SPEED * off + URGENT_SPEED * self.urgent;
        self.lasting = (self.lasting + change * passed_s).clamp(0.0, MOST_PRESSURE + SLIGHT_PRESSURE);
        self.own = own;
    }

    /// How far ahead plans are to be asked for if other work delays them, seconds.
    pub fn lead_s(&self) -> f32 {
        (1.0 - self.own) * self.delay_s * LEAD_MARGIN
    }

    /// The pressure, 0 to [`MOST_PRESSURE`].
    pub fn pressure(&self) -> f32 {
        (self.lasting + self.urgent - SLIGHT_PRESSURE).clamp(0.0, MOST_PRESSURE)
    }
}

#[cfg(test)]
#[path = "budget_tests.rs"]
mod tests;
