#![no_main]
//! See [`troupe_fuzz::csv`].

troupe_fuzz::target!(csv);
