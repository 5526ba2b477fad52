//! The frames that the encoder and the decoders read and write, and how decoded windows become one
//! motion.
//!
//! A decoder gives frames relative to its first root. A [`Stitcher`] moves a window so that it
//! meets the last known frame, blends the remaining difference away, and gives the frames after it.

use std::sync::Arc;

use troupe_motion::contacts::detect;
use troupe_motion::features::{FEATURES_PER_JOINT, pose_features_from_world, world_rotations_from_features};
use troupe_motion::fk::WorldMotion;
use troupe_motion::interpolate::smoothstep;
use troupe_motion::model::{GLOBAL_ROOT, KeyTensors, Motion, Rig};
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::{six_d, slerp, yaw};
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

/// Frames over which a seam is blended.
const SEAM_FRAMES: usize = 8;

/// Frames of one character, in the networks' format.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frames {
    /// Pose features, `[frames, joints * 9]`.
    pub pose: Vec<f32>,
    /// Global roots, `[frames, 5]`.
    pub root: Vec<f32>,
}

impl Frames {
    /// Number of frames.
    pub fn len(&self) -> usize {
        self.root.len() / GLOBAL_ROOT
    }

    /// Whether there are no frames.
    pub fn is_empty(&self) -> bool {
        self.root.is_empty()
    }

    /// Parts of `frames` frames each.
    pub(crate) fn split(&self, frames: usize) -> Vec<Self> {
        let root = self.root.chunks_exact((frames * GLOBAL_ROOT).max(1));
        let pose = self
            .pose
            .chunks_exact((self.pose.len() / self.len().max(1) * frames).max(1));
        (pose.zip(root))
            .map(|(pose, root)| Self {
                pose: pose.to_vec(),
                root: root.to_vec(),
            })
            .collect()
    }

    /// Frames of keyframes. None if a keyframe lacks its root, or a pose of `joints` joints.
    pub(super) fn of_keys(keys: &[KeyTensors], joints: usize) -> Option<Self> {
        let mut frames = Self::default();
        for key in keys {
            let pose = key.pose.as_deref()?;
            if pose.len() != joints * FEATURES_PER_JOINT {
                return None;
            }
            frames.pose.extend_from_slice(pose);
            frames.root.extend(key.global_root?);
        }
        Some(frames)
    }

    /// The frames as keyframes of `joints` joints.
    pub(super) fn keys(&self, joints: usize) -> impl Iterator<Item = KeyTensors> {
        let poses = self.pose.chunks_exact(joints * FEATURES_PER_JOINT);
        poses
            .zip(self.root.as_chunks().0)
            .map(|(pose, &root)| KeyTensors {
                local_root: None,
                global_root: Some(root),
                pose: Some(pose.into()),
            })
    }

    fn body(&self, frame: usize, joints: usize) -> BodyFrame {
        let root = std::array::from_fn(|n| self.root[frame * GLOBAL_ROOT + n]);
        let width = joints * FEATURES_PER_JOINT;
        let mut rotations = vec![Quat::IDENTITY; joints];
        world_rotations_from_features(&self.pose[frame * width..(frame + 1) * width], &mut rotations);
        BodyFrame {
            root: GlobalRoot::from_array(root),
            rotations,
        }
    }
}

/// The root and pose of a character in one frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct BodyFrame {
    pub root: GlobalRoot,
    /// World rotations, one a joint.
    pub rotations: Vec<Quat>,
}

impl BodyFrame {
    /// Turns the character about its own root.
    fn turn(&mut self, angle: f32) {
        let turn = yaw(angle);
        self.root.heading = wrap_angle(self.root.heading + angle);
        for rotation in &mut self.rotations {
            *rotation = turn * *rotation;
        }
    }

    fn positions<'a>(&'a self, skeleton: &'a Skeleton, out: &mut Vec<Vec3>) {
        let first = out.len();
        for joint in &skeleton.joints {
            out.push(match joint.parent {
                Some(parent) => out[first + parent] + self.rotations[parent] * joint.offset_m,
                None => self.root.position,
            });
        }
    }
}

/// The difference between two poses of a character.
struct Difference {
    position: Vec3,
    heading: f32,
    /// The rotation of each joint that remains after the turn.
    rotations: Vec<Quat>,
}

impl Difference {
    fn between(from: &BodyFrame, to: &BodyFrame) -> Self {
        let mut turned = from.clone();
        let heading = wrap_angle(to.root.heading - from.root.heading);
        turned.turn(heading);
        Self {
            position: to.root.position - from.root.position,
            heading,
            rotations: (to.rotations.iter().zip(&turned.rotations))
                .map(|(to, from)| *to * from.conjugate())
                .collect(),
        }
    }

    /// Adds a share of the difference: `place` of position and heading, `pose` of the joints'
    /// rotations.
    fn add(&self, body: &mut BodyFrame, place: f32, pose: f32) {
        body.root.position += self.position * place;
        body.turn(self.heading * place);
        for (rotation, difference) in body.rotations.iter_mut().zip(&self.rotations) {
            *rotation = (slerp(Quat::IDENTITY, *difference, pose) * *rotation).normalize();
        }
    }
}

/// A movement over the ground that keeps heights.
#[derive(Debug, Clone, Copy)]
struct Placement {
    /// New position of the origin.
    origin: Vec3,
    turn: f32,
}

