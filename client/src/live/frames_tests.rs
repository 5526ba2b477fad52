//! Decoding of frame blocks.

use proptest::prelude::*;
use troupe_motion::codec::{MAX_ROTATION_ERROR_RAD, write_roots, write_rotations};
use troupe_motion::rotation::{angle_between, to_wxyz};
use troupe_motion::skeleton::Joint;

use super::*;
use crate::error::AnswerError;
use crate::live::Encoding;
use crate::pack::Pack;

const JOINTS: usize = 3;

/// Two characters in slots 4 and 1, two frames each, with numbers that follow from their index.
fn parts() -> (Vec<Vec3>, Vec<Quat>) {
    let roots = (0..4)
        .map(|i| Vec3::new(i as f32, 0.9, -0.5 * i as f32))
        .collect();
    let turn = |i: usize| Quat::from_rotation_y(0.1 * i as f32) * Quat::from_rotation_x(0.3);
    (roots, (0..4 * JOINTS).map(turn).collect())
}

fn message(encoding: Encoding) -> v1::FrameBlock {
    let (roots, rotations) = parts();
    let mut block = v1::FrameBlock {
        pack: "human".to_owned(),
        slots: vec![4, 1],
        frame_count: 2,
        first_frames: vec![30, 60],
        contacts: vec![0b01, 0b10, 0b11, 0b00],
        ..v1::FrameBlock::default()
    };
    match encoding {
        Encoding::F32 => {
            block.root_positions = roots.iter().flat_map(|r| r.to_array()).collect();
            block.rotations = rotations.iter().flat_map(|&q| to_wxyz(q)).collect();
        }
        Encoding::Qpos => unreachable!("a robot's: see hopper"),
        Encoding::Compact => {
            write_roots(&roots, &mut block.packed_roots);
            write_rotations(&rotations, &mut block.packed_rotations);
        }
    }
    block
}

/// A skeleton whose joints are a chain.
fn chain(joints: usize) -> Skeleton {
    let joint = |nth: usize| Joint {
        name: format!("joint {nth}"),
        parent: nth.checked_sub(1),
        offset_m: Vec3::Y,
    };
    Skeleton::new((0..joints).map(joint).collect(), Vec3::X, 0.0, None).unwrap()
}

fn native(_: u32) -> Convention {
    Convention::Native
}

fn read(message: v1::FrameBlock) -> Result<Block, AnswerError> {
    let mut block = Block::default();
    block.read(message, &chain(JOINTS), native).map(|()| block)
}

#[test]
fn floats_come_as_they_were_sent() {
    let (roots, rotations) = parts();
    let mut sent = message(Encoding::F32);
    sent.positions = (0..4 * JOINTS * 3).map(|i| i as f32).collect();
    let block = read(sent).unwrap();
    assert_eq!(block.slots(), [4, 1]);
    let second = block.frames(1);
    assert_eq!((second.first_frame(), second.len()), (60, 2));
    let frame = second.get(1).unwrap();
    assert_eq!(frame.root, roots[3]);
    assert_eq!(frame.rotations, &rotations[3 * JOINTS..]);
    assert_eq!(frame.positions[0], Vec3::new(27.0, 28.0, 29.0));
    assert!(!frame.contacts.is_down(0) && second.get(0).unwrap().contacts.is_down(1));
    assert_eq!(second.last(), Some(frame));
    assert_eq!(second.iter().collect::<Vec<_>>()[1], frame);
    assert_eq!(second.get(2), None);
    assert!(block.frames(2).is_empty());
}

