#![no_main]
//! See [`troupe_fuzz::describe`].

troupe_fuzz::target!(describe);
