//! No code: `Cargo.toml` says which features the server and the command line share.