#[test]
fn compact_frames_are_close_and_in_the_characters_unit() {
    let (roots, rotations) = parts();
    let mut block = Block::default();
    // Slot 1 is in centimetres.
    let convention = |slot| match slot {
        1 => Convention::Unreal,
        _ => Convention::Native,
    };
    block
        .read(message(Encoding::Compact), &chain(JOINTS), convention)
        .unwrap();
    for (place, scale) in [(0, 1.0), (1, 100.0)] {
        for (i, frame) in block.frames(place).iter().enumerate() {
            let nth = place * 2 + i;
            assert!(frame.root.abs_diff_eq(roots[nth] * scale, 1e-4 * scale));
            for (q, want) in frame.rotations.iter().zip(&rotations[nth * JOINTS..]) {
                assert!(angle_between(*q, *want) < 2.0 * MAX_ROTATION_ERROR_RAD + 1e-3);
            }
            assert!(frame.positions.is_empty());
        }
    }
}

/// Two frames of a robot of one hinge, in slots 0 and 3.
fn hopper() -> (Pack, v1::FrameBlock) {
    let pack = Pack::try_from(crate::pack::tests::robot_message()).unwrap();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let block = v1::FrameBlock {
        slots: vec![0, 3],
        frame_count: 1,
        first_frames: vec![9, 9],
        contacts: vec![1, 0],
        // Two metres ahead, one to the left; turned to the left by a quarter; the foot at 0.4 rad.
        qpos: [2.0, 1.0, 0.9, half, 0.0, 0.0, half, 0.4].repeat(2),
        hinge_residuals: vec![0.02, 0.0],
        clamped_hinges: vec![1, 0],
        hinge_speed_ratios: vec![0.5, 1.5],
        fastest_hinges: vec![0, 0],
        hinge_accelerations: vec![20.0, 70.0],
        ..v1::FrameBlock::default()
    };
    (pack, block)
}

