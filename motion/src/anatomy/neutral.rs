//! Poses made neutral: limbs hanging down.

use glam::{Quat, Vec3};

use super::biped::Biped;
use super::parts::Parts;
use crate::clip::Clip;
use crate::root::heading_of;
use crate::rotation::{align_sign, yaw};
use crate::skeleton::Skeleton;

/// World rotations of a pose whose arms and legs are let down. Feet keep their rotations in the
/// world. `pose` has a world rotation for each joint.
pub fn let_down(skeleton: &Skeleton, body: &Biped, pose: &[Quat]) -> Vec<Quat> {
    straightened(skeleton, pose, &Limbs::of(skeleton, body))
}

/// As [`let_down`], by the parts of a body on two legs.
pub(crate) fn hang(skeleton: &Skeleton, parts: &Parts, pose: &[Quat]) -> Vec<Quat> {
    let limbs = parts.legs.iter().chain(parts.arms.iter().flatten());
    let limbs = Limbs {
        hanging: limbs.map(|limb| limb.chain()).collect(),
        still: parts.legs.iter().map(|leg| leg.end).collect(),
        ..Limbs::default()
    };
    straightened(skeleton, pose, &limbs)
}

/// As [`let_down`], and the trunk is made upright. The head keeps its rotation too.
pub fn stand_up(skeleton: &Skeleton, body: &Biped, pose: &[Quat]) -> Vec<Quat> {
    straightened(skeleton, pose, &Limbs::of(skeleton, body).with_spine(body))
}

/// The average pose of a clip, with trunk and limbs straightened.
pub(crate) fn neutral_of_motion(clip: &Clip, body: &Biped) -> Vec<Quat> {
    stand_up(&clip.skeleton, body, &ahead(&clip.skeleton, average_pose(clip)))
}

/// World rotations turned to head along +Z.
pub(crate) fn ahead(skeleton: &Skeleton, pose: Vec<Quat>) -> Vec<Quat> {
    let turn = yaw(-heading_of(pose[0], skeleton.left_axis));
    let turned = pose.into_iter().map(|rotation| (turn * rotation).normalize());
    turned.collect()
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

/// World rotations of a pose: joint 0 in the world, others relative to their parents.
pub(crate) fn world_of(skeleton: &Skeleton, local: &[Quat]) -> Vec<Quat> {
    let mut world: Vec<Quat> = Vec::with_capacity(local.len());
    for (joint, rotation) in skeleton.joints.iter().zip(local) {
        world.push(joint.parent.map_or(*rotation, |parent| world[parent] * *rotation));
    }
    world
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
    fn of(skeleton: &Skeleton, body: &Biped) -> Self {
        let legs = body.hips.into_iter().zip(body.feet);
        let legs = legs.filter_map(|(hip, foot)| leg(skeleton, hip, foot));
        Self {
            hanging: body.arms.into_iter().flatten().chain(legs).collect(),
            still: body.feet.to_vec(),
            ..Self::default()
        }
    }

    fn with_spine(mut self, body: &Biped) -> Self {
        self.still.push(body.head);
        self.spine.clone_from(&body.spine);
        self
    }
}

/// Hip, knee and ankle. The knee is the joint above the ankle.
fn leg(skeleton: &Skeleton, hip: usize, foot: usize) -> Option<[usize; 3]> {
    let knee = skeleton.joints[foot].parent?;
    (knee != hip).then_some([hip, knee, foot])
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
