//! The clips that characters are compared with.

use std::collections::BTreeMap;
use std::path::Path;

use troupe_cli::{Failure, Reading, StyleList};
use troupe_client::Pack;
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::metrics::{
    LimbDistances, Limbs, foot_skate_m_per_frame, joint_accelerations_mps2, root_accelerations_mps2,
};

use crate::clips::{clip_names, read_named};

/// Takes of each clip to measure, at most.
const TAKES: usize = 15;
/// Share of a clip at either end that is not measured: it may start or stop there.
const EDGE: f32 = 0.15;

/// Figures of the clips of a gait.
#[derive(Debug, Clone, Default)]
pub(super) struct Reference {
    /// Clips measured.
    pub(super) clips: usize,
    /// Mean foot skate, metres a frame.
    pub(super) skate_m: f64,
    /// All joint accelerations, m/s².
    pub(super) accelerations: Vec<f64>,
    /// How near limbs come to each other in each clip.
    pub(super) nearest: Vec<LimbDistances>,
    /// The largest acceleration of the root over the ground in each clip, m/s².
    pub(super) root_mps2: Vec<f64>,
}

/// References by style and gait.
pub(super) type References = BTreeMap<(String, String), Reference>;

/// Measures the clips that a list names for the gaits of `styles`, with other takes of the same.
pub(super) fn read(
    list: &Path,
    data: &Path,
    styles: &[String],
    (pack, reading): (&Pack, &Reading),
) -> Result<References, Failure> {
    let list = StyleList::read(list)?;
    let names = clip_names(data, None)?;
    let mut references = References::new();
    let wanted = list.styles.iter().filter(|(name, _)| styles.contains(*name));
    for (style, entry) in wanted {
        for (gait, listed) in &entry.gaits {
            let mut reference = Reference::default();
            let stems: Vec<String> = listed.parts().iter().map(|p| stem(&p.clip).to_owned()).collect();
            let takes = names
                .iter()
                .filter(|name| stems.iter().any(|s| s == stem(name)))
                .take(TAKES);
            for name in takes {
                let clip = read_named(data, name, pack, reading)?;
                reference
                    .add(&clip)
                    .map_err(|e| Failure::file(data, format_args!("{name}: {e}")))?;
            }
            if reference.clips > 0 {
                references.insert((style.clone(), gait.clone()), reference);
            }
        }
    }
    Ok(references)
}

impl Reference {
    fn add(&mut self, clip: &Clip) -> Result<(), troupe_motion::metrics::MetricError> {
        let motion = WorldMotion::from_clip(clip);
        let edge = (clip.frames() as f32 * EDGE) as usize;
        let middle = edge..clip.frames() - edge;
        let skate = foot_skate_m_per_frame(&clip.skeleton, &motion, middle.clone())?;
        self.skate_m = (self.skate_m * self.clips as f64 + skate) / (self.clips + 1) as f64;
        let limbs = Limbs::of(&clip.skeleton);
        self.nearest.push(limbs.nearest(&motion, middle.clone())?);
        let root = root_accelerations_mps2(&motion, middle.clone(), clip.fps)?;
        self.root_mps2.push(root.into_iter().fold(0.0, f64::max));
        self.accelerations
            .extend(joint_accelerations_mps2(&motion, middle, clip.fps)?);
        self.clips += 1;
        Ok(())
    }
}

/// A name without the number of the take at its end.
fn stem(name: &str) -> &str {
    name.trim_end_matches(|c: char| c.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_differ_in_the_number_at_the_end() {
        assert_eq!(stem("dataset-2_walk_normal_010"), stem("dataset-2_walk_normal_3"));
        assert_ne!(
            stem("dataset-2_walk_normal_010"),
            stem("dataset-1_walk_normal_010")
        );
        assert_ne!(stem("dataset-2_walk-left_a_1"), stem("dataset-2_walk_a_1"));
    }
}
