//! Troupe's motion server.
//!
//! # The way of a request
//! A request arrives over gRPC or HTTP ([`api`]), is checked and brought into each character's segment frame
//! ([`inbetween`]), waits in a bounded queue until the engine is free and travels with whatever else waits ([`batch`]),
//! passes root, pose and decoder ([`engine`]) of a model pack ([`pack`]), and comes back as frames ([`inbetween`]).
//!
//! # The way of a live character
//! Commands change what a character wants ([`primitives`], [`style`]); whenever it needs a plan, its session has one made on
//! the same way through the batcher, and cross-fades it into the frames that a step or a stream takes ([`session`]).
//!
//! # What characters live among
//! A [`scene`] has ground, colliders and objects; an [`object`] definition says what characters can do with a thing. Both
//! are read from TOML or JSON by [`document`], whose errors name line and field. [`world`] has those of a server.
//!
//! [`service`] ties these together, [`server`] runs them on a port, [`telemetry`] counts, [`config`] configures, [`doctor`] says what
//! a machine offers, [`health`] asks a running server whether it is ready.
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
pub mod batch;
pub mod config;
pub mod doctor;
pub mod health;
pub mod inbetween;
pub mod server;
pub mod service;
pub mod session;
pub mod telemetry;
pub mod world;
