use troupe_motion::fk::joint_transform;

use super::*;
use crate::live::behaviour::testing::{doll_rig, doll_style};

const FEET: [usize; 2] = [12, 15];
const FRAMES: usize = 40;
const GAP: Range<usize> = 4..39;

/// Glides ahead at 1 cm a frame in the standing pose, hips at `height_m`.
fn glide(height_m: f32) -> (Vec<Vec3>, Vec<Quat>) {
    let roots = (0..FRAMES).map(|f| Vec3::new(0.0, height_m, 0.01 * f as f32));
    (roots.collect(), doll_style().idle().rotations.repeat(FRAMES))
}

fn feet(roots: &[Vec3], rotations: &[Quat], frame: usize) -> [Vec3; 2] {
    let rig = doll_rig();
    let pose = &rotations[frame * rig.dims.joints..];
    FEET.map(|foot| joint_transform(&rig.skeleton, roots[frame], pose, foot).0)
}

#[test]
fn contacts_are_bits() {
    let rows = [0.5, 0.1, 0.9, 0.0, 0.49, 1.0, 0.0, 0.7];
    assert_eq!(contact_bits(&rows, 4, 2), [0b0101, 0b1010]);
    assert_eq!(contact_bits(&rows, 4, 1), [0b0101]);
    assert_eq!(contact_bits(&[], 0, 2), [0, 0]);
}

#[test]
fn a_foot_in_contact_stays_where_it_is() {
    let (mut roots, mut rotations) = glide(0.9);
    let before = (roots.clone(), rotations.clone());
    // The left foot stands for half a second while the right one swings.
    let contacts: Vec<u8> = (0..FRAMES).map(|f| u8::from((10..25).contains(&f))).collect();
    hold_between(&doll_rig(), &mut roots, &mut rotations, &contacts, GAP);
    assert_eq!(roots, before.0, "the root keeps its way");
    for frame in 11..25 {
        let slid = feet(&roots, &rotations, frame)[0].distance(feet(&roots, &rotations, frame - 1)[0]);
        assert!(slid < 5e-4, "frame {frame} slides {slid} m");
    }
    for frame in (0..4).chain(39..FRAMES) {
        let joints = doll_rig().dims.joints;
        let at = frame * joints..(frame + 1) * joints;
        assert_eq!(rotations[at.clone()], before.1[at], "keyframe {frame}");
    }
}

#[test]
fn a_live_foot_that_slides_far_is_not_held() {
    let (mut roots, mut rotations) = glide(0.9);
    let before = (roots.clone(), rotations.clone());
    hold_live(&doll_rig(), &mut roots, &mut rotations, &mut [1; FRAMES], 4);
    let most = (4..FRAMES)
        .map(|f| feet(&roots, &rotations, f)[0].distance(feet(&before.0, &before.1, f)[0]))
        .fold(0.0, f32::max);
    assert!((0.04..=FARTHEST_LIVE_M + 1e-3).contains(&most), "{most}");
}

#[test]
fn feet_are_lifted_out_of_the_ground_unless_the_keyframes_are_below_it() {
    let sunk = 0.04;
    let (mut roots, mut rotations) = glide(0.9);
    roots[GAP].iter_mut().for_each(|root| root.y -= sunk);
    hold_between(&doll_rig(), &mut roots, &mut rotations, &[0; FRAMES], GAP);
    let lowest = |roots: &[Vec3], rotations: &[Quat]| feet(roots, rotations, 20)[0].y;
    assert!(
        (lowest(&roots, &rotations) - 0.07).abs() < 2e-3,
        "{}",
        lowest(&roots, &rotations)
    );

    let (mut roots, mut rotations) = glide(-0.1);
    let before = rotations.clone();
    hold_between(&doll_rig(), &mut roots, &mut rotations, &[0; FRAMES], GAP);
    assert_eq!(rotations, before, "its keyframes are a metre down");
}
