//! Walking over ground of varying heights: a flat motion is lifted onto it.
//!
//! Feet take the height of the ground that they are planted on and pass from one to the next in
//! their swing; the root goes with the mean of the feet, smoothed, and no higher than the legs
//! allow; legs follow by inverse kinematics. Flat motion and lifts stay apart, so that a buffer of
//! flat motion can be lifted again whenever the motion or the ground changes.

use serde::{Deserialize, Serialize};
use std::f32::consts::PI;
use std::ops::Range;

use glam::{Quat, Vec3};

use crate::fk::joint_transform;
use crate::ik::{Leg, LegTrack, MAX_LEGS, cover, forward, smooth, spans, two_bone};
use crate::interpolate::smoothstep;
use crate::skeleton::Skeleton;

/// The straightest that the root's height leaves a leg, as a share of its length, unless it is
/// straighter in the flat motion.
const STRAIGHTEST: f32 = 0.9985;
/// Frames over which new lifts take over from those that are known.
const TAKE_OVER_FRAMES: usize = 10;
/// The largest half window that counts, frames.
const MOST_HALF_WINDOW: usize = 30;
/// Half the window, frames, that a swing is smoothed over where the ground comes up under it.
const SWING_HALF_WINDOW: usize = 2;
/// A foot may cut a corner of the ground this near to where it is planted, frames.
const CORNER_FRAMES: usize = 6;
/// A foot that was in the air before anything that is known is at its new height after so many
/// frames.
const GO_ON_FRAMES: usize = 15;
/// The most that a foot goes up or down in a frame, metres: where it catches up with its way, and
/// ever.
const MOST_RATE_M: (f32, f32) = (0.07, 0.1);
/// A planted foot that moves less than this in a frame stands, metres.
const STANDS_M: f32 = 1e-4;
/// Gaps of this many frames in a contact are closed.
const GAP_FRAMES: usize = 1;
/// A foot goes up in the first part of its swing and down in the last: this many times as fast.
const SWING_RATE: f32 = 1.6;

/// What one frame of a flat motion, whose ground is at y = 0, is lifted by, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lift {
    /// The root.
    pub root_m: f32,
    /// The feet, in the order of the legs.
    pub feet_m: [f32; MAX_LEGS],
}

impl Lift {
    /// Everything by the same height.
    pub fn even(height_m: f32) -> Self {
        Self {
            root_m: height_m,
            feet_m: [height_m; MAX_LEGS],
        }
    }
}

/// How a motion is lifted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terrain {
    /// How much higher than its way a foot swings where it changes its height, metres.
    pub clear_m: f32,
    /// Half the window that the root is smoothed over, frames, twice.
    pub half_window: usize,
    /// Shorter contacts are none, frames.
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
/// `ground` answers the height of the ground at `(x, z)`, NaN where there is none to know, which
/// leaves a foot at the height that it had. `contacts` holds a byte a frame. The first
/// `known.len()` frames are lifted by `known`, which was shown: the others go on from there, a
/// planted foot at its height until it leaves the ground, a swinging one from where it is. Ground
/// that is at `h` everywhere lifts everything by `h`.
///
/// The same input gives the same lifts. A foot that is in the air at either end of the motion is
/// taken to come from or land on the ground below it.
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
/// Answers how far a leg falls short of its foot's place, metres.
///
/// A lift that is the same for root and feet moves the root and leaves the pose bit for bit; one
/// that is not finite changes nothing and answers infinity. Does not allocate.
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

/// Lifts a whole flat motion ([`lifts`] with nothing known, and [`lift_frame`]); answers the
/// farthest that a leg falls short, metres.
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

/// The root's lifts from the means of the feet's, below the cap, from the known ones on.
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

/// What was `shown` comes first; what differs from it in the first frame behind fades out until the
/// foot comes down. A foot that is to stand sooner than it was going to comes down late, for it
/// goes up and down no faster than it may.
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
    /// How much higher than with the foot the hip could be in a frame before the leg is straight,
    /// metres.
    fn room(&self, frame: usize, leg_m: f32) -> f32 {
        let over = self.hips[frame] - self.feet[frame];
        let longest = (leg_m * STRAIGHTEST).max(over.length());
        let height = longest * longest - over.x * over.x - over.z * over.z;
        (height.max(0.0).sqrt() - over.y).max(0.0)
    }

    /// Height of the ground below foot and toe in a frame, whichever is higher.
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
        // Frames at which the foot's height is known, in order: contacts, and the ends.
        let mut anchors: Vec<(Range<usize>, f32)> = Vec::with_capacity(planted.len() + 2);
        let mut height = None;
        let taken_up = planted.iter().rposition(|span| span.start < shown.len());
        match shown.last() {
            // In the air since before what is known: it goes on from where it is.
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
                // A foot that was planted when it was shown stays where it is, unless it was still
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

    /// The foot's lifts between frames `from` and `to`: up early or down late, and over what is in
    /// between. One that has not taken off here, but before anything that is known, has had its
    /// clearance: it goes to its new height soon.
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
            // Next to where it is planted the foot rather cuts a corner than jumps.
            let planted = (frame - from).min(to - frame) as f32;
            let more = (low + over - lifts[frame]).max(0.0);
            lifts[frame] += more * smoothstep((planted / CORNER_FRAMES as f32).min(1.0));
        }
    }

    /// The least lift that keeps foot and toe over the ground in a frame; minus infinity where the
    /// ground is not known.
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
