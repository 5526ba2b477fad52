#![no_main]
//! See [`troupe_fuzz::codec`].

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| troupe_fuzz::codec(bytes));
