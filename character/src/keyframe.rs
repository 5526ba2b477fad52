//! Keyframes whose values were checked, and their tensors in the segment frame.

use troupe_motion::feasibility::Key;
use troupe_motion::features::pose_features_from_world;
use troupe_motion::fk::world_transforms;
use troupe_motion::model::{KeyTensors, POSE_FEATURES};
use troupe_motion::root::wrap_angle;
use troupe_motion::{GlobalRoot, LocalRoot, Quat, SegmentFrame, Skeleton, Vec3};

/// A keyframe with every value checked on its own, still in the world.
#[derive(Debug, Clone)]
pub struct Checked {
    /// Where the root is and faces.
    pub root: Option<GlobalRoot>,
    /// Height of the root joint, wherever it was given.
    pub height: Option<f32>,
    /// Velocity over the ground, turning, and height.
    pub velocity: Option<LocalRoot>,
    /// The pose.
    pub pose: Option<CheckedPose>,
}

impl Checked {
    /// A keyframe of parts that need no checks: rotations of unit length, joint 0 in the world, and
    /// everything finite. A pose needs a height, from `height`, the root or the velocity, and is
    /// left out without one.
    pub fn of(
        root: Option<GlobalRoot>,
        height: Option<f32>,
        velocity: Option<LocalRoot>,
        rotations: Option<Vec<Quat>>,
    ) -> Self {
        let height = root
            .map(|root| root.position.y)
            .or(height)
            .or(velocity.map(|velocity| velocity.height));
        Self {
            root,
            height,
            velocity,
            pose: rotations
                .zip(height)
                .map(|(rotations, height)| CheckedPose { rotations, height }),
        }
    }

    /// As what is judged.
    pub fn key(&self) -> Key<'_> {
        Key {
            root: self.root,
            height: self.height,
            velocity: self.velocity,
            rotations: self.pose.as_ref().map(|pose| &*pose.rotations),
        }
    }

    /// What the keyframe fixes, in the segment frame.
    pub fn given(&self, frame: &SegmentFrame) -> Given {
        let rotations = self.pose.as_ref().map(|pose| {
            let mut rotations = pose.rotations.clone();
            if let Some(pelvis) = rotations.first_mut() {
                *pelvis = frame.to_segment_rotation(*pelvis);
            }
            rotations
        });
        let root = self.root.map(|root| frame.to_segment_root(root));
        Given {
            root,
            height: self.height,
            velocity: self
                .velocity
                .map(|velocity| frame.to_segment_local_root(velocity)),
            rotations,
        }
    }
}

/// The pose of a checked keyframe.
#[derive(Debug, Clone)]
pub struct CheckedPose {
    /// Unit length; joint 0 in the world, others parent-relative.
    pub rotations: Vec<Quat>,
    /// Height of the root joint, metres.
    pub height: f32,
}

/// What a keyframe fixes, in the segment frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Given {
    /// Where the root is and faces.
    pub root: Option<GlobalRoot>,
    /// How high the root is, metres; given without a root too.
    pub height: Option<f32>,
    /// How it is asked to move.
    pub velocity: Option<LocalRoot>,
    /// One rotation for each joint: joint 0 in the segment, others parent-relative.
    pub rotations: Option<Vec<Quat>>,
}

impl Given {
    /// As what is judged.
    pub fn key(&self) -> Key<'_> {
        Key {
            root: self.root,
            height: self.height,
            velocity: self.velocity,
            rotations: self.rotations.as_deref(),
        }
    }
}

/// Makes keyframe tensors in a segment frame; keeps its scratch memory between keyframes.
pub struct KeyWriter<'a> {
    skeleton: &'a Skeleton,
    fps: f32,
    local: Vec<Quat>,
    positions: Vec<Vec3>,
    rotations: Vec<Quat>,
}

impl<'a> KeyWriter<'a> {
    /// For keyframes of `skeleton`.
    pub fn new(skeleton: &'a Skeleton, fps: f32) -> Self {
        let joints = skeleton.joint_count();
        Self {
            skeleton,
            fps,
            local: vec![Quat::IDENTITY; joints],
            positions: vec![Vec3::ZERO; joints],
            rotations: vec![Quat::IDENTITY; joints],
        }
    }

    /// Tensors of consecutive keyframes. A velocity that is not given follows from the root of the
    /// keyframe before it; the first keyframe takes that of the second, as in training.
    pub fn write(&mut self, frame: &SegmentFrame, keys: &[Checked]) -> Vec<KeyTensors> {
        let roots: Vec<Option<GlobalRoot>> = keys
            .iter()
            .map(|key| key.root.map(|root| frame.to_segment_root(root)))
            .collect();
        let step = |pair: &[Option<GlobalRoot>]| Some(self.local_root(&pair[0]?, &pair[1]?));
        let mut locals: Vec<Option<LocalRoot>> = std::iter::once(None)
            .chain(roots.windows(2).map(step))
            .take(keys.len())
            .collect();
        if let ([first, Some(second), ..], Some(root)) =
            (locals.as_mut_slice(), roots.first().copied().flatten())
        {
            *first = Some(LocalRoot {
                height: root.position.y,
                ..*second
            });
        }
        for (local, key) in locals.iter_mut().zip(keys) {
            if let Some(velocity) = key.velocity {
                *local = Some(frame.to_segment_local_root(velocity));
            }
        }
        keys.iter()
            .zip(roots)
            .zip(locals)
            .map(|((key, root), local)| KeyTensors {
                local_root: local.map(LocalRoot::to_array),
                global_root: root.map(GlobalRoot::to_array),
                pose: key.pose.as_ref().map(|pose| self.pose(frame, pose)),
            })
            .collect()
    }

    /// The backward difference of two consecutive roots.
    fn local_root(&self, before: &GlobalRoot, now: &GlobalRoot) -> LocalRoot {
        let velocity = (now.position - before.position) * self.fps;
        LocalRoot {
            vx: velocity.x,
            vz: velocity.z,
            omega: wrap_angle(now.heading - before.heading) * self.fps,
            height: now.position.y,
        }
    }

    fn pose(&mut self, frame: &SegmentFrame, pose: &CheckedPose) -> Box<[f32]> {
        self.local.copy_from_slice(&pose.rotations);
        self.local[0] = frame.to_segment_rotation(self.local[0]);
        // Features are relative to the projected root, so the root stands above the origin whatever
        // its place.
        let root = Vec3::new(0.0, pose.height, 0.0);
        world_transforms(
            self.skeleton,
            root,
            &self.local,
            &mut self.positions,
            &mut self.rotations,
        );
        let mut features = vec![0.0; self.skeleton.joint_count() * POSE_FEATURES].into_boxed_slice();
        pose_features_from_world(root, &self.positions, &self.rotations, &mut features);
        features
    }
}
