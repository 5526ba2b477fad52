#![no_main]
//! See [`troupe_fuzz::drive`].

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| troupe_fuzz::drive(bytes));
