#![no_main]
//! See [`troupe_fuzz::scene`].

troupe_fuzz::target!(scene);
