//! Keeps standing feet in place.

use std::f32::consts::PI;
use std::ops::Range;

use glam::{Quat, Vec3};

use crate::interpolate::smoothstep;
use crate::skeleton::Skeleton;

use super::two_bone::{STRAIGHTEST, two_bone_soft};
use super::{Leg, LegTrack, cover, forward, spans};

/// A span that begins this near after a frame that may not change begins at the foot's place: there
/// is no room to fade.
const ANCHOR_FRAMES: usize = 3;
/// Frames over which changes that do not depend on contacts fade in from a frame that may not
/// change.
const EDGE_FRAMES: usize = 6;
/// Half of the window over which the lowering of the root is smoothed, frames.
const DROP_HALF_WINDOW: usize = 3;
/// A foot that is carried to another place between two contacts is lifted by this share of the
/// distance, at most by the second value, metres.
const CARRY_SHARE: f32 = 0.2;
const MAX_CARRY_M: f32 = 0.03;
/// Share of a leg's length over which it eases towards full reach. Otherwise the knee jumps when a
/// foot that made the leg straight is released. The root is lowered for straighter legs, so that
/// held feet stay in place.
const SOFT_SHARE: f32 = 0.02;
/// Smaller offsets count as none, metres.
const NO_OFFSET_M: f32 = 1e-5;

/// Options for holding feet.
#[derive(Clone, Debug, PartialEq)]
pub struct FootLock {
    /// The frames that may change. The frames around them are read: a foot that stands there fixes
    /// its place.
    pub range: Range<usize>,
    /// Contacts shorter than this are not held, frames, unless they touch a frame that may not
    /// change.
    pub min_frames: usize,
    /// Gaps of up to this many frames in a contact are closed.
    pub gap_frames: usize,
    /// Frames over which an offset fades in before a contact and out after it.
    pub fade_frames: usize,
    /// Farthest that a foot is moved over the ground, metres. Beyond that it slides.
    pub max_offset_m: f32,
    /// Farthest that the root is lowered for a leg that would be too short, metres.
    pub max_drop_m: f32,
    /// World height of the ground, out of which feet are lifted, metres. `None` keeps their
    /// heights.
    pub floor_m: Option<f32>,
}

impl Default for FootLock {
    fn default() -> Self {
        Self {
            range: 0..usize::MAX,
            min_frames: 3,
            gap_frames: 1,
            fade_frames: 12,
            max_offset_m: 0.25,
            max_drop_m: 0.08,
            floor_m: None,
        }
    }
}

impl FootLock {
    /// The defaults, for some frames.
    pub fn over(range: Range<usize>) -> Self {
        Self {
            range,
            ..Self::default()
        }
    }
}

/// What [`lock_feet`] changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Locked {
    /// Farthest that a foot was moved, metres.
    pub max_offset_m: f32,
    /// Farthest that the root was lowered, metres.
    pub max_drop_m: f32,
    /// Farthest that a leg remained from its foot's place, metres; infinite if a pose was not
    /// finite.
    pub max_short_m: f32,
    /// Frames in which a foot was held, summed over the legs.
    pub held_frames: usize,
}

