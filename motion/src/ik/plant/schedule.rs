//! Which feet stand: found from how feet move, also where none stands still.

use std::ops::Range;

use glam::Vec3;

use super::FootPlant;
use crate::ik::smooth;
use crate::ik::spans;

/// Legs of a pair; one of them stands while the body goes.
const PAIR: usize = 2;
/// What a leg may do in a frame: swing, or stand in one of the stages of a contact. A stage is a
/// part of the way that the body goes over a foot.
const STAGES: usize = 6;
const STATES: usize = (STAGES + 1).pow(PAIR as u32);
/// A foot slower than this share of the body's speed stands, whatever the other does.
const STANDS_SHARE: f32 = 0.35;
/// A body slower than this does not go, leg lengths a second.
const GOES_PER_S: f32 = 0.25;
/// Half of the window over which the body's speed is smoothed, frames.
const SPEED_HALF_WINDOW: usize = 6;
/// A foot higher than this counts as faster by [`HEIGHT_COST`] of what is above, leg lengths.
const LOW: f32 = 0.025;
const HEIGHT_COST: f32 = 0.3;
/// A body whose feet are all higher than this may be in flight, leg lengths.
const HIGH: f32 = 0.08;
/// Hips lower than this do not stand on their legs: a share of their length, or of the height at
/// which the body stands if that is less.
const UPRIGHT: f32 = 0.6;
/// Cost of a foot that begins or ends to stand, leg lengths.
const CHANGE_COST: f32 = 0.035;
/// Cost of a frame in which nothing carries a body that goes.
const NONE_COST: f32 = 1.0;
/// Cost of a frame in which a foot stands that left the ground fewer than [`LEAST_SWING`] frames
/// before.
const SOON_COST: f32 = 0.5;
/// Feet that swing for fewer frames than this stand all the time.
const SHORTEST_SWING: usize = 4;
/// Frames that a swing takes at least, if the other foot can stand for as long.
const LEAST_SWING: usize = 10;
/// Contacts of fewer frames are none.
const SHORTEST_STAND: usize = 3;
/// The body goes at most this far over a foot that stands, leg lengths.
const FARTHEST: f32 = 1.0;

/// A leg over the frames of a window.
#[derive(Debug)]
pub(super) struct Walker<'a> {
    /// Places of the hip and of the foot's foremost point.
    pub(super) hips: &'a [Vec3],
    pub(super) toes: &'a [Vec3],
    /// Heights of the lowest point of the foot over where it stands, metres.
    pub(super) low_m: &'a [f32],
    pub(super) length_m: f32,
    /// Whether the foot stands in the frame before the window's first free one.
    pub(super) stood: bool,
    /// How far the body has gone over it since then, metres.
    pub(super) gone_m: f32,
    /// Frames since it left the ground.
    pub(super) aloft: Option<usize>,
}

