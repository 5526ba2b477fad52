#![no_main]
//! See [`troupe_fuzz::bvh`].

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| troupe_fuzz::bvh(bytes));
