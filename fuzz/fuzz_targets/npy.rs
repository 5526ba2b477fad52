#![no_main]
//! See [`troupe_fuzz::npy`].

troupe_fuzz::target!(npy);
