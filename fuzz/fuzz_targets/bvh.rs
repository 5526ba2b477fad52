#![no_main]
//! See [`troupe_fuzz::bvh`].

troupe_fuzz::target!(bvh);