#[test]
fn qpos_is_read_as_poses_in_the_characters_convention() {
    let (pack, message) = hopper();
    let mut block = Block::default();
    let convention = |slot| match slot {
        3 => Convention::Unreal,
        _ => Convention::Native,
    };
    block.read(message, pack.skeleton(), convention).unwrap();
    for (place, of) in [(0, Convention::Native), (1, Convention::Unreal)] {
        let frames = block.frames(place);
        let frame = frames.get(0).unwrap();
        assert_eq!(Some(frame), frames.iter().next());
        assert_eq!((frame.qpos.len(), frame.qpos[7]), (8, 0.4));
        let root = frame.native_root(pack.skeleton(), of);
        assert!(
            root.position.abs_diff_eq(Vec3::new(1.0, 0.9, 2.0), 1e-5),
            "{root:?}"
        );
        assert!((root.heading - std::f32::consts::FRAC_PI_2).abs() < 1e-5);
        let foot = of.rotation_to_native(frame.rotations[1]);
        assert!(angle_between(foot, Quat::from_rotation_x(0.4)) < 1e-5);
    }
    assert_eq!(block.frames(0).hinge_residuals(), [0.02]);
    assert_eq!(block.frames(1).clamped_hinges(), [0]);
    assert_eq!(block.frames(1).hinge_speed_ratios(), [1.5]);
    assert_eq!(block.frames(0).hinge_accelerations(), [20.0]);
    assert_eq!(block.frames(0).fastest_hinges(), [0]);
    // Frames in another encoding clear it.
    let mut plain = hopper().1;
    (plain.qpos, plain.hinge_residuals, plain.clamped_hinges) = Default::default();
    (
        plain.hinge_speed_ratios,
        plain.fastest_hinges,
        plain.hinge_accelerations,
    ) = Default::default();
    plain.root_positions = vec![0.0; 6];
    plain.rotations = [1.0, 0.0, 0.0, 0.0].repeat(4);
    block.read(plain, pack.skeleton(), convention).unwrap();
    let frames = block.frames(1);
    assert!(frames.get(0).unwrap().qpos.is_empty() && frames.hinge_residuals().is_empty());
    assert!(frames.hinge_speed_ratios().is_empty());
    let mut short = hopper().1;
    short.qpos.pop();
    let error = block.read(short, pack.skeleton(), convention).unwrap_err();
    assert!(
        matches!(
            error,
            AnswerError::Length {
                field: "qpos",
                expected: 16,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn a_block_is_read_over_the_last_one() {
    let mut block = Block::default();
    let mut with_positions = message(Encoding::F32);
    with_positions.positions = vec![0.0; 4 * JOINTS * 3];
    let skeleton = chain(JOINTS);
    block.read(with_positions, &skeleton, native).unwrap();
    block.read(message(Encoding::Compact), &skeleton, native).unwrap();
    assert_eq!(block.frames(0).len(), 2);
    assert!(block.frames(0).get(0).unwrap().positions.is_empty());
    // A block that cannot be read clears it.
    let mut broken = message(Encoding::F32);
    broken.contacts.pop();
    assert!(block.read(broken, &skeleton, native).is_err());
    assert!(block.frames(0).is_empty());
}

#[test]
fn a_column_of_the_wrong_length_is_named() {
    type Break = fn(&mut v1::FrameBlock);
    let broken: [(&str, Encoding, Break); 12] = [
        ("first_frames", Encoding::F32, |b| b.first_frames.truncate(1)),
        ("root_positions", Encoding::F32, |b| b.root_positions.push(0.0)),
        ("rotations", Encoding::F32, |b| b.rotations.truncate(40)),
        ("contacts", Encoding::F32, |b| b.contacts.push(0)),
        ("positions", Encoding::F32, |b| b.positions.push(0.0)),
        ("root_positions", Encoding::F32, |b| b.frame_count = 3),
        ("packed_roots", Encoding::Compact, |b| b.packed_roots.truncate(47)),
        ("packed_rotations", Encoding::Compact, |b| {
            b.packed_rotations.clear()
        }),
        ("rotations", Encoding::Compact, |b| b.rotations.push(1.0)),
        // Floats, and a robot's numbers for a skeleton that is no robot's.
        ("root_positions", Encoding::F32, |b| b.qpos.push(1.0)),
        ("clamped_hinges", Encoding::F32, |b| b.clamped_hinges.push(1)),
        ("fastest_hinges", Encoding::F32, |b| b.fastest_hinges.push(1)),
    ];
    for (name, encoding, break_it) in broken {
        let mut block = message(encoding);
        break_it(&mut block);
        let error = read(block).unwrap_err();
        assert!(
            matches!(&error, AnswerError::Length { field, .. } if *field == name),
            "{name}: {error}"
        );
    }
}

#[test]
fn the_native_root_is_the_same_in_every_convention() {
    let skeleton = Pack::try_from(crate::pack::tests::message())
        .unwrap()
        .skeleton()
        .clone();
    let (place, turn) = (Vec3::new(1.0, 0.9, -2.0), Quat::from_rotation_y(0.7));
    for convention in Convention::ALL {
        let frame = Frame {
            root: convention.position_from_native(place),
            rotations: &[convention.rotation_from_native(turn), Quat::IDENTITY],
            contacts: Contacts::default(),
            positions: &[],
            qpos: &[],
        };
        let root = frame.native_root(&skeleton, convention);
        assert!(root.position.abs_diff_eq(place, 1e-5) && (root.heading - 0.7).abs() < 1e-5);
    }
}

proptest! {
    /// Any bytes of a server are read or refused.
    #[test]
    fn any_lengths_are_read_or_refused(
        slots in 0usize..3,
        frames in 0u32..4,
        floats in 0usize..80,
        bytes in 0usize..80,
        joints in 1usize..4,
    ) {
        let block = v1::FrameBlock {
            slots: vec![0; slots],
            frame_count: frames,
            first_frames: vec![0; slots],
            root_positions: vec![0.5; slots * frames as usize * 3],
            rotations: vec![0.5; floats],
            packed_roots: vec![1; bytes],
            packed_rotations: vec![1; bytes / 2],
            contacts: vec![0; slots * frames as usize],
            ..v1::FrameBlock::default()
        };
        let mut out = Block::default();
        if out.read(block, &chain(joints), native).is_ok() {
            for place in 0..=slots {
                let read = out.frames(place);
                prop_assert!(read.iter().all(|frame| frame.rotations.len() == joints));
            }
        }
    }
}
