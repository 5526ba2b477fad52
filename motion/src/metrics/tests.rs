//! The measures on motions made by hand.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::{Quat, Vec3};

use super::*;
use crate::clip::Clip;
use crate::skeleton::Skeleton;
use crate::testing::{arm, biped, stand, walk};

fn near(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-5 * b.abs().max(1.0), "{a} is not {b}");
}

fn world(clip: &Clip) -> WorldMotion {
    WorldMotion::from_clip(clip)
}

/// A clip of one joint with the rotations `(w, x, y, z)` as given, without normalising them.
fn signal(frames: &[[f32; 4]]) -> WorldMotion {
    let rotations = frames
        .iter()
        .map(|&[w, x, y, z]| Quat::from_xyzw(x, y, z, w))
        .collect();
    WorldMotion {
        joints: 1,
        positions: vec![Vec3::ZERO; frames.len()],
        rotations,
    }
}

#[test]
fn l2p_is_the_norm_of_the_whole_pose() {
    let (truth, mut clip) = (stand(6), stand(6));
    // All eight joints 3 cm off in frame 2 and 6 cm in frame 3: sqrt(8) · 0.03 and 0.06.
    clip.root_positions[2].x += 0.03;
    clip.root_positions[3].z += 0.06;
    let (clip, truth) = (world(&clip), world(&truth));
    near(l2p_m(&clip, &truth, 2..4).unwrap(), 8f64.sqrt() * 0.045);
    near(l2p_m(&clip, &truth, 0..6).unwrap(), 8f64.sqrt() * 0.015);
    near(l2p_m(&truth, &truth, 0..6).unwrap(), 0.0);
}

#[test]
fn l2q_does_not_see_signs() {
    let (truth, mut clip) = (stand(4), stand(4));
    // The spine has no children: one joint, 60°: |q - 1|² = 2 - 2·cos 30°.
    clip.rotations_at_mut(1)[1] = -Quat::from_rotation_x(60f32.to_radians());
    clip.rotations_at_mut(2)[1] = -Quat::IDENTITY;
    let (clip, truth) = (world(&clip), world(&truth));
    near(
        l2q(&clip, &truth, 1..2).unwrap(),
        (2.0 - 2.0 * 30f64.to_radians().cos()).sqrt(),
    );
    near(l2q(&clip, &truth, 2..3).unwrap(), 0.0);
    // Turning the pelvis turns all eight joints in the world.
    let mut bowed = stand(4);
    bowed.rotations_at_mut(0)[0] = Quat::from_rotation_x(60f32.to_radians());
    near(
        l2q(&world(&bowed), &truth, 0..1).unwrap(),
        (8.0 * (2.0 - 2.0 * 30f64.to_radians().cos())).sqrt(),
    );
}

/// NPSS as LaFAN1's Python computes it, written out: full complex transform, then its real part.
fn reference_npss(motion: &[Vec<f64>], truth: &[Vec<f64>]) -> f64 {
    let spectrum = |x: &[f64]| -> Vec<f64> {
        let n = x.len() as f64;
        let real = |k: usize| {
            x.iter()
                .enumerate()
                .map(|(t, v)| v * (TAU * k as f64 * t as f64 / n).cos())
                .sum::<f64>()
        };
        (0..x.len()).map(|k| real(k).powi(2)).collect()
    };
    let cumulative = |p: &[f64]| -> Vec<f64> {
        let total: f64 = p.iter().sum();
        p.iter()
            .scan(0.0, |sum, v| {
                Some({
                    *sum += v / total;
                    *sum
                })
            })
            .collect()
    };
    let (mut weighted, mut weight) = (0.0, 0.0);
    for (m, t) in motion.iter().zip(truth) {
        let (m, t) = (spectrum(m), spectrum(t));
        let total: f64 = t.iter().sum();
        if total > 0.0 {
            let emd: f64 = cumulative(&m)
                .iter()
                .zip(cumulative(&t))
                .map(|(a, b)| (a - b).abs())
                .sum();
            weighted += total * emd;
            weight += total;
        }
    }
    weighted / weight
}

#[test]
fn npss_by_hand() {
    // Four frames: a constant has all its power at frequency 0, and alternating signs at frequency
    // 2. The cumulative spectra are 1 1 1 1 and 0 0 1 1, two apart. (Quaternion (1, x, 0, 0); w is
    // the same in both, with power 16.)
    let truth = signal(&[[1.0, 0.5, 0.0, 0.0]; 4]);
    let flip = |t: usize| [1.0, if t.is_multiple_of(2) { 0.5 } else { -0.5 }, 0.0, 0.0];
    let motion = signal(&[flip(0), flip(1), flip(2), flip(3)]);
    // Weights: w has power (4·1)² = 16, x (4·0.5)² = 4.
    near(npss(&motion, &truth, 0..4).unwrap(), 2.0 * 4.0 / 20.0);
    near(npss(&truth, &truth, 0..4).unwrap(), 0.0);
}

