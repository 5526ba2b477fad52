//! The server's port, and its connections from the first byte to the last.

mod activity;
mod connections;
mod early;
mod files;
mod listen;
mod slots;
mod tls;

pub use connections::{ConnectionLimits, Port, Routes, accept};
pub use early::{Early, Head, Refuse};
pub use files::{TooFewFiles, max_connections};
pub use listen::Listen;
pub use slots::ConnectionSlots;
pub use tls::{Tls, TlsError, TlsFiles};
