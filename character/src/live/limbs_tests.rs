use proptest::prelude::*;
use troupe_motion::fk::joint_transform;
use troupe_motion::{Quat, Vec3};

use super::*;
use crate::live::behaviour::testing::{doll_rig, doll_style};
use crate::live::buffer::{Fade, Frames, MotionBuffer};

/// The feet of the doll, in the order of their contacts.
const FEET: [usize; 2] = [12, 15];
/// Frames of a gait's cycle, as in the doll's style.
const CYCLE: f32 = 30.0;
const FRAMES: usize = 64;
/// Way of the body in a frame: a slow walk, metres.
const STEP_M: f32 = 0.015;

/// Frames of a walk whose feet glide: legs swing like scissors.
struct Glide {
    roots: Vec<Vec3>,
    rotations: Vec<Quat>,
    contacts: Vec<u8>,
}

impl Glide {
    /// A walk of `step_m` a frame from `from` on, which begins at a phase, in frames.
    fn new(from: Vec3, step_m: f32, phase: f32) -> Self {
        let idle = doll_style().idle().rotations.clone();
        let pose = |frame: usize| {
            let swing = 0.3 * ((frame as f32 + phase) / CYCLE * std::f32::consts::TAU).sin();
            let mut pose = idle.clone();
            for (first, side) in [(10, 1.0), (13, -1.0)] {
                pose[first] *= Quat::from_rotation_x(side * swing);
                pose[first + 2] *= Quat::from_rotation_x(-side * swing);
            }
            pose
        };
        Self {
            roots: (0..FRAMES)
                .map(|frame| from + Vec3::Z * step_m * frame as f32)
                .collect(),
            rotations: (0..FRAMES).flat_map(pose).collect(),
            contacts: vec![0; FRAMES],
        }
    }

    fn frames(&self) -> Frames<'_> {
        Frames {
            roots: &self.roots,
            rotations: &self.rotations,
            contacts: &self.contacts,
        }
    }
}

/// A character that walks and whose feet stand from frame 4 on.
fn walking(step_m: f32) -> MotionBuffer {
    let walk = Glide::new(Vec3::Y * 0.9, step_m, 0.0);
    let mut buffer = MotionBuffer::new(doll_rig().dims.joints, 0, walk.frames());
    finish_limbs(&doll_rig(), true, buffer.behind_mut(3));
    buffer
}

/// Places of the feet in a frame, and whether they stand.
fn feet(buffer: &MotionBuffer, frame: i64) -> [(Vec3, bool); 2] {
    let bits = buffer.range(frame, frame).contacts[0];
    [0, 1].map(|nth| {
        let (root, pose) = (buffer.root(frame), buffer.pose(frame));
        let place = joint_transform(&doll_rig().skeleton, root, pose, FEET[nth]).0;
        (place, bits >> nth & 1 == 1)
    })
}

/// Farthest that a foot goes over the ground in a frame of a contact, metres.
fn farthest_slide_m(buffer: &MotionBuffer, frames: std::ops::Range<i64>) -> f32 {
    let pairs = frames.flat_map(|frame| {
        let (from, to) = (feet(buffer, frame), feet(buffer, frame + 1));
        from.into_iter().zip(to)
    });
    pairs
        .filter(|((_, stood), (_, stands))| *stood && *stands)
        .map(|((from, _), (to, _))| (to - from).with_y(0.0).length())
        .fold(0.0, f32::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Without the frames before the plan, or with feet that stand before the cross-fade, a foot
    /// slides by up to some centimetres.
    #[test]
    fn a_foot_that_stands_keeps_its_place_in_a_new_plan(
        at in 16i64..40,
        shift in -4.0f32..4.0,
        faster in 0.9f32..1.1,
    ) {
        let mut buffer = walking(STEP_M);
        let stood = feet(&buffer, at);
        prop_assert!(stood.iter().any(|(_, stands)| *stands), "a foot carries the body");
        let from = buffer.root(at).with_y(0.9) + Vec3::Z * STEP_M;
        let plan = Glide::new(from, STEP_M * faster, at as f32 + 1.0 + shift);
        buffer.splice(at, plan.frames(), Fade::USUAL);
        finish_limbs(&doll_rig(), true, buffer.behind_mut(at));
        let slides_m = farthest_slide_m(&buffer, at - 4..at + 20);
        prop_assert!(slides_m < 1e-4, "{} mm a frame", 1e3 * slides_m);
    }

    #[test]
    fn a_plan_that_changes_nothing_leaves_feet_where_they_were(at in 16i64..40) {
        let mut buffer = walking(STEP_M);
        let last = buffer.last();
        let before: Vec<_> = (at..=last).map(|frame| feet(&buffer, frame)).collect();
        let same = buffer.range(at + 1, last);
        let (roots, rotations, contacts) =
            (same.roots.to_vec(), same.rotations.to_vec(), same.contacts.to_vec());
        let plan = Frames { roots: &roots, rotations: &rotations, contacts: &contacts };
        buffer.splice(at, plan, Fade::USUAL);
        finish_limbs(&doll_rig(), true, buffer.behind_mut(at));
        for (frame, before) in (at..=last).zip(before) {
            for ((was, _), (is, _)) in before.into_iter().zip(feet(&buffer, frame)) {
                prop_assert!(was.distance(is) < 0.05, "frame {frame}: {was} {is}");
            }
        }
    }
}

#[test]
fn feet_that_do_not_glide_are_left_alone() {
    let walk = Glide::new(Vec3::Y * 0.9, STEP_M, 0.0);
    let mut buffer = MotionBuffer::new(doll_rig().dims.joints, 0, walk.frames());
    finish_limbs(&doll_rig(), false, buffer.behind_mut(3));
    assert_eq!(buffer.range(0, buffer.last()).rotations, walk.rotations);
}
