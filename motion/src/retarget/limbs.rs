//! Limbs of the target whose ends have places: feet, and hands that hold on to something.

use glam::{Quat, Vec3};

use super::feet::Toes;
use super::figure::Figure;
use crate::anatomy::Limb;
use crate::ik::{bend_by, side_of};
use crate::rotation::align_sign;

/// Least cosine between the side to which a limb bends and its pole that is left as it is.
const ASIDE: f32 = 0.7;

/// A limb of the target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chain {
    /// Hip, knee and ankle, or shoulder, elbow and wrist.
    pub(super) chain: [usize; 3],
    /// Their parents.
    above: [Option<usize>; 3],
}

/// A leg of the target and the places that it takes from the source.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) limb: Chain,
    /// Where the knee bends to in the neutral pose, in the hip's own frame of reference: ahead of a
    /// body on two legs.
    pub(super) aside: Vec3,
    /// Length of the target's leg, metres.
    pub(super) length_m: f32,
    /// The inverse of the ankle's rotation in the neutral pose.
    pub(super) still: Quat,
    /// Ankle and toe of the source: the ankle twice without toes.
    pub(super) from: [usize; 2],
    /// In the neutral pose, from the source's scaled ankle to the target's.
    pub(super) ankle_m: Vec3,
    /// The same of the toes.
    pub(super) toe_m: Vec3,
    /// From the target's ankle to its toe in the ankle's own frame of reference.
    pub(super) foot: Vec3,
    pub(super) toes: Option<Toes>,
}

/// An arm of the target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hand {
    pub(super) limb: Chain,
    /// 0 left, 1 right.
    pub(super) side: usize,
    /// Behind the body in the neutral pose, in the shoulder's own frame of reference.
    pub(super) behind: Vec3,
}

impl Chain {
    fn of(figure: &Figure, limb: &Limb) -> Self {
        let chain = limb.chain();
        Self {
            chain,
            above: chain.map(|joint| figure.skeleton.joints[joint].parent),
        }
    }

    /// Bends the limb so that its end comes to a goal, as [`crate::ik::place_end`] does, with the
    /// rotation that the end has in the world. `to` are the places and rotations in the world of
    /// the pose `out`, whose limb is as in `to`. Returns the remaining distance, metres, and the
    /// place of the end; none if it cannot be bent.
    pub(super) fn bend(
        &self,
        to: &(Vec<Vec3>, Vec<Quat>),
        goal: (Vec3, f32),
        pole: Vec3,
        out: &mut [Quat],
    ) -> Option<(f32, Vec3)> {
        let (places, world) = to;
        let [upper, middle, end] = self.chain;
        let side = |first, line, shorter_m| side_near(first, line, pole, shorter_m);
        let joints = self.chain.map(|joint| places[joint]);
        let bend = bend_by(joints, goal, &side)?;
        let mut place = joints[2];
        if let Some((first, second)) = bend.turns {
            place = joints[0] + first * (joints[1] - joints[0]) + second * (joints[2] - joints[1]);
            let above = |nth: usize| self.above[nth].map_or(Quat::IDENTITY, |joint| world[joint]);
            let mut write = |joint: usize, above: Quat, rotation: Quat| {
                let local = (above.conjugate() * rotation).normalize();
                out[joint] = align_sign(local, out[joint]);
            };
            write(upper, above(0), first * world[upper]);
            write(middle, first * above(1), second * world[middle]);
            write(end, second * above(2), world[end]);
        }
        Some((bend.short_m, place))
    }
}

/// The side of `line` to which a limb bends: where its middle joint is, but not far from the pole.
fn side_near(first: Vec3, line: Vec3, pole: Vec3, shorter_m: f32) -> Vec3 {
    let side = side_of(first, line, pole, shorter_m);
    let Some(pole) = (pole - line * pole.dot(line)).try_normalize() else {
        return side;
    };
    let lacking = ASIDE - side.dot(pole);
    match lacking > 0.0 {
        true => (side + pole * (3.0 * lacking)).try_normalize().unwrap_or(pole),
        false => side,
    }
}

/// The legs of the target beside those of the source; the fore legs of bodies on four too.
pub(super) fn steps(source: &Figure, target: &Figure, scale: f32) -> Vec<Step> {
    let mut limbs: Vec<_> = source.parts.legs.iter().zip(&target.parts.legs).collect();
    if let (true, Some(from), Some(to)) = (source.parts.on_fours, &source.parts.arms, &target.parts.arms) {
        limbs.extend(from.iter().zip(to));
    }
    let step = |(from, to): (&Limb, &Limb)| {
        let toes = from.toe.zip(to.toe);
        let (toe, own) = toes.unwrap_or((from.end, to.end));
        let apart = |a: usize, b: usize| target.places[b] - scale * source.places[a];
        Step {
            limb: Chain::of(target, to),
            aside: target.neutral[to.upper[0]].conjugate() * aside(target, to),
            length_m: length_m(target, to.chain()),
            still: target.neutral[to.end].conjugate(),
            from: [from.end, toe],
            ankle_m: apart(from.end, to.end),
            toe_m: apart(toe, own),
            foot: target.neutral[to.end].conjugate() * target.between(to.end, own),
            toes: Toes::of(target, to),
        }
    };
    limbs.into_iter().map(step).collect()
}

/// The side to which a leg bends in the neutral pose. Legs on four bend as they stand.
fn aside(figure: &Figure, leg: &Limb) -> Vec3 {
    if !figure.parts.on_fours {
        return Vec3::Z;
    }
    let [top, middle, end] = leg.chain();
    let (first, line) = (figure.between(top, middle), figure.between(top, end));
    let shorter_m = first.length().min(figure.between(middle, end).length());
    side_of(first, line.normalize_or(Vec3::NEG_Y), Vec3::Z, shorter_m)
}

/// The arms of the target.
pub(super) fn hands(source: &Figure, target: &Figure) -> Vec<Hand> {
    let arms = target.parts.arms.iter().flatten().enumerate();
    let hand = |(side, arm): (usize, &Limb)| Hand {
        limb: Chain::of(target, arm),
        side,
        behind: target.neutral[arm.upper[0]].conjugate() * Vec3::NEG_Z,
    };
    arms.filter(|_| !source.parts.on_fours).map(hand).collect()
}

/// Length of a leg's bones.
fn length_m(figure: &Figure, [upper, middle, end]: [usize; 3]) -> f32 {
    figure.between(upper, middle).length() + figure.between(middle, end).length()
}
