//! The diffusion steps that a sampler visits, and the DDIM update between them.

/// The diffusion schedule of a pack.
#[derive(Debug, Clone)]
pub(super) struct Schedule {
    /// Share of the signal's power that remains at each diffusion step.
    signal: Box<[f64]>,
}

impl Schedule {
    pub(super) fn new(signal: &[f64]) -> Self {
        Self {
            signal: signal.into(),
        }
    }

    /// Diffusion steps of the training: the most that a sampler can visit.
    pub(super) fn steps(&self) -> usize {
        self.signal.len()
    }

    /// The diffusion step of a sampler's call `index` of `count`. Call 0 has the noisiest.
    pub(super) fn step(&self, index: usize, count: usize) -> usize {
        self.steps() * (count - index) / count - 1
    }

    /// The DDIM update from call `index` of `count` to the next one, without new noise: `noisy`
    /// becomes less noisy, given the predicted `clean` rows. After the last call it equals `clean`.
    pub(super) fn advance(&self, index: usize, count: usize, noisy: &mut [f32], clean: &[f32]) {
        if index + 1 == count {
            noisy.copy_from_slice(clean);
            return;
        }
        let [now, then] = [index, index + 1].map(|index| self.signal[self.step(index, count)]);
        let (kept, added) = (now.sqrt() as f32, (1.0 - now).sqrt() as f32);
        let (keep, add) = (then.sqrt() as f32, (1.0 - then).sqrt() as f32);
        for (noisy, &clean) in noisy.iter_mut().zip(clean) {
            let noise = (*noisy - kept * clean) / added;
            *noisy = keep * clean + add * noise;
        }
    }
}
