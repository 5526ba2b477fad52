//! What networks read of a body: a description of each row, and which rows read which.

use glam::{Quat, Vec3};

use crate::skeleton::Skeleton;

/// Numbers that describe a row: bone (3), place in the neutral pose (3), hinge axis (3). Then six
/// flags: a hinge, fixed, a contact, an end, the root, the root's place. Last depth, side, reach
/// and the logarithm of the size.
pub const DESCRIPTION: usize = 19;
/// Rows that a row's attention reads: itself, the root's place, the root joint, then its nearest
/// ancestors.
pub const SLOTS: usize = 16;

/// Slots of each row.
type Slots<T> = Box<[[T; SLOTS]]>;

/// Index of the flag for the root's place in a description.
const IS_PLACE: usize = 14;
/// Unit in which the joints between a joint and the root are counted.
const DEPTH_UNIT: f32 = 8.0;

/// Descriptions of all rows, `[J + 1]`.
pub(super) fn describe(
    skeleton: &Skeleton,
    neutral: &[Quat],
    bones_m: &[Vec3],
    places_m: &[Vec3],
    sides: &[i8],
    size_m: f32,
) -> Box<[[f32; DESCRIPTION]]> {
    let log_size = size_m.ln();
    let reach_m = reach(skeleton, bones_m);
    let mut place = [0.0; DESCRIPTION];
    (place[IS_PLACE], place[DESCRIPTION - 1]) = (1.0, log_size);
    let mut rows = vec![place];
    let flag = |yes: bool| if yes { 1.0 } else { 0.0 };
    for joint in 0..skeleton.joint_count() {
        let hinge = skeleton.robot.as_ref().and_then(|robot| robot.axis_of(joint));
        let axis = hinge.map_or(Vec3::ZERO, |axis| neutral[joint] * axis);
        let fixed = skeleton.robot.is_some() && hinge.is_none() && joint > 0;
        let (bone, at) = (bones_m[joint] / size_m, places_m[joint] / size_m);
        rows.push([
            bone.x,
            bone.y,
            bone.z,
            at.x,
            at.y,
            at.z,
            axis.x,
            axis.y,
            axis.z,
            flag(hinge.is_some()),
            flag(fixed),
            flag(contact_joints(skeleton).contains(&joint)),
            flag(is_leaf(skeleton, joint)),
            flag(joint == 0),
            0.0,
            ancestors(skeleton, joint).count() as f32 / DEPTH_UNIT,
            f32::from(sides[joint]),
            reach_m[joint] / size_m,
            log_size,
        ]);
    }
    rows.into()
}

/// Rows that each row reads, as indices from the body's first row, and 1 for a slot that is used.
pub(super) fn slots(skeleton: &Skeleton) -> (Slots<i64>, Slots<f32>) {
    let row_of = |joint: usize| Some(joint + 1);
    let mut rows = Vec::with_capacity(skeleton.joint_count() + 1);
    // The root's place reads the ends of limbs, contact joints first.
    let contacts = contact_joints(skeleton);
    let leaves = (0..skeleton.joint_count()).filter(|&joint| is_leaf(skeleton, joint));
    let leaves = leaves.filter(|joint| !contacts.contains(joint));
    let ends = contacts.iter().copied().chain(leaves).filter(|&joint| joint > 0);
    rows.push(fill([Some(0), None, Some(1)].into_iter().chain(ends.map(row_of))));
    for joint in 0..skeleton.joint_count() {
        let root = (joint > 0).then_some(1);
        let above = ancestors(skeleton, joint).filter(|&above| above > 0);
        let first = [row_of(joint), Some(0), root].into_iter();
        rows.push(fill(first.chain(above.map(row_of))));
    }
    let (rows, reads): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
    (rows.into(), reads.into())
}

fn fill(read: impl Iterator<Item = Option<usize>>) -> ([i64; SLOTS], [f32; SLOTS]) {
    let (mut rows, mut reads) = ([0; SLOTS], [0.0; SLOTS]);
    for (slot, row) in read.take(SLOTS).enumerate() {
        if let Some(row) = row {
            (rows[slot], reads[slot]) = (row as i64, 1.0);
        }
    }
    (rows, reads)
}

/// Longest path from each joint down to an end, metres.
fn reach(skeleton: &Skeleton, bones_m: &[Vec3]) -> Vec<f32> {
    let mut reach = vec![0.0_f32; bones_m.len()];
    for (index, joint) in skeleton.joints.iter().enumerate().rev() {
        if let Some(parent) = joint.parent {
            reach[parent] = reach[parent].max(reach[index] + bones_m[index].length());
        }
    }
    reach
}

fn contact_joints(skeleton: &Skeleton) -> &[usize] {
    skeleton
        .contacts
        .as_ref()
        .map_or(&[], |contacts| &contacts.joints)
}

pub(super) fn is_leaf(skeleton: &Skeleton, joint: usize) -> bool {
    skeleton.joints.iter().all(|other| other.parent != Some(joint))
}

/// A joint's ancestors, nearest first, the root last.
fn ancestors(skeleton: &Skeleton, joint: usize) -> impl Iterator<Item = usize> {
    let parent = |joint: &usize| skeleton.joints.get(*joint)?.parent;
    std::iter::successors(parent(&joint), move |joint| parent(joint))
}
