#![no_main]
//! See [`troupe_fuzz::inbetween`].

troupe_fuzz::target!(inbetween);
