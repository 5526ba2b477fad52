//! Conversion between files and clips.

use std::sync::Arc;

use glam::{Quat, Vec3};
use proptest::prelude::*;

use super::SMALL;
use crate::bvh::{BvhFile, BvhOptions, BvhWriteOptions, ConvertError, EulerOrder, parse, write};
use crate::clip::{Clip, ClipError, MAX_ROTATIONS};
use crate::fk::WorldMotion;
use crate::rotation::angle_between;
use crate::skeleton::{Joint, MAX_JOINTS, Skeleton, SkeletonError};
use crate::testing::{biped, walk};

const SIX: &str = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation";

/// A root that places the hips, hips with two legs, and six channels everywhere. `frames` gives the
/// positions `(placing root, hips, left leg)`. The only rotation is 90° about Y at the placing
/// root.
fn placed(frames: &[([f64; 3], [f64; 3], [f64; 3])]) -> BvhFile {
    let mut text = format!(
        "HIERARCHY ROOT place {{ OFFSET 0 0 0 {SIX} JOINT Hips {{ OFFSET 7 7 7 {SIX}
        JOINT Leg_L {{ OFFSET 8 8 8 {SIX} }} JOINT Leg_R {{ OFFSET -1 0 0 }} }} }}
        MOTION\nFrames: {}\nFrame Time: 0.01\n",
        frames.len()
    );
    for (place, hips, leg) in frames {
        let numbers = [&place[..], &[0.0, 0.0, 90.0], hips, &[0.0; 3], leg, &[0.0; 3]].concat();
        text += &(numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ") + "\n");
    }
    parse(&text).unwrap()
}

#[test]
fn a_small_clip_by_hand() {
    let clip = parse(SMALL).unwrap().to_clip(&BvhOptions::default()).unwrap();
    assert_eq!(
        (clip.frames(), clip.fps, clip.skeleton.joint_count()),
        (2, 30.0, 2)
    );
    assert!(clip.root_positions[0].abs_diff_eq(Vec3::new(0.01, 0.02, 0.03), 1e-7));
    assert!(
        clip.skeleton.joints[1]
            .offset_m
            .abs_diff_eq(Vec3::new(0.0, 0.1, 0.0), 1e-7)
    );
    let world = WorldMotion::from_clip(&clip);
    // 90° about Z takes the chest from above the hips to their -X side.
    assert!(world.positions_at(0)[1].abs_diff_eq(Vec3::new(-0.09, 0.02, 0.03), 1e-6));
    assert!(
        angle_between(
            clip.rotations_at(1)[1],
            Quat::from_rotation_x(std::f32::consts::FRAC_PI_2)
        ) < 1e-6
    );
}

#[test]
fn channels_apply_in_their_order() {
    let text = "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 3 Yrotation Zrotation Xrotation }\nMOTION Frames: 1 Frame Time: 1\n30 40 50";
    let clip = parse(text).unwrap().to_clip(&BvhOptions::default()).unwrap();
    let [y, z, x] = [30f32, 40.0, 50.0].map(f32::to_radians);
    let want = Quat::from_rotation_y(y) * Quat::from_rotation_z(z) * Quat::from_rotation_x(x);
    assert!(angle_between(clip.rotations[0], want) < 1e-6);
}

#[test]
fn a_static_placing_root_is_folded() {
    let file = placed(&[([10.0, 0.0, 0.0], [0.0, 90.0, 5.0], [1.0, 0.0, 0.0]); 3]);
    let clip = file.to_clip(&BvhOptions::default()).unwrap();
    assert_eq!(clip.skeleton.joints[0].name, "Hips");
    // 90° about Y takes the hips' +Z to the world's +X.
    assert!(clip.root_positions[0].abs_diff_eq(Vec3::new(0.15, 0.9, 0.0), 1e-6));
    assert!(
        angle_between(
            clip.rotations[0],
            Quat::from_rotation_y(std::f32::consts::FRAC_PI_2)
        ) < 1e-6
    );
    // Position channels replaced the OFFSETs; the others stay. Left points from the right leg to
    // the left.
    let offsets: Vec<_> = clip.skeleton.joints[1..].iter().map(|j| j.offset_m).collect();
    assert!(offsets[0].abs_diff_eq(Vec3::new(0.01, 0.0, 0.0), 1e-6));
    assert!(offsets[1].abs_diff_eq(Vec3::new(-0.01, 0.0, 0.0), 1e-6));
    assert!(clip.skeleton.left_axis.abs_diff_eq(Vec3::X, 1e-6));
    assert_eq!(clip.fps, 100.0);
}

