#![no_main]
//! See [`troupe_fuzz::gltf`].

troupe_fuzz::target!(gltf);
