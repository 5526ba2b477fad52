#![no_main]
//! See [`troupe_fuzz::manifest`].

troupe_fuzz::target!(manifest);
