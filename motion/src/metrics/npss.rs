//! NPSS: normalised power spectrum similarity (Gopalakrishnan et al. 2019), as LaFAN1's benchmark
//! computes it.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::Quat;

use super::{MetricError, check_pair};
use crate::fk::WorldMotion;
use crate::rotation::align_sign;

/// Gathers NPSS over many sequences: the mean of all channels' distances, weighted by ground-truth
/// power over the whole set. The mean of the sequences' own NPSS would be another number.
///
/// For each channel (four a joint, world quaternions): take the discrete Fourier transform over the
/// frames, square its **real part**, normalise by the sum over frequencies, accumulate over
/// frequencies, and sum the absolute differences of the two cumulative spectra (an earth mover's
/// distance). LaFAN1's code drops the imaginary part, so this does too. A channel without power in
/// ground truth has no weight. One without power in the motion counts as a spectrum of zeros.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Npss {
    weighted: f64,
    weight: f64,
}

impl Npss {
    /// Adds the frames `range` of one sequence. Quaternions are first made continuous in time,
    /// because a rotation's sign has no meaning.
    ///
    /// # Errors
    /// [`MetricError`] if the motions or the range do not fit.
    pub fn add(
        &mut self,
        motion: &WorldMotion,
        truth: &WorldMotion,
        range: Range<usize>,
    ) -> Result<(), MetricError> {
        check_pair(motion, truth, &range)?;
        let frames = range.len();
        let cosines: Vec<f64> = (0..frames)
            .map(|i| (TAU * i as f64 / frames as f64).cos())
            .collect();
        let mut channels = [vec![0.0; frames * 4], vec![0.0; frames * 4]];
        let mut powers = [vec![0.0; frames], vec![0.0; frames]];
        for joint in 0..truth.joints {
            for (source, channels) in [motion, truth].into_iter().zip(&mut channels) {
                continuous_channels(source, joint, range.clone(), channels);
            }
            for channel in 0..4 {
                for (channels, power) in channels.iter().zip(&mut powers) {
                    power_spectrum(
                        &channels[channel * frames..(channel + 1) * frames],
                        &cosines,
                        power,
                    );
                }
                let total: f64 = powers[1].iter().sum();
                if total > 0.0 {
                    self.weighted += total * cumulative_distance(&powers[0], &powers[1]);
                    self.weight += total;
                }
            }
        }
        Ok(())
    }

    /// NPSS of everything added; `None` if there was no power.
    pub fn value(&self) -> Option<f64> {
        (self.weight > 0.0).then(|| self.weighted / self.weight)
    }

    /// Adds what another has gathered.
    pub fn merge(&mut self, other: &Self) {
        self.merge_times(other, 1);
    }

    /// Adds what another has gathered, `times` times.
    pub(super) fn merge_times(&mut self, other: &Self, times: u32) {
        self.weighted += other.weighted * f64::from(times);
        self.weight += other.weight * f64::from(times);
    }
}

/// NPSS of one sequence over the frames `range`.
///
/// # Errors
/// [`MetricError`] if the motions or the range do not fit.
pub fn npss(motion: &WorldMotion, truth: &WorldMotion, range: Range<usize>) -> Result<f64, MetricError> {
    let mut all = Npss::default();
    all.add(motion, truth, range)?;
    Ok(all.value().unwrap_or(0.0))
}

/// The four quaternion components of one joint, each a run over the frames, without sign jumps.
fn continuous_channels(motion: &WorldMotion, joint: usize, range: Range<usize>, out: &mut [f64]) {
    let frames = range.len();
    let mut before: Option<Quat> = None;
    for (t, f) in range.enumerate() {
        let q = motion.rotations_at(f)[joint];
        let q = before.map_or(q, |before| align_sign(q, before));
        for (channel, value) in q.to_array().into_iter().enumerate() {
            out[channel * frames + t] = f64::from(value);
        }
        before = Some(q);
    }
}

/// Squared real part of the discrete Fourier transform, as a plain sum: gaps have at most a few
/// dozen frames.
fn power_spectrum(signal: &[f64], cosines: &[f64], out: &mut [f64]) {
    let n = signal.len();
    for (k, out) in out.iter_mut().enumerate() {
        let mut sum = 0.0;
        let mut phase = 0;
        for &v in signal {
            sum += v * cosines[phase];
            phase += k;
            if phase >= n {
                phase -= n;
            }
        }
        *out = sum * sum;
    }
}

/// Sum over frequencies of the absolute difference of the two normalised cumulative spectra.
fn cumulative_distance(power: &[f64], truth: &[f64]) -> f64 {
    let share = |p: &[f64]| {
        let total: f64 = p.iter().sum();
        if total > 0.0 { 1.0 / total } else { 0.0 }
    };
    let (a, b) = (share(power), share(truth));
    let mut gap = 0.0;
    let mut sum = 0.0f64;
    for (p, t) in power.iter().zip(truth) {
        gap += p * a - t * b;
        sum += gap.abs();
    }
    sum
}
