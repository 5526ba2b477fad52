//! A request on a body of the caller's own: what of it guides the model's body.

use troupe_character::take::{Effector, Ground, Knot, Onto, PoseKey, Wanted};
use troupe_live::skeleton::Worn;
use troupe_motion::anatomy::{Limb, Parts};
use troupe_motion::root::heading_of;
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Quat, Vec3};

/// A path that moves less than this between its neighbours has no direction, metres.
const STANDS_M: f32 = 1e-3;

/// What guides the model's body, and what the caller's body meets. `still` is the caller's rest
/// pose.
pub fn onto(worn: &Worn, wanted: Wanted, still: &[Quat]) -> (Wanted, Onto) {
    let guide = Wanted {
        path: path(worn, &wanted.path),
        keys: wanted.keys.iter().map(|key| pose(worn, key, still)).collect(),
        effectors: wanted
            .effectors
            .iter()
            .map(|given| effector(worn, given))
            .collect(),
        // The model walks on a floor. The caller's body is lifted.
        ground: Ground::default(),
    };
    let mut onto = worn.onto().clone();
    onto.reset();
    (guide, Onto::new(onto, wanted))
}

/// A path of the model's root. The two roots may be at other places of their bodies, so a body that
/// goes ahead passes each knot with the heading of its path.
fn path(worn: &Worn, knots: &[Knot]) -> Vec<Knot> {
    let mut facing = None;
    let towards = |nth: usize| {
        let (from, to) = (
            &knots[nth.saturating_sub(1)],
            &knots[(nth + 1).min(knots.len() - 1)],
        );
        let way = [0, 1].map(|axis: usize| to.place[axis] - from.place[axis]);
        (way[0].hypot(way[1]) > STANDS_M).then(|| way[0].atan2(way[1]))
    };
    // Before it moves, a body faces where it will go.
    let first = (0..knots.len()).find_map(towards).unwrap_or(0.0);
    let knot = |(nth, knot): (usize, &Knot)| {
        facing = knot.heading.or(towards(nth)).or(facing);
        let [x, z] = knot.place;
        let root = GlobalRoot::new(Vec3::new(x, 0.0, z), facing.unwrap_or(first));
        let there = worn.root_in(root).position;
        Knot {
            place: [there.x, there.z],
            ..*knot
        }
    };
    knots.iter().enumerate().map(knot).collect()
}

/// A pose of the model's body. One that has all main joints is whole, others leave all but place
/// and heading free.
fn pose(worn: &Worn, key: &PoseKey, still: &[Quat]) -> PoseKey {
    let [model, own] = worn.onto().figures();
    let is_whole = main(own.parts()).all(|joint| key.rotations[joint].is_some());
    if is_whole {
        let filled = key.rotations.iter().zip(still);
        let filled: Vec<Quat> = filled.map(|(given, &still)| given.unwrap_or(still)).collect();
        let root = key.root.unwrap_or(own.root());
        if let Some((place, rotations)) = worn.back(&[(root, &filled)]).pop() {
            return PoseKey {
                frame: key.frame,
                rotations: rotations.into_iter().map(Some).collect(),
                root: key.root.map(|_| place),
            };
        }
    }
    let heading = key.rotations[0].map(|turned| heading_of(turned, own.skeleton().left_axis));
    let mut rotations = vec![None; model.skeleton().joint_count()];
    rotations[0] = heading.map(|heading| yaw(heading) * model.neutral()[0]);
    PoseKey {
        frame: key.frame,
        rotations,
        root: key.root.map(|place| match heading {
            Some(heading) => worn.root_in(GlobalRoot::new(place, heading)).position,
            None => worn.place_in(place),
        }),
    }
}

/// Trunk, neck, and the bones of limbs: the joints that make a pose.
fn main(parts: &Parts) -> impl Iterator<Item = usize> {
    let limbs = parts.legs.iter().chain(parts.arms.iter().flatten());
    let trunk = parts.trunk.iter().chain(&parts.neck).copied();
    trunk.chain(limbs.flat_map(Limb::chain))
}

/// A place of the model's body: that of a foot, of the root, or of something that is in front.
fn effector(worn: &Worn, given: &Effector) -> Effector {
    let [model, own] = worn.onto().figures();
    let joints = &own.skeleton().joints;
    let mut above = std::iter::successors(Some(given.joint), |&joint| joints[joint].parent);
    let leg = above.find_map(|joint| own.parts().legs.iter().position(|leg| leg.end == joint));
    Effector {
        joint: match (given.joint, leg) {
            (0, _) => 0,
            (_, Some(side)) => model.parts().legs[side].end,
            (_, None) => model.parts().neck.last().map_or(1, |&head| head.max(1)),
        },
        point: worn.place_in(given.point),
        rotation: None,
        ..*given
    }
}

#[cfg(test)]
#[path = "onto_tests.rs"]
mod tests;
