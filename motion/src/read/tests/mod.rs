//! Tests of whole files.

mod archives;
mod dialects;
#[cfg(feature = "fbx")]
mod fbx;
mod hostile;
mod kinds;
mod neutral;
mod people;
mod rigs;
mod robots;
mod shared;
