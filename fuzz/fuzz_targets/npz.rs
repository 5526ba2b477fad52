#![no_main]
//! See [`troupe_fuzz::npz`].

troupe_fuzz::target!(npz);
