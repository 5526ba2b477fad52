//! Diversity: how far takes of one task are from each other (Tevet et al. 2022, who call it
//! multimodality).

use std::ops::Range;

use super::{MetricError, check_pair, mean};
use crate::fk::WorldMotion;

/// Joint diversity: mean distance between a joint's two world positions over all pairs of takes,
/// the frames of `range` and all joints, metres. The paper gives no unit for its own.
///
/// # Errors
/// [`MetricError`] for fewer than two takes, or if they or the range do not fit.
pub fn joint_diversity_m(takes: &[WorldMotion], range: Range<usize>) -> Result<f64, MetricError> {
    if takes.len() < 2 {
        return Err(MetricError::Takes(takes.len()));
    }
    let distances: Result<Vec<f64>, MetricError> = pairs(takes)
        .map(|(a, b)| joint_distance_m(a, b, range.clone()))
        .collect();
    Ok(mean(distances?.into_iter()))
}

/// Mean distance between a joint's world positions in two motions over the frames of `range` and
/// all joints, metres.
///
/// # Errors
/// [`MetricError`] if the motions or the range do not fit.
pub fn joint_distance_m(a: &WorldMotion, b: &WorldMotion, range: Range<usize>) -> Result<f64, MetricError> {
    check_pair(a, b, &range)?;
    let part = range.start * a.joints..range.end * a.joints;
    let pairs = a.positions[part.clone()].iter().zip(&b.positions[part]);
    Ok(mean(pairs.map(|(a, b)| f64::from(a.distance(*b)))))
}

/// Latent diversity: mean Euclidean distance over all pairs of vectors of one length, such as the
/// latents of several takes. `None` for fewer than two.
pub fn mean_pairwise_distance(vectors: &[Vec<f32>]) -> Option<f64> {
    (vectors.len() > 1).then(|| {
        mean(pairs(vectors).map(|(a, b)| {
            let squares = a
                .iter()
                .zip(b)
                .map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
            squares.sum::<f64>().sqrt()
        }))
    })
}

/// Every pair of two different entries, once.
fn pairs<T>(all: &[T]) -> impl Iterator<Item = (&T, &T)> {
    all.iter()
        .enumerate()
        .flat_map(|(nth, a)| all[nth + 1..].iter().map(move |b| (a, b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::stand;

    #[test]
    fn takes_are_compared_in_pairs() {
        // Three takes stand at x = 0, 0.1 and 0.4 in the frames that count: 0.1, 0.3 and 0.4 m
        // between them.
        let take = |x: f32| {
            let mut clip = stand(4);
            (1..3).for_each(|f| clip.root_positions[f].x += x);
            WorldMotion::from_clip(&clip)
        };
        let takes = [take(0.0), take(0.1), take(0.4)];
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} is not {b}");
        near(joint_diversity_m(&takes, 1..3).unwrap(), 0.8 / 3.0);
        near(joint_diversity_m(&takes, 0..4).unwrap(), 0.4 / 3.0);
        near(joint_diversity_m(&takes, 3..4).unwrap(), 0.0);
        near(joint_distance_m(&takes[0], &takes[2], 1..3).unwrap(), 0.4);
        near(joint_distance_m(&takes[2], &takes[1], 2..4).unwrap(), 0.15);
        assert!(joint_distance_m(&takes[0], &takes[1], 3..5).is_err());
        assert_eq!(joint_diversity_m(&takes[..1], 1..3), Err(MetricError::Takes(1)));
        assert!(joint_diversity_m(&takes, 3..5).is_err());
        assert!(joint_diversity_m(&[take(0.0), WorldMotion::from_clip(&stand(5))], 0..4).is_err());
    }

    #[test]
    fn latents_by_hand() {
        let latents = [vec![0.0, 0.0], vec![3.0, 4.0], vec![0.0, 4.0]];
        assert_eq!(mean_pairwise_distance(&latents), Some((5.0 + 4.0 + 3.0) / 3.0));
        assert_eq!(mean_pairwise_distance(&latents[..1]), None);
    }
}
