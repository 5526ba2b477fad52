//! The server over gRPC, HTTP and WebSocket, with toy packs whose engine answers with straight
//! lines. No ONNX Runtime.

#![allow(clippy::unwrap_used, reason = "these are tests, their helpers too")]

#[path = "../common/mod.rs"]
mod common;

mod access_keys;
mod access_tls;
mod access_tokens;
mod bad_input;
mod bursts;
mod certificates;
mod connections;
mod crowd;
mod drive;
mod generate;
mod interactions;
mod lifecycle;
mod metrics;
mod mmcp;
mod observe;
mod openapi;
mod overload;
mod packs;
mod pages;
mod paths;
mod recordings;
mod restart;
mod robots;
mod scene_sessions;
mod scenes;
mod service;
mod session_errors;
mod session_life;
mod sessions;
mod skills;
mod strangers;
mod tenants;
mod traces;
mod watching;
mod websocket;
