//! Measuring characters that wander.

use troupe_cli::Failure;
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::metrics::{
    Estimate, Gaussian, Latents, MetricError, Resamples, foot_skate_m_per_frame, joint_jitter_mps2,
    root_jitter_mps2,
};

use crate::evaluator::Evaluator;
use crate::resampling::{DISTRIBUTION_SETS, SETS};

/// Frames at the start that are not measured.
const UNMEASURED: usize = 30;
/// Frames of the windows that FID is measured on: those of a gap of 30.
pub(super) const WINDOW_FRAMES: usize = 35;
/// Frames from the start of one such window to that of the next.
pub(super) const WINDOW_STRIDE: usize = 30;
/// Windows that the evaluator takes at a time.
const LATENT_BATCH: usize = 32;

/// A figure of a character.
pub(super) struct Kind {
    /// Name in JSON.
    pub(super) key: &'static str,
    pub(super) name: &'static str,
    pub(super) unit: &'static str,
    /// From the measured value to the unit.
    pub(super) factor: f64,
}

/// The figures of each character, and of gaps.
pub(super) const KINDS: [Kind; 3] = {
    const fn kind(key: &'static str, name: &'static str, unit: &'static str, factor: f64) -> Kind {
        Kind {
            key,
            name,
            unit,
            factor,
        }
    }
    [
        kind("foot_skate_m_per_frame", "foot skate", "mm/frame", 1e3),
        kind("joint_jitter_mps2", "joint jitter", "m/s²", 1.0),
        kind("root_jitter_mps2", "root jitter", "m/s²", 1.0),
    ]
};

/// Something for each of [`KINDS`].
pub(super) type Kinds<T> = [T; KINDS.len()];

/// The figures of characters, one for each clip, with intervals over characters.
pub(super) fn figures(clips: &[Clip], seed: u64) -> Result<Kinds<Estimate>, MetricError> {
    let mut values: Kinds<Vec<(usize, f64)>> = Default::default();
    for (nth, clip) in clips.iter().enumerate() {
        let motion = WorldMotion::from_clip(clip);
        let frames = UNMEASURED..clip.frames();
        let found = [
            foot_skate_m_per_frame(&clip.skeleton, &motion, frames.clone())?,
            joint_jitter_mps2(&motion, frames.clone(), clip.fps)?,
            root_jitter_mps2(&motion, frames, clip.fps)?,
        ];
        values
            .iter_mut()
            .zip(found)
            .for_each(|(values, found)| values.push((nth, found)));
    }
    let resamples = Resamples::new(clips.len(), SETS, seed);
    Ok(values.map(|values| resamples.mean(&values).unwrap_or(Estimate::bare(f64::NAN))))
}

/// The latents of windows cut from clips.
pub(super) fn latents<'a>(
    evaluator: &Evaluator,
    clips: impl Iterator<Item = &'a Clip>,
    from: usize,
) -> Result<Latents, Failure> {
    let mut windows = Vec::new();
    for (nth, clip) in clips.enumerate() {
        let starts = from..(clip.frames() + 1).saturating_sub(WINDOW_FRAMES);
        for start in starts.step_by(WINDOW_STRIDE) {
            let window = clip.slice(start..start + WINDOW_FRAMES);
            windows.push((nth, window.map_err(|e| Failure::Other(e.to_string()))?));
        }
    }
    let mut latents = Latents::default();
    for some in windows.chunks(LATENT_BATCH) {
        let rows = evaluator.latents(&some.iter().map(|(_, clip)| clip).collect::<Vec<_>>())?;
        some.iter()
            .zip(rows)
            .for_each(|((nth, _), row)| latents.push(*nth, row));
    }
    Ok(latents)
}

/// FID between characters that wander and clips, with an interval over characters. None if there
/// are too few windows.
pub(super) fn fid(
    evaluator: &Evaluator,
    clips: &[Clip],
    truth: &Gaussian,
    seed: u64,
) -> Result<Option<Estimate>, Failure> {
    let latents = latents(evaluator, clips.iter(), UNMEASURED)?;
    let distance = |times: &[u32]| Some(truth.frechet_distances([&Gaussian::fit(&latents, times)?]));
    let resamples = Resamples::new(clips.len(), DISTRIBUTION_SETS, seed);
    let measured = distance(&vec![1; clips.len()]);
    Ok(measured.map(|measured| {
        let [estimate] = resamples.centred(measured, distance);
        estimate
    }))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{Quat, Vec3};
    use troupe_motion::skeleton::{ContactParams, Joint, Skeleton};

    use super::*;

    #[test]
    fn characters_count_alike_and_the_first_second_does_not() {
        // One joint that is hips and foot, 100 frames: it leaps at first, and slides over the
        // ground by `step` metres a frame from frame 28 on.
        let joint = Joint {
            name: "Hips".to_owned(),
            parent: None,
            offset_m: Vec3::ZERO,
        };
        let contacts = ContactParams {
            joints: vec![0],
            max_height_m: vec![0.1],
            max_speed_mps: 0.4,
            clearance_m: vec![0.0],
        };
        let skeleton = Arc::new(Skeleton::new(vec![joint], Vec3::X, 0.0, Some(contacts)).unwrap());
        let slide = |step: f32| {
            let place = |f: usize| match f {
                0..28 => Vec3::X * (f % 2) as f32,
                _ => Vec3::Z * step * f as f32,
            };
            let roots = (0..100).map(place).collect();
            Clip::new(Arc::clone(&skeleton), 30.0, roots, vec![Quat::IDENTITY; 100]).unwrap()
        };
        let [skate, joints, root] = figures(&[slide(0.01), slide(0.03)], 0).unwrap();
        assert!((skate.mean - 0.02).abs() < 1e-6, "{skate:?}");
        assert!((skate.low.unwrap() - 0.01).abs() < 1e-6 && (skate.high.unwrap() - 0.03).abs() < 1e-6);
        assert!(joints.mean < 0.01 && root.mean < 0.01, "{joints:?} {root:?}");
    }
}
