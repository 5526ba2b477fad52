//! What a trial shows, measured on its frames: the character's own word about errors is only reported beside.

use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::metrics::{foot_skate_m_per_frame, joint_accelerations_mps2, percentile};
use troupe_motion::root::{heading_of, wrap_angle};
use troupe_motion::{Quat, Vec3};
use troupe_server::object::{Definition, Keyframe, Origin};
use troupe_server::pack::Pack;
use troupe_server::scene::Transform;
use troupe_server::session::{CharacterEvent, EventKind, KeyframeError};

use super::trials::Spec;

/// A keyframe counts as met within this of its joints and root, metres.
pub const WITHIN_M: f32 = 0.05;
/// And within this of its heading, degrees.
pub const WITHIN_DEG: f32 = 15.0;

/// What was taken down of a trial.
pub struct Record {
    place: Transform,
    told_at: Option<u64>,
    roots: Vec<Vec3>,
    rotations: Vec<Quat>,
    contacts: Vec<u8>,
    events: Vec<CharacterEvent>,
    refused: Option<String>,
}

/// What came of a trial.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    /// The interaction went through to its end.
    pub done: bool,
    /// Why it did not, in a word.
    pub why: Option<String>,
    /// Every hard keyframe was met.
    pub met: bool,
    /// The worst of the hard keyframes, measured: joints and root in metres, heading in degrees.
    pub joint_m: f32,
    pub root_m: f32,
    pub heading_deg: f32,
    /// The worst before it was drawn to its keyframes, by the character's word: joints and root in metres.
    pub before_joint_m: f32,
    pub before_root_m: f32,
    /// From the command to the end, seconds.
    pub seconds: f32,
    /// Foot skate from the command to the end, and before it, millimetres a frame.
    pub skate_mm: f64,
    pub skate_before_mm: f64,
    /// Joint acceleration that 99.5 % stay below from the command to the end, m/s².
    pub acceleration: f64,
    /// The variant that was chosen.
    pub variant: String,
    /// Which of the twelve directions, of those trials.
    pub direction: Option<usize>,
    /// The hard keyframes' poses are compared over trials for variety: joints of the frame where the first was reached,
    /// as seen from the root.
    pub pose: Vec<Vec3>,
}

impl Record {
    pub fn new(place: Transform) -> Self {
        Self {
            place,
            told_at: None,
            roots: Vec::new(),
            rotations: Vec::new(),
            contacts: Vec::new(),
            events: Vec::new(),
            refused: None,
        }
    }

