//! The windows that are cut from clips.

use std::path::PathBuf;

use clap::Args;
use troupe_cli::{Failure, Reading, positive};
use troupe_client::{CONTEXT_FRAMES, Pack};
use troupe_motion::clip::Clip;
use troupe_motion::metrics::Task;

use crate::clips::NamedClip;

/// Which windows to cut from which clips.
#[derive(Debug, Args)]
pub(crate) struct WindowArgs {
    /// Folder of clips: .bvh, .glb or .npz, or .csv for a robot.
    #[arg(long, value_name = "DIR")]
    pub(super) data: PathBuf,

    /// File with the names of the clips to use, one a line. Default: every clip of the folder.
    #[arg(long, value_name = "FILE")]
    pub(super) split: Option<PathBuf>,

    /// Frames from the start of one window to the start of the next.
    #[arg(long, default_value_t = 30, value_name = "FRAMES", value_parser = positive)]
    pub(super) stride: usize,

    /// Most windows for each gap or kind of request, spread evenly over all.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(super) max_windows: Option<usize>,

    #[command(flatten)]
    pub(super) reading: Reading,
}

/// Frames of a piece of a clip.
const PIECE_FRAMES: usize = 300;

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

/// Every window of `task` that starts at a multiple of `stride`; if there are more than `most`,
/// that number, spread evenly over all.
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

/// The piece of a clip that each window belongs to, counted from 0 over pieces with windows.
/// Intervals are drawn over pieces. A piece is a clip, or ten seconds of a longer one. The windows
/// are in the order of their clips.
pub(super) fn pieces_of(windows: &[Window]) -> Vec<usize> {
    let piece = |window: &Window| (window.clip, window.start / PIECE_FRAMES);
    let mut count = 0;
    let counted = windows.iter().enumerate().map(|(nth, window)| {
        let new = nth > 0 && piece(&windows[nth - 1]) != piece(window);
        count += usize::from(new);
        count
    });
    counted.collect()
}

/// The seed of a window, which is the same in every run.
pub(super) fn window_seed(seed: u64, name: &str, start: usize) -> u64 {
    // FNV-1a over name and start.
    let bytes = name.bytes().chain(start.to_le_bytes()).chain(seed.to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Checks that a pack can fill gaps of these lengths.
///
/// # Errors
/// [`Failure::Input`] with the lengths that it can fill.
pub(super) fn check_gaps(gaps: &[usize], pack: &Pack) -> Result<(), Failure> {
    let given = task(0).frames();
    let (min, max) = pack.segment_frames().into_inner();
    match gaps.iter().find(|&&gap| !(min..=max).contains(&(gap + given))) {
        None => Ok(()),
        Some(gap) => Err(Failure::Input(format!(
            "--gaps: {gap} is outside what pack `{}` can fill, {} to {}",
            pack.name(),
            min.saturating_sub(given),
            max - given
        ))),
    }
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
    use crate::testing::lone_hips;

    fn clips(frames: &[usize]) -> Vec<NamedClip> {
        let clip = |&n: &usize| NamedClip {
            name: format!("clip {n}"),
            clip: Clip::new(lone_hips(), 30.0, vec![Vec3::ZERO; n], vec![Quat::IDENTITY; n]).unwrap(),
        };
        frames.iter().map(clip).collect()
    }

    #[test]
    fn windows_lie_inside_their_clips() {
        // A window has 15 + 5 frames: none fits 19 frames, one 20, two 30 and 39, three 40.
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
    fn pieces_are_clips_or_ten_seconds_of_them() {
        // Clip 1 has no window, clip 2 has four: at 0, 200, 400 and 600.
        let clips = clips(&[40, 19, 700, 20]);
        let windows = windows(&clips, task(15), 200, None);
        assert_eq!(pieces_of(&windows), [0, 1, 1, 2, 3, 4]);
        assert_eq!(pieces_of(&[]), [0; 0]);
    }

    #[test]
    fn seeds_differ_between_windows_but_not_between_runs() {
        assert_eq!(window_seed(1, "walk", 30), window_seed(1, "walk", 30));
        let others = [
            window_seed(2, "walk", 30),
            window_seed(1, "run", 30),
            window_seed(1, "walk", 60),
        ];
        assert!(others.iter().all(|&seed| seed != window_seed(1, "walk", 30)));
    }
}
