//! The BVH reader and writer on real clips.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use troupe_motion::bvh::{self, BvhFile, BvhOptions, BvhWriteOptions};
use troupe_motion::fk::WorldMotion;
use troupe_motion::inspect::{Limits, inspect};

use crate::{data_folder, folder_or_default};

/// The most clips that one run reads, evenly spread over the folder.
const MAX_CLIPS: usize = 150;

/// All BVH files below `folder`, by name. Empty if it is not a folder.
fn find_clips(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut clips = Vec::new();
    if !folder.is_dir() {
        return Ok(clips);
    }
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder)? {
            let entry = entry?;
            if entry.file_type()?.is_dir() {
                folders.push(entry.path());
            } else if entry
                .path()
                .extension()
                .is_some_and(|e| e.eq_ignore_ascii_case("bvh"))
            {
                clips.push(entry.path());
            }
        }
    }
    clips.sort();
    Ok(clips)
}

/// The problem of one clip, if it has one.
fn check(path: &Path) -> Result<(), String> {
    let text = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
    let file = bvh::parse(&text).map_err(|e| e.to_string())?;
    let again = bvh::parse(&bvh::write(&file)).map_err(|e| format!("written: {e}"))?;
    for f in 0..file.frames() {
        if file
            .row(f)
            .iter()
            .zip(again.row(f))
            .any(|(a, b)| (a - b).abs() > 1e-4)
        {
            return Err(format!("frame {f} changed in a round trip"));
        }
    }
    let clip = file.to_clip(&BvhOptions::default()).map_err(|e| e.to_string())?;
    // Bandai-Namco's placing root is never the pelvis, moving or not.
    let (placing, root) = (&file.joints()[0].name, &clip.skeleton.joints[0].name);
    if placing == "joint_Root" && root != "Hips" {
        return Err(format!("the root is {root}"));
    }
    if let Some(issue) = inspect(&clip, &Limits::default()).first() {
        return Err(issue.to_string());
    }
    // Written from the clip and put back onto its skeleton, every joint is in its place.
    let written = BvhFile::from_clip(&clip, &BvhWriteOptions::default()).map_err(|e| e.to_string())?;
    let skeleton = Arc::clone(&clip.skeleton);
    let back = written
        .to_clip_on(&skeleton, &BvhOptions::default())
        .map_err(|e| e.to_string())?;
    let (a, b) = (WorldMotion::from_clip(&clip), WorldMotion::from_clip(&back));
    match a
        .positions
        .iter()
        .zip(&b.positions)
        .position(|(a, b)| !a.abs_diff_eq(*b, 1e-4))
    {
        Some(at) => Err(format!("frame {} moved in a round trip", at / a.joints)),
        None => Ok(()),
    }
}

#[test]
fn clips_are_found_in_folders() {
    assert!(folder_or_default(None).ends_with("target/data/bandai-namco"));
    let folder = folder_or_default(Some("not/there".into()));
    assert_eq!(folder, Path::new("not/there"));
    assert_eq!(find_clips(&folder).unwrap(), Vec::<PathBuf>::new());
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("clips");
    let clip = folder.join("of/a/kind/Walk.BVH");
    std::fs::create_dir_all(clip.parent().unwrap()).unwrap();
    std::fs::write(&clip, "").unwrap();
    std::fs::write(folder.join("notes.txt"), "").unwrap();
    assert_eq!(find_clips(&folder).unwrap(), std::slice::from_ref(&clip));
    assert_eq!(
        find_clips(&clip).unwrap(),
        Vec::<PathBuf>::new(),
        "a file is not a folder"
    );
}

#[test]
fn real_clips_load() {
    let folder = data_folder();
    let clips = find_clips(&folder).unwrap();
    if clips.is_empty() {
        eprintln!(
            "note: real clips are not tested, there are none in {}; set TROUPE_DATA to a folder of BVH files",
            folder.display()
        );
        return;
    }
    let step = clips.len().div_ceil(MAX_CLIPS);
    let faults: Vec<String> = clips
        .iter()
        .step_by(step)
        .filter_map(|path| {
            check(path)
                .err()
                .map(|reason| format!("{}: {reason}", path.display()))
        })
        .collect();
    assert!(
        faults.is_empty(),
        "{} clips:\n{}",
        faults.len(),
        faults.join("\n")
    );
}