#[test]
fn a_moving_placing_root_is_folded_too() {
    // The root carries the travel and the hips the bob, as in a few of Bandai-Namco's clips.
    let frame = |t: f64| ([0.0, 0.0, 10.0 * t], [0.0, 90.0 + t, 0.0], [1.0, 0.0, 0.0]);
    let clip = placed(&[0.0, 1.0, 2.0].map(frame))
        .to_clip(&BvhOptions::default())
        .unwrap();
    assert_eq!(clip.skeleton.joints[0].name, "Hips");
    assert!(clip.root_positions[2].abs_diff_eq(Vec3::new(0.0, 0.92, 0.2), 1e-6));
}

#[test]
fn a_root_that_moves_over_a_fixed_child_stays() {
    let frame = |t: f64| ([0.0, 0.0, 10.0 * t], [0.0, 90.0, 0.0], [1.0, 0.0, 0.0]);
    let file = placed(&[0.0, 1.0].map(frame));
    let clip = file.to_clip(&BvhOptions::default()).unwrap();
    assert_eq!(clip.skeleton.joints[0].name, "place");
    assert!(
        clip.skeleton.joints[1]
            .offset_m
            .abs_diff_eq(Vec3::new(0.0, 0.9, 0.0), 1e-6)
    );
    let still = placed(&[frame(0.0)]);
    let kept = still
        .to_clip(&BvhOptions {
            fold_root: false,
            ..Default::default()
        })
        .unwrap();
    assert_eq!(kept.skeleton.joint_count(), 4);
}

#[test]
fn a_pelvis_with_an_only_child_stays() {
    // Hips > Spine > two arms: the first joint that branches is not the pelvis. With and without
    // position channels at the spine, which every joint has in some files.
    for (channels, place) in [("CHANNELS 3 Zrotation Xrotation Yrotation", ""), (SIX, "0 10 0")] {
        let text = format!(
            "HIERARCHY ROOT Hips {{ OFFSET 0 0 0 {SIX} JOINT Spine {{ OFFSET 0 10 0 {channels}
            JOINT Arm_L {{ OFFSET 10 0 0 }} JOINT Arm_R {{ OFFSET -10 0 0 }} }} }}
            MOTION\nFrames: 2\nFrame Time: 0.01\n
            0 90 0 0 0 0 {place} 0 0 0\n0 91 3 0 0 5 {place} 0 0 9\n"
        );
        let clip = parse(&text).unwrap().to_clip(&BvhOptions::default()).unwrap();
        let names: Vec<_> = clip.skeleton.joints.iter().map(|j| j.name.as_str()).collect();
        assert_eq!(names, ["Hips", "Spine", "Arm_L", "Arm_R"], "{channels}");
        assert!(clip.root_positions[1].abs_diff_eq(Vec3::new(0.0, 0.91, 0.03), 1e-6));
    }
}

#[test]
fn a_joint_that_moves_in_its_parent_is_reported() {
    let frame = |leg: f64| ([0.0; 3], [0.0, 90.0, 0.0], [leg, 0.0, 0.0]);
    let file = placed(&[frame(1.0), frame(3.0), frame(2.0)]);
    let error = file.to_clip(&BvhOptions::default()).unwrap_err();
    let ConvertError::VaryingOffset {
        joint,
        frame: 1,
        variation_m,
    } = &error
    else {
        panic!("{error}")
    };
    assert!(joint == "Leg_L" && (variation_m - 0.02).abs() < 1e-6);
    let loose = BvhOptions {
        max_offset_variation_m: 0.03,
        ..Default::default()
    };
    let clip = file.to_clip(&loose).unwrap();
    assert!(
        clip.skeleton.joints[1]
            .offset_m
            .abs_diff_eq(Vec3::new(0.02, 0.0, 0.0), 1e-6),
        "the mean place"
    );
}

/// A skeleton of some of `placed`'s joints, in another order.
fn legs() -> Arc<Skeleton> {
    let joint = |name: &str, parent, x| Joint {
        name: name.to_owned(),
        parent,
        offset_m: Vec3::new(x, 0.0, 0.0),
    };
    let joints = vec![
        joint("Hips", None, 0.0),
        joint("Leg_R", Some(0), -0.01),
        joint("Leg_L", Some(0), 0.01),
    ];
    Arc::new(Skeleton::new(joints, Vec3::X, 0.0, None).unwrap())
}

