//! Troupe's motion server.
//!
//! Characters run in the crates below: `troupe-batch` has queues and workers, `troupe-live`
//! sessions and scenes, `troupe-edge` connections and keys. This crate has the calls, their
//! transports, and the server that joins all parts.
//!
//! A module uses only modules above it in this table:
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
//! A request arrives over gRPC or HTTP. [`inbetween`] checks it and moves each character into its
//! segment frame. The request waits in a bounded queue and shares a batch with other requests
//! (`troupe-batch`). The networks of a pack process the batch (`troupe-engine`), and the result
//! becomes frames.
//!
//! # The way of a live character
//! Commands change what a character wants (`troupe-character`). When a character needs a plan, its
//! session asks the same batcher for one. It cross-fades the plan into the frames that a step or a
//! stream takes (`troupe-live`).
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
