//! The clips of a split and the windows cut from them.

use std::collections::HashSet;
use std::path::Path;

use serde::Serialize;
use troupe_motion::clip::Clip;
use troupe_motion::metrics::Task;

use crate::cli::args::Scale;
use crate::cli::failure::Failure;
use crate::cli::files::read_clip;
use crate::cli::term::Term;
use crate::inbetween::CONTEXT_FRAMES;
use crate::pack::Pack;

/// A clip by its file's stem.
pub(super) struct NamedClip {
    pub(super) name: String,
    pub(super) clip: Clip,
}

/// A clip that could not be used.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Skipped {
    pub(super) clip: String,
    pub(super) reason: String,
}

/// One task: frames of one clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    /// Index of the clip.
    pub(super) clip: usize,
    /// First context frame.
    pub(super) start: usize,
}

/// The task of a gap: four context frames, the gap, one target keyframe.
pub(super) fn task(gap_frames: usize) -> Task {
    Task {
        context_frames: CONTEXT_FRAMES,
        gap_frames,
        target_frames: 1,
    }
}

/// Names of the clips to use, sorted: those of the split file, or every BVH file of the folder.
pub(super) fn clip_names(data: &Path, split: Option<&Path>) -> Result<Vec<String>, Failure> {
    let mut names: Vec<String> = match split {
        Some(split) => std::fs::read_to_string(split)
            .map_err(|e| Failure::file(split, e))?
            .lines()
            .map(|line| line.split('#').next().unwrap_or_default().trim())
            .filter(|line| !line.is_empty())
            .map(|line| line.strip_suffix(".bvh").unwrap_or(line).to_owned())
            .collect(),
        None => std::fs::read_dir(data)
            .map_err(|e| Failure::file(data, e))?
            .filter_map(|entry| {
                let name = entry.ok()?.file_name().into_string().ok()?;
                Some(name.strip_suffix(".bvh")?.to_owned())
            })
            .collect(),
    };
    let mut seen = HashSet::new();
    names.retain(|name| seen.insert(name.clone()));
    names.sort();
    Ok(names)
}

/// Reads clips by name onto the pack's skeleton; those that cannot be used come back with the reason.
pub(super) fn read_clips(
    data: &Path,
    names: &[String],
    pack: &Pack,
    scale: Scale,
    term: &Term,
) -> (Vec<NamedClip>, Vec<Skipped>) {
    let bar = term.bar(names.len(), "reading clips");
    let (mut clips, mut skipped) = (Vec::new(), Vec::new());
    for name in names {
        let path = data.join(format!("{name}.bvh"));
        match read_clip(&path, pack, scale, &Term::new(true)) {
            Ok(clip) => clips.push(NamedClip {
                name: name.clone(),
                clip,
            }),
            Err(why) => {
                let why = why.to_string();
                // The path in front says the name once more.
                let reason = why
                    .strip_prefix(&format!("{}: ", path.display()))
                    .unwrap_or(&why)
                    .to_owned();
                skipped.push(Skipped {
                    clip: name.clone(),
                    reason,
                });
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    (clips, skipped)
}

/// Every window of `task` that starts at a multiple of `stride`, of at most `most` windows spread evenly over all.
pub(super) fn windows(clips: &[NamedClip], task: Task, stride: usize, most: Option<usize>) -> Vec<Window> {
    let mut all = Vec::new();
    for (clip, named) in clips.iter().enumerate() {
        let starts = (0..(named.clip.frames() + 1).saturating_sub(task.frames())).step_by(stride);
        all.extend(starts.map(|start| Window { clip, start }));
    }
    match most {
        Some(most) if most < all.len() => (0..most).map(|i| all[i * all.len() / most]).collect(),
        _ => all,
    }
}

/// A number that names the same seed for the same window in every run.
pub(super) fn window_seed(seed: u64, name: &str, start: usize) -> u64 {
    // FNV-1a over name and start.
    let bytes = name.bytes().chain(start.to_le_bytes()).chain(seed.to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The clip's frames of a window.
pub(super) fn cut(clips: &[NamedClip], window: Window, task: Task) -> Result<Clip, Failure> {
    let frames = window.start..window.start + task.frames();
    clips[window.clip]
        .clip
        .slice(frames)
        .map_err(|e| Failure::Other(e.to_string()))
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::cli::testing::lone_hips;

    fn clips(frames: &[usize]) -> Vec<NamedClip> {
        let clip = |&n: &usize| NamedClip {
            name: format!("clip {n}"),
            clip: Clip::new(lone_hips(), 30.0, vec![Vec3::ZERO; n], vec![Quat::IDENTITY; n]).unwrap(),
        };
        frames.iter().map(clip).collect()
    }

    #[test]
    fn windows_lie_inside_their_clips() {
        // 15 + 5 frames a window: none in 19 frames, one in 20, two in 30 and 39, three in 40.
        let clips = clips(&[19, 20, 30, 39, 40]);
        let windows = windows(&clips, task(15), 10, None);
        let counts = (0..5)
            .map(|i| windows.iter().filter(|w| w.clip == i).count())
            .collect::<Vec<_>>();
        assert_eq!(counts, [0, 1, 2, 2, 3]);
        assert!(
            windows
                .iter()
                .all(|&w| cut(&clips, w, task(15)).unwrap().frames() == 20)
        );
    }

    #[test]
    fn fewer_windows_are_spread_over_all_clips() {
        let clips = clips(&[120, 120, 120]);
        let few = windows(&clips, task(15), 10, Some(6));
        assert_eq!(few.iter().map(|w| w.clip).collect::<Vec<_>>(), [0, 0, 1, 1, 2, 2]);
        assert_eq!(windows(&clips, task(15), 10, Some(1000)).len(), 33);
    }

    #[test]
    fn a_split_file_may_have_comments_endings_and_repeats() {
        let folder = std::env::temp_dir().join(format!("troupe-split-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let split = folder.join("split.txt");
        std::fs::write(&split, "# held out\nwalk_2.bvh\r\n\nwalk_1  # good\nwalk_2\n").unwrap();
        let names = clip_names(&folder, Some(&split)).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(names, ["walk_1", "walk_2"]);
        assert!(matches!(clip_names(&folder, None), Err(Failure::Input(_))));
    }

    #[test]
    fn seeds_differ_between_windows_and_hold_between_runs() {
        assert_eq!(window_seed(1, "walk", 30), window_seed(1, "walk", 30));
        let others = [
            window_seed(2, "walk", 30),
            window_seed(1, "run", 30),
            window_seed(1, "walk", 60),
        ];
        assert!(others.iter().all(|&seed| seed != window_seed(1, "walk", 30)));
    }
}
