//! Keeps forearms off the trunk: where one would pass through it, the arm turns at its shoulder.

use troupe_motion::fk::transforms_down_to;
use troupe_motion::ik::Torso;
use troupe_motion::model::Rig;
use troupe_motion::rotation::align_sign;
use troupe_motion::{Quat, Skeleton, Vec3};

use super::apart::{Apart, Meeting, eased, runs};

/// Least distance between the axes of a forearm and the trunk, metres. In clips of people that turn
/// it is never below 8 cm.
const ARMS_APART_M: f32 = 0.1;
/// Number of passes. The second corrects what the first leaves.
const PASSES: usize = 2;

/// Keeps the forearms of a body on two legs off its trunk in consecutive frames. Robots' arms stay
/// as they are, because their shoulders turn by hinges alone.
pub(crate) fn clear_arms(rig: &Rig, roots: &[Vec3], rotations: &mut [Quat]) {
    let skeleton = &*rig.skeleton;
    let (Some(torso), 2, None) = (rig.torso.as_deref(), rig.legs.len(), &skeleton.robot) else {
        return;
    };
    for &arm in &torso.arms {
        for _ in 0..PASSES {
            if !clear(skeleton, torso, arm, roots, rotations) {
                break;
            }
        }
    }
}

/// Turns an arm away from the trunk in the frames in which it is too near. Answers whether there
/// are any.
fn clear(
    skeleton: &Skeleton,
    torso: &Torso,
    arm: [usize; 3],
    roots: &[Vec3],
    rotations: &mut [Quat],
) -> bool {
    let joints = skeleton.joint_count();
    let poses = roots.iter().zip(rotations.chunks_exact(joints));
    let placed: Vec<Placed> = poses
        .map(|(&root, pose)| Placed::of(skeleton, torso, arm, root, pose))
        .collect();
    let meetings: Vec<Meeting> = placed.iter().map(Placed::meeting).collect();
    let near = runs(&meetings);
    if near.is_empty() {
        return false;
    }
    let mut ways = vec![Vec3::ZERO; meetings.len()];
    for run in near {
        let apart = Apart::of(&meetings[run.clone()]);
        run.for_each(|frame| ways[frame] = apart.way(&meetings[frame]));
    }
    let poses = rotations.chunks_exact_mut(joints).zip(&placed);
    for ((pose, placed), (meeting, way)) in poses.zip(meetings.iter().zip(eased(&ways))) {
        if way != Vec3::ZERO {
            placed.turn(&mut pose[arm[0]], meeting.point, way);
        }
    }
    true
}

/// An arm and the trunk in the world.
struct Placed {
    /// From the root joint to the top.
    trunk: [Vec3; 2],
    /// Shoulder, elbow and hand.
    arm: [Vec3; 3],
    /// Rotation of the shoulder's parent.
    parent: Quat,
}

impl Placed {
    fn of(skeleton: &Skeleton, torso: &Torso, arm: [usize; 3], root: Vec3, pose: &[Quat]) -> Self {
        let mut placed = Self {
            trunk: [root; 2],
            arm: [root; 3],
            parent: Quat::IDENTITY,
        };
        let parent = skeleton.joints[arm[0]].parent;
        transforms_down_to(skeleton, root, pose, arm[2], &mut |joint, position, rotation| {
            if joint == torso.trunk[1] {
                placed.trunk[1] = position;
            }
            if Some(joint) == parent {
                placed.parent = rotation;
            }
            if let Some(at) = arm.iter().position(|&of| of == joint) {
                placed.arm[at] = position;
            }
        });
        placed
    }

    fn meeting(&self) -> Meeting {
        let [shoulder, elbow, hand] = self.arm;
        let side = shoulder - self.trunk[1];
        // The whole arm turns.
        Meeting::of([elbow, hand], self.trunk, side, ARMS_APART_M).counting_from(1.0)
    }

    /// Turns the shoulder, so that `point` of the forearm moves by about `way`.
    fn turn(&self, shoulder: &mut Quat, point: Vec3, way: Vec3) {
        let [from, to] = [point, point + way].map(|place| (place - self.arm[0]).normalize_or_zero());
        let turn = Quat::from_rotation_arc(from, to);
        let turned = (self.parent.conjugate() * turn * self.parent * *shoulder).normalize();
        *shoulder = align_sign(turned, *shoulder);
    }
}

#[cfg(test)]
#[path = "arms_tests.rs"]
mod tests;
