//! The port: connections, from their first byte to their last.

mod activity;
mod connections;
mod files;
mod listen;
mod slots;
mod tls;

pub use connections::{ConnectionLimits, Routes, accept};
pub use files::{TooFewFiles, max_connections};
pub use listen::Listen;
pub use slots::ConnectionSlots;
pub use tls::{Tls, TlsError, TlsFiles};