/// Keeps feet in place over the ground while they are in contact.
///
/// A foot is held by its toe while that is in contact, otherwise by its ankle; it still rolls over
/// the toes. The place of a contact is the mean of its places in the motion, so that the leg moves
/// least. A foot that stands in the frame before `options.range` keeps its place from there, and
/// one that stands in the first frame after it comes to its place there. (If both hold and differ,
/// the foot must slide, and does so evenly.) Between contacts the offset passes from one to the
/// next, with the foot slightly lifted. If there is time, it fades out and in again instead.
/// Heights in contact change only if the ground is given. Feet keep their rotation in the world. If
/// a leg would be too short for its foot's place, the root is lowered, smoothly and for both legs.
///
/// All slices have the same frames; `contacts` has a byte a frame. Frames outside the range, and
/// frames without anything to do, stay as they are bit for bit. So do poses that are not finite.
pub fn lock_feet(
    skeleton: &Skeleton,
    legs: &[Leg],
    roots: &mut [Vec3],
    rotations: &mut [Quat],
    contacts: &[u8],
    options: &FootLock,
) -> Locked {
    let joints = skeleton.joint_count();
    let frames = roots.len().min(rotations.len() / joints).min(contacts.len());
    let range = options.range.start..options.range.end.min(frames);
    let mut locked = Locked::default();
    if range.is_empty() || legs.is_empty() {
        return locked;
    }
    // Includes the frames next to the range, which must not change.
    let window = range.start.saturating_sub(1)..range.end.saturating_add(1).min(frames);
    let fixed = [window.start < range.start, window.end > range.end];
    let tracks: Vec<Track> = legs
        .iter()
        .map(|leg| {
            let mut track = Track::of(skeleton, leg, &window, roots, rotations);
            track.hold(leg, &contacts[window.clone()], fixed, options, &mut locked);
            if let Some(floor) = options.floor_m {
                track.lift_out_of(floor, leg, fixed);
            }
            track
        })
        .collect();
    let drops = drops(&tracks, legs, skeleton, fixed, options.max_drop_m.max(0.0));
    for frame in range {
        let index = frame - window.start;
        let moved = |track: &Track| track.offsets[index].length() > NO_OFFSET_M;
        if drops[index] <= 0.0 && !tracks.iter().any(moved) {
            continue;
        }
        roots[frame].y -= drops[index];
        let pose = &mut rotations[frame * joints..][..joints];
        let pole = forward(skeleton, pose);
        for (leg, track) in legs.iter().zip(&tracks) {
            let goal = track.leg.feet[index] + track.offsets[index];
            let short = two_bone_soft(
                skeleton,
                roots[frame],
                pose,
                leg.chain(),
                (goal, SOFT_SHARE),
                pole,
                true,
            );
            locked.max_short_m = locked.max_short_m.max(short);
            locked.max_offset_m = locked.max_offset_m.max(track.offsets[index].length());
        }
        locked.max_drop_m = locked.max_drop_m.max(drops[index]);
    }
    locked
}

/// A leg in every frame of the window, and the offset of its foot.
struct Track {
    leg: LegTrack,
    offsets: Vec<Vec3>,
}

impl Track {
    fn of(skeleton: &Skeleton, leg: &Leg, window: &Range<usize>, roots: &[Vec3], rotations: &[Quat]) -> Self {
        Self {
            leg: LegTrack::of(skeleton, leg, window, roots, rotations),
            offsets: vec![Vec3::ZERO; window.len()],
        }
    }

    /// Offsets that hold the foot in its contacts.
    fn hold(
        &mut self,
        leg: &Leg,
        contacts: &[u8],
        fixed: [bool; 2],
        options: &FootLock,
        locked: &mut Locked,
    ) {
        let frames = contacts.len();
        let last = frames - 1;
        let held = spans(
            frames,
            |f| leg.stands(contacts[f]),
            options.gap_frames,
            options.min_frames,
            fixed,
        );
        locked.held_frames += held.iter().map(Range::len).sum::<usize>();
        for span in &held {
            self.hold_span(leg, contacts, span, fixed);
        }
        // Frames that may not change count as contacts without offset.
        let mut known = held;
        if fixed[0] && known.first().is_none_or(|span| span.start > 0) {
            known.insert(0, 0..1);
        }
        if fixed[1] && known.last().is_none_or(|span| span.end <= last) {
            known.push(last..frames);
        }
        self.pass_on(&known, options.fade_frames);
        for offset in &mut self.offsets {
            *offset = offset.clamp_length_max(options.max_offset_m.max(0.0));
        }
    }

    /// Offsets within one contact, against the sliding.
    fn hold_span(&mut self, leg: &Leg, contacts: &[u8], span: &Range<usize>, fixed: [bool; 2]) {
        let on = |frame: usize, which: usize| {
            leg.contacts[which].is_some_and(|bit| contacts[frame] & (1 << bit) != 0)
        };
        let by_foot = |frame: usize| !on(frame, 1) && on(frame, 0);
        let mut offset = Vec3::ZERO;
        for frame in span.start + 1..span.end {
            let track = match by_foot(frame) || by_foot(frame - 1) {
                true => &self.leg.feet,
                false => &self.leg.toes,
            };
            let step = track[frame] - track[frame - 1];
            offset -= Vec3::new(step.x, 0.0, step.z);
            self.offsets[frame] = offset;
        }
        let begins = fixed[0] && span.start < ANCHOR_FRAMES;
        let ends = fixed[1] && span.end + ANCHOR_FRAMES > contacts.len();
        let offsets = &mut self.offsets[span.clone()];
        let (count, end) = (offsets.len(), offset);
        let mean = offsets.iter().sum::<Vec3>() / count as f32;
        for (nth, offset) in offsets.iter_mut().enumerate() {
            *offset -= match (begins, ends) {
                (true, true) => end * smoothstep(nth as f32 / (count - 1).max(1) as f32),
                (true, false) => Vec3::ZERO,
                (false, true) => end,
                (false, false) => mean,
            };
        }
    }

