//! Live characters along scripted paths, recorded.

mod character;
mod crowd;
mod events;
mod follow;

pub(crate) use self::character::{Character, options_of, pack_of, scene_of};
pub(crate) use self::crowd::{CrowdTake, Recorded, follow_together};
pub(crate) use self::events::{Event, InWords, Moved, print_events};
pub(crate) use self::follow::{Order, Take, follow};
