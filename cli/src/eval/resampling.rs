//! How many sets intervals come from.

/// Sets of pieces of clips that intervals of means come from.
pub(super) const SETS: usize = 1000;
/// The same of FID and MMD, which take long.
pub(super) const DISTRIBUTION_SETS: usize = 100;
