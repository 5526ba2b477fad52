#![no_main]
//! See [`troupe_fuzz::websocket`].

troupe_fuzz::target!(websocket);
