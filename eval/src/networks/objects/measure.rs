//! Measures a trial on its frames. The errors that the character itself reports are only printed
//! beside them.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::ops::Range;

use troupe_character::live::{CharacterEvent, EventKind, KeyframeError};
use troupe_character::object::{Definition, Keyframe, Origin};
use troupe_character::scene::Transform;
use troupe_engine::pack::Pack;
use troupe_motion::clip::Clip;
use troupe_motion::fk::{WorldMotion, world_transforms};
use troupe_motion::metrics::{foot_skate_m_per_frame, joint_accelerations_mps2, percentile};
use troupe_motion::root::{heading_of, wrap_angle};
use troupe_motion::rotation::yaw;
use troupe_motion::{Quat, Skeleton, Vec3};

use super::runner::GROUND_M;
use super::trials::Spec;

/// A keyframe counts as met within this of its joints and root, metres.
pub const WITHIN_M: f32 = 0.05;
/// It must also be within this of its heading, degrees.
pub const WITHIN_DEG: f32 = 15.0;

/// The frames and events of a trial.
pub struct Record {
    place: Transform,
    command_at: Option<u64>,
    broken_off_at: Option<u64>,
    roots: Vec<Vec3>,
    rotations: Vec<Quat>,
    contacts: Vec<u8>,
    events: Vec<CharacterEvent>,
    refused: Option<String>,
}

/// Roughness of a stretch of motion: of its worst joint and frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct Roughness {
    /// Distance in one frame, metres.
    pub way_m: f64,
    /// Acceleration, m/s².
    pub acceleration: f64,
}

/// Figures of a trial.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    /// The interaction went through to its end.
    pub done: bool,
    /// Why it did not, if it did not.
    pub why: Option<String>,
    /// Whether every hard keyframe was met.
    pub met: bool,
    /// Largest errors of the hard keyframes, measured: joints and root in metres, heading in
    /// degrees.
    pub joint_m: f32,
    pub root_m: f32,
    pub heading_deg: f32,
    /// Largest errors before the motion was drawn to its keyframes, as the character reports them:
    /// joints and root in metres.
    pub before_joint_m: f32,
    pub before_root_m: f32,
    /// From the command to the end, seconds.
    pub seconds: f32,
    /// Foot skate from the command to the end, and before it, millimetres a frame.
    pub skate_mm: f64,
    pub skate_before_mm: f64,
    /// 99.5th percentile of joint accelerations from the command to the end, m/s².
    pub acceleration: f64,
    /// The largest acceleration of a knee from the command until a second after the end, m/s².
    pub knee_acceleration: f64,
    /// The variant that the character chose.
    pub variant: String,
    /// Which of the twelve directions, in trials by direction.
    pub direction: Option<usize>,
    /// Soft sets: their number, how many were left early, and by how many frames at most.
    pub soft: usize,
    pub soft_early: usize,
    pub earliest_frames: u32,
    /// Positions of joints at every keyframe that was reached, one keyframe after the other,
    /// relative to the root and turned to face ahead. Variety is measured on them.
    pub poses: Vec<Vec3>,
    /// If the interaction was broken off: roughness in the second after that, and of the walk
    /// before.
    pub broken_off: Option<[Roughness; 2]>,
    /// A digest of all frames and events.
    pub digest: u64,
}

impl Record {
    pub fn new(place: Transform) -> Self {
        Self {
            place,
            command_at: None,
            broken_off_at: None,
            roots: Vec::new(),
            rotations: Vec::new(),
            contacts: Vec::new(),
            events: Vec::new(),
            refused: None,
        }
    }

    pub fn commanded(&mut self, frame: u64) {
        self.command_at = Some(frame);
    }

    pub fn broken_off(&mut self, frame: u64) {
        self.broken_off_at = Some(frame);
    }

    pub fn refused(&mut self, why: String) {
        self.refused = Some(why);
    }

    pub fn frame(&mut self, root: Vec3, rotations: &[Quat], contacts: u8) {
        self.roots.push(root);
        self.rotations.extend_from_slice(rotations);
        self.contacts.push(contacts);
    }

    pub fn event(&mut self, event: CharacterEvent) {
        self.events.push(event);
    }