#[test]
fn joints_are_matched_to_a_skeleton_by_name() {
    let frame = ([10.0, 0.0, 0.0], [0.0, 90.0, 5.0], [1.0, 0.0, 0.0]);
    let clip = placed(&[frame; 2])
        .to_clip_on(&legs(), &BvhOptions::default())
        .unwrap();
    assert!(clip.root_positions[1].abs_diff_eq(Vec3::new(0.15, 0.9, 0.0), 1e-6));
    assert!((clip.root_at(0).heading - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    assert!(
        clip.rotations_at(0)[1..]
            .iter()
            .all(|&q| angle_between(q, Quat::IDENTITY) < 1e-6)
    );
    let error = placed(&[frame])
        .to_clip_on(&biped(), &BvhOptions::default())
        .unwrap_err();
    assert_eq!(
        error,
        ConvertError::MissingJoints(
            ["Spine", "Foot_L", "Toes_L", "Foot_R", "Toes_R"]
                .map(str::to_owned)
                .to_vec()
        )
    );
    assert!(error.to_string().contains("Spine, Foot_L"));
}

#[test]
fn bones_of_another_length_are_reported() {
    let frame = |leg| ([0.0; 3], [0.0, 90.0, 0.0], [leg, 0.0, 0.0]);
    let file = placed(&[frame(1.0), frame(4.0)]);
    let error = file.to_clip_on(&legs(), &BvhOptions::default()).unwrap_err();
    let ConvertError::OffsetMismatch {
        joint,
        frame: 1,
        error_m,
    } = &error
    else {
        panic!("{error}")
    };
    assert!(joint == "Leg_L" && (error_m - 0.03).abs() < 1e-6);
    assert!(
        file.to_clip_on(
            &legs(),
            &BvhOptions {
                max_offset_error_m: 0.04,
                ..Default::default()
            }
        )
        .is_ok()
    );
}

#[test]
fn files_that_cannot_be_a_clip_are_refused() {
    let options = BvhOptions::default();
    let (head, _) = SMALL.split_once("1 2 3").unwrap();
    let empty = parse(&head.replace("Frames: 2", "Frames: 0")).unwrap();
    assert_eq!(empty.to_clip(&options), Err(ConvertError::Clip(ClipError::Empty)));
    let two = "HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Yrotation } ROOT b { OFFSET 1 1 1 }\nMOTION Frames: 1 Frame Time: 1\n7";
    assert_eq!(
        parse(two).unwrap().to_clip(&options),
        Err(ConvertError::SeveralRoots(2))
    );
    let same = parse(&SMALL.replace("Chest", "Hips")).unwrap().to_clip(&options);
    assert!(matches!(same, Err(ConvertError::Skeleton(_))), "{same:?}");
    // Fits double precision but not single.
    let huge = parse(&SMALL.replace("4 5 6", "4 1e200 6"))
        .unwrap()
        .to_clip(&options);
    assert_eq!(huge, Err(ConvertError::Clip(ClipError::Value { frame: 1 })));
    for scale in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let bad = BvhOptions {
            scale_to_metres: scale,
            ..Default::default()
        };
        assert!(matches!(
            parse(SMALL).unwrap().to_clip(&bad),
            Err(ConvertError::Scale(_))
        ));
    }
}

/// A file of `joints` joints in a chain, of which only the first has a channel, with `frames` rows
/// of "0".
fn long(joints: usize, frames: usize) -> BvhFile {
    let mut text = "HIERARCHY ROOT j0 { OFFSET 0 0 0 CHANNELS 1 Yrotation\n".to_owned();
    for n in 1..joints {
        text += &format!("JOINT j{n} {{ OFFSET 0 0 0 }}\n");
    }
    text += &format!("}}\nMOTION\nFrames: {frames}\nFrame Time: 1\n");
    text += &"0\n".repeat(frames);
    parse(&text).unwrap()
}

#[test]
fn joints_without_channels_take_limited_memory() {
    let options = BvhOptions::default();
    let file = long(crate::bvh::MAX_JOINTS, crate::bvh::MAX_FRAMES);
    assert_eq!(
        file.to_clip(&options),
        Err(SkeletonError::TooManyJoints(crate::bvh::MAX_JOINTS).into())
    );
    // As many joints as a skeleton may have, but too many frames of them.
    let (joints, frames) = (MAX_JOINTS, MAX_ROTATIONS / MAX_JOINTS + 1);
    let too_long = ConvertError::TooLong { frames, joints };
    let file = long(joints, frames);
    assert_eq!(file.to_clip(&options), Err(too_long.clone()));
    assert_eq!(
        too_long.to_string(),
        "131073 frames of 512 joints are too many: at most 131072 frames of so many joints are converted"
    );
    // Onto a small skeleton too: all of the file's joints are played.
    let one = vec![Joint {
        name: "j0".to_owned(),
        parent: None,
        offset_m: Vec3::ZERO,
    }];
    let skeleton = Arc::new(Skeleton::new(one, Vec3::X, 0.0, None).unwrap());
    assert_eq!(file.to_clip_on(&skeleton, &options), Err(too_long));
    // The longest possible file, of few joints, is within the limit.
    let file = long(1, crate::bvh::MAX_FRAMES);
    let clip = file.to_clip_on(&skeleton, &options).unwrap();
    assert_eq!(clip.frames(), crate::bvh::MAX_FRAMES);
}

#[test]
fn rates_near_whole_numbers_are_whole() {
    let fps = |time: &str| parse(&SMALL.replace("0.0333333", time)).unwrap().fps();
    assert_eq!(fps("0.033333"), 30.0);
    assert_eq!(fps("0.008333"), 120.0);
    assert_eq!(fps("0.016667"), 60.0);
    assert!(
        (fps("0.0333667") - 29.97).abs() < 1e-3,
        "television's rate is not whole"
    );
    assert_eq!(fps("4"), 0.25);
}

#[test]
fn a_walk_goes_through_a_file_unchanged() {
    let clip = walk(40);
    for order in [EulerOrder::ZXY, EulerOrder::XYZ] {
        let file = BvhFile::from_clip(
            &clip,
            &BvhWriteOptions {
                order,
                ..Default::default()
            },
        )
        .unwrap();
        let back = parse(&write(&file)).unwrap();
        let same = back.to_clip_on(&clip.skeleton, &BvhOptions::default()).unwrap();
        let (a, b) = (WorldMotion::from_clip(&clip), WorldMotion::from_clip(&same));
        assert!(
            a.positions
                .iter()
                .zip(&b.positions)
                .all(|(a, b)| a.abs_diff_eq(*b, 1e-5))
        );
        let own = back.to_clip(&BvhOptions::default()).unwrap();
        assert_eq!(
            own.skeleton.joint_count(),
            clip.skeleton.joint_count(),
            "the root is not folded"
        );
        assert!(own.skeleton.left_axis.abs_diff_eq(Vec3::X, 1e-6));
    }
}

/// Any angle, and angles at or near quarter turns.
fn angle() -> impl Strategy<Value = f32> {
    let near = prop_oneof![Just(0.0f32), -1e-4f32..1e-4];
    let quarters = (-3i32..=3, near).prop_map(|(q, near)| q as f32 * std::f32::consts::FRAC_PI_2 + near);
    prop_oneof![quarters, -4.0f32..4.0]
}

proptest! {
    #[test]
    fn rotations_survive_every_order_of_axes(turns in prop::collection::vec((angle(), angle(), angle()), 8)) {
        let skeleton = biped();
        let rotations: Vec<Quat> = turns.iter().map(|&(z, x, y)| {
            (Quat::from_rotation_z(z) * Quat::from_rotation_x(x) * Quat::from_rotation_y(y)).normalize()
        }).collect();
        let clip = Clip::new(skeleton, 30.0, vec![Vec3::new(1.0, 2.0, -3.0)], rotations).unwrap();
        for order in [EulerOrder::XYZ, EulerOrder::XZY, EulerOrder::YXZ, EulerOrder::YZX, EulerOrder::ZXY, EulerOrder::ZYX] {
            let file = BvhFile::from_clip(&clip, &BvhWriteOptions { order, ..Default::default() }).unwrap();
            let back = parse(&write(&file)).unwrap().to_clip_on(&clip.skeleton, &BvhOptions::default()).unwrap();
            prop_assert!(back.root_positions[0].abs_diff_eq(clip.root_positions[0], 1e-6));
            for (a, b) in clip.rotations.iter().zip(&back.rotations) {
                prop_assert!(angle_between(*a, *b) < 1e-5, "{:?}: {} for {}", order, b, a);
            }
        }
    }
}
