//! Which joints of the target turn with which of the source.

use super::figure::Figure;
use crate::anatomy::{Limb, Parts};

/// How a joint of the target turns. A turn is the rotation from the neutral pose in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Turn {
    /// With its parent: it holds its neutral pose.
    Along,
    /// As two joints of the source, mixed: the share of the second.
    Between(usize, usize, f32),
}

/// One turn for each joint of the target.
pub(super) fn plan(source: &Figure, target: &Figure) -> Box<[Turn]> {
    let mut turns = vec![Turn::Along; target.skeleton.joint_count()];
    let (from, to) = (&source.parts, &target.parts);
    let mut set = |joint: usize, turn: Turn| turns[joint] = turn;
    let same = |joint: usize| Turn::Between(joint, joint, 0.0);
    let (pelvis, chest) = (from.trunk[0], from.trunk[from.trunk.len() - 1]);
    // The root and what lies between it and the pelvis move with the pelvis.
    let above = std::iter::successors(Some(to.trunk[0]), |&joint| target.skeleton.joints[joint].parent);
    above.for_each(|joint| set(joint, same(pelvis)));
    spread(&from.trunk[1..], &to.trunk[1..], (pelvis, pelvis), &mut set);
    let head = from.neck.last().copied().unwrap_or(chest);
    match (&from.neck[..], &to.neck[..]) {
        ([neck @ .., head], [own @ .., top]) => {
            spread(neck, own, (chest, *head), &mut set);
            set(*top, same(*head));
        }
        ([], own) => own.iter().for_each(|&joint| set(joint, same(head))),
        (_, []) => {}
    }
    for side in [0, 1] {
        let carry = match from.on_fours {
            true => whole_limb,
            false => limb,
        };
        carry(&from.legs[side], &to.legs[side], pelvis, &mut set);
        if let (Some(arms), Some(own)) = (&from.arms, &to.arms) {
            carry(&arms[side], &own[side], chest, &mut set);
        }
    }
    tail(from, to, &mut set);
    turns.into()
}

/// A limb: girdle, upper and lower bone, hand or foot, toes. Fingers hold.
fn limb(from: &Limb, to: &Limb, trunk: usize, set: &mut dyn FnMut(usize, Turn)) {
    let (upper, lower) = (from.upper[0], from.lower[0]);
    spread(&from.girdle, &to.girdle, (trunk, trunk), set);
    // Twists of the source end in the next joint; the target's share the way there.
    share(&from.upper, &to.upper, upper, set);
    share(&from.lower, &to.lower, lower, set);
    set(to.end, Turn::Between(from.end, from.end, 0.0));
    if let (Some(toe), Some(own)) = (from.toe, to.toe) {
        set(own, Turn::Between(toe, toe, 0.0));
    }
}

/// A leg of a body on four, whose bones have no common names: all its joints share the bend.
fn whole_limb(from: &Limb, to: &Limb, trunk: usize, set: &mut dyn FnMut(usize, Turn)) {
    let joints = |limb: &Limb| -> Vec<usize> {
        let bones = limb.girdle.iter().chain(&limb.upper).chain(&limb.lower);
        bones.copied().chain([limb.end]).chain(limb.toe).collect()
    };
    spread(&joints(from), &joints(to), (trunk, trunk), set);
}

/// Bones of a limb: the first joint as the source's first, twists as the source's twists.
fn share(from: &[usize], to: &[usize], first: usize, set: &mut dyn FnMut(usize, Turn)) {
    set(to[0], Turn::Between(first, first, 0.0));
    spread(&from[1..], &to[1..], (first, first), set);
}

/// Joints of a chain share the bend of another: the same number turns alike, otherwise each lies
/// between two. Without joints in the source they lie between those at its `ends`.
fn spread(from: &[usize], to: &[usize], ends: (usize, usize), set: &mut dyn FnMut(usize, Turn)) {
    let (n, m) = (from.len() as f32, to.len() as f32);
    for (nth, &joint) in to.iter().enumerate() {
        let turn = match from.len() {
            0 => Turn::Between(ends.0, ends.1, (nth as f32 + 1.0) / (m + 1.0)),
            count => {
                let at = ((nth as f32 + 0.5) * n / m - 0.5).clamp(0.0, n - 1.0);
                let low = (at as usize).min(count - 1);
                let high = (low + 1).min(count - 1);
                Turn::Between(from[low], from[high], at - low as f32)
            }
        };
        set(joint, turn);
    }
}

fn tail(from: &Parts, to: &Parts, set: &mut dyn FnMut(usize, Turn)) {
    if !from.tail.is_empty() {
        spread(&from.tail, &to.tail, (from.trunk[0], from.trunk[0]), set);
    }
}
