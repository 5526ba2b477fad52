//! Walking over uneven ground: lifts a flat motion onto it.
//!
//! Feet take the height of the ground on which they are planted, and change to the next height in
//! their swing. The root follows the mean of the feet, smoothed, but no higher than the legs allow.
//! Legs follow by inverse kinematics. Flat motion and lifts are kept apart, so a buffer of flat
//! motion can be lifted again whenever the motion or the ground changes.

use serde::{Deserialize, Serialize};
use std::f32::consts::PI;
use std::ops::Range;

use glam::{Quat, Vec3};

use crate::fk::joint_transform;
use crate::ik::{Leg, LegTrack, MAX_LEGS, cover, forward, smooth, spans, two_bone};
use crate::interpolate::smoothstep;
use crate::skeleton::Skeleton;

/// The root's height leaves a leg at most this straight, as a share of its length, unless it is
/// straighter in the flat motion.
const STRAIGHTEST: f32 = 0.9985;
/// Frames over which new lifts take over from known ones.
const TAKE_OVER_FRAMES: usize = 10;
/// Largest half window that counts, frames.
const MOST_HALF_WINDOW: usize = 30;
/// Half of the window over which a swing is smoothed if the ground rises under it, frames.
const SWING_HALF_WINDOW: usize = 2;
/// A foot may cut a corner of the ground within this many frames of being planted.
const CORNER_FRAMES: usize = 6;
/// A foot that was in the air before the known lifts reaches its new height within this many
/// frames.
const GO_ON_FRAMES: usize = 15;
/// Highest rate at which a foot rises or sinks, metres a frame: while it catches up with its path,
/// and in any case.
const MOST_RATE_M: (f32, f32) = (0.07, 0.1);
/// A planted foot that moves less than this in a frame stands, metres.
const STANDS_M: f32 = 1e-4;
/// Gaps of up to this many frames in a contact are closed.
const GAP_FRAMES: usize = 1;
/// A foot rises in the first part of its swing and sinks in the last, this many times as fast as
/// evenly.
const SWING_RATE: f32 = 1.6;

/// The lift of one frame of a flat motion, whose ground is at y = 0, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lift {
    /// Lift of the root, metres.
    pub root_m: f32,
    /// Lifts of the feet, in the order of the legs, metres.
    pub feet_m: [f32; MAX_LEGS],
}

impl Lift {
    /// The same lift for everything.
    pub fn even(height_m: f32) -> Self {
        Self {
            root_m: height_m,
            feet_m: [height_m; MAX_LEGS],
        }
    }
}

/// Options for lifting a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terrain {
    /// Extra height with which a foot swings when its height changes, metres.
    pub clear_m: f32,
    /// Half of the window over which the root is smoothed, twice, frames.
    pub half_window: usize,
    /// Shorter contacts do not count, frames.
    pub min_frames: usize,
}

impl Default for Terrain {
    fn default() -> Self {
        Self {
            clear_m: 0.05,
            half_window: 4,
            min_frames: 3,
        }
    }
}