#[test]
fn npss_equals_the_reference() {
    let (motion, truth) = (walk(40), walk(40).slice(5..40).unwrap());
    let motion = motion.slice(0..35).unwrap();
    let (motion, truth) = (world(&motion), world(&truth));
    let channels = |m: &WorldMotion| -> Vec<Vec<f64>> {
        let channel = |j: usize, c: usize| {
            (4..34)
                .map(|f| f64::from(m.rotations_at(f)[j].to_array()[c]))
                .collect()
        };
        (0..32).map(|i| channel(i / 4, i % 4)).collect()
    };
    let want = reference_npss(&channels(&motion), &channels(&truth));
    assert!(want > 0.01, "{want}");
    near(npss(&motion, &truth, 4..34).unwrap(), want);
}

#[test]
fn npss_does_not_see_signs() {
    let truth = world(&walk(30));
    let mut flipped = truth.clone();
    // From frame 12 on every rotation has the other sign, as after a careless conversion.
    flipped.rotations[12 * 8..].iter_mut().for_each(|q| *q = -*q);
    near(npss(&flipped, &truth, 0..30).unwrap(), 0.0);
}

#[test]
fn npss_of_many_is_weighted_by_power() {
    let strong = signal(&[[1.0, 0.0, 0.0, 0.0]; 4]);
    let weak = signal(&[[0.1, 0.0, 0.0, 0.0]; 4]);
    let flip = |a: f32| {
        signal(&[
            [a, 0.3, 0.0, 0.0],
            [-a, 0.3, 0.0, 0.0],
            [a, 0.3, 0.0, 0.0],
            [-a, 0.3, 0.0, 0.0],
        ])
    };
    let mut all = Npss::default();
    assert_eq!(all.value(), None);
    all.add(&strong, &strong, 0..4).unwrap();
    let mut other = Npss::default();
    other.add(&flip(0.1), &weak, 0..4).unwrap();
    near(other.value().unwrap(), 2.0);
    all.merge(&other);
    near(all.value().unwrap(), 2.0 * 0.16 / 16.16);
}

#[test]
fn skate_counts_near_the_ground_only() {
    // 3 cm a frame at rest height: full weight for all four contact joints.
    let slide = |up: f32| {
        let mut clip = stand(5);
        for f in 0..5 {
            clip.root_positions[f] += Vec3::new(0.03 * f as f32, up, 0.0);
        }
        foot_skate_m_per_frame(&biped(), &world(&clip), 0..5).unwrap()
    };
    near(slide(0.0), 0.03);
    near(slide(0.0125), 0.03 * (2.0 - 2f64.sqrt()));
    near(slide(0.025), 0.0);
    near(slide(0.5), 0.0);
    near(slide(-0.1), 0.03);
    // Up and down is not skating.
    let mut hop = stand(3);
    hop.root_positions[1].y += 0.01;
    near(foot_skate_m_per_frame(&biped(), &world(&hop), 1..3).unwrap(), 0.0);
}

#[test]
fn penetration_has_five_millimetres_of_grace() {
    let sink = |down: f32| {
        let mut clip = stand(2);
        clip.root_positions[1].y -= down;
        penetration_m(&biped(), &world(&clip), 0..2).unwrap()
    };
    near(sink(0.004), 0.0);
    near(sink(0.025), 0.01);
}

#[test]
fn contact_accuracy_is_a_share() {
    let (truth, mut clip) = (stand(10), stand(10));
    // Off the ground in frames 5..8. Landing in frame 8 is too fast for a contact, so four frames
    // of ten are wrong.
    (5..8).for_each(|f| clip.root_positions[f].y += 0.5);
    near(
        contact_accuracy(&biped(), &world(&clip), &world(&truth), 0..10, 30.0).unwrap(),
        0.6,
    );
    near(
        contact_accuracy(&biped(), &world(&clip), &world(&truth), 5..9, 30.0).unwrap(),
        0.0,
    );
}

