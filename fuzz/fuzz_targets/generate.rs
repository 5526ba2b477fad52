#![no_main]
//! See [`troupe_fuzz::generate`].

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| troupe_fuzz::generate(bytes));
