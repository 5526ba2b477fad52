#![no_main]
//! See [`troupe_fuzz::inbetween`].

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| troupe_fuzz::inbetween(bytes));
