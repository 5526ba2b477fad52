//! Putting generated frames into the clip that they were made for.

use std::ops::Range;

use troupe_client::CONTEXT_FRAMES;
use troupe_motion::clip::{Clip, ClipError};

/// The frames of a segment that are neither context nor target.
pub(super) fn gap_of(segment: &Clip, target_frames: usize) -> Range<usize> {
    CONTEXT_FRAMES..segment.frames().saturating_sub(target_frames).max(CONTEXT_FRAMES)
}

/// The clip up to `from`, the generated frames, and the clip from `to` on. The clip's own frames
/// stay as they are.
///
/// # Errors
/// [`ClipError`] if `from` or `to` is outside the clip.
pub(super) fn splice(clip: &Clip, from: usize, to: usize, generated: &Clip) -> Result<Clip, ClipError> {
    let mut whole = clip.slice(0..from + 1)?;
    let after = clip.slice(to..clip.frames())?;
    for part in [generated, &after] {
        whole.root_positions.extend_from_slice(&part.root_positions);
        whole.rotations.extend_from_slice(&part.rotations);
    }
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::testing::lone_hips;

    /// A clip of one joint whose root height counts the frames from `first` on.
    fn counting(first: usize, frames: usize) -> Clip {
        let roots = (first..first + frames).map(|f| Vec3::Y * f as f32).collect();
        Clip::new(lone_hips(), 30.0, roots, vec![Quat::IDENTITY; frames]).unwrap()
    }

    fn heights(clip: &Clip) -> Vec<usize> {
        clip.root_positions.iter().map(|p| p.y as usize).collect()
    }

    #[test]
    fn only_the_frames_between_are_replaced() {
        // Context 2..=5, target 14: the segment has 13 frames, of which 8 are generated.
        let segment = counting(100, 13);
        let generated = segment.slice(gap_of(&segment, 1)).unwrap();
        assert_eq!(heights(&generated), (104..112).collect::<Vec<_>>());

        let whole = splice(&counting(0, 20), 5, 14, &generated).unwrap();
        let expected = (0..=5).chain(104..112).chain(14..20).collect::<Vec<_>>();
        assert_eq!(heights(&whole), expected);
        assert_eq!(whole.rotations.len(), whole.frames());
    }

    #[test]
    fn a_target_behind_the_clip_is_an_error() {
        let clip = counting(0, 10);
        assert!(splice(&clip, 3, 10, &clip).is_err());
    }
}
