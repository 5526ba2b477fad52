//! How late windows leave.

use std::time::Duration;

/// Width of a bucket.
const BUCKET: Duration = Duration::from_micros(50);
/// Buckets; the last one has all that is later.
const BUCKETS: usize = 2000;

/// Counts of times from when windows were due until they were sent.
#[derive(Debug, Clone)]
pub struct Jitter {
    counts: Vec<u64>,
    most: Duration,
}

impl Default for Jitter {
    fn default() -> Self {
        Self {
            counts: vec![0; BUCKETS],
            most: Duration::ZERO,
        }
    }
}

impl Jitter {
    pub(crate) fn add(&mut self, late: Duration) {
        let bucket = (late.as_micros() / BUCKET.as_micros()) as usize;
        self.counts[bucket.min(BUCKETS - 1)] += 1;
        self.most = self.most.max(late);
    }

    /// Adds the counts of another robot.
    pub fn merge(&mut self, other: &Self) {
        for (count, more) in self.counts.iter_mut().zip(&other.counts) {
            *count += more;
        }
        self.most = self.most.max(other.most);
    }

    /// The lateness, milliseconds, that a share of the windows (0 to 1) does not exceed.
    pub fn percentile_ms(&self, share: f64) -> f64 {
        let all: u64 = self.counts.iter().sum();
        let wanted = (all as f64 * share).ceil() as u64;
        let mut seen = 0;
        let bucket = self.counts.iter().position(|count| {
            seen += count;
            seen >= wanted
        });
        let end = BUCKET * (bucket.unwrap_or_default() as u32 + 1);
        end.min(self.most).as_secs_f64() * 1e3
    }

    /// The largest lateness, milliseconds.
    pub fn most_ms(&self) -> f64 {
        self.most.as_secs_f64() * 1e3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_ends_of_buckets() {
        let mut jitter = Jitter::default();
        assert_eq!(jitter.percentile_ms(0.99), 0.0);
        for late in 0..100 {
            jitter.add(Duration::from_micros(100 * late));
        }
        assert!((jitter.percentile_ms(0.5) - 4.95).abs() < 1e-9);
        assert!((jitter.percentile_ms(0.99) - 9.85).abs() < 1e-9);
        let mut slow = Jitter::default();
        slow.add(Duration::from_secs(2));
        jitter.merge(&slow);
        assert_eq!((jitter.percentile_ms(1.0), jitter.most_ms()), (100.0, 2000.0));
    }
}
