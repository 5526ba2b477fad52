use std::f32::consts::FRAC_PI_2;

use troupe_motion::codec::{MAX_ROOT_ERROR_M, MAX_ROTATION_ERROR_RAD, decode_root, read_rotations};
use troupe_motion::rotation::{angle_between, from_wxyz};

use super::*;
use troupe_character::testing::toy_rig;

fn frame(number: u64, x: f32) -> FrameOut {
    FrameOut {
        frame: number,
        root: Vec3::new(x, 0.9, -1.25),
        rotations: vec![
            Quat::from_rotation_y(0.7 + x),
            Quat::from_rotation_x(0.3) * Quat::from_rotation_z(x - 0.2),
        ],
        contacts: 1,
        ..FrameOut::default()
    }
}

fn block(encoding: v1::Encoding, convention: Convention) -> v1::FrameBlock {
    let pack = toy_rig();
    let form = Form {
        encoding,
        positions: true,
        six_d: false,
    };
    let mut writer = BlockWriter::new(&pack.skeleton, form, 2, 3);
    for character in 0..2 {
        writer.name(10 + character as u32);
        for number in 0..3 {
            let out = frame(7 + number as u64, character as f32 + 0.1 * number as f32);
            writer.write((character, number), &out, convention, &pack.skeleton);
        }
    }
    writer.finish(|_| true)
}

#[test]
fn columns_hold_all_frames_of_one_character_before_the_next() {
    let block = block(v1::Encoding::F32, Convention::Native);
    assert_eq!(
        (block.slots.as_slice(), block.frame_count),
        ([10, 11].as_slice(), 3)
    );
    assert_eq!(block.first_frames, [7, 7]);
    let xs: Vec<f32> = block.root_positions.chunks(3).map(|root| root[0]).collect();
    assert_eq!(xs, [0.0, 0.1, 0.2, 1.0, 1.1, 1.2]);
    assert_eq!(block.rotations.len(), 2 * 3 * 2 * 4);
    assert_eq!(block.contacts, [1; 6]);
    assert!(block.packed_roots.is_empty() && block.packed_rotations.is_empty());
}

#[test]
fn the_compact_form_is_within_its_error_bound() {
    for convention in Convention::ALL {
        let exact = block(v1::Encoding::F32, convention);
        let compact = block(v1::Encoding::Compact, convention);
        assert!(compact.rotations.is_empty() && compact.root_positions.is_empty());
        assert_eq!(compact.packed_roots.len(), 6 * 12);
        assert_eq!(compact.packed_rotations.len(), 6 * 2 * 6);
        for (bytes, exact) in compact
            .packed_roots
            .chunks(12)
            .zip(exact.root_positions.chunks(3))
        {
            let step = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            let root = decode_root([step(0), step(4), step(8)]) * convention.units_per_metre();
            let error = (root - Vec3::from_slice(exact)).abs().max_element();
            assert!(
                error <= MAX_ROOT_ERROR_M * convention.units_per_metre(),
                "{error}"
            );
        }
        let mut rotations = Vec::new();
        read_rotations(&compact.packed_rotations, &mut rotations);
        for (rotation, exact) in rotations.iter().zip(exact.rotations.as_chunks::<4>().0) {
            assert!(angle_between(*rotation, from_wxyz(*exact)) <= MAX_ROTATION_ERROR_RAD);
        }
    }
}

#[test]
fn positions_are_the_worlds_in_the_sessions_convention() {
    let pack = toy_rig();
    let form = Form {
        encoding: v1::Encoding::F32,
        positions: true,
        six_d: true,
    };
    let mut writer = BlockWriter::new(&pack.skeleton, form, 1, 1);
    writer.name(0);
    let out = FrameOut {
        root: Vec3::new(1.0, 0.9, 2.0),
        // The foot hangs 0.8 m below the hips: a quarter turn about +Z takes it to +X.
        rotations: vec![Quat::from_rotation_z(FRAC_PI_2), Quat::IDENTITY],
        ..FrameOut::default()
    };
    writer.write((0, 0), &out, Convention::Unreal, &pack.skeleton);
    let block = writer.finish(|_| true);
    // Unreal: forward, right, up, in centimetres; native +X is left.
    for (found, wanted) in block
        .positions
        .iter()
        .zip([200.0, -100.0, 90.0, 200.0, -180.0, 90.0])
    {
        assert!((found - wanted).abs() < 1e-3, "{:?}", block.positions);
    }
    // Both joints are turned alike: forward stays, right goes down; in a left-handed frame.
    for (found, wanted) in block.six_d.iter().zip([1.0, 0.0, 0.0, 0.0, 0.0, -1.0].repeat(2)) {
        assert!((found - wanted).abs() < 1e-6, "{:?}", block.six_d);
    }
}

#[test]
fn characters_that_failed_leave_no_gap() {
    let pack = toy_rig();
    let form = Form {
        encoding: v1::Encoding::F32,
        positions: false,
        six_d: false,
    };
    let mut writer = BlockWriter::new(&pack.skeleton, form, 3, 1);
    for character in 0..3 {
        writer.name(character as u32);
        let out = frame(character as u64, character as f32);
        writer.write((character, 0), &out, Convention::Native, &pack.skeleton);
    }
    let block = writer.finish(|character| character != 1);
    assert_eq!((block.slots, block.first_frames), (vec![0, 2], vec![0, 2]));
    assert_eq!(block.root_positions, [0.0, 0.9, -1.25, 2.0, 0.9, -1.25]);
    assert_eq!((block.rotations.len(), block.contacts.len()), (16, 2));
}

#[test]
fn an_encoding_that_is_none_is_refused() {
    let error = Form::of(&Path::root(), 3, false, false).unwrap_err();
    assert_eq!(
        (error.field.as_str(), error.message.as_str()),
        ("encoding", "is 3")
    );
}
