//! Files for benchmarks, examples and packs.

pub(crate) mod requests;
pub(crate) mod takes;
