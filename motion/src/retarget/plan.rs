//! Which joints of the target turn with which of the source.

use super::figure::Figure;
use crate::anatomy::{Limb, Name, Parts};

/// A joint above the pelvis lies on the floor if it is lower than this share of the legs' length.
const FLOOR_SHARE: f32 = 0.1;

/// How a joint of the target turns. A turn is the rotation from the neutral pose in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Turn {
    /// With its parent: it holds its neutral pose.
    Along,
    /// About the vertical axis, as the heading of a joint of the source.
    Heading(usize),
    /// As two joints of the source, mixed: the share of the second.
    Between(usize, usize, f32),
    /// As an elbow or knee of the source, which does not bend backwards.
    Bent(Bend),
    /// With a bone, and rolled about it.
    Rolled(Roll),
}

/// A knee of a leg that hangs in the neutral pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bend {
    /// The source's joint.
    pub(super) from: usize,
    /// The target's hip.
    pub(super) upper: usize,
}

/// A twist along a bone that hangs in the neutral pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Roll {
    /// The target's joint that the bone begins with.
    pub(super) own: usize,
    /// The source's joint that its bone begins with, and the next one, whose roll is shared.
    pub(super) from: [usize; 2],
    pub(super) share: f32,
}

/// One turn for each joint of the target.
pub(super) fn plan(source: &Figure, target: &Figure) -> Box<[Turn]> {
    let mut turns = vec![Turn::Along; target.skeleton.joint_count()];
    let (from, to) = (&source.parts, &target.parts);
    let mut set = |joint: usize, turn: Turn| turns[joint] = turn;
    let same = |joint: usize| Turn::Between(joint, joint, 0.0);
    let (pelvis, chest) = (from.trunk[0], from.trunk[from.trunk.len() - 1]);
    // The root and what lies between it and the pelvis move with the pelvis. A joint on the floor
    // would swing about the hips, and stays below them.
    let above = std::iter::successors(Some(to.trunk[0]), |&joint| target.skeleton.joints[joint].parent);
    let lies =
        |joint: usize| target.skeleton.robot.is_none() && target.places[joint].y < FLOOR_SHARE * target.leg_m;
    above.for_each(|joint| match lies(joint) {
        true => set(joint, Turn::Heading(pelvis)),
        false => set(joint, same(pelvis)),
    });
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
        let mut carry = |from: &Limb, to: &Limb, trunk: usize, is_leg: bool| {
            if source.parts.on_fours {
                return whole_limb([source, target], [from, to], &mut set);
            }
            limb(from, to, trunk, &mut set);
            // Robots have limits of their own.
            if target.skeleton.robot.is_none() {
                // The neutral pose does not say which way an arm's elbow points.
                if is_leg {
                    let bend = Bend {
                        from: from.lower[0],
                        upper: to.upper[0],
                    };
                    set(to.lower[0], Turn::Bent(bend));
                }
                twists(from, to, target, &mut set);
            }
        };
        carry(&from.legs[side], &to.legs[side], pelvis, true);
        if let (Some(arms), Some(own)) = (&from.arms, &to.arms) {
            carry(&arms[side], &own[side], chest, false);
        }
    }
    tail(from, to, &mut set);
    turns.into()
}

/// A limb: girdle, upper and lower bone, hand or foot, toes. Fingers hold.
fn limb(from: &Limb, to: &Limb, trunk: usize, set: &mut dyn FnMut(usize, Turn)) {
    spread(&from.girdle, &to.girdle, (trunk, trunk), set);
    for (bone, own) in [(from.upper[0], to.upper[0]), (from.lower[0], to.lower[0])] {
        set(own, Turn::Between(bone, bone, 0.0));
    }
    set(to.end, Turn::Between(from.end, from.end, 0.0));
    if let (Some(toe), Some(own)) = (from.toe, to.toe) {
        set(own, Turn::Between(toe, toe, 0.0));
    }
}

/// Twists along the bones of a limb on two legs: those between its joints, and those beside them
/// that are twists by name. Each takes as much of the next joint's roll as it is near to it.
fn twists(from: &Limb, to: &Limb, target: &Figure, set: &mut dyn FnMut(usize, Turn)) {
    let joints = &target.skeleton.joints;
    for (bones, own, end) in [
        ([from.upper[0], from.lower[0]], to.upper[0], to.lower[0]),
        ([from.lower[0], from.end], to.lower[0], to.end),
    ] {
        let line = target.between(own, end);
        let above = |joint: usize| std::iter::successors(Some(joint), |&joint| joints[joint].parent);
        let is_on_limb = |joint: usize| [to.lower[0], to.end].contains(&joint);
        for (joint, described) in joints.iter().enumerate().skip(own + 1) {
            // Twists of the next bone and of fingers are not along this one.
            let is_along = above(joint)
                .take_while(|&at| !is_on_limb(at) || at == own)
                .any(|at| at == own);
            let is_twist = || Name::of(&described.name).has_any(&["twist", "roll"]);
            let is_between = || {
                above(end)
                    .skip(1)
                    .take_while(|&at| at != own)
                    .any(|at| at == joint)
            };
            if is_along && (is_between() || is_twist()) {
                let share = target.between(own, joint).dot(line) / line.length_squared().max(1e-9);
                let roll = Roll {
                    own,
                    from: bones,
                    share: share.clamp(0.0, 1.0),
                };
                set(joint, Turn::Rolled(roll));
            }
        }
    }
}

/// A leg of a body on four, whose bones have no common names: all its joints share the bend. Legs
/// with as many joints turn joint by joint; otherwise each bone turns as those do that are as far
/// down the leg.
fn whole_limb(figures: [&Figure; 2], limbs: [&Limb; 2], set: &mut dyn FnMut(usize, Turn)) {
    let [from, to] = limbs.map(|limb| -> Vec<usize> {
        let bones = limb.girdle.iter().chain(&limb.upper).chain(&limb.lower);
        bones.copied().chain([limb.end]).chain(limb.toe).collect()
    });
    let middles = middles(figures[0], &from);
    let last = from.len() - 1;
    for (nth, (&joint, middle)) in to.iter().zip(self::middles(figures[1], &to)).enumerate() {
        let above = middles
            .iter()
            .rposition(|&at| at <= middle)
            .unwrap_or(0)
            .min(last);
        let below = (above + 1).min(last);
        let room = (middles[below] - middles[above]).max(f32::MIN_POSITIVE);
        let turn = match from.len() == to.len() {
            true => Turn::Between(from[nth], from[nth], 0.0),
            false => {
                let share = (middle - middles[above]) / room;
                Turn::Between(from[above], from[below], share.clamp(0.0, 1.0))
            }
        };
        set(joint, turn);
    }
}

/// For each joint of a chain how far down the chain the middle of the bone below it is, 0 to 1.
fn middles(figure: &Figure, chain: &[usize]) -> Vec<f32> {
    let bones = chain
        .windows(2)
        .map(|bone| figure.between(bone[0], bone[1]).length());
    let bones: Vec<f32> = bones.collect();
    let whole = bones.iter().sum::<f32>().max(f32::MIN_POSITIVE);
    let mut above = 0.0;
    let middles = bones.iter().map(|bone| {
        above += bone;
        (above - 0.5 * bone) / whole
    });
    let mut middles: Vec<f32> = middles.collect();
    middles.push(1.0);
    middles
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
