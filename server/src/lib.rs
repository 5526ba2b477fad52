//! Troupe's motion server.
//!
//! # Layers
//! A module knows those above it in this table, and none below it. `scripts/check-layers.sh` holds
//! it to that.
//!
//! | module | holds |
//! |---|---|
//! | [`traces`] | where traces go |
//! | [`inbetween`] | single requests: from keyframes to tasks, from motion to frames |
//! | [`service`] | every call, apart from how it travels |
//! | [`mmcp`] | the protocol of motion tools: requests in its form, answers as glTF |
//! | [`api`] | gRPC, HTTP, WebSocket, and how errors look there |
//! | [`health`] | asks a running server whether it is ready |
//! | [`config`], [`server`], [`doctor`] | options; what runs the rest on a port; what a machine offers |
//!
//! Each layer has an error of its own. They become answers in one place, [`api`].
//!
//! # The way of a request
//! A request arrives over gRPC or HTTP, is checked and brought into each character's segment frame
//! ([`inbetween`]), waits in a bounded queue and travels with whatever else waits (`troupe-batch`),
//! passes the networks of a pack (`troupe-engine`), and comes back as frames.
//!
//! # The way of a live character
//! Commands change what a character wants (`troupe-character`). Whenever it needs a plan, its
//! session has one made on the same way through the batcher, and cross-fades it into the frames
//! that a step or a stream takes ([`session`]).
//!
//! # Embedding
//! ```no_run
//! # async fn example() -> Result<(), Box<dyn std::error::Error>> {
//! use std::path::Path;
//!
//! let config = troupe_server::config::Config::local(Path::new("models"))?;
//! let listener = tokio::net::TcpListener::bind(config.listen).await?;
//! let mut server = troupe_server::server::serve(config, listener).await?;
//! server.ready().await?;
//! println!("serving on http://{}", server.address());
//! server.shut_down().await;
//! # Ok(())
//! # }
//! ```

pub mod api;
pub mod config;
pub mod doctor;
pub mod health;
pub mod inbetween;
pub mod mmcp;
pub mod server;
pub mod service;
pub mod traces;