/// The lifts of a flat motion, one a frame, into `out`.
///
/// `ground` returns the height of the ground at `(x, z)`. NaN if that is unknown, which leaves a
/// foot at its height. `contacts` has a byte a frame. The first `known.len()` frames are lifted by
/// `known`, because they were shown. The others continue from there: a planted foot at its height
/// until it leaves the ground, a swinging one from its place. Ground at height `h` everywhere
/// lifts everything by `h`.
///
/// The same input gives the same lifts. A foot in the air at either end of the motion is assumed to
/// come from the ground below it, or to land there.
#[expect(clippy::too_many_arguments, reason = "a motion by its columns")]
pub fn lifts(
    skeleton: &Skeleton,
    legs: &[Leg],
    roots: &[Vec3],
    rotations: &[Quat],
    contacts: &[u8],
    known: &[Lift],
    mut ground: impl FnMut(f32, f32) -> f32,
    options: &Terrain,
    out: &mut Vec<Lift>,
) {
    let joints = skeleton.joint_count();
    let frames = roots.len().min(rotations.len() / joints).min(contacts.len());
    let known = &known[..known.len().min(frames)];
    let legs = &legs[..legs.len().min(MAX_LEGS)];
    out.clear();
    out.extend_from_slice(known);
    if known.len() == frames {
        return;
    }
    out.resize(frames, Lift::default());
    let mut cap = vec![f32::INFINITY; frames];
    for (nth, leg) in legs.iter().enumerate() {
        let track = LegTrack::of(skeleton, leg, &(0..frames), roots, rotations);
        let shown: Vec<f32> = known.iter().map(|lift| lift.feet_m[nth]).collect();
        let feet = track.lifts(leg, contacts, &shown, &mut ground, options);
        for (frame, &foot) in feet.iter().enumerate() {
            out[frame].feet_m[nth] = foot;
            cap[frame] = cap[frame].min(foot + track.room(frame, leg.length_m(skeleton)));
        }
    }
    let feet: Vec<f32> = match legs.is_empty() {
        true => follow(roots, frames, &mut ground),
        false => out
            .iter()
            .map(|lift| lift.feet_m[..legs.len()].iter().sum::<f32>() / legs.len() as f32)
            .collect(),
    };
    lift_root(&feet, &cap, known, options.half_window.min(MOST_HALF_WINDOW), out);
}

/// Lifts one frame: the root and, by the legs, the feet, which keep their rotation in the world.
/// Returns the farthest that a leg remains from its foot's place, metres.
///
/// The same lift for root and feet moves the root and leaves the pose unchanged bit for bit. A lift
/// that is not finite changes nothing and returns infinity. Does not allocate.
pub fn lift_frame(
    skeleton: &Skeleton,
    legs: &[Leg],
    root: &mut Vec3,
    rotations: &mut [Quat],
    lift: &Lift,
) -> f32 {
    let finite = lift.root_m.is_finite() && lift.feet_m.iter().all(|foot| foot.is_finite());
    if !finite || rotations.len() < skeleton.joint_count() {
        return f32::INFINITY;
    }
    let mut short = 0.0_f32;
    root.y += lift.root_m;
    let pole = forward(skeleton, rotations);
    for (leg, foot) in legs.iter().zip(lift.feet_m) {
        let up = foot - lift.root_m;
        if up != 0.0 {
            let goal = joint_transform(skeleton, *root, rotations, leg.foot).0 + Vec3::Y * up;
            short = short.max(two_bone(
                skeleton,
                *root,
                rotations,
                leg.chain(),
                goal,
                pole,
                true,
            ));
        }
    }
    short
}

/// Lifts a whole flat motion ([`lifts`] without known ones, and [`lift_frame`]). Returns the
/// farthest that a leg remained from its foot's place, metres.
pub fn lift_motion(
    skeleton: &Skeleton,
    legs: &[Leg],
    roots: &mut [Vec3],
    rotations: &mut [Quat],
    contacts: &[u8],
    ground: impl FnMut(f32, f32) -> f32,
    options: &Terrain,
) -> f32 {
    let mut made = Vec::new();
    lifts(
        skeleton,
        legs,
        roots,
        rotations,
        contacts,
        &[],
        ground,
        options,
        &mut made,
    );
    let poses = rotations.chunks_exact_mut(skeleton.joint_count());
    let frames = roots.iter_mut().zip(poses).zip(&made);
    frames
        .map(|((root, pose), lift)| lift_frame(skeleton, legs, root, pose, lift))
        .fold(0.0, f32::max)
}

/// Without legs the whole body follows the ground below it.
fn follow(roots: &[Vec3], frames: usize, ground: &mut impl FnMut(f32, f32) -> f32) -> Vec<f32> {
    let mut last = 0.0;
    let heights = roots[..frames].iter().map(|root| {
        let height = ground(root.x, root.z);
        if height.is_finite() {
            last = height;
        }
        last
    });
    heights.collect()
}