#[test]
fn predicted_contacts_are_compared_with_those_of_the_motion() {
    // Standing, so all four are contacts. In frame 1 one is denied and one doubtful; frame 2 is
    // completely wrong.
    let truth = world(&stand(3));
    let said = [1.0; 4]
        .into_iter()
        .chain([0.2, 0.5, 0.9, 1.0])
        .chain([0.4; 4])
        .collect::<Vec<_>>();
    let share = |range| contact_prediction_accuracy(&biped(), &said, &truth, range, 30.0);
    near(share(0..3).unwrap(), 7.0 / 12.0);
    near(share(1..2).unwrap(), 0.75);
    let short = contact_prediction_accuracy(&biped(), &said[..8], &truth, 0..1, 30.0);
    assert_eq!(short, Err(MetricError::Shape("contacts")));
}

#[test]
fn jitter_is_acceleration() {
    // x = t² · 2 cm: a second difference of 4 cm a frame², times 900.
    let mut clip = stand(8);
    for f in 0..8 {
        clip.root_positions[f].x = 0.02 * (f * f) as f32;
    }
    near(root_jitter_mps2(&world(&clip), 2..5, 30.0).unwrap(), 36.0);
    near(joint_jitter_mps2(&world(&clip), 0..8, 30.0).unwrap(), 36.0);
    // A jump of 1 cm at the seam: both frames beside it see it, one of which is in the gap.
    let mut jump = stand(8);
    (4..8).for_each(|f| jump.root_positions[f].x = 0.01);
    near(root_jitter_mps2(&world(&jump), 4..8, 30.0).unwrap(), 9.0 / 3.0);
    // A single joint: the spine's end swings, the rest stands.
    let mut nod = stand(3);
    nod.rotations_at_mut(1)[0] = Quat::from_rotation_y(0.1);
    assert!(joint_jitter_mps2(&world(&nod), 1..2, 30.0).unwrap() > 0.0);
    near(root_jitter_mps2(&world(&nod), 1..2, 30.0).unwrap(), 0.0);
}

#[test]
fn the_highest_percentile_sees_a_pop_that_the_mean_does_not() {
    // 200 frames of y = t² · 0.2 mm (0.36 m/s²), all eight joints. One frame is 1 cm off: 9 m/s²
    // beside it, 18 at it.
    let pop = |off: f32| {
        let mut clip = stand(200);
        (0..200).for_each(|f| clip.root_positions[f].y += 2e-4 * (f * f) as f32);
        clip.root_positions[100].x += off;
        world(&clip)
    };
    let share = |motion: &WorldMotion, share| {
        joint_acceleration_percentile_mps2(motion, 0..200, 30.0, share).unwrap()
    };
    let within = |a: f64, b: f64, by: f64| assert!((a - b).abs() < by, "{a} is not {b}");
    within(share(&pop(0.0), 0.999), 0.36, 0.05);
    within(share(&pop(0.01), 0.5), 0.36, 0.05);
    within(share(&pop(0.01), 0.999), 18.0, 0.1);
    assert!(joint_jitter_mps2(&pop(0.01), 0..200, 30.0).unwrap() < 0.6);
    assert_eq!(
        joint_accelerations_mps2(&pop(0.0), 0..200, 30.0).unwrap().len(),
        198 * 8
    );
    assert!(joint_accelerations_mps2(&pop(0.0), 100..201, 30.0).is_err());
}

#[test]
fn percentiles_by_hand() {
    let of = |share| percentile(vec![4.0, 1.0, 3.0, 2.0], share);
    assert_eq!((of(0.0), of(0.5), of(1.0)), (Some(1.0), Some(2.5), Some(4.0)));
    near(of(0.9).unwrap(), 3.7);
    assert_eq!(percentile(Vec::new(), 0.5), None);
}

#[test]
fn keyframe_errors_are_the_largest() {
    let (truth, mut clip) = (stand(6), stand(6));
    clip.root_positions[4].y += 0.02;
    clip.rotations_at_mut(5)[2] = Quat::from_rotation_x(0.1);
    let (clip, truth) = (world(&clip), world(&truth));
    near(keyframe_error_m(&clip, &truth, 0..4).unwrap(), 0.0);
    near(keyframe_error_m(&clip, &truth, 4..5).unwrap(), 0.02);
    // The leg swings by 0.1 rad; the toes are farthest from the hip, at sqrt(0.95² + 0.12²).
    let toes = (0.95f64.powi(2) + 0.12f64.powi(2)).sqrt();
    near(
        keyframe_error_m(&clip, &truth, 4..6).unwrap(),
        2.0 * 0.05f64.sin() * toes,
    );
    near(root_error_m(&clip, &truth, 4..6).unwrap(), 0.02);
    near(root_error_m(&clip, &truth, 5..6).unwrap(), 0.0);
}