    pub fn told(&mut self, frame: u64) {
        self.told_at = Some(frame);
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
        let (Some(told), false) = (self.told_at, self.roots.len() < 4) else {
            return outcome;
        };
        let fps = pack.manifest.fps;
        let clip = Clip::new(
            pack.skeleton.clone(),
            fps,
            self.roots.clone(),
            self.rotations.clone(),
        );
        let Ok(clip) = clip else {
            outcome.why = Some("frames that are no motion".to_owned());
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
                    ..
                } => {
                    let Some(set) = definition.set(set) else { continue };
                    if outcome.pose.is_empty() {
                        let joints = motion.joints;
                        let root = motion.positions[at * joints];
                        outcome.pose = motion.positions[at * joints..][..joints]
                            .iter()
                            .map(|p| *p - root)
                            .collect();
                    }
                    if !set.is_hard() {
                        continue;
                    }
                    let key = &set.keyframes[*keyframe as usize];
                    let error = self.error(pack, definition, set.origin, key, &clip, &motion, at);
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
        let told = (told as usize).min(motion.frames() - 2);
        let range = told..end.max(told + 2).min(motion.frames() - 1);
        outcome.seconds = (end.saturating_sub(told)) as f32 / fps;
        let skate =
            |range| foot_skate_m_per_frame(&pack.skeleton, &motion, range).map_or(f64::NAN, |m| 1000.0 * m);
        outcome.skate_mm = skate(range.clone());
        outcome.skate_before_mm = skate(1..told.max(2));
        outcome.acceleration = joint_accelerations_mps2(&motion, range, fps)
            .ok()
            .and_then(|values| percentile(values, 0.995))
            .unwrap_or(f64::NAN);
        outcome
    }

    /// How far the frame `at` is from a keyframe, whatever side it was approached from where the keyframe leaves that open.
    #[expect(clippy::too_many_arguments, reason = "all of it is what is compared")]
    fn error(
        &self,
        pack: &Pack,
        definition: &Definition,
        origin: Origin,
        key: &Keyframe,
        clip: &Clip,
        motion: &WorldMotion,
        at: usize,
    ) -> KeyframeError {
        let joints = motion.joints;
        let positions = &motion.positions[at * joints..][..joints];
        let heading = heading_of(clip.rotations_at(at)[0], pack.skeleton.left_axis);
        let mut error = KeyframeError::default();
        if origin == Origin::Character {
            // Its origin is where the set began; its pose is compared below, its place is not known here.
            if let Some(rotations) = &key.rotations {
                error.joint_m = pose_error(pack, rotations, clip.rotations_at(at), heading);
            }
            return error;
        }
        // A keyframe with ω may be turned to any side: the one that the character is on.
        let pivot = definition.pivot(self.place);
        let side = match (key.pivot, key.place_m) {
            (true, Some([x, z])) => {
                let local = Vec3::new(x, 0.0, z) - definition.pivot_m.with_y(0.0);
                let there = (positions[0] - pivot).with_y(0.0);
                wrap_angle(bearing(there) - bearing(local) - self.place.heading())
            }
            (true, None) => {
                let facing = key.heading.unwrap_or(0.0);
                wrap_angle(heading - facing - self.place.heading())
            }
            (false, _) => 0.0,
        };
        let ground_y = 0.0;
        let world = definition.anchor(self.place, side, ground_y).keyframe(key);
        if let Some([x, z]) = world.place {
            let off = Vec3::new(positions[0].x - x, 0.0, positions[0].z - z);
            error.root_m = off.length();
        }
        if let Some(height) = world.height {
            error.root_m = error.root_m.hypot(positions[0].y - height);
        }
        if let Some(wanted) = world.heading {
            error.heading = match (key.pivot, key.place_m) {
                // The side was taken from the heading: what is left is how well it faces the pivot.
                (true, None) => {
                    let to_pivot = bearing(pivot - positions[0]);
                    let meant = wrap_angle(to_pivot + key.heading.unwrap_or(0.0) - std::f32::consts::PI);
                    wrap_angle(heading - meant).abs()
                }
                _ => wrap_angle(heading - wanted).abs(),
            };
        }
        if let Some(rotations) = &key.rotations {
            error.joint_m = pose_error(pack, rotations, clip.rotations_at(at), heading);
        }
        for point in &world.points {
            error.joint_m = error.joint_m.max(positions[point.joint].distance(point.position));
        }
        error
    }
}

/// Angle about +Y of a direction over the ground.
fn bearing(direction: Vec3) -> f32 {
    direction.x.atan2(direction.z)
}

/// The farthest joint between a pose with its heading taken out and one in the world, both at one root.
fn pose_error(pack: &Pack, local: &[Quat], world: &[Quat], heading: f32) -> f32 {
    let joints = pack.skeleton.joint_count();
    let place = |rotations: &[Quat]| {
        let (mut positions, mut turns) = (vec![Vec3::ZERO; joints], vec![Quat::IDENTITY; joints]);
        troupe_motion::fk::world_transforms(
            &pack.skeleton,
            Vec3::ZERO,
            rotations,
            &mut positions,
            &mut turns,
        );
        positions
    };
    let mut meant = local.to_vec();
    meant[0] = troupe_motion::rotation::yaw(heading) * meant[0];
    let (meant, shown) = (place(&meant), place(world));
    meant
        .iter()
        .zip(&shown)
        .map(|(a, b)| a.distance(*b))
        .fold(0.0, f32::max)
}
