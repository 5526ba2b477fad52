//! Targets of files of motion.

use std::sync::Arc;

use troupe_motion::Clip;
use troupe_motion::bvh::{self, BvhFile, BvhOptions, BvhWriteOptions};
use troupe_motion::files::{write_npz, write_qpos};
use troupe_motion::glb::{self, Beside, GlbOptions, write_glb};
use troupe_motion::read::{Options, Source, read};
use troupe_motion::robot::write_csv;

use crate::{SEPARATOR, planted, robot};

/// Rate for formats with keys, Hz. Keys far apart in time would give many frames.
const SLOW_HZ: f32 = 2.0;
/// Longer motions are valid, but slow. Frames times joints.
const MAX_ROTATIONS: usize = 10_000;

/// Reads a file onto its own skeleton and onto the robot's. An error says something. A clip is
/// finite, has a report, and survives writing as arrays and reading again.
fn understand(name: &str, bytes: &[u8], fps: Option<f32>, beside: Beside<'_>) -> Vec<Clip> {
    let source = Source { name, bytes, beside };
    let skeletons = [None, Some(robot())];
    let clips = skeletons.map(|skeleton| {
        let options = Options {
            skeleton,
            fps,
            ..Options::default()
        };
        match read(&source, &options) {
            Ok(understood) => {
                assert!(!understood.report.rows().is_empty());
                let clip = understood.clip;
                assert!(clip.root_positions.iter().all(|root| root.is_finite()));
                (clip.rotations.len() <= MAX_ROTATIONS).then_some(clip)
            }
            Err(error) => {
                assert!(!error.to_string().is_empty());
                None
            }
        }
    });
    let clips: Vec<Clip> = clips.into_iter().flatten().collect();
    for clip in &clips {
        let written = write_npz(clip).expect("a short clip");
        let again = read_again("again.npz", &written, clip);
        assert_eq!(again.frames(), clip.frames());
    }
    clips
}

/// Reads what was written of a clip onto the clip's own skeleton.
fn read_again(name: &str, written: &[u8], clip: &Clip) -> Clip {
    let options = Options {
        skeleton: Some(Arc::clone(&clip.skeleton)),
        ..Options::default()
    };
    let understood = read(&Source::new(name, written), &options);
    understood.expect("what was written is read").clip
}

/// The bug of targets of clips.
fn planted_clips(clips: &[Clip]) {
    for clip in clips {
        let above = |height| clip.root_positions.iter().any(|root| root.y > height);
        planted(|| [clip.frames() > 1, above(10.0), above(100.0)]);
    }
}

/// A BVH file. An accepted file survives writing and reading again, and conversion to a clip and
/// back.
pub fn bvh(bytes: &[u8]) {
    understand("walk.bvh", bytes, None, &|_| None);
    let Ok(file) = bvh::parse_bytes(bytes) else { return };
    // Numbers are written with six decimals, so only the structure must be the same.
    let again = bvh::parse(&bvh::write(&file)).expect("what was written is read");
    assert_eq!(again.frames(), file.frames());
    assert_eq!(again.joints().len(), file.joints().len());
    let mut pairs = again.joints().iter().zip(file.joints());
    assert!(pairs.all(|(a, b)| a.name == b.name && a.parent == b.parent));
    if let Ok(clip) = file.to_clip(&BvhOptions::default())
        && let Ok(written) = BvhFile::from_clip(&clip, &BvhWriteOptions::default())
    {
        bvh::parse(&bvh::write(&written)).expect("a clip's file is read");
        planted(|| [file.joints().len() == 2, file.frame_time_s() < 0.02]);
    }
}

/// Motion of a robot, as CSV. An accepted clip survives writing and reading again.
pub fn csv(bytes: &[u8]) {
    let clips = understand("walk.csv", bytes, None, &|_| None);
    for clip in &clips {
        let written = write_csv(clip).expect("a robot's clip");
        assert_eq!(
            read_again("again.csv", written.as_bytes(), clip).frames(),
            clip.frames()
        );
    }
    planted_clips(&clips);
}

/// FBX, binary or as text, which a library in C reads.
pub fn fbx(bytes: &[u8]) {
    planted_clips(&understand("walk.fbx", bytes, Some(SLOW_HZ), &|_| None));
}

/// The animation of a glb file. A clip that is made of it survives writing and reading again.
pub fn glb(bytes: &[u8]) {
    understand("walk.glb", bytes, Some(SLOW_HZ), &|_| None);
    let options = GlbOptions {
        fps: Some(SLOW_HZ),
        ..GlbOptions::default()
    };
    let animation = match glb::parse(bytes, &options) {
        Ok(animation) => animation,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    // Minutes of motion with many joints are valid, but slow.
    if animation.frames() > 1000 {
        return;
    }
    let Ok(clip) = animation.to_clip(&options) else {
        return;
    };
    let written = write_glb(&clip).expect("a short clip");
    let again = glb::parse(&written, &options).expect("what was written is read");
    assert_eq!(again.frames(), clip.frames());
    let high = clip.root_positions.iter().any(|root| root.y > 10.0);
    planted(|| [clip.frames() > 2, high]);
}

/// glTF as text. What follows the first separator are the bytes of all files beside it.
pub fn gltf(bytes: &[u8]) {
    let (text, beside) = split(bytes);
    let beside = |_: &str| Some(beside.to_vec());
    planted_clips(&understand("walk.gltf", text, Some(SLOW_HZ), &beside));
}

/// An array of a robot's `qpos`. An accepted clip survives writing and reading again.
pub fn npy(bytes: &[u8]) {
    let clips = understand("walk.npy", bytes, None, &|_| None);
    for clip in clips.iter().filter(|clip| clip.skeleton.robot.is_some()) {
        let written = write_qpos(clip).expect("a robot's clip");
        assert_eq!(read_again("again.npy", &written, clip).frames(), clip.frames());
    }
    planted_clips(&clips);
}

/// NumPy's arrays in the layouts of Troupe, AMASS, Kimodo and BeyondMimic.
pub fn npz(bytes: &[u8]) {
    planted_clips(&understand("walk.npz", bytes, None, &|_| None));
}

/// SONIC's files: angles, places and quaternions, between separators.
pub fn sonic(bytes: &[u8]) {
    let (angles, others) = split(bytes);
    let (places, turns) = split(others);
    let beside = |name: &str| match name {
        "body_pos.csv" => Some(places.to_vec()),
        "body_quat.csv" => Some(turns.to_vec()),
        _ => None,
    };
    planted_clips(&understand("joint_pos.csv", angles, None, &beside));
}

/// What stands before the first separator, and what stands after it.
fn split(bytes: &[u8]) -> (&[u8], &[u8]) {
    let at = bytes.iter().position(|&byte| byte == SEPARATOR);
    at.map_or((bytes, &[]), |at| (&bytes[..at], &bytes[at + 1..]))
}
