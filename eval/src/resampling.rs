//! How many resamples the intervals of figures come from.

/// Resamples of means.
pub(super) const SETS: usize = 1000;
/// Resamples of FID and MMD, which take long to compute.
pub(super) const DISTRIBUTION_SETS: usize = 100;
