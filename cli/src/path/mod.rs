//! Scripted paths: files with the commands or the way of a character.

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
