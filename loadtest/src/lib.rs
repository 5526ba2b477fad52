//! Load tester of the Troupe motion server.
//!
//! # The way of a run
//! The command line ([`cli`]) makes a [`plan::Plan`]: what is asked ([`workloads`]) and when
//! ([`arrivals`]). [`run`] carries it out, in this process or in several. Single requests are sent
//! by [`loops`], and every answer goes to a recorder ([`measure`]), which also watches the server's
//! `/metrics`. A run comes to its [`figures`]. [`search`] looks for the most that a server can do
//! within a bound, and [`overload`] for how it takes more than that. What comes out of all is a
//! [`report::Report`]: JSON with a version, a table, and a page with plots.
//!
//! # What a latency is
//! In an **open loop** arrivals come when they are due, however late the server is, and latency
//! counts from the moment when a request was due, not from when it was sent: a server that stalls
//! for a second is charged for every request of that second, as its users would (no coordinated
//! omission). In a **closed loop** each client waits for its answer before it asks again, and
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