    /// Measures the trial.
    pub fn outcome(self, pack: &Pack, definition: &Definition, spec: &Spec) -> Outcome {
        let mut outcome = Outcome {
            direction: spec.direction,
            why: self.refused.clone(),
            ..Outcome::default()
        };
        let (Some(command), false) = (self.command_at, self.roots.len() < 4) else {
            return outcome;
        };
        let fps = pack.manifest.fps;
        let clip = Clip::new(
            pack.rig.skeleton.clone(),
            fps,
            self.roots.clone(),
            self.rotations.clone(),
        );
        let Ok(clip) = clip else {
            outcome.why = Some("its frames are no motion".to_owned());
            return outcome;
        };
        let motion = WorldMotion::from_clip(&clip);
        let mut end = motion.frames();
        let mut met = true;
        for event in &self.events {
            let at = (event.frame as usize).saturating_sub(1).min(motion.frames() - 1);
            match &event.kind {
                EventKind::Started { variant, .. } => outcome.variant.clone_from(variant),
                EventKind::Reached {
                    set,
                    keyframe,
                    before,
                    early_frames,
                    ..
                } => {
                    let Some(set) = definition.set(set) else { continue };
                    let frame = Frame {
                        skeleton: &pack.rig.skeleton,
                        positions: &motion.positions[at * motion.joints..][..motion.joints],
                        heading: heading_of(clip.rotations_at(at)[0], pack.rig.skeleton.left_axis),
                    };
                    let root = frame.positions[0];
                    let unturned = yaw(-frame.heading);
                    (outcome.poses).extend(frame.positions.iter().map(|p| unturned * (*p - root)));
                    if !set.is_hard() {
                        outcome.soft += 1;
                        outcome.soft_early += usize::from(*early_frames > 0);
                        outcome.earliest_frames = outcome.earliest_frames.max(*early_frames);
                        met &= *early_frames <= set.drop_frames;
                        continue;
                    }
                    met &= *early_frames == 0;
                    let key = &set.keyframes[*keyframe as usize];
                    let error = self.error(definition, set.origin, key, &frame);
                    outcome.before_joint_m = outcome.before_joint_m.max(before.joint_m);
                    outcome.before_root_m = outcome.before_root_m.max(before.root_m);
                    outcome.joint_m = outcome.joint_m.max(error.joint_m);
                    outcome.root_m = outcome.root_m.max(error.root_m);
                    outcome.heading_deg = outcome.heading_deg.max(error.heading.to_degrees());
                    met &= error.joint_m <= WITHIN_M
                        && error.root_m <= WITHIN_M
                        && error.heading.to_degrees() <= WITHIN_DEG;
                }
                EventKind::Done { .. } => {
                    outcome.done = true;
                    end = at + 1;
                }
                EventKind::Failed { reason, .. } => outcome.why = Some(reason.word().to_owned()),
                _ => {}
            }
        }
        outcome.met = outcome.done && met;
        outcome.digest = self.digest();
        outcome.broken_off = self.broken_off_at.map(|at| {
            let at = (at as usize).min(motion.frames() - 3);
            let after = at - 1..(at + fps as usize).min(motion.frames() - 1);
            [after, 1..(command as usize).max(3)].map(|range| roughness(&motion, range, fps))
        });
        let start = (command as usize).min(motion.frames() - 2);
        let range = start..end.max(start + 2).min(motion.frames() - 1);
        outcome.seconds = (end.saturating_sub(start)) as f32 / fps;
        let skate = |range| {
            foot_skate_m_per_frame(&pack.rig.skeleton, &motion, range).map_or(f64::NAN, |m| 1000.0 * m)
        };
        outcome.skate_mm = skate(range.clone());
        outcome.skate_before_mm = skate(1..start.max(2));
        let knees: Vec<usize> = pack.rig.legs.iter().map(|leg| leg.lower).collect();
        let after = start..(range.end + fps as usize).min(motion.frames() - 1);
        outcome.knee_acceleration = largest_acceleration(&motion, after, &knees, fps);
        outcome.acceleration = joint_accelerations_mps2(&motion, range, fps)
            .ok()
            .and_then(|values| percentile(values, 0.995))
            .unwrap_or(f64::NAN);
        outcome
    }

    fn digest(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        let numbers = |p: &Vec3| p.to_array().map(f32::to_bits);
        self.roots
            .iter()
            .map(numbers)
            .for_each(|bits| bits.hash(&mut hasher));
        let turns = self.rotations.iter().map(|q| q.to_array().map(f32::to_bits));
        turns.for_each(|bits| bits.hash(&mut hasher));
        for event in &self.events {
            format!("{event:?}").hash(&mut hasher);
        }
        hasher.finish()
    }

