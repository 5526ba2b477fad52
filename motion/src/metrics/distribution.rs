//! How similar two sets of motions are as a whole: FID and MMD between their latents in a motion
//! autoencoder.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Width of MMD's Gaussian kernel (Jayasumana et al. 2024).
pub const MMD_SIGMA: f64 = 10.0;
/// Factor that makes MMD easier to read (Jayasumana et al. 2024).
pub const MMD_SCALE: f64 = 1000.0;

/// Latents of windows, all of one length, with the clip that each window was cut from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Latents {
    clips: Vec<usize>,
    rows: Vec<Vec<f32>>,
}

impl Latents {
    /// Adds a window's latent; `clip` counts from 0.
    ///
    /// # Panics
    /// If the latent's length differs from those before.
    pub fn push(&mut self, clip: usize, latent: Vec<f32>) {
        if let Some(first) = self.rows.first() {
            assert_eq!(first.len(), latent.len(), "latents of one length");
        }
        self.clips.push(clip);
        self.rows.push(latent);
    }

    /// Number of windows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no window.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The latents, in the order in which they were added.
    pub fn rows(&self) -> &[Vec<f32>] {
        &self.rows
    }

    /// Every other window from the first on, and every other from the second on. Ground truth is
    /// measured against itself by these halves.
    pub fn halves(&self) -> [Self; 2] {
        let mut halves = [Self::default(), Self::default()];
        for (nth, (&clip, row)) in self.clips.iter().zip(&self.rows).enumerate() {
            halves[nth % 2].push(clip, row.clone());
        }
        halves
    }

    /// How many times each window counts, if `times` says so for each clip.
    fn weights<'a>(&'a self, times: &'a [u32]) -> impl Iterator<Item = f64> + 'a {
        self.clips
            .iter()
            .map(|&clip| f64::from(times.get(clip).copied().unwrap_or(0)))
    }
}

/// A Gaussian fitted to a set of latents.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussian {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Gaussian {
    /// Mean and covariance (divided by n - 1) of latents, each counted as often as `times` says of
    /// its clip. None for fewer than two.
    pub fn fit(latents: &Latents, times: &[u32]) -> Option<Self> {
        let total: f64 = latents.weights(times).sum();
        let dims = latents.rows.first()?.len();
        if total < 2.0 {
            return None;
        }
        let mut mean = DVector::zeros(dims);
        for (row, weight) in latents.rows.iter().zip(latents.weights(times)) {
            for (sum, &value) in mean.iter_mut().zip(row) {
                *sum += weight * f64::from(value);
            }
        }
        mean /= total;
        let mut centred = DMatrix::zeros(dims, latents.len());
        let columns = centred.column_iter_mut().zip(&latents.rows);
        for ((mut column, row), weight) in columns.zip(latents.weights(times)) {
            for ((out, &value), mean) in column.iter_mut().zip(row).zip(&mean) {
                *out = weight.sqrt() * (f64::from(value) - mean);
            }
        }
        let covariance = (&centred * centred.transpose()) / (total - 1.0);
        Some(Self { mean, covariance })
    }

    /// FID (Heusel et al. 2017) of each of the others: the Fréchet distance of two Gaussians,
    /// `|m_a - m_b|² + tr(A + B - 2 (A^½ B A^½)^½)`. In the unit of the latents squared; not scaled.
    ///
    /// Both square roots are taken through eigenvalues of symmetric matrices. Finite sets from the
    /// same distribution still measure more than 0, and more with fewer windows: compare only
    /// figures with the same number of windows.
    ///
    /// # Panics
    /// If the latents' lengths differ.
    pub fn frechet_distances<const N: usize>(&self, others: [&Self; N]) -> [f64; N] {
        let root = self.covariance_root();
        others.map(|other| {
            let between = &root * &other.covariance * &root;
            // Rounding must not leave it slightly asymmetric.
            let between = (&between + between.transpose()) * 0.5;
            let shared: f64 = between
                .symmetric_eigenvalues()
                .iter()
                .map(|v| v.max(0.0).sqrt())
                .sum();
            let apart = (&self.mean - &other.mean).norm_squared();
            (apart + self.covariance.trace() + other.covariance.trace() - 2.0 * shared).max(0.0)
        })
    }

    fn covariance_root(&self) -> DMatrix<f64> {
        let SymmetricEigen {
            eigenvalues,
            eigenvectors,
        } = SymmetricEigen::new(self.covariance.clone());
        let roots = DMatrix::from_diagonal(&eigenvalues.map(|v| v.max(0.0).sqrt()));
        &eigenvectors * roots * eigenvectors.transpose()
    }
}

