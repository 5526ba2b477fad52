//! The neutral pose of a file's body, for models of many bodies: upright, heading along +Z, limbs
//! hanging down.

use glam::{Quat, Vec3};

use super::Understood;
use super::body::{Body, Tree};
use super::names::Name;
use super::report::RestPose;
use crate::clip::Clip;
use crate::root::heading_of;
use crate::rotation::{align_sign, yaw};
use crate::skeleton::Skeleton;

impl Understood {
    /// World rotations of the neutral pose, one a joint.
    ///
    /// It is the rest pose if the body stands in it; the limbs of a T-pose or an A-pose are let
    /// down. A body on two legs whose rest pose is no stance has it by its average pose, with trunk
    /// and limbs straightened. Other bodies keep their rest pose. It is none for a clip on a given
    /// skeleton.
    pub fn neutral_pose(&self) -> Option<Vec<Quat>> {
        let skeleton = &*self.clip.skeleton;
        let body = Body::find(&tree_of(skeleton));
        let rest = self.rest.as_ref()?;
        let no_limbs = Limbs::default();
        let (pose, limbs) = match (body, self.report.rest_pose.value) {
            (Some(body), RestPose::None) => {
                let limbs = Limbs::of(skeleton, &body).with_spine(&body);
                (average_pose(&self.clip), limbs)
            }
            (Some(body), RestPose::T | RestPose::A) => (world_of(skeleton, rest), Limbs::of(skeleton, &body)),
            _ => (world_of(skeleton, rest), no_limbs),
        };
        let turn = yaw(-heading_of(pose[0], skeleton.left_axis));
        let pose: Vec<Quat> = pose.into_iter().map(|rotation| turn * rotation).collect();
        Some(straightened(skeleton, &pose, &limbs))
    }
}

/// What is straightened. Limbs are shoulder, elbow, wrist or hip, knee, ankle.
#[derive(Default)]
struct Limbs {
    hanging: Vec<[usize; 3]>,
    /// From the pelvis to the head.
    spine: Vec<usize>,
    /// Joints that keep their rotations in the world.
    still: Vec<usize>,
}

impl Limbs {
    /// Arms and legs. Feet keep their rotations.
    fn of(skeleton: &Skeleton, body: &Body) -> Self {
        let legs = body.hips.into_iter().zip(body.feet);
        let legs = legs.filter_map(|(hip, foot)| leg(skeleton, hip, foot));
        Self {
            hanging: body.arms.into_iter().flatten().chain(legs).collect(),
            still: body.feet.to_vec(),
            ..Self::default()
        }
    }

    fn with_spine(mut self, body: &Body) -> Self {
        self.still.push(body.head);
        self.spine.clone_from(&body.spine);
        self
    }
}

fn tree_of(skeleton: &Skeleton) -> Tree {
    let joints = skeleton.joints.iter();
    Tree {
        names: joints.clone().map(|joint| Name::of(&joint.name)).collect(),
        parents: joints.map(|joint| joint.parent).collect(),
    }
}

/// Hip, knee and ankle. The knee is the joint above the ankle.
fn leg(skeleton: &Skeleton, hip: usize, foot: usize) -> Option<[usize; 3]> {
    let knee = skeleton.joints[foot].parent?;
    (knee != hip).then_some([hip, knee, foot])
}

/// World rotations of a pose: joint 0 in the world, others relative to their parents.
fn world_of(skeleton: &Skeleton, local: &[Quat]) -> Vec<Quat> {
    let mut world: Vec<Quat> = Vec::with_capacity(local.len());
    for (joint, rotation) in skeleton.joints.iter().zip(local) {
        world.push(joint.parent.map_or(*rotation, |parent| world[parent] * *rotation));
    }
    world
}

/// The mean of the world rotations of all frames, each turned to the heading 0.
fn average_pose(clip: &Clip) -> Vec<Quat> {
    let mut sums = vec![Quat::from_xyzw(0.0, 0.0, 0.0, 0.0); clip.skeleton.joint_count()];
    for frame in 0..clip.frames() {
        let mut pose = clip.rotations_at(frame).to_vec();
        pose[0] = yaw(-clip.root_at(frame).heading) * pose[0];
        for (sum, rotation) in sums.iter_mut().zip(world_of(&clip.skeleton, &pose)) {
            *sum = *sum + align_sign(rotation, *sum);
        }
    }
    let unit = |sum: Quat| {
        if sum.length() > 1e-6 {
            sum.normalize()
        } else {
            Quat::IDENTITY
        }
    };
    sums.into_iter().map(unit).collect()
}

/// The pose with its limbs hanging down and the joints of its spine on top of each other. What
/// hangs on them goes along.
fn straightened(skeleton: &Skeleton, pose: &[Quat], limbs: &Limbs) -> Vec<Quat> {
    // For each joint that is turned: the joint of its bone's end, and where the bone points then.
    let mut aims: Vec<Option<(usize, Vec3)>> = vec![None; pose.len()];
    for &[top, middle, end] in &limbs.hanging {
        aims[top] = Some((middle, Vec3::NEG_Y));
        aims[middle] = Some((end, Vec3::NEG_Y));
    }
    for bone in limbs.spine.windows(2) {
        aims[bone[0]] = Some((bone[1], Vec3::Y));
    }
    let mut out: Vec<Quat> = Vec::with_capacity(pose.len());
    for (joint, described) in skeleton.joints.iter().enumerate() {
        let along = described
            .parent
            .map_or(Quat::IDENTITY, |parent| out[parent] * pose[parent].conjugate());
        let mut rotation = match limbs.still.contains(&joint) {
            true => pose[joint],
            false => along * pose[joint],
        };
        if let Some((end, wanted)) = aims[joint] {
            let bone = rotation * to(skeleton, pose, joint, end);
            if let Some(bone) = bone.try_normalize() {
                rotation = Quat::from_rotation_arc(bone, wanted) * rotation;
            }
        }
        out.push(rotation.normalize());
    }
    out
}

/// The place of a joint below another, in the other's own frame, metres.
fn to(skeleton: &Skeleton, pose: &[Quat], above: usize, below: usize) -> Vec3 {
    let mut place = Vec3::ZERO;
    let mut joint = below;
    while let Some(parent) = skeleton.joints[joint].parent.filter(|_| joint != above) {
        place += pose[parent] * skeleton.joints[joint].offset_m;
        joint = parent;
    }
    pose[above].conjugate() * place
}
