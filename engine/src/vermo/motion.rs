//! Frames as the encoder and the decoders read and write them, and how decoded windows become one
//! motion.
//!
//! A decoder gives frames in the frame of its first root. A [`Stitcher`] lays a window onto the
//! last frame that there is, blends what is left of the difference away, and gives the frames
//! behind it.

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

/// Frames of one body, as networks have them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frames {
    /// Pose features, `[frames, joints * 9]`.
    pub pose: Vec<f32>,
    /// Global roots, `[frames, 5]`.
    pub root: Vec<f32>,
}

impl Frames {
    /// How many.
    pub fn len(&self) -> usize {
        self.root.len() / GLOBAL_ROOT
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.root.is_empty()
    }

    /// In parts of so many frames.
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

    /// Of keyframes; none where one of them lacks its root, or has no pose of so many joints.
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

    /// As keyframes, of so many joints.
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

    fn body(&self, frame: usize, joints: usize) -> Body {
        let root = std::array::from_fn(|n| self.root[frame * GLOBAL_ROOT + n]);
        let width = joints * FEATURES_PER_JOINT;
        let mut rotations = vec![Quat::IDENTITY; joints];
        world_rotations_from_features(&self.pose[frame * width..(frame + 1) * width], &mut rotations);
        Body {
            root: GlobalRoot::from_array(root),
            rotations,
        }
    }
}

/// A body in one frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Body {
    pub root: GlobalRoot,
    /// World rotations, one a joint.
    pub rotations: Vec<Quat>,
}

impl Body {
    /// Turned about its own root.
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

/// What is to be added to a body to make another of it.
struct Difference {
    position: Vec3,
    heading: f32,
    /// Of each joint, after the turn.
    rotations: Vec<Quat>,
}

impl Difference {
    fn between(from: &Body, to: &Body) -> Self {
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

    /// Adds shares of it: of place and heading, and of the pose.
    fn add(&self, body: &mut Body, place: f32, pose: f32) {
        body.root.position += self.position * place;
        body.turn(self.heading * place);
        for (rotation, difference) in body.rotations.iter_mut().zip(&self.rotations) {
            *rotation = (slerp(Quat::IDENTITY, *difference, pose) * *rotation).normalize();
        }
    }
}

/// Moves bodies over the ground.
#[derive(Debug, Clone, Copy)]
struct Placement {
    /// Where the origin comes to lie.
    origin: Vec3,
    turn: f32,
}

impl Placement {
    /// Brings the root `from` onto `to`, but for its height.
    fn onto(from: GlobalRoot, to: GlobalRoot) -> Self {
        let turn = wrap_angle(to.heading - from.heading);
        Self {
            origin: to.projected() - yaw(turn) * from.projected(),
            turn,
        }
    }

    fn place(&self, body: &mut Body) {
        body.root.position = yaw(self.turn) * body.root.position + self.origin;
        body.turn(self.turn);
    }
}

/// Makes one motion of decoded windows.
#[derive(Debug, Clone)]
pub(super) struct Stitcher {
    rig: Arc<Rig>,
    /// Frames that are there, the last ones: those that a next message may be told.
    past: Vec<Body>,
    /// Most of them.
    keep: usize,
    /// Where a motion without a past begins.
    start: Vec3,
}

impl Stitcher {
    /// Behind the frames of `past`; at `start` where there are none. `keep` is how many frames a
    /// next message is told.
    pub(super) fn new(rig: &Arc<Rig>, past: &Frames, start: Vec3, keep: usize) -> Self {
        let joints = rig.dims.joints;
        Self {
            rig: rig.clone(),
            past: (0..past.len()).map(|frame| past.body(frame, joints)).collect(),
            keep: keep.max(1),
            start,
        }
    }

    /// The last frames, as many as a next message is told.
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

    /// The frames of a window from `first` to before `end`. The one before `first` is laid onto the
    /// last frame that there is, if there is one; `target`, where it is given, is what frame `end`
    /// is to be.
    pub(super) fn join(
        &mut self,
        window: &Frames,
        first: usize,
        end: usize,
        target: Option<&Body>,
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
        let mut bodies: Vec<Body> = (first..end).map(placed).collect();
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

    /// The motion of bodies, which are the last frames from now on.
    fn write(&mut self, bodies: Vec<Body>) -> Motion {
        let mut motion = Motion::default();
        let skeleton = &self.rig.skeleton;
        // Speeds count from the frame before.
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

/// The body of a keyframe's first frame.
pub(super) fn first_body(frames: &Frames, joints: usize) -> Option<Body> {
    (!frames.is_empty()).then(|| frames.body(0, joints))
}