/// The root's lifts from the mean of the feet's, below the cap, after the known ones.
fn lift_root(feet: &[f32], cap: &[f32], known: &[Lift], half: usize, out: &mut [Lift]) {
    let mut root = smooth(&smooth(feet, half), half);
    let over: Vec<f32> = root.iter().zip(cap).map(|(root, cap)| root - cap).collect();
    for (root, over) in root.iter_mut().zip(cover(&over, half)) {
        *root -= over;
    }
    let shown = known.len();
    let residual = match known.last() {
        Some(last) => last.root_m - root[shown - 1],
        None => 0.0,
    };
    for (frame, lift) in out.iter_mut().enumerate().skip(shown) {
        let since = (frame + 1 - shown) as f32 / TAKE_OVER_FRAMES as f32;
        lift.root_m = root[frame] + residual * (1.0 - smoothstep(since.min(1.0)));
    }
}

/// `shown` comes first. The difference to it in the first frame after fades out until the foot
/// comes down. If a foot is to stand sooner than planned, it comes down late: it rises and sinks no
/// faster than allowed.
fn take_over(shown: &[f32], comes_down: usize, lifts: &mut [f32]) {
    let mut meant = lifts[shown.len().saturating_sub(1)];
    if let Some(last) = shown.last() {
        let residual = last - meant;
        let fade = TAKE_OVER_FRAMES.min(comes_down + 1 - shown.len());
        for (since, lift) in (1..fade).zip(&mut lifts[shown.len()..]) {
            *lift += residual * (1.0 - smoothstep(since as f32 / fade as f32));
        }
        lifts[..shown.len()].copy_from_slice(shown);
    }
    for frame in shown.len().max(1)..lifts.len() {
        let (before, now) = (lifts[frame - 1], lifts[frame]);
        let most = (now - meant).abs().clamp(MOST_RATE_M.0, MOST_RATE_M.1);
        meant = now;
        lifts[frame] = before + (now - before).max(-most).min(most);
    }
}

impl LegTrack {
    /// How much farther than the foot the hip could rise in a frame before the leg is straight,
    /// metres.
    fn room(&self, frame: usize, leg_m: f32) -> f32 {
        let over = self.hips[frame] - self.feet[frame];
        let longest = (leg_m * STRAIGHTEST).max(over.length());
        let height = longest * longest - over.x * over.x - over.z * over.z;
        (height.max(0.0).sqrt() - over.y).max(0.0)
    }

    /// Height of the ground below ankle or toe in a frame, whichever is higher.
    fn ground(&self, frame: usize, ground: &mut impl FnMut(f32, f32) -> f32) -> Option<f32> {
        let height = [self.feet[frame], self.toes[frame]]
            .map(|p| ground(p.x, p.z))
            .into_iter()
            .fold(f32::NAN, f32::max);
        height.is_finite().then_some(height)
    }

