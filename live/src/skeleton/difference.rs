//! The difference of a pose that a user gave to the pose that is carried over. It eases out.

use serde::{Deserialize, Serialize};
use troupe_motion::anatomy::Limb;
use troupe_motion::fk::joint_transform;
use troupe_motion::ik::place_end;
use troupe_motion::retarget::Figure;
use troupe_motion::rotation::slerp;
use troupe_motion::{Quat, Vec3};

/// Most limbs that stand: those of a body on four legs.
const MAX_FEET: usize = 4;
/// A foot this near to its place is there, metres.
const THERE_M: f32 = 1e-4;

/// The difference of a given pose to one that is carried over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    root: Vec3,
    /// One turn a joint, in its parent's frame of reference. Empty: none.
    turns: Vec<Quat>,
    /// Of the ends of standing limbs in the world: ways, and turns.
    feet: [(Vec3, Quat); MAX_FEET],
}

impl Difference {
    /// No difference.
    pub fn none() -> Self {
        Self::of_place(Vec3::ZERO)
    }

    /// A pose that is only moved.
    pub fn of_place(root: Vec3) -> Self {
        Self {
            root,
            turns: Vec::new(),
            feet: [(root, Quat::IDENTITY); MAX_FEET],
        }
    }

    /// From a pose that was made to a given one: root, and rotations of all joints.
    pub fn between(figure: &Figure, made: (Vec3, &[Quat]), given: (Vec3, &[Quat])) -> Self {
        let mut difference = Self::of_place(given.0 - made.0);
        let pairs = given.1.iter().zip(made.1);
        difference.turns = pairs.map(|(given, made)| *given * made.conjugate()).collect();
        for (foot, limb) in difference.feet.iter_mut().zip(feet(figure)) {
            let [made, given] = [made, given]
                .map(|(root, rotations)| joint_transform(figure.skeleton(), root, rotations, limb.end));
            *foot = (given.0 - made.0, given.1 * made.1.conjugate());
        }
        difference
    }

    /// Number of joints that are turned. 0: none.
    pub(crate) fn joints(&self) -> usize {
        self.turns.len()
    }
}

/// Adds shares of differences to a pose. Feet go as far as the shares say, and so stay on the
/// ground: turns alone move them by more, because a straight leg and a bent one do not move alike.
pub fn add(figure: &Figure, shares: &[(f32, &Difference)], root: &mut Vec3, rotations: &mut [Quat]) {
    let skeleton = figure.skeleton();
    let mut goals = [(Vec3::ZERO, Quat::IDENTITY); MAX_FEET];
    for (nth, limb) in feet(figure).enumerate() {
        let (mut place, mut turn) = joint_transform(skeleton, *root, rotations, limb.end);
        for (share, difference) in shares {
            let (way, turned) = difference.feet[nth];
            place += *share * way;
            turn = slerp(Quat::IDENTITY, turned, *share) * turn;
        }
        goals[nth] = (place, turn);
    }
    for (share, difference) in shares {
        *root += *share * difference.root;
        for (rotation, &turn) in rotations.iter_mut().zip(&difference.turns) {
            *rotation = (slerp(Quat::IDENTITY, turn, *share) * *rotation).normalize();
        }
    }
    for (limb, (place, turn)) in feet(figure).zip(goals) {
        if joint_transform(skeleton, *root, rotations, limb.end)
            .0
            .distance(place)
            < THERE_M
        {
            continue;
        }
        let hip = limb.upper[0];
        let ahead = figure.neutral()[hip].conjugate() * Vec3::Z;
        let ahead = joint_transform(skeleton, *root, rotations, hip).1 * ahead;
        place_end(
            skeleton,
            *root,
            rotations,
            limb.chain(),
            (place, 0.0),
            ahead,
            turn,
        );
    }
}

