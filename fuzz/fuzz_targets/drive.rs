#![no_main]
//! See [`troupe_fuzz::drive`].

troupe_fuzz::target!(drive);
