//! Scripted paths: what a character is told to do, in a file.

mod cast;
mod player;
mod read;
mod script;
mod velocity;

#[cfg(test)]
mod tests;

pub(crate) use self::cast::Cast;
pub(crate) use self::player::Player;
pub(crate) use self::script::{MOMENT_S, Moment, Path};
