#![no_main]
//! See [`troupe_fuzz::codec`].

troupe_fuzz::target!(codec);