/// The limbs that stand.
fn feet(figure: &Figure) -> impl Iterator<Item = &Limb> {
    let parts = figure.parts();
    let fore = parts.arms.iter().flatten().filter(|_| parts.on_fours);
    parts.legs.iter().chain(fore)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use troupe_motion::anatomy::PartsDoc;
    use troupe_motion::{Joint, Skeleton};

    use super::*;

    fn person() -> Figure {
        let rows: [(&str, &str, [f32; 3]); 15] = [
            ("Hips", "", [0.0, 0.95, 0.0]),
            ("Spine", "Hips", [0.0, 0.2, 0.0]),
            ("Neck", "Spine", [0.0, 0.3, 0.0]),
            ("Head", "Neck", [0.0, 0.1, 0.0]),
            ("LeftArm", "Spine", [0.2, 0.25, 0.0]),
            ("LeftForeArm", "LeftArm", [0.0, -0.28, 0.0]),
            ("LeftHand", "LeftForeArm", [0.0, -0.25, 0.0]),
            ("RightArm", "Spine", [-0.2, 0.25, 0.0]),
            ("RightForeArm", "RightArm", [0.0, -0.28, 0.0]),
            ("RightHand", "RightForeArm", [0.0, -0.25, 0.0]),
            ("LeftUpLeg", "Hips", [0.1, -0.05, 0.0]),
            ("LeftLeg", "LeftUpLeg", [0.0, -0.42, 0.0]),
            ("LeftFoot", "LeftLeg", [0.0, -0.4, 0.0]),
            ("RightUpLeg", "Hips", [-0.1, -0.05, 0.0]),
            ("RightLeg", "RightUpLeg", [0.0, -0.42, 0.0]),
        ];
        let foot = ("RightFoot", "RightLeg", [0.0, -0.4, 0.0]);
        let rows: Vec<_> = rows.into_iter().chain([foot]).collect();
        let joint = |(name, parent, offset): &(&str, &str, [f32; 3])| Joint {
            name: (*name).to_owned(),
            parent: rows.iter().position(|row| row.0 == *parent),
            offset_m: Vec3::from_array(*offset),
        };
        let joints = rows.iter().map(joint).collect();
        let skeleton = Arc::new(Skeleton::new(joints, Vec3::X, 0.0, None).unwrap());
        let still = vec![Quat::IDENTITY; skeleton.joint_count()];
        Figure::new(skeleton, &still, Some(0.95), &PartsDoc::default()).unwrap()
    }

    /// Stands with the hips at a height, and the feet this far ahead of them.
    fn stands(figure: &Figure, height_m: f32, ahead_m: f32) -> (Vec3, Vec<Quat>) {
        let root = Vec3::Y * height_m;
        let mut pose = vec![Quat::IDENTITY; figure.skeleton().joint_count()];
        for (side, limb) in feet(figure).enumerate() {
            let goal = Vec3::new([0.1, -0.1][side], 0.08, ahead_m);
            let goal = (goal, 0.0);
            place_end(
                figure.skeleton(),
                root,
                &mut pose,
                limb.chain(),
                goal,
                Vec3::Z,
                Quat::IDENTITY,
            );
        }
        (root, pose)
    }

    #[test]
    fn feet_stay_on_the_ground_while_a_difference_eases_out() {
        let figure = person();
        let (made, given) = (stands(&figure, 0.9, 0.0), stands(&figure, 0.8, 0.0));
        let difference = Difference::between(&figure, (made.0, &made.1), (given.0, &given.1));
        let ankles = |root: Vec3, pose: &[Quat]| {
            let places = feet(&figure).map(|limb| joint_transform(figure.skeleton(), root, pose, limb.end).0);
            places.collect::<Vec<_>>()
        };
        for (share, height_m, ahead_m) in [(0.9, 0.91, 0.05), (0.5, 0.93, 0.1), (0.1, 0.85, 0.3)] {
            let (mut root, mut pose) = stands(&figure, height_m, ahead_m);
            add(&figure, &[(share, &difference)], &mut root, &mut pose);
            assert!((root.y - height_m + 0.1 * share).abs() < 1e-4, "{root}");
            for ankle in ankles(root, &pose) {
                assert!(
                    (ankle.y - 0.08).abs() < 1e-3 && (ankle.z - ahead_m).abs() < 1e-3,
                    "{share}: {ankle}"
                );
            }
        }
        // The given pose itself is met.
        let (mut root, mut pose) = made;
        add(&figure, &[(1.0, &difference)], &mut root, &mut pose);
        let apart = pose.iter().zip(&given.1).map(|(a, b)| a.angle_between(*b));
        assert!(root.distance(given.0) < 1e-6 && apart.fold(0.0, f32::max) < 1e-3);
    }
}
