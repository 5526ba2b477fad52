#![no_main]
//! See [`troupe_fuzz::glb`].

troupe_fuzz::target!(glb);
