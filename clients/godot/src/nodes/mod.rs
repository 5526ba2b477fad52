//! The nodes that Godot gets.

mod character;
mod commands;
mod server;
