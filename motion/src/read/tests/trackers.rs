//! BeyondMimic's arrays as others write them.

use super::robots::{on_g1, same, topics, walk, with};
use crate::clip::Clip;
use crate::files::npz::Archive;
use crate::read::{Options, Topic};
use crate::robot::reference;

/// BeyondMimic's arrays: the rate that is written, and whether quaternions are x y z w, bodies are
/// in the other direction, and named.
fn beyond(clip: &Clip, fps: Option<f32>, is_xyzw: bool, is_turned: bool, is_named: bool) -> Vec<u8> {
    let reference = reference(clip).unwrap();
    let (frames, bodies) = (reference.frames, reference.body_names.len());
    let blocks = |numbers: &[f32], width: usize| -> Vec<f32> {
        let frames = numbers.chunks_exact(width * bodies);
        let frame = |row: &[f32]| -> Vec<f32> {
            let mut blocks: Vec<Vec<f32>> = row.chunks_exact(width).map(<[f32]>::to_vec).collect();
            if is_turned {
                blocks.reverse();
            }
            if is_xyzw && width == 4 {
                blocks.iter_mut().for_each(|block| block.rotate_left(1));
            }
            blocks.concat()
        };
        frames.flat_map(frame).collect()
    };
    let mut archive = Archive::new();
    if let Some(fps) = fps {
        archive.add("fps", &[1], &[fps]).unwrap();
    }
    let hinges = reference.joint_names.len();
    archive
        .add("joint_pos", &[frames, hinges], &reference.joint_pos)
        .unwrap();
    let (places, turns) = (blocks(&reference.body_pos, 3), blocks(&reference.body_quat, 4));
    archive.add("body_pos_w", &[frames, bodies, 3], &places).unwrap();
    archive.add("body_quat_w", &[frames, bodies, 4], &turns).unwrap();
    if is_named {
        let mut names: Vec<String> = reference
            .body_names
            .iter()
            .map(|name| format!("{name}_link"))
            .collect();
        if is_turned {
            names.reverse();
        }
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        archive.add_names("body_names", &names).unwrap();
    }
    archive.finish().unwrap()
}

#[test]
fn trackers_arrays_are_checked() {
    let truth = walk(100, 50.0, 0.8);
    for (is_xyzw, is_turned, is_named) in [
        (false, false, false),
        (true, false, false),
        (false, true, true),
        (true, true, true),
    ] {
        let bytes = beyond(&truth, Some(50.0), is_xyzw, is_turned, is_named);
        let found = with("walk.npz", &bytes, &on_g1()).unwrap();
        assert!(same(&truth, &found.clip), "{is_xyzw} {is_turned}");
        assert_eq!(topics(&found).contains(&Topic::Quaternion), is_xyzw);
        assert!(found.report.oddities.is_empty(), "{:?}", found.report.oddities);
    }
    // Without names, the first body is the root.
    let bytes = beyond(&truth, Some(50.0), false, true, false);
    let found = with("walk.npz", &bytes, &on_g1()).unwrap();
    let odd = &found.report.oddities;
    assert!(
        odd.iter()
            .any(|note| note.text.contains("from the robot's links")),
        "{odd:?}"
    );
    for (fps, found) in [(None, "array \"fps\" is missing"), (Some(0.0), "fps is [0.0]")] {
        let bytes = beyond(&truth, fps, false, false, false);
        let error = with("walk.npz", &bytes, &on_g1()).unwrap_err().to_string();
        assert!(
            error.contains(found) && error.ends_with("--fps decides"),
            "{error}"
        );
        let options = Options {
            fps: Some(50.0),
            ..on_g1()
        };
        assert!(same(&truth, &with("walk.npz", &bytes, &options).unwrap().clip));
    }
}
