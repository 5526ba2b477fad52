#![no_main]
//! See [`troupe_fuzz::object`].

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| troupe_fuzz::object(bytes));
