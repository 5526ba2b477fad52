//! Cargo takes features of build scripts into account where there is one.

fn main() {}