/// MMD (CMMD's, Jayasumana et al. 2024) between two sets of latents: the mean of a Gaussian kernel
/// `exp(-|x - y|² / (2 σ²))` over all pairs in the first set, plus that in the second, less twice
/// that between them, times [`MMD_SCALE`]. As in their code, pairs of a latent with itself count,
/// so it is never below 0.
///
/// The kernel's sums are stored for each pair of clips, so any choice of clips can be measured at
/// once.
#[derive(Clone, Debug, PartialEq)]
pub struct Mmd {
    clips: usize,
    within_a: Vec<f64>,
    within_b: Vec<f64>,
    between: Vec<f64>,
    count_a: Vec<f64>,
    count_b: Vec<f64>,
}

impl Mmd {
    /// Computes the kernel of all pairs.
    pub fn between(a: &Latents, b: &Latents) -> Self {
        let clips = a.clips.iter().chain(&b.clips).max().map_or(0, |most| most + 1);
        let count = |of: &Latents| {
            let mut count = vec![0.0; clips];
            of.clips.iter().for_each(|&clip| count[clip] += 1.0);
            count
        };
        Self {
            clips,
            within_a: kernel_sums(a, a, clips),
            within_b: kernel_sums(b, b, clips),
            between: kernel_sums(a, b, clips),
            count_a: count(a),
            count_b: count(b),
        }
    }

    /// The distance, with each clip counted as often as `times` says. None if a set has no clip
    /// left.
    pub fn value(&self, times: &[u32]) -> Option<f64> {
        let times = |clip: usize| f64::from(times.get(clip).copied().unwrap_or(0));
        let total = |count: &[f64]| -> f64 { count.iter().enumerate().map(|(c, n)| n * times(c)).sum() };
        let mean = |sums: &[f64], pairs: f64| -> f64 {
            let rows = sums.chunks_exact(self.clips.max(1)).enumerate();
            let row = |row: &[f64]| -> f64 { row.iter().enumerate().map(|(c, s)| s * times(c)).sum() };
            rows.map(|(c, sums)| times(c) * row(sums)).sum::<f64>() / pairs
        };
        let (a, b) = (total(&self.count_a), total(&self.count_b));
        (a > 0.0 && b > 0.0).then(|| {
            let apart =
                mean(&self.within_a, a * a) + mean(&self.within_b, b * b) - 2.0 * mean(&self.between, a * b);
            MMD_SCALE * apart.max(0.0)
        })
    }
}

