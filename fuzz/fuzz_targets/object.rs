#![no_main]
//! See [`troupe_fuzz::object`].

troupe_fuzz::target!(object);
