//! Load tester of the Troupe motion server.
//!
//! # Steps of a run
//! The command line ([`cli`]) makes a [`plan::Plan`]: the requests ([`workloads`]) and their times
//! ([`arrivals`]). [`run`] carries it out, in this process or in several. [`loops`] send single
//! requests. A recorder ([`measure`]) takes every answer, and reads the server's `/metrics`. The
//! [`figures`] of a run come from it. [`search`] finds the highest load at which a server keeps a
//! bound, and [`overload`] measures a server under a higher load. The result is a
//! [`report::Report`]: versioned JSON, a table, and a page with plots.
//!
//! # Latency
//! In an **open loop** requests come at fixed times, however late the server is. Latency counts
//! from the time at which a request was due, not from its sending. So a server that stalls for a
//! second is charged for every request of that second, as its users would be (no coordinated
//! omission). In a **closed loop** each client waits for its answer before the next request, and
//! latency counts from the sending.

pub mod access;
pub mod arrivals;
pub mod cli;
pub mod failure;
pub mod figures;
pub mod loops;
pub mod measure;
pub mod overload;
pub mod plan;
pub mod report;
pub mod run;
pub mod search;
pub mod workloads;

pub use failure::Failure;
