#![no_main]
//! See [`troupe_fuzz::generate`].

troupe_fuzz::target!(generate);