    /// The foot's lift in every frame, the first of which are `shown`.
    fn lifts(
        &self,
        leg: &Leg,
        contacts: &[u8],
        shown: &[f32],
        ground: &mut impl FnMut(f32, f32) -> f32,
        options: &Terrain,
    ) -> Vec<f32> {
        let frames = self.feet.len();
        let planted = spans(
            frames,
            |frame| leg.stands(contacts[frame]),
            GAP_FRAMES,
            options.min_frames,
            [true, false],
        );
        // Frames with a known height of the foot, in order: contacts, and the ends.
        let mut anchors: Vec<(Range<usize>, f32)> = Vec::with_capacity(planted.len() + 2);
        let mut height = None;
        let taken_up = planted.iter().rposition(|span| span.start < shown.len());
        match shown.last() {
            // In the air since before the known frames: it continues from its last height.
            Some(&last) if taken_up.is_none() => {
                height = Some(last);
                anchors.push((shown.len() - 1..shown.len(), last));
            }
            None if planted.first().is_none_or(|span| span.start > 0) => {
                height = self.ground(0, ground);
                anchors.push((0..1, height.unwrap_or_default()));
            }
            _ => {}
        }
        for span in planted.into_iter().skip(taken_up.unwrap_or_default()) {
            height = match shown[..span.end.min(shown.len())] {
                _ if span.start >= shown.len() => None,
                // A foot that was planted when it was shown keeps its height, unless it was still
                // on its way down.
                [.., before, last] if (last - before).abs() < STANDS_M => Some(last),
                [only] => Some(only),
                _ => None,
            }
            .or_else(|| self.ground((span.start + span.end - 1) / 2, ground))
            .or(height);
            anchors.push((span, height.unwrap_or_default()));
        }
        if anchors.last().is_none_or(|(span, _)| span.end < frames) {
            height = self.ground(frames - 1, ground).or(height);
            anchors.push((frames - 1..frames, height.unwrap_or_default()));
        }

        let mut lifts = vec![0.0; frames];
        for (span, height) in &anchors {
            lifts[span.clone()].fill(*height);
        }
        let goes_on = !shown.is_empty() && taken_up.is_none();
        for (nth, pair) in anchors.windows(2).enumerate() {
            let (from, to) = (pair[0].0.end - 1, pair[1].0.start);
            if to > from + 1 {
                let took_off = nth > 0 || !goes_on;
                self.swing(leg, (from, to), took_off, &mut lifts, ground, options.clear_m);
            }
        }
        let stands = anchors.iter().find(|(span, _)| span.end > shown.len());
        let comes_down = stands.map_or(frames, |(span, _)| span.start.max(shown.len()));
        take_over(shown, comes_down, &mut lifts);
        lifts
    }

    /// The foot's lifts between frames `from` and `to`: it rises early or sinks late, and clears
    /// what is in between. A foot that took off before the known frames has had its clearance, and
    /// goes to its new height soon.
    fn swing(
        &self,
        leg: &Leg,
        (from, to): (usize, usize),
        took_off: bool,
        lifts: &mut [f32],
        ground: &mut impl FnMut(f32, f32) -> f32,
        clear_m: f32,
    ) {
        let (start, up) = (lifts[from], lifts[to] - lifts[from]);
        let phase = |frame: usize| (frame - from) as f32 / (to - from) as f32;
        for (frame, lift) in lifts.iter_mut().enumerate().take(to).skip(from + 1) {
            let t = match (took_off, up > 0.0) {
                (false, _) => (frame - from) as f32 / (to - from).min(GO_ON_FRAMES) as f32,
                (true, true) => phase(frame) * SWING_RATE,
                (true, false) => phase(frame) * SWING_RATE - (SWING_RATE - 1.0),
            };
            *lift = start + up * smoothstep(t.clamp(0.0, 1.0));
            if took_off && up != 0.0 {
                *lift += clear_m * (PI * phase(frame)).sin();
            }
        }
        // As high over the ground as over the flat one.
        let low = lifts[from].min(lifts[to]);
        let needs: Vec<f32> = (from..=to)
            .map(|frame| self.least(leg, frame, ground) - low)
            .collect();
        let cover = cover(&needs, SWING_HALF_WINDOW);
        for (frame, over) in (from..=to).zip(cover) {
            // Close to a planted frame, the foot cuts a corner rather than jump.
            let planted = (frame - from).min(to - frame) as f32;
            let more = (low + over - lifts[frame]).max(0.0);
            lifts[frame] += more * smoothstep((planted / CORNER_FRAMES as f32).min(1.0));
        }
    }

    /// The least lift that keeps ankle and toe over the ground in a frame; minus infinity if the
    /// ground is unknown.
    fn least(&self, leg: &Leg, frame: usize, ground: &mut impl FnMut(f32, f32) -> f32) -> f32 {
        let places = [self.feet[frame], self.toes[frame]];
        places
            .iter()
            .zip(leg.clearance_m)
            .map(|(place, clearance)| ground(place.x, place.z) - (place.y - clearance).max(0.0))
            .fold(f32::NEG_INFINITY, f32::max)
    }
}

#[cfg(test)]
mod tests;
