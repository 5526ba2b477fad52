#![no_main]
//! See [`troupe_fuzz::snapshot`].

troupe_fuzz::target!(snapshot);
