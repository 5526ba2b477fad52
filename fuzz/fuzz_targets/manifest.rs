#![no_main]
//! See [`troupe_fuzz::manifest`].

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| troupe_fuzz::manifest(bytes));
