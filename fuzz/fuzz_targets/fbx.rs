#![no_main]
//! See [`troupe_fuzz::fbx`].

troupe_fuzz::target!(fbx);
