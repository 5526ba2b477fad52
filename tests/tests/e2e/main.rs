//! End-to-end tests: the real server with a real pack, called over gRPC, HTTP and the command line.
//!
//! They need the ONNX Runtime library, which `make runtime` downloads, and a pack: `models/human`,
//! or the folder in the environment variable TROUPE_TEST_PACK.

#![allow(clippy::unwrap_used, reason = "these are tests, their helpers too")]

mod answers;
mod bad_input;
mod batching;
mod cli;
mod clip;
mod crowd;
mod eval;
mod film;
mod g1;
mod http;
mod live;
mod motion;
mod object;
mod own_kept;
mod own_skeleton;
mod real;
mod retarget;
mod robustness;
mod roots;
mod scene;
mod seeds;
mod server;
mod style;
mod walk;
mod words;
