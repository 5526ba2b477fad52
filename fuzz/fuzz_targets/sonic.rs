#![no_main]
//! See [`troupe_fuzz::sonic`].

troupe_fuzz::target!(sonic);