/// The frames in which the feet of one leg or of a pair stand, by leg. `first` is the first free
/// frame. `max_step_m` is the way in a frame below which a foot stands in a body that does not go.
pub(super) fn schedule(
    walkers: &[Walker<'_>],
    roots: &[Vec3],
    first: usize,
    max_step_m: f32,
    options: &FootPlant,
) -> Vec<Vec<Range<usize>>> {
    let frames = roots.len();
    let length_m = walkers.iter().map(|walker| walker.length_m).sum::<f32>() / walkers.len().max(1) as f32;
    let upright_m = UPRIGHT * length_m.min(options.height_m);
    let speeds = smooth(&speeds(roots), SPEED_HALF_WINDOW);
    let steps: Vec<Vec<f32>> = walkers.iter().map(|walker| self::speeds(walker.toes)).collect();
    let cost = |frame: usize, state: usize| {
        let goes = speeds[frame] * options.fps > GOES_PER_S * length_m;
        let still_m = match goes {
            true => max_step_m.min(STANDS_SHARE * speeds[frame]),
            false => max_step_m,
        };
        let is_upright = walkers
            .iter()
            .any(|walker| walker.hips[frame].y - options.floor_m > upright_m);
        let is_high = walkers.iter().all(|walker| walker.low_m[frame] > HIGH * length_m);
        if state == 0 {
            return if goes && is_upright && !is_high {
                NONE_COST
            } else {
                0.0
            };
        }
        let standing = walkers.iter().zip(&steps).enumerate();
        let costs = standing
            .filter(|(leg, _)| state & (1 << leg) != 0)
            .map(|(_, (walker, steps))| {
                let high_m = (walker.low_m[frame] - LOW * length_m).max(0.0);
                let is_soon = (frame.checked_sub(first).zip(walker.aloft))
                    .is_some_and(|(free, aloft)| free + aloft < LEAST_SWING);
                let soon = if is_soon { SOON_COST } else { 0.0 };
                steps[frame] - still_m + HEIGHT_COST * high_m + soon
            });
        costs.sum()
    };
    let way_m = FARTHEST * length_m / STAGES as f32;
    let begins = walkers.iter().rev().fold(0, |state, walker| {
        let stage = match walker.stood {
            true => 1 + ((walker.gone_m / way_m) as usize).min(STAGES - 1),
            false => 0,
        };
        state * (STAGES + 1) + stage
    });
    let begins = (first > 0).then_some(begins);
    let mut gone_m = 0.0;
    let ticks: Vec<bool> = (0..frames)
        .map(|frame| {
            let before = gone_m;
            gone_m += if frame < first { 0.0 } else { speeds[frame] };
            (gone_m / way_m) as usize > (before / way_m) as usize
        })
        .collect();
    let change = CHANGE_COST * length_m;
    let states = cheapest(first..frames, walkers.len(), (begins, &ticks), change, cost);
    let mut found: Vec<Vec<Range<usize>>> = (0..walkers.len())
        .map(|leg| {
            let on = |frame: usize| match frame.checked_sub(first) {
                Some(free) => states[free] & (1 << leg) != 0,
                None => frame + 1 == first && walkers[leg].stood,
            };
            let mut found = spans(frames, on, SHORTEST_SWING - 1, SHORTEST_STAND, [true, true]);
            // The next foot stands before this one leaves the ground.
            let least = first.saturating_sub(usize::from(walkers[leg].stood));
            for span in &mut found {
                span.start = span.start.saturating_sub(1).max(least);
            }
            found
        })
        .collect();
    if let [left, right] = &mut found[..] {
        widen(left, right, first);
        widen(right, left, first);
    }
    found
}

/// Which legs stand in consecutive frames, as bits: the cheapest way. A change costs `change` for
/// each leg. With each tick a leg that stands comes to the next stage of its contact. It leaves the
/// ground after the last.
fn cheapest(
    frames: Range<usize>,
    legs: usize,
    (begins, ticks): (Option<usize>, &[bool]),
    change: f32,
    cost: impl Fn(usize, usize) -> f32,
) -> Vec<usize> {
    let states = (STAGES + 1).pow(legs as u32);
    let stages = |state: usize| [state % (STAGES + 1), state / (STAGES + 1)];
    let bits = |state: usize| {
        let [left, right] = stages(state).map(|stage| usize::from(stage > 0));
        left | right << 1
    };
    let mut sums = [f32::INFINITY; STATES];
    match begins {
        Some(begins) => sums[begins] = 0.0,
        None => (0..states)
            .filter(|&state| stages(state).iter().all(|&stage| stage < 2))
            .for_each(|state| sums[state] = 0.0),
    }
    let mut from: Vec<[u8; STATES]> = Vec::with_capacity(frames.len());
    for (nth, frame) in frames.enumerate() {
        let costs: [f32; 1 << PAIR] = std::array::from_fn(|bits| match bits < 1 << legs {
            true => cost(frame, bits),
            false => f32::INFINITY,
        });
        // Without frames before it, the first one begins anywhere.
        let is_free = nth == 0 && begins.is_none();
        let mut best = [(f32::INFINITY, 0_u8); STATES];
        for before in (0..states).filter(|&state| sums[state].is_finite()) {
            let next = stages(before).map(|stage| match stage {
                0 => 1,
                stage if ticks[frame] => (stage + 1) % (STAGES + 1),
                stage => stage,
            });
            for stands in 0..1 << legs {
                let [left, right] = [0, 1].map(|leg| if stands >> leg & 1 == 1 { next[leg] } else { 0 });
                let state = left + right * (STAGES + 1);
                let changes = (bits(before) ^ bits(state)).count_ones() as f32;
                let changes = if is_free { 0.0 } else { change * changes };
                let sum = sums[before] + changes + costs[bits(state)];
                if sum < best[state].0 {
                    best[state] = (sum, before as u8);
                }
            }
        }
        from.push(best.map(|(_, before)| before));
        sums = best.map(|(sum, _)| sum);
    }
    let ends = (0..states).min_by(|&a, &b| sums[a].total_cmp(&sums[b]));
    let mut state = ends.unwrap_or(0);
    let mut found = vec![0; from.len()];
    for (slot, from) in found.iter_mut().zip(&from).rev() {
        *slot = bits(state);
        state = usize::from(from[state]);
    }
    found
}

/// Makes the swings between contacts last at least [`LEAST_SWING`] frames. The foot beside stands
/// for as long.
fn widen(spans: &mut [Range<usize>], beside: &mut [Range<usize>], first: usize) {
    for nth in 1..spans.len() {
        let (left, right) = (spans[nth - 1].clone(), spans[nth].clone());
        let lack = LEAST_SWING.saturating_sub(right.start - left.end);
        if lack == 0 {
            continue;
        }
        let room = |span: &Range<usize>| span.len().saturating_sub(SHORTEST_STAND);
        let before = lack.div_ceil(2).min(room(&left));
        let after = (lack - before).min(room(&right));
        let (start, end) = (left.end - before, right.start + after);
        let carries = |other: &&mut Range<usize>| other.start < right.start && other.end > left.end;
        if let Some(other) = beside.iter_mut().find(carries) {
            (spans[nth - 1].end, spans[nth].start) = (start, end);
            if other.start >= first {
                other.start = other.start.min(start.saturating_sub(1)).max(first);
            }
            other.end = other.end.max(end + 1);
        }
    }
}

/// Way over the ground in each frame: half of that between the frames beside it, metres.
fn speeds(places: &[Vec3]) -> Vec<f32> {
    (0..places.len())
        .map(|frame| velocity(places, frame).length())
        .collect()
}

/// Way over the ground, metres.
pub(super) fn way_m(places: &[Vec3]) -> f32 {
    let steps = places.windows(2).map(|pair| flat(pair[1] - pair[0]).length());
    steps.sum()
}

/// Velocity over the ground in a frame, metres a frame.
pub(super) fn velocity(places: &[Vec3], frame: usize) -> Vec3 {
    let (before, after) = (frame.saturating_sub(1), (frame + 1).min(places.len() - 1));
    let span = (after - before).max(1) as f32;
    flat(places[after] - places[before]) / span
}

pub(super) fn flat(way: Vec3) -> Vec3 {
    Vec3::new(way.x, 0.0, way.z)
}
