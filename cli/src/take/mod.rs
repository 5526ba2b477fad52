//! A live character along a scripted path, recorded.

mod character;
mod events;
mod follow;

pub(crate) use self::character::{Character, options_of, scene_of};
pub(crate) use self::events::{Event, Moved, Told, print_events};
#[cfg(test)]
pub(crate) use self::follow::Order;
pub(crate) use self::follow::{Take, follow};
