//! The windows that are cut from clips.

use troupe_client::CONTEXT_FRAMES;
use troupe_motion::clip::Clip;
use troupe_motion::metrics::Task;

use crate::eval::clips::NamedClip;
use crate::failure::Failure;

/// Frames of a piece of a clip.
const PIECE_FRAMES: usize = 300;

/// One task: frames of one clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::eval) struct Window {
    /// Index of the clip.
    pub(in crate::eval) clip: usize,
    /// First context frame.
    pub(in crate::eval) start: usize,
}

/// The task of a gap: four context frames, the gap, one target keyframe.
pub(in crate::eval) fn task(gap_frames: usize) -> Task {
    Task {
        context_frames: CONTEXT_FRAMES,
        gap_frames,
        target_frames: 1,
    }
}

/// Every window of `task` that starts at a multiple of `stride`, of at most `most` windows spread
/// evenly over all.
pub(in crate::eval) fn windows(
    clips: &[NamedClip],
    task: Task,
    stride: usize,
    most: Option<usize>,
) -> Vec<Window> {
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

/// The piece of a clip that each window is of, counted from 0 over those that have any: what
/// intervals are drawn over. A piece is a clip, or ten seconds of a longer one. The windows are in
/// the order of their clips.
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

/// A number that names the same seed for the same window in every run.
pub(in crate::eval) fn window_seed(seed: u64, name: &str, start: usize) -> u64 {
    // FNV-1a over name and start.
    let bytes = name.bytes().chain(start.to_le_bytes()).chain(seed.to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The clip's frames of a window.
pub(in crate::eval) fn cut(clips: &[NamedClip], window: Window, task: Task) -> Result<Clip, Failure> {
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
    fn pieces_are_clips_or_ten_seconds_of_them() {
        // Clip 1 has no window, and clip 2 those at 0, 200, 400 and 600.
        let clips = clips(&[40, 19, 700, 20]);
        let windows = windows(&clips, task(15), 200, None);
        assert_eq!(pieces_of(&windows), [0, 1, 1, 2, 3, 4]);
        assert_eq!(pieces_of(&[]), [0; 0]);
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
