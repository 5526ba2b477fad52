//! What the end-to-end tests share: a server, requests, and motion of their own.

pub mod figures;
pub mod program;
pub mod walk;
