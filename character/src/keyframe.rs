//! Checked keyframes, and their tensors in the segment frame.

use troupe_motion::feasibility::Key;
use troupe_motion::features::pose_features_from_world;
use troupe_motion::fk::world_transforms;
use troupe_motion::model::{KeyTensors, POSE_FEATURES};
use troupe_motion::root::wrap_angle;
use troupe_motion::{GlobalRoot, LocalRoot, Quat, SegmentFrame, Skeleton, Vec3};

/// A keyframe whose values were each checked, still in world coordinates.
#[derive(Debug, Clone)]
pub struct Checked {
    /// Position in metres and heading in radians.
    pub root: Option<GlobalRoot>,
    /// Height of the root joint, metres, from whichever part gives it.
    pub height: Option<f32>,
    /// Velocity over the ground, m/s, turning rate, rad/s, and height, metres.
    pub velocity: Option<LocalRoot>,
    /// Rotations of all joints, with their own height.
    pub pose: Option<CheckedPose>,
}

impl Checked {
    /// A keyframe whose parts need no checks: finite numbers, rotations of unit length, joint 0 in
    /// the world. A pose needs a height, from `height`, the root or the velocity. Without one it is
    /// dropped.
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

    /// The form in which feasibility is judged.
    pub fn key(&self) -> Key<'_> {
        Key {
            root: self.root,
            height: self.height,
            velocity: self.velocity,
            rotations: self.pose.as_ref().map(|pose| &*pose.rotations),
        }
    }

    /// What the keyframe prescribes, in the segment frame.
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
    /// Unit quaternions: joint 0 in the world, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// Height of the root joint, metres.
    pub height: f32,
}

/// What a keyframe prescribes, in the segment frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Given {
    /// Position in metres and heading in radians.
    pub root: Option<GlobalRoot>,
    /// Height of the root, metres. May be given without a root.
    pub height: Option<f32>,
    /// Velocity that was asked for.
    pub velocity: Option<LocalRoot>,
    /// One rotation a joint: joint 0 in the segment frame, others relative to their parents.
    pub rotations: Option<Vec<Quat>>,
}

impl Given {
    /// The form in which feasibility is judged.
    pub fn key(&self) -> Key<'_> {
        Key {
            root: self.root,
            height: self.height,
            velocity: self.velocity,
            rotations: self.rotations.as_deref(),
        }
    }
}

/// Makes keyframe tensors in a segment frame. Keeps its scratch memory between keyframes.
pub struct KeyWriter<'a> {
    skeleton: &'a Skeleton,
    fps: f32,
    local: Vec<Quat>,
    positions: Vec<Vec3>,
    rotations: Vec<Quat>,
}

impl<'a> KeyWriter<'a> {
    /// A writer for keyframes of `skeleton` at `fps` frames a second.
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

    /// Tensors of consecutive keyframes. A missing velocity follows from the root of the keyframe
    /// before; the first keyframe takes the velocity of the second, as in training.
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
        // Features are relative to the projected root, so the root always stands above the origin.
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
