#![no_main]
//! See [`troupe_fuzz::scene`].

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| troupe_fuzz::scene(bytes));
