//! Seated poses, which clips seldom have: the hips of a standing one go down onto a seat, the feet
//! stay in place.

use troupe_motion::ik::{Leg, Posed, arms, legs, pose_at, two_bone};
use troupe_motion::{Quat, Skeleton, Vec3};

use super::placement::Pose;

/// Lowest and highest seat, metres.
pub(super) const HEIGHTS_M: (f32, f32) = (0.3, 0.7);
/// Height of the root joint over the seat that a character sits on, metres.
const HIPS_OVER_SEAT_M: f32 = 0.1;
/// The feet are this share of their farthest place before the hips.
const FEET_AHEAD: f32 = 0.95;
/// Forward lean of the trunk, radians.
const LEAN: f32 = 0.1;
/// Hands lie this far along the thighs, from hip to knee, and this far above them, metres.
const ON_THIGH: (f32, f32) = (0.62, 0.09);

/// The pose on a seat of `height` metres. None if the skeleton has no legs that can be bent.
pub(super) fn seated(skeleton: &Skeleton, pose: &Pose, height: f32) -> Option<Pose> {
    let legs = legs(skeleton);
    let hips = skeleton.ground_y_m + height + HIPS_OVER_SEAT_M;
    let forward = pose.root.forward();
    let ahead = legs.iter().map(|leg| {
        let ankle = pose.positions[leg.foot] - pose.root.position;
        ankle.dot(forward) - feet_ahead(skeleton, leg, pose, hips)
    });
    let back = ahead.sum::<f32>() / legs.len() as f32;
    if !back.is_finite() {
        return None;
    }
    let root = (pose.root.position + forward * back).with_y(hips);
    let standing = Posed {
        root: pose.root.position,
        rotations: &pose.rotations,
    };
    let mut rotations = pose_at(skeleton, &legs, standing, root, LEAN).rotations;
    let sitting = Pose::new(skeleton, root, rotations.clone());
    for chain in arms(skeleton) {
        let Some(goal) = on_thigh(&sitting, &legs, chain[0]) else {
            continue;
        };
        let from_middle = sitting.positions[chain[0]] - sitting.root.position;
        let out = from_middle.reject_from(forward).with_y(0.0).normalize_or_zero();
        straighten(skeleton, &mut rotations, chain);
        // An arm that is too short for its thigh comes as near as it can.
        two_bone(
            skeleton,
            root,
            &mut rotations,
            chain,
            goal,
            elbow(out, forward),
            false,
        );
    }
    Some(Pose::new(skeleton, root, rotations))
}

/// Where elbows go: down, and a little back and out.
fn elbow(out: Vec3, forward: Vec3) -> Vec3 {
    out * 0.4 - forward * 0.5 - Vec3::Y
}

/// Stretches a limb of upper, middle and end joint, so that it has no side of its own that it bends
/// to.
fn straighten(skeleton: &Skeleton, rotations: &mut [Quat], [_, middle, end]: [usize; 3]) {
    let upper_bone = skeleton.joints[middle].offset_m.normalize_or_zero();
    let lower_bone = rotations[middle] * skeleton.joints[end].offset_m.normalize_or_zero();
    if upper_bone != Vec3::ZERO && lower_bone != Vec3::ZERO {
        let turn = Quat::from_rotation_arc(lower_bone, upper_bone);
        rotations[middle] = (turn * rotations[middle]).normalize();
    }
}

/// Distance of a foot before the hips if the shin is upright, metres.
fn feet_ahead(skeleton: &Skeleton, leg: &Leg, pose: &Pose, hips: f32) -> f32 {
    let [thigh, shin] = [leg.lower, leg.foot].map(|joint| skeleton.joints[joint].offset_m.length());
    let hip = hips + pose.positions[leg.upper].y - pose.root.position.y;
    let knee = pose.positions[leg.foot].y + shin;
    FEET_AHEAD * (thigh * thigh - (knee - hip).powi(2)).max(0.0).sqrt()
}

/// Where the hand of an arm lies: on the thigh of its side.
fn on_thigh(pose: &Pose, legs: &[Leg], shoulder: usize) -> Option<Vec3> {
    let shoulder = pose.positions[shoulder];
    let distance = |leg: &&Leg| pose.positions[leg.upper].with_y(shoulder.y).distance(shoulder);
    let leg = legs.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    let (along, above) = ON_THIGH;
    let [hip, knee] = [leg.upper, leg.lower].map(|joint| pose.positions[joint]);
    Some(hip.lerp(knee, along) + Vec3::Y * above)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::files::read_clip_on;
    use crate::pack_folder;
    use crate::reading::Reading;

    #[test]
    fn the_hips_go_down_and_the_feet_stay() {
        let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let pack = pack_folder::read(&repository.join("models/human")).unwrap();
        let skeleton = pack.skeleton();
        let clip = read_clip_on(
            &repository.join("examples/walk.bvh"),
            skeleton,
            &Reading::default(),
            None,
        )
        .unwrap();
        for (frame, height) in [(0, 0.45), (20, 0.4), (70, 0.5)] {
            let standing = Pose::of(&clip, frame);
            let pose = seated(skeleton, &standing, height).unwrap();
            assert!((pose.root.position.y - height - 0.1).abs() < 1e-4);
            assert!((pose.root.heading - standing.root.heading).abs() < 0.02);
            let forward = standing.root.forward();
            let legs = legs(skeleton);
            for leg in &legs {
                let moved = pose.positions[leg.foot].distance(standing.positions[leg.foot]);
                assert!(moved < 0.01, "a foot moved by {moved} m in frame {frame}");
                let [hip, knee] = [leg.upper, leg.lower].map(|joint| pose.positions[joint]);
                assert!(
                    (knee - hip).dot(forward) > 0.25,
                    "the thigh goes ahead in frame {frame}"
                );
            }
            for chain in arms(skeleton) {
                let thigh = on_thigh(&pose, &legs, chain[0]).unwrap();
                let short = pose.positions[chain[2]].distance(thigh);
                assert!(
                    short < 0.03,
                    "a hand is {short} m from its thigh in frame {frame}"
                );
            }
        }
    }
}
