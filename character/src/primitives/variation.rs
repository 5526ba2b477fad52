//! How one character of a crowd differs from another: what a seed chooses of its style.
//!
//! Seed 0 is the style itself. Any other seed takes its posture above the legs and its cadence from
//! one take of the data. It also chooses the foot that goes first, and when standing poses come.

use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_motion::Quat;

use super::recipe::STAND_FRAMES;
use crate::style::{MAX_KEYS, Style, Take};

/// The random stream of a variation. Plans use the streams of their numbers.
const STREAM: u64 = u64::MAX;

/// What a seed chooses of a style.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Variation<'a> {
    take: Option<&'a Take>,
    /// Cycles by which the first step is delayed.
    pub(crate) first_step: f32,
    /// Frames at 30 Hz by which standing poses come sooner.
    pub(crate) stand_frames: u64,
}

impl<'a> Variation<'a> {
    pub(crate) fn of(style: &'a Style, seed: u64) -> Self {
        if seed == 0 {
            return Self::default();
        }
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(STREAM);
        let [take, foot, stand] = std::array::from_fn(|_| generator.next_u64());
        Self {
            take: (take as usize)
                .checked_rem(style.takes.len())
                .map(|nth| &style.takes[nth]),
            first_step: if foot % 2 == 0 { 0.0 } else { 0.5 },
            stand_frames: stand % (STAND_FRAMES * MAX_KEYS as u64),
        }
    }

    /// Cadence relative to the style's.
    pub(crate) fn cadence(&self) -> f32 {
        self.take.map_or(1.0, |take| take.cadence)
    }

    /// Turns a pose of the style into the take's. Rotations from joint 1 on are relative to their
    /// parents.
    pub(crate) fn hold(&self, pose: &mut [Quat]) {
        for &(joint, turn) in self.take.iter().flat_map(|take| &take.turns) {
            if let Some(rotation) = pose.get_mut(joint) {
                *rotation = (turn * *rotation).normalize();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::style::testing::walker_style;

    fn style() -> Style {
        let take = |nth: usize| Take {
            cadence: 0.9 + 0.02 * nth as f32,
            turns: vec![(1, Quat::from_rotation_x(0.05 * nth as f32))],
        };
        Style {
            takes: (0..10).map(take).collect::<Arc<[_]>>(),
            ..walker_style()
        }
    }

    /// What a seed makes of a pose, its cadence, its delay of the first step, and its shift of
    /// standing poses.
    fn chosen(style: &Style, seed: u64) -> (Quat, f32, f32, u64) {
        let variation = Variation::of(style, seed);
        let mut pose = [Quat::IDENTITY; 2];
        variation.hold(&mut pose);
        assert_eq!(pose[0], Quat::IDENTITY, "only the take's joints are turned");
        (
            pose[1],
            variation.cadence(),
            variation.first_step,
            variation.stand_frames,
        )
    }

    #[test]
    fn seed_0_is_the_style_and_every_other_chooses_once() {
        let style = style();
        assert_eq!(chosen(&style, 0), (Quat::IDENTITY, 1.0, 0.0, 0));
        let all: Vec<_> = (1..40).map(|seed| chosen(&style, seed)).collect();
        assert_eq!(all, (1..40).map(|seed| chosen(&style, seed)).collect::<Vec<_>>());
        let mut cadences: Vec<_> = all
            .iter()
            .map(|chosen| (chosen.1 * 100.0).round() as i32)
            .collect();
        cadences.sort_unstable();
        cadences.dedup();
        assert!(cadences.len() > 7, "nearly all of the takes: {cadences:?}");
        let feet = all.iter().filter(|chosen| chosen.2 == 0.5).count();
        assert!((10..30).contains(&feet), "{feet} of 39 start with the other foot");
    }

    #[test]
    fn a_pack_without_takes_has_steps_that_differ() {
        let style = walker_style();
        let (pose, cadence, ..) = chosen(&style, 7);
        assert_eq!((pose, cadence), (Quat::IDENTITY, 1.0));
        assert!((1..9).any(|seed| chosen(&style, seed).3 != chosen(&style, 9).3));
    }
}
