#![no_main]
//! See [`troupe_fuzz::calls`].

troupe_fuzz::target!(calls);
