use proptest::prelude::*;
use troupe_motion::ik::legs;
use troupe_motion::rotation::{angle_between, yaw};
use troupe_motion::{Quat, Vec3};

use super::super::PlanTrace;
use super::super::behaviour::testing::{doll, doll_style};
use super::*;

/// A plan of `frames` frames that walks ahead at 3 cm a frame, in the standing pose.
fn walk(frames: usize) -> LivePlan {
    let idle = doll_style().idle().clone();
    LivePlan {
        feet_glide: false,
        roots: (0..frames)
            .map(|f| Vec3::new(0.0, 0.9, 0.03 * f as f32))
            .collect(),
        rotations: idle.rotations.repeat(frames),
        contacts: vec![0; frames],
        trace: PlanTrace::default(),
    }
}

fn key(x: f32, y: f32, z: f32, heading: f32, bend: f32) -> Key {
    let mut rotations = doll_style().idle().rotations.clone();
    rotations[0] = yaw(heading);
    rotations[1] = Quat::from_rotation_x(bend);
    Key {
        root: Vec3::new(x, y, z),
        rotations,
        points: Vec::new(),
    }
}

/// A foot that travels farther than this in a frame does not stand, metres.
const GOES_M: f32 = 0.4 / 30.0;

fn pins(keys: Vec<Key>, settles: bool) -> Pins {
    Pins {
        keys,
        settles,
        legs: legs(&doll()).into(),
        fps: 30.0,
    }
}

#[test]
fn a_plan_that_is_too_short_stays_as_it_is() {
    let mut plan = walk(5);
    pins(vec![key(0.0, 0.9, 0.0, 0.0, 0.0); 2], true).pin_to_targets(&mut plan, &doll());
    assert_eq!(plan, walk(5));
}

#[test]
fn a_settling_plan_comes_to_rest() {
    let mut plan = walk(40);
    pins(vec![key(0.1, 0.9, 1.0, 0.2, 0.4)], true).pin_to_targets(&mut plan, &doll());
    let step = |frame: usize| plan.roots[frame].distance(plan.roots[frame - 1]);
    assert!(step(39) < 0.002 && step(20) > 0.02, "{} {}", step(39), step(20));
    let mut soft = walk(40);
    pins(vec![key(0.1, 0.9, 1.0, 0.2, 0.4)], false).pin_to_targets(&mut soft, &doll());
    assert!(soft.roots[39].distance(soft.roots[38]) > 0.02);
}

#[test]
fn feet_that_stand_do_not_slide() {
    let mut plan = walk(40);
    // On the spot, with the keyframe a little to the side.
    plan.roots.fill(Vec3::new(0.0, 0.9, 0.0));
    plan.contacts.fill(3);
    let foot = |plan: &LivePlan, frame: usize| {
        let rotations = &plan.rotations[frame * 16..(frame + 1) * 16];
        joint_transform(&doll(), plan.roots[frame], rotations, 12).0
    };
    let first = foot(&plan, 3);
    pins(vec![key(0.0, 0.85, 0.0, 0.0, 0.3)], true).pin_to_targets(&mut plan, &doll());
    for frame in 4..36 {
        assert!(foot(&plan, frame).distance(first) < 0.03, "frame {frame}");
    }
}

#[test]
fn a_moving_foot_is_released() {
    let leg = &legs(&doll())[0];
    let bits = leg.contact_bits();
    let mut plan = walk(40);
    // Stands up to frame 20, then moves at 6 cm a frame. The networks report three more frames of
    // contact.
    for (frame, root) in plan.roots.iter_mut().enumerate() {
        *root = Vec3::new(0.0, 0.9, 0.06 * frame.saturating_sub(20) as f32);
    }
    plan.contacts[..24].fill(bits);
    let stands = |plan: &LivePlan| plan.contacts.iter().filter(|&&on| on & bits != 0).count();
    let mut loose = plan.clone();
    let_go(leg, 4..24, (36, GOES_M), &mut loose, &doll());
    assert_eq!(stands(&loose), 21, "up to the last frame in which it stood");
    // A contact is not shortened at a keyframe, nor to nothing.
    let mut key = plan.clone();
    let_go(leg, 4..24, (24, GOES_M), &mut key, &doll());
    assert_eq!(stands(&key), 24);
    let_go(leg, 20..24, (36, GOES_M), &mut plan, &doll());
    assert_eq!(stands(&plan), 23);
}

proptest! {
    #[test]
    fn keyframes_are_met_and_the_context_stays(
        frames in 16usize..64, count in 1usize..4, x in -1.0f32..1.0, z in -1.0f32..2.0, heading in -3.0f32..3.0,
        bend in -0.6f32..0.6, stands: bool, settles: bool,
    ) {
        let mut plan = walk(frames);
        if stands {
            plan.contacts.fill(3);
        }
        let keys: Vec<Key> = (0..count).map(|nth| key(x + 0.02 * nth as f32, 0.85, z, heading, bend)).collect();
        pins(keys.clone(), settles).pin_to_targets(&mut plan, &doll());
        prop_assert_eq!(&plan.roots[..4], &walk(frames).roots[..4]);
        prop_assert_eq!(&plan.rotations[..64], &walk(frames).rotations[..64]);
        for (nth, key) in keys.iter().enumerate() {
            let frame = frames - count + nth;
            prop_assert!(plan.roots[frame].distance(key.root) < 1e-4);
            for (a, b) in plan.rotations[frame * 16..].iter().zip(&key.rotations) {
                prop_assert!(angle_between(*a, *b) < 1e-3);
            }
        }
        prop_assert_eq!(plan.trace.off.len(), count);
        prop_assert!(plan.trace.off[0].root_m > 0.0);
        prop_assert!(plan.roots.iter().all(|root| root.is_finite()) && plan.rotations.iter().all(|q| q.is_finite()));
    }
}