#[test]
fn a_broken_frame_does_not_look_perfect() {
    let (truth, mut clip) = (stand(3), stand(3));
    clip.root_positions[1].x = f32::NAN;
    assert!(
        keyframe_error_m(&world(&clip), &world(&truth), 0..3)
            .unwrap()
            .is_nan()
    );
    assert!(
        root_error_m(&world(&clip), &world(&truth), 0..3)
            .unwrap()
            .is_nan()
    );
    assert!(!reached(&clip, &truth, 1));
}

#[test]
fn reaching_needs_place_and_heading() {
    let truth = stand(2);
    let at = |x: f32, degrees: f32| {
        let mut clip = stand(2);
        clip.root_positions[1].x += x;
        clip.rotations_at_mut(1)[0] = Quat::from_rotation_y(degrees.to_radians());
        reached(&clip, &truth, 1)
    };
    assert!(at(0.0, 0.0) && at(0.049, 14.9) && at(-0.049, -14.9));
    assert!(!at(0.051, 0.0) && !at(0.0, 15.1) && !at(0.0, -15.1) && !at(0.0, 180.0));
}

#[test]
fn a_task_is_measured_in_its_parts() {
    let task = Task {
        context_frames: 4,
        gap_frames: 15,
        target_frames: 1,
    };
    assert_eq!(
        (task.frames(), task.context(), task.gap(), task.targets()),
        (20, 0..4, 4..19, 19..20)
    );
    let truth = walk(20);
    let same = evaluate(&truth, &truth, task).unwrap().figures;
    let truths_own = [
        same.foot_skate_m_per_frame,
        same.penetration_m,
        same.joint_jitter_mps2,
        same.root_jitter_mps2,
    ];
    assert!(truths_own.iter().all(|v| v.is_finite()));
    let zeros = [
        same.l2p_m,
        same.l2q,
        same.npss,
        same.context_keyframe_error_m,
        same.target_root_error_m,
    ];
    assert_eq!(zeros, [0.0; 5]);
    assert_eq!((same.contact_accuracy, same.reaching_success), (1.0, 1.0));
    let mut off = truth.clone();
    off.root_positions[1].x += 0.1;
    off.root_positions[10].x += 0.2;
    off.root_positions[19].x += 0.3;
    let off = evaluate(&off, &truth, task).unwrap();
    near(off.figures.l2p_m, 8f64.sqrt() * 0.2 / 15.0);
    near(off.figures.context_keyframe_error_m, 0.1);
    near(off.figures.context_root_error_m, 0.1);
    near(off.figures.target_keyframe_error_m, 0.3);
    near(off.figures.target_root_error_m, 0.3);
    near(off.figures.reaching_success, 0.0);
    let mut summary = Summary::default();
    assert_eq!(summary.figures(), None);
    summary.add(&off);
    summary.add(&evaluate(&truth, &truth, task).unwrap());
    let means = summary.figures().unwrap();
    assert_eq!(summary.count(), 2);
    near(means.target_root_error_m, 0.15);
    near(means.reaching_success, 0.5);
}

#[test]
fn motions_that_do_not_fit_are_refused() {
    let (a, b) = (stand(8), stand(9));
    let (wa, wb) = (world(&a), world(&b));
    assert_eq!(l2p_m(&wa, &wb, 0..2), Err(MetricError::Shape("frames")));
    assert_eq!(l2q(&wa, &world(&arm()), 0..1), Err(MetricError::Shape("joints")));
    assert!(matches!(
        l2p_m(&wa, &wa, 5..9),
        Err(MetricError::Range {
            start: 5,
            end: 9,
            frames: 8
        })
    ));
    assert!(matches!(
        root_jitter_mps2(&wa, 3..3, 30.0),
        Err(MetricError::Range { .. })
    ));
    let bare = Skeleton::new(biped().joints.clone(), Vec3::X, 0.0, None).unwrap();
    assert_eq!(penetration_m(&bare, &wa, 0..2), Err(MetricError::NoContacts));
    let task = Task {
        context_frames: 4,
        gap_frames: 3,
        target_frames: 1,
    };
    assert_eq!(evaluate(&b, &a, task).err(), Some(MetricError::Shape("frames")));
    let fast = Clip {
        fps: 60.0,
        skeleton: Arc::clone(&a.skeleton),
        ..a.clone()
    };
    assert_eq!(evaluate(&fast, &a, task).err(), Some(MetricError::Shape("rate")));
    assert!(evaluate(&a, &a, task).is_ok());
}