    /// Offsets between contacts, before the first and after the last.
    fn pass_on(&mut self, known: &[Range<usize>], fade: usize) {
        let fading = |distance: usize| 1.0 - smoothstep((distance as f32 / (fade as f32 + 1.0)).min(1.0));
        if let (Some(first), Some(last)) = (known.first(), known.last()) {
            let (before, behind) = (self.offsets[first.start], self.offsets[last.end - 1]);
            for frame in 0..first.start {
                self.offsets[frame] = before * fading(first.start - frame);
            }
            for frame in last.end..self.offsets.len() {
                self.offsets[frame] = behind * fading(frame + 1 - last.end);
            }
        }
        for pair in known.windows(2) {
            let (left, right) = (pair[0].end - 1, pair[1].start);
            let (from, to) = (self.offsets[left], self.offsets[right]);
            for frame in left + 1..right {
                let way = (frame - left) as f32 / (right - left) as f32;
                let lift = (CARRY_SHARE * from.distance(to)).min(MAX_CARRY_M);
                self.offsets[frame] = if (right - left) / 2 <= fade {
                    from.lerp(to, smoothstep(way)) + Vec3::Y * (lift * (PI * way).sin())
                } else {
                    from * fading(frame - left) + to * fading(right - frame)
                };
            }
        }
    }

    /// Upward offsets that keep ankle and toe at their clearance over the ground.
    fn lift_out_of(&mut self, floor: f32, leg: &Leg, fixed: [bool; 2]) {
        let frames = self.offsets.len();
        for frame in 0..frames {
            let foot = floor + leg.clearance_m[0] - self.leg.feet[frame].y;
            let toe = floor + leg.clearance_m[1] - self.leg.toes[frame].y;
            self.offsets[frame].y += foot.max(toe).max(0.0) * edge(frame, frames, fixed);
        }
    }
}

/// From 0 at a frame that may not change to 1 a few frames away.
fn edge(frame: usize, frames: usize, fixed: [bool; 2]) -> f32 {
    let ramp = |distance: usize| smoothstep((distance as f32 / EDGE_FRAMES as f32).min(1.0));
    let first = if fixed[0] { ramp(frame) } else { 1.0 };
    let last = if fixed[1] { ramp(frames - 1 - frame) } else { 1.0 };
    first.min(last)
}

/// How far the root must be lowered in each frame so that every leg reaches its foot.
fn drops(tracks: &[Track], legs: &[Leg], skeleton: &Skeleton, fixed: [bool; 2], max_drop_m: f32) -> Vec<f32> {
    let frames = tracks.first().map_or(0, |track| track.offsets.len());
    let mut needs = vec![0.0_f32; frames];
    if max_drop_m <= 0.0 {
        return needs;
    }
    for (track, leg) in tracks.iter().zip(legs) {
        let leg_m = leg.length_m(skeleton) * (STRAIGHTEST - SOFT_SHARE);
        for (frame, need) in needs.iter_mut().enumerate() {
            let (hip, foot) = (track.leg.hips[frame], track.leg.feet[frame]);
            let goal = foot + track.offsets[frame];
            let excess = excess_height(hip, goal, leg_m.max(hip.distance(foot)));
            if excess > NO_OFFSET_M {
                *need = need.max(excess.min(max_drop_m));
            }
        }
    }
    let mut drops = cover(&needs, DROP_HALF_WINDOW);
    for (frame, drop) in drops.iter_mut().enumerate() {
        *drop = drop.min(max_drop_m) * edge(frame, frames, fixed);
    }
    drops
}

/// How much lower a hip must be for its leg to reach a foot, metres. 0 if it does already, or
/// cannot.
pub(crate) fn excess_height(hip: Vec3, foot: Vec3, leg_m: f32) -> f32 {
    let over = hip - foot;
    let height = leg_m * leg_m - over.x * over.x - over.z * over.z;
    (over.y - height.max(0.0).sqrt()).max(0.0)
}