impl Placement {
    /// The movement that brings the root `from` onto `to`. The height stays.
    fn onto(from: GlobalRoot, to: GlobalRoot) -> Self {
        let turn = wrap_angle(to.heading - from.heading);
        Self {
            origin: to.projected() - yaw(turn) * from.projected(),
            turn,
        }
    }

    fn place(&self, body: &mut BodyFrame) {
        body.root.position = yaw(self.turn) * body.root.position + self.origin;
        body.turn(self.turn);
    }
}

/// Joins decoded windows to one motion.
#[derive(Debug, Clone)]
pub(super) struct Stitcher {
    rig: Arc<Rig>,
    /// The last known frames: the next message may contain them.
    past: Vec<BodyFrame>,
    /// How many frames the next message contains.
    keep: usize,
    /// Start of a motion without context, metres.
    start: Vec3,
}

impl Stitcher {
    /// A motion that follows the frames of `past`; without any it begins at `start`. `keep` is how
    /// many frames the next message contains.
    pub(super) fn new(rig: &Arc<Rig>, past: &Frames, start: Vec3, keep: usize) -> Self {
        let joints = rig.dims.joints;
        Self {
            rig: rig.clone(),
            past: (0..past.len()).map(|frame| past.body(frame, joints)).collect(),
            keep: keep.max(1),
            start,
        }
    }

    /// The last `keep` frames, or fewer if there are fewer.
    pub(super) fn past(&self) -> Frames {
        let mut frames = Frames::default();
        let mut positions = Vec::new();
        for body in &self.past[self.past.len().saturating_sub(self.keep)..] {
            positions.clear();
            body.positions(&self.rig.skeleton, &mut positions);
            let first = frames.pose.len();
            frames
                .pose
                .resize(first + positions.len() * FEATURES_PER_JOINT, 0.0);
            pose_features_from_world(
                body.root.position,
                &positions,
                &body.rotations,
                &mut frames.pose[first..],
            );
            frames.root.extend(body.root.to_array());
        }
        frames
    }

    /// The frames of a window from `first` to before `end`. The frame before `first` is moved onto
    /// the last known frame, if any. `target`, if given, is the pose that frame `end` must have.
    pub(super) fn join(
        &mut self,
        window: &Frames,
        first: usize,
        end: usize,
        target: Option<&BodyFrame>,
    ) -> Motion {
        let joints = self.rig.dims.joints;
        let placement = match (self.past.last(), first.checked_sub(1)) {
            (Some(last), Some(seam)) => Placement::onto(window.body(seam, joints).root, last.root),
            (Some(last), None) => Placement::onto(window.body(0, joints).root, last.root),
            (None, _) => Placement {
                origin: self.start,
                turn: 0.0,
            },
        };
        let placed = |frame: usize| {
            let mut body = window.body(frame, joints);
            placement.place(&mut body);
            body
        };
        let mut bodies: Vec<BodyFrame> = (first..end).map(placed).collect();
        if let (Some(last), Some(seam)) = (self.past.last(), first.checked_sub(1)) {
            let difference = Difference::between(&placed(seam), last);
            for (index, body) in bodies.iter_mut().enumerate().take(SEAM_FRAMES) {
                let left = 1.0 - smoothstep((index + 1) as f32 / (SEAM_FRAMES + 1) as f32);
                difference.add(body, left, left);
            }
        }
        if let Some(target) = target {
            let difference = Difference::between(&placed(end), target);
            let count = bodies.len();
            for (index, body) in bodies.iter_mut().enumerate() {
                let place = smoothstep((index + 1) as f32 / (count + 1) as f32);
                let near = (index + 1 + SEAM_FRAMES).saturating_sub(count) as f32;
                difference.add(body, place, smoothstep(near / (SEAM_FRAMES + 1) as f32));
            }
        }
        self.write(bodies)
    }

    /// Writes these frames as motion. They become the last known frames.
    fn write(&mut self, bodies: Vec<BodyFrame>) -> Motion {
        let mut motion = Motion::default();
        let skeleton = &self.rig.skeleton;
        // Speeds are differences from the frame before.
        let before = self.past.last().cloned();
        let mut world = WorldMotion {
            joints: self.rig.dims.joints,
            positions: Vec::new(),
            rotations: Vec::new(),
        };
        for body in before.iter().chain(&bodies) {
            body.positions(skeleton, &mut world.positions);
            world.rotations.extend_from_slice(&body.rotations);
        }
        if let Some(params) = &skeleton.contacts {
            let found = detect(&world, params, skeleton.ground_y_m, self.rig.fps);
            let skip = if before.is_some() { params.len() } else { 0 };
            let found = found.into_iter().skip(skip);
            motion.contacts = found.map(|down| if down { 1.0 } else { 0.0 }).collect();
        }
        for body in bodies {
            motion.root.extend(body.root.to_array());
            motion
                .rotations
                .extend(body.rotations.iter().flat_map(|&rotation| six_d(rotation)));
            self.past.push(body);
        }
        let over = self.past.len().saturating_sub(2 * self.keep);
        self.past.drain(..over);
        motion
    }
}

/// The first of the frames; none if there are no frames.
pub(super) fn first_body(frames: &Frames, joints: usize) -> Option<BodyFrame> {
    (!frames.is_empty()).then(|| frames.body(0, joints))
}
