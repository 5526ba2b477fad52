//! Troupe's motion server.
//!
//! The crates below do the work: `troupe-batch` has queues and workers, `troupe-live` sessions and
//! scenes, `troupe-service` the calls, `troupe-edge` connections and keys. This crate has the
//! transports, and the server that joins all parts.
//!
//! A module uses only modules above it in this table:
//!
//! | module | holds |
//! |---|---|
//! | [`traces`] | export of traces |
//! | [`mmcp`] | the protocol of motion tools: its requests, and answers as glTF |
//! | [`api`] | gRPC, HTTP, WebSocket, and the form of errors |
//! | [`health`] | asks a running server whether it is ready |
//! | [`config`], [`server`], [`doctor`] | options; the running server; report on a machine |
//!
//! Each layer has its own error type. Only [`api`] turns errors into answers.
//!
//! # How a request is served
//! A request arrives over gRPC or HTTP. [`troupe_service::inbetween`] checks it and moves each
//! character into its segment frame. The request waits in a bounded queue and shares a batch with
//! other requests (`troupe-batch`). The networks of a pack process the batch (`troupe-engine`), and
//! the result becomes frames.
//!
//! # How a live character moves
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
pub mod mmcp;
pub mod program;
pub mod server;
pub mod traces;