/// Sums of the kernel over the pairs of windows of each pair of clips, `clips * clips`.
fn kernel_sums(a: &Latents, b: &Latents, clips: usize) -> Vec<f64> {
    let mut sums = vec![0.0; clips * clips];
    for (x, &of_x) in a.rows.iter().zip(&a.clips) {
        for (y, &of_y) in b.rows.iter().zip(&b.clips) {
            let squares = x
                .iter()
                .zip(y)
                .map(|(x, y)| (f64::from(*x) - f64::from(*y)).powi(2));
            sums[of_x * clips + of_y] += (-squares.sum::<f64>() / (2.0 * MMD_SIGMA.powi(2))).exp();
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    fn latents(rows: &[&[f32]]) -> Latents {
        let mut all = Latents::default();
        rows.iter()
            .enumerate()
            .for_each(|(clip, row)| all.push(clip, row.to_vec()));
        all
    }

    fn near(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{a} is not {b}");
    }

    /// Latents with a given diagonal spread around a mean: the corners of a box.
    fn spread(mean: [f32; 2], half: [f32; 2]) -> Latents {
        let corners = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
        let rows = corners.map(|[x, y]: [f32; 2]| [mean[0] + x * half[0], mean[1] + y * half[1]]);
        latents(&rows.each_ref().map(|row| &row[..]))
    }

    fn fid(a: &Latents, b: &Latents) -> f64 {
        let of = |latents: &Latents| Gaussian::fit(latents, &vec![1; latents.len()]).unwrap();
        of(a).frechet_distances([&of(b)])[0]
    }

    #[test]
    fn fid_of_axes_by_hand() {
        // Four corners at ±h have a variance of 4 h² / 3. For diagonal matrices the Fréchet
        // distance is |m_a - m_b|² + Σ (√a - √b)².
        let (a, b) = (spread([0.0, 0.0], [3.0, 1.0]), spread([1.0, 2.0], [1.0, 4.0]));
        let wanted = 1.0 + 4.0 + (4.0 / 3.0) * ((3.0 - 1.0f64).powi(2) + (1.0 - 4.0f64).powi(2));
        near(fid(&a, &b), wanted);
        near(fid(&b, &a), wanted);
        assert!(fid(&a, &a).abs() < 1e-9);
    }

    #[test]
    fn fid_of_correlated_latents_by_hand() {
        // A = [[2, 1], [1, 2]] (eigenvalues 3 and 1) and B = diag(1, 4). tr (A B)^½ of 2 x 2
        // matrices is √(tr AB + 2 √det AB) = √(10 + 2 √12).
        let gaussian = |c: [f64; 4]| Gaussian {
            mean: DVector::zeros(2),
            covariance: DMatrix::from_row_slice(2, 2, &c),
        };
        let (a, b) = (gaussian([2.0, 1.0, 1.0, 2.0]), gaussian([1.0, 0.0, 0.0, 4.0]));
        let wanted = 4.0 + 5.0 - 2.0 * (10.0 + 2.0 * 12f64.sqrt()).sqrt();
        let [to_b, to_itself] = a.frechet_distances([&b, &a]);
        near(to_b, wanted);
        assert!(to_itself.abs() < 1e-9);
        near(b.frechet_distances([&a])[0], wanted);
    }

    #[test]
    fn fid_takes_fewer_windows_than_dimensions() {
        // On a line in three dimensions: variances 2 and 8 along x, nothing else.
        let (a, b) = (
            latents(&[&[-1.0, 5.0, 0.0], &[1.0, 5.0, 0.0]]),
            latents(&[&[-2.0, 5.0, 0.0], &[2.0, 5.0, 0.0]]),
        );
        near(fid(&a, &b), (8f64.sqrt() - 2f64.sqrt()).powi(2));
        assert_eq!(Gaussian::fit(&latents(&[&[1.0]]), &[1]), None);
        assert_eq!(Gaussian::fit(&Latents::default(), &[]), None);
    }

    #[test]
    fn counting_a_clip_twice_equals_having_its_windows_twice() {
        let three = latents(&[&[0.0, 1.0], &[2.0, 0.5], &[-1.0, 3.0]]);
        let more = latents(&[&[0.0, 1.0], &[0.0, 1.0], &[-1.0, 3.0]]);
        let (times, once) = ([2, 0, 1], [1, 1, 1]);
        let (a, b) = (
            Gaussian::fit(&three, &times).unwrap(),
            Gaussian::fit(&more, &once).unwrap(),
        );
        assert!((a.covariance - b.covariance).norm() < 1e-12 && (a.mean - b.mean).norm() < 1e-12);
        let other = latents(&[&[1.0, 0.0], &[4.0, 0.0], &[0.0, 0.0]]);
        let again = latents(&[&[1.0, 0.0], &[1.0, 0.0], &[0.0, 0.0]]);
        near(
            Mmd::between(&three, &other).value(&times).unwrap(),
            Mmd::between(&more, &again).value(&once).unwrap(),
        );
    }

    #[test]
    fn mmd_by_hand() {
        // a at 0 and 10, b at 20, σ = 10: kernels exp(-½) at 10 and exp(-2) at 20.
        let (a, b) = (latents(&[&[0.0], &[10.0]]), latents(&[&[20.0]]));
        let (one, two) = ((-0.5f64).exp(), (-2.0f64).exp());
        let wanted = 1000.0 * ((2.0 + 2.0 * one) / 4.0 + 1.0 - 2.0 * (one + two) / 2.0);
        near(Mmd::between(&a, &b).value(&[1, 1]).unwrap(), wanted);
        near(Mmd::between(&a, &a).value(&[1, 1]).unwrap(), 0.0);
        assert_eq!(Mmd::between(&a, &b).value(&[0, 1]), None, "b is of clip 0");
        assert_eq!(Mmd::between(&a, &Latents::default()).value(&[1, 1]), None);
    }

    #[test]
    fn halves_share_no_window() {
        let [a, b] = latents(&[&[0.0], &[1.0], &[2.0]]).halves();
        assert_eq!(
            (a.rows(), b.rows()),
            (&[vec![0.0], vec![2.0]][..], &[vec![1.0]][..])
        );
        assert_eq!((a.clips, b.clips), (vec![0, 2], vec![1]));
    }
}
