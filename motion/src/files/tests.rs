//! Writes and reads files of every format.

use std::collections::HashMap;
use std::io::{Cursor, Read as _, Write as _};
use std::sync::Arc;

use glam::{Quat, Vec3};
use npyz::NpyFile;
use proptest::prelude::*;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::*;
use crate::bvh::{BvhFile, BvhWriteOptions, write};
use crate::clip::Clip;
use crate::fk::WorldMotion;
use crate::glb::write_glb;
use crate::read::{Options, ReadError, Source, read};
use crate::robot::testing::g1;
use crate::robot::write_csv;
use crate::rotation::angle_between;
use crate::skeleton::Skeleton;
use crate::testing::{biped, stand, walk};

/// Bytes of all arrays of an archive.
fn arrays(bytes: &[u8]) -> HashMap<String, Vec<u8>> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut all = HashMap::new();
    for nth in 0..archive.len() {
        let mut entry = archive.by_index(nth).unwrap();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        all.insert(entry.name().unwrap().into_owned(), bytes);
    }
    all
}

fn archive(arrays: &HashMap<String, Vec<u8>>, method: CompressionMethod) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in arrays {
        let options = SimpleFileOptions::default().compression_method(method);
        writer.start_file(name.as_str(), options).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

fn shape(bytes: &[u8]) -> Vec<u64> {
    NpyFile::new(bytes).unwrap().shape().to_vec()
}

/// Reads a file onto a skeleton.
fn read_on(name: &str, bytes: &[u8], skeleton: &Arc<Skeleton>) -> Result<Clip, ReadError> {
    let options = Options {
        skeleton: Some(Arc::clone(skeleton)),
        ..Options::default()
    };
    Ok(read(&Source::new(name, bytes), &options)?.clip)
}

fn read_npz(bytes: &[u8], skeleton: &Arc<Skeleton>) -> Result<Clip, ReadError> {
    read_on("clip.npz", bytes, skeleton)
}

fn same(a: &Clip, b: &Clip, tolerance: f32) {
    assert_eq!((a.frames(), a.fps), (b.frames(), b.fps));
    for (a, b) in a.root_positions.iter().zip(&b.root_positions) {
        assert!(a.abs_diff_eq(*b, tolerance), "{a} {b}");
    }
    for (a, b) in a.rotations.iter().zip(&b.rotations) {
        assert!(angle_between(*a, *b) < tolerance, "{a} {b}");
    }
}

#[test]
fn arrays_follow_the_documented_format() {
    let clip = walk(9);
    let unpacked = |clip: &Clip| arrays(&write_npz(clip).unwrap());
    let arrays = unpacked(&clip);
    let text = |name: &str| {
        NpyFile::new(&arrays[name][..])
            .unwrap()
            .into_vec::<String>()
            .unwrap()
    };
    let floats = |name: &str| {
        NpyFile::new(&arrays[name][..])
            .unwrap()
            .into_vec::<f32>()
            .unwrap()
    };
    for (name, wanted) in [
        ("positions.npy", &[9, 8, 3][..]),
        ("quaternions.npy", &[9, 8, 4]),
        ("root.npy", &[9, 3]),
        ("fps.npy", &[]),
        ("joint_names.npy", &[8]),
        ("parents.npy", &[8]),
        ("offsets.npy", &[8, 3]),
        ("contacts.npy", &[9, 4]),
        ("contact_joints.npy", &[4]),
    ] {
        assert_eq!(shape(&arrays[name]), wanted, "{name}");
    }
    assert_eq!(arrays.len(), 9, "a clip of no robot has no qpos");
    assert_eq!(floats("fps.npy"), [30.0]);
    let names: Vec<&str> = clip.skeleton.joints.iter().map(|joint| &*joint.name).collect();
    assert_eq!(text("joint_names.npy"), names);
    assert_eq!(
        text("contact_joints.npy"),
        ["Foot_L", "Toes_L", "Foot_R", "Toes_R"]
    );
    let parents = NpyFile::new(&arrays["parents.npy"][..])
        .unwrap()
        .into_vec::<i32>()
        .unwrap();
    assert_eq!(parents, [-1, 0, 0, 2, 3, 0, 5, 6]);
    let world = WorldMotion::from_clip(&clip);
    let flat: Vec<f32> = world.positions.iter().flat_map(|p| p.to_array()).collect();
    assert_eq!(floats("positions.npy"), flat);
    let first = &floats("quaternions.npy")[..4];
    let q = clip.rotations[0];
    assert_eq!(first, [q.w, q.x, q.y, q.z]);
    let standing = unpacked(&stand(2));
    let touch = NpyFile::new(&standing["contacts.npy"][..])
        .unwrap()
        .into_vec::<bool>()
        .unwrap();
    assert_eq!(touch, [true; 8]);
}

#[test]
fn an_archive_comes_back_packed_or_not() {
    let clip = walk(12);
    let bytes = write_npz(&clip).unwrap();
    assert_eq!(
        bytes,
        write_npz(&clip).unwrap(),
        "the same clip gives the same bytes"
    );
    let packed = archive(&arrays(&bytes), CompressionMethod::Deflated);
    assert!(packed.len() < bytes.len());
    for bytes in [bytes, packed] {
        same(&read_npz(&bytes, &biped()).unwrap(), &clip, 1e-6);
    }
}

#[test]
fn a_wrong_array_is_named() {
    let good = arrays(&write_npz(&walk(3)).unwrap());
    let with = |name: &str, bytes: Option<Vec<u8>>| {
        let mut all = good.clone();
        match bytes {
            Some(bytes) => all.insert(format!("{name}.npy"), bytes),
            None => all.remove(&format!("{name}.npy")),
        };
        let bytes = archive(&all, CompressionMethod::Stored);
        read_npz(&bytes, &biped()).unwrap_err().to_string()
    };
    let mut cut = good["root.npy"].clone();
    cut.pop();
    let other = arrays(&write_npz(&walk(4)).unwrap());
    let mut long = good["quaternions.npy"].clone();
    let end = long.len();
    long[end - 16..end - 12].copy_from_slice(&9.0_f32.to_le_bytes());
    for (name, bytes, expected) in [
        ("fps", None, "array \"fps\""),
        ("fps", Some(good["root.npy"].clone()), "one number"),
        ("root", Some(cut), "array \"root\""),
        (
            "root",
            Some(good["positions.npy"].clone()),
            "shape [3, 8, 3]; it must be frames, 3",
        ),
        ("root", Some(good["joint_names.npy"].clone()), "must be float32"),
        (
            "quaternions",
            Some(other["quaternions.npy"].clone()),
            "4 frames, but root has 3",
        ),
        (
            "quaternions",
            Some(long),
            "frame 2, joint \"Toes_R\": no unit length",
        ),
        ("joint_names", Some(b"no numpy".to_vec()), "array \"joint_names\""),
    ] {
        let error = with(name, bytes);
        assert!(error.contains(expected), "{name}: {error}");
    }
    let error = read_npz(b"PK\x03\x04", &biped()).unwrap_err().to_string();
    assert!(error.contains("no .npz archive"), "{error}");
}

#[test]
fn a_robots_qpos_comes_back() {
    let skeleton = g1();
    let robot = skeleton.robot.as_ref().unwrap();
    let row = [2.0, 1.0, 0.9, 1.0, 0.0, 0.0, 0.0];
    let mut rows = Vec::new();
    for frame in 0..5 {
        rows.extend(row);
        rows.extend(
            robot
                .hinges()
                .iter()
                .map(|hinge| hinge.limited(0.1 * frame as f32)),
        );
    }
    let mut bytes = Vec::new();
    npz::write_array(&mut bytes, &[5, robot.qpos_len()], &rows).unwrap();
    let clip = read_on("clip.npy", &bytes, &skeleton).unwrap();
    assert_eq!((clip.frames(), clip.fps), (5, DEFAULT_FPS));
    assert!(
        clip.root_positions[0].abs_diff_eq(Vec3::new(1.0, 0.9, 2.0), 1e-6),
        "ROS to native axes"
    );
    let written = NpyFile::new(&write_qpos(&clip).unwrap()[..])
        .unwrap()
        .into_vec::<f32>()
        .unwrap();
    for (nth, (a, b)) in written.iter().zip(&rows).enumerate() {
        assert!((a - b).abs() < 1e-5, "number {nth}: {a} {b}");
    }
    let in_archive = arrays(&write_npz(&clip).unwrap());
    assert_eq!(shape(&in_archive["qpos.npy"]), [5, robot.qpos_len() as u64]);
    let error = read_on("clip.npy", &bytes, &biped()).unwrap_err().to_string();
    assert!(error.contains("angles of a robot's hinges"), "{error}");
    assert!(matches!(write_qpos(&walk(2)), Err(NumpyError::NoRobot)));
    rows[3] = 2.0;
    let mut bytes = Vec::new();
    npz::write_array(&mut bytes, &[5, robot.qpos_len()], &rows).unwrap();
    let error = read_on("clip.npy", &bytes, &skeleton).unwrap_err().to_string();
    assert!(
        error.contains("frame 0: the length of the root's quaternion is 2"),
        "{error}"
    );
}

#[test]
fn every_format_reads_what_its_writer_wrote() {
    let clip = walk(20);
    let robot = Clip::new(
        g1(),
        30.0,
        vec![Vec3::Y; 4],
        vec![Quat::IDENTITY; 4 * g1().joint_count()],
    );
    let robot = read_on("clip.npy", &write_qpos(&robot.unwrap()).unwrap(), &g1()).unwrap();
    let bvh = write(&BvhFile::from_clip(&clip, &BvhWriteOptions::default()).unwrap()).into_bytes();
    for (format, clip, bytes) in [
        (Format::Bvh, &clip, bvh),
        (Format::Glb, &clip, write_glb(&clip).unwrap()),
        (Format::Npz, &clip, write_npz(&clip).unwrap()),
        (Format::Csv, &robot, write_csv(&robot).unwrap().into_bytes()),
        (Format::Npy, &robot, write_qpos(&robot).unwrap()),
    ] {
        // The content decides about the format if it can, whatever the ending.
        let endings = [format.ending(), if format == Format::Csv { "CSV" } else { "dat" }];
        for ending in endings {
            let read = read_on(&format!("clip.{ending}"), &bytes, &clip.skeleton).unwrap();
            same(&read, clip, 1e-4);
        }
    }
}

#[test]
fn files_that_are_not_clips_are_errors() {
    for (name, bytes, expected) in [
        ("a.xyz", &b"1,2"[..], "neither its ending nor its content"),
        ("a.bvh", b"HIERARCHY ROOT", "line 1"),
        ("a.glb", b"{}", "no glTF: missing field `asset`"),
        ("a.glb", b"glTF\x02\0\0\0", "no glTF"),
        ("a.csv", b"1,\xff", "robot's"),
        ("a.csv", b"1,2", "robot's"),
        ("a.npy", b"1,2", "robot's"),
        ("a.npz", b"1,2", "no .npz archive"),
    ] {
        let error = read_on(name, bytes, &biped()).unwrap_err().to_string();
        assert!(error.contains(expected), "{name}: {error}");
    }
}

proptest! {
    /// Shape, type and numbers of any array are restored from its header and bytes.
    #[test]
    fn any_array_comes_back(shape in proptest::collection::vec(0_usize..5, 0..4), seed in any::<u32>()) {
        let count: usize = shape.iter().product();
        let values: Vec<f32> = (0..count).map(|n| f32::from_bits(seed.wrapping_mul(n as u32 + 1) & 0x7f7f_ffff)).collect();
        let mut bytes = Vec::new();
        npz::write_array(&mut bytes, &shape, &values).unwrap();
        prop_assert_eq!(bytes.len() % 4, 0);
        let file = NpyFile::new(&bytes[..]).unwrap();
        let wanted: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
        prop_assert_eq!(file.shape(), &wanted[..]);
        prop_assert_eq!(file.order(), npyz::Order::C);
        prop_assert_eq!(file.into_vec::<f32>().unwrap(), values.clone());
        prop_assert_eq!(npz::read_array(&bytes).unwrap(), (wanted, values));
    }

    /// Names with any letters are restored from an archive, and joints are matched by them.
    #[test]
    fn any_names_come_back(names in proptest::collection::hash_set("[A-Za-z0-9_é骨😀. -]{1,12}", 1..6)) {
        // NumPy pads text with zeros and removes only those.
        let joints = names.iter().enumerate().map(|(nth, name)| crate::Joint {
            name: name.clone(),
            parent: nth.checked_sub(1),
            offset_m: Vec3::Y,
        });
        let skeleton = Arc::new(Skeleton::new(joints.collect(), Vec3::X, 0.0, None).unwrap());
        let clip = Clip::new(Arc::clone(&skeleton), 60.0, vec![Vec3::Z], vec![Quat::IDENTITY; names.len()]).unwrap();
        same(&read_npz(&write_npz(&clip).unwrap(), &skeleton).unwrap(), &clip, 1e-6);
    }

    /// Bytes that are not an archive, or a broken one, give an error and never panic.
    #[test]
    fn broken_bytes_never_panic(at in 0_usize..4000, with in any::<u8>(), cut in 0_usize..4000) {
        let clip = walk(2);
        for (name, mut bytes) in [
            ("clip.npz", write_npz(&clip).unwrap()),
            ("clip.glb", write_glb(&clip).unwrap()),
        ] {
            let length = bytes.len();
            bytes[at % length] = with;
            let _ = read_on(name, &bytes, &biped());
            bytes.truncate(cut % length);
            prop_assert!(read_on(name, &bytes, &biped()).is_err());
        }
    }
}

#[test]
fn arrays_in_fortrans_order_are_read() {
    use npyz::WriterBuilder as _;
    let shape = [2_u64, 3, 4];
    let number = |[i, j, k]: [u64; 3]| (100 * i + 10 * j + k) as f32;
    let mut bytes = Vec::new();
    let mut writer = npyz::WriteOptions::new()
        .default_dtype()
        .order(npyz::Order::Fortran)
        .shape(&shape)
        .writer(&mut bytes)
        .begin_nd()
        .unwrap();
    for at in 0..24 {
        writer.push(&number([at % 2, at / 2 % 3, at / 6])).unwrap();
    }
    writer.finish().unwrap();
    let wanted: Vec<f32> = (0..24).map(|at| number([at / 12, at / 4 % 3, at % 4])).collect();
    assert_eq!(npz::read_array(&bytes), Ok((shape.to_vec(), wanted)));
}