    /// The distance of a frame from a keyframe. A keyframe that leaves the side open is turned to
    /// the side from which the character came. Joints are compared in the world, so if a keyframe
    /// gives the root, an error of the root counts for every joint too.
    fn error(
        &self,
        definition: &Definition,
        origin: Origin,
        key: &Keyframe,
        frame: &Frame<'_>,
    ) -> KeyframeError {
        let mut error = KeyframeError::default();
        if origin == Origin::Character {
            // The root of such a keyframe counts from the start of the set, which is not known
            // here. Only its pose is compared.
            if let Some(rotations) = &key.rotations {
                error.joint_m = frame.pose_error(frame.positions[0], frame.heading, rotations);
            }
            return error;
        }
        // A keyframe that pivots may be turned to any side. It is the side of the character.
        let root = frame.positions[0];
        let pivot = definition.pivot(self.place);
        let side = match (key.pivot, key.place_m) {
            (true, Some([x, z])) => {
                let local = Vec3::new(x, 0.0, z) - definition.pivot_m.with_y(0.0);
                let there = (root - pivot).with_y(0.0);
                wrap_angle(bearing(there) - bearing(local) - self.place.heading())
            }
            (true, None) => {
                let facing = key.heading.unwrap_or(0.0);
                wrap_angle(frame.heading - facing - self.place.heading())
            }
            (false, _) => 0.0,
        };
        let world = definition.anchor(self.place, side, GROUND_M).keyframe(key);
        let mut wanted = root;
        if let Some([x, z]) = world.place {
            (wanted.x, wanted.z) = (x, z);
        }
        if let Some(height) = world.height {
            wanted.y = height;
        }
        error.root_m = wanted.distance(root);
        if let Some(heading) = world.heading {
            error.heading = match (key.pivot, key.place_m) {
                // The side came from the heading. The error is how far it faces from the pivot.
                (true, None) => {
                    let to_pivot = bearing(pivot - root);
                    let meant = wrap_angle(to_pivot + key.heading.unwrap_or(0.0) - std::f32::consts::PI);
                    wrap_angle(frame.heading - meant).abs()
                }
                _ => wrap_angle(frame.heading - heading).abs(),
            };
        }
        if let Some(rotations) = &key.rotations {
            let heading = world.heading.unwrap_or(frame.heading);
            error.joint_m = frame.pose_error(wanted, heading, rotations);
        }
        for point in &world.points {
            error.joint_m = error
                .joint_m
                .max(frame.positions[point.joint].distance(point.position));
        }
        error
    }
}

/// One frame in the world.
struct Frame<'a> {
    skeleton: &'a Skeleton,
    positions: &'a [Vec3],
    heading: f32,
}

impl Frame<'_> {
    /// Largest distance of a joint from a pose without heading, which is placed at a root and
    /// turned to a heading.
    fn pose_error(&self, root: Vec3, heading: f32, pose: &[Quat]) -> f32 {
        let mut pose = pose.to_vec();
        pose[0] = yaw(heading) * pose[0];
        let mut meant = vec![Vec3::ZERO; self.positions.len()];
        let mut turns = vec![Quat::IDENTITY; self.positions.len()];
        world_transforms(self.skeleton, root, &pose, &mut meant, &mut turns);
        let far = meant.iter().zip(self.positions).map(|(a, b)| a.distance(*b));
        far.fold(0.0, f32::max)
    }
}

/// The largest acceleration of given joints in the frames of a range, m/s².
fn largest_acceleration(motion: &WorldMotion, range: Range<usize>, joints: &[usize], fps: f32) -> f64 {
    let at = |frame: usize, joint: usize| motion.positions[frame * motion.joints + joint];
    let largest = range
        .filter(|&frame| frame > 0)
        .flat_map(|frame| {
            joints.iter().map(move |&joint| {
                (at(frame + 1, joint) - 2.0 * at(frame, joint) + at(frame - 1, joint)).length()
            })
        })
        .fold(0.0, f32::max);
    f64::from(largest * fps * fps)
}

fn roughness(motion: &WorldMotion, range: Range<usize>, fps: f32) -> Roughness {
    let joints = motion.joints;
    let ways = range.clone().flat_map(|frame| {
        let (before, now) = (
            &motion.positions[(frame - 1) * joints..][..joints],
            &motion.positions[frame * joints..],
        );
        before.iter().zip(now).map(|(a, b)| f64::from(a.distance(*b)))
    });
    let accelerations = joint_accelerations_mps2(motion, range.clone(), fps).unwrap_or_default();
    Roughness {
        way_m: ways.fold(0.0, f64::max),
        acceleration: accelerations.into_iter().fold(0.0, f64::max),
    }
}

/// Heading of a direction over the ground, radians.
fn bearing(direction: Vec3) -> f32 {
    direction.x.atan2(direction.z)
}
