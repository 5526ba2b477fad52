//! Saves characters as bytes and restores them, so that they survive a restart of their server.
//!
//! Saved is the whole state of a character. What it shares with others is not: styles and
//! definitions are saved by name, and rig and scene come from the [`Surroundings`] at the restore.
//! A plan on its way is not saved; a restored character asks for another.

use std::sync::Arc;

use scoped_tls::scoped_thread_local;
use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer, de::Error as _};
use troupe_motion::ik::{self, Leg};
use troupe_motion::model::Rig;

use crate::live::{Character, World};
use crate::object::Definition;
use crate::skill::Skills;
use crate::style::Style;

/// Rises with every change of what is saved. Bytes of another format are not read.
pub const FORMAT: u32 = 6;

/// What a character needs at its restore, because it is not saved with it.
#[derive(Debug, Clone)]
pub struct Surroundings {
    /// The skeleton of its pack, and how that pack plans.
    pub rig: Arc<Rig>,
    /// The styles of the server, by name.
    pub styles: Arc<dyn Styles>,
    /// The skills of its pack.
    pub skills: Arc<Skills>,
    /// Its scene; none in a session without one.
    pub world: Option<World>,
}

/// Styles by name.
pub trait Styles: Send + Sync + std::fmt::Debug {
    /// The style of this name; none if it no longer exists.
    fn find(&self, name: &str) -> Option<Arc<Style>>;
}

/// Why a character cannot be restored.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreError {
    /// Another version of the server saved the character.
    #[error("it was saved in format {found}; allowed: format {FORMAT}")]
    Format {
        /// The format that it was saved in.
        found: u32,
    },
    /// The bytes are not those that were written.
    #[error("its bytes are damaged")]
    Damaged,
    /// The character refers to something that no longer exists, or its skeleton has changed.
    #[error("it does not fit: {0}")]
    Unfit(String),
}

scoped_thread_local!(static AROUND: Surroundings);

/// Appends the bytes of a character to `into`.
pub fn save(character: &Character, into: &mut Vec<u8>) {
    let start = into.len();
    into.extend_from_slice(&FORMAT.to_le_bytes());
    into.extend_from_slice(&[0; 4]);
    match postcard::to_extend(character, std::mem::take(into)) {
        Ok(bytes) => *into = bytes,
        // A character can always be written, and a vector takes any number of bytes.
        Err(error) => unreachable!("a character cannot be written: {error}"),
    }
    let sum = crc32fast::hash(&into[start + HEAD_BYTES..]);
    into[start + 4..start + HEAD_BYTES].copy_from_slice(&sum.to_le_bytes());
}

/// Bytes of format and checksum.
const HEAD_BYTES: usize = 8;

/// Restores the character that [`save`] wrote.
///
/// # Errors
/// [`RestoreError`] for bytes of another format, damaged ones, or missing surroundings.
pub fn restore(bytes: &[u8], around: &Surroundings) -> Result<Character, RestoreError> {
    let (head, body) = bytes.split_at_checked(HEAD_BYTES).ok_or(RestoreError::Damaged)?;
    let word = |at: usize| head[at..].first_chunk().map(|word| u32::from_le_bytes(*word));
    let found = word(0).ok_or(RestoreError::Damaged)?;
    if found != FORMAT {
        return Err(RestoreError::Format { found });
    }
    if word(4) != Some(crc32fast::hash(body)) {
        return Err(RestoreError::Damaged);
    }
    read(body, around)
}

/// [`restore`] without head and checksum.
fn read(body: &[u8], around: &Surroundings) -> Result<Character, RestoreError> {
    let unfit = |error: postcard::Error| RestoreError::Unfit(error.to_string());
    let mut character: Character = AROUND.set(around, || postcard::from_bytes(body).map_err(unfit))?;
    character.wake().map_err(RestoreError::Unfit)?;
    Ok(character)
}

/// Finds something in the surroundings of the character that is being restored.
fn around<T, E: serde::de::Error>(find: impl FnOnce(&Surroundings) -> Option<T>, what: &str) -> Result<T, E> {
    let found = AROUND.is_set().then(|| AROUND.with(find)).flatten();
    found.ok_or_else(|| E::custom(format_args!("there is no {what}")))
}

/// Writes a style as its name.
pub(crate) mod style {
    use super::*;

    pub(crate) fn serialize<S: Serializer>(style: &Arc<Style>, to: S) -> Result<S::Ok, S::Error> {
        style.name.serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Arc<Style>, D::Error> {
        let name = String::deserialize(from)?;
        around(|around| around.styles.find(&name), &format!("style {name:?}"))
    }
}

/// Writes an object definition or a skill as its name.
pub(crate) mod definition {
    use super::*;

    pub(crate) fn serialize<S: Serializer>(definition: &Arc<Definition>, to: S) -> Result<S::Ok, S::Error> {
        (definition.is_skill, &definition.name).serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Arc<Definition>, D::Error> {
        let (is_skill, name) = <(bool, String)>::deserialize(from)?;
        if is_skill {
            let find = |around: &Surroundings| around.skills.get(&name).cloned();
            return around(find, &format!("skill {name:?}"));
        }
        let find = |around: &Surroundings| around.world.as_ref()?.definition(&name);
        around(find, &format!("object definition {name:?}"))
    }
}

/// Writes nothing for the pack's skills.
pub(crate) mod skills {
    use super::*;

    pub(crate) fn serialize<S: Serializer>(_: &Arc<Skills>, to: S) -> Result<S::Ok, S::Error> {
        ().serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Arc<Skills>, D::Error> {
        <()>::deserialize(from)?;
        around(|around| Some(Arc::clone(&around.skills)), "skills")
    }
}

/// Writes nothing for the scene. A character without one gets level ground.
pub(crate) mod world {
    use super::*;

    pub(crate) fn serialize<S: Serializer>(_: &World, to: S) -> Result<S::Ok, S::Error> {
        ().serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<World, D::Error> {
        <()>::deserialize(from)?;
        let world = |around: &Surroundings| Some(around.world.clone().unwrap_or_else(World::level));
        around(world, "scene")
    }
}

/// Writes only the number of the rig's joints, to notice another skeleton.
pub(crate) mod rig {
    use super::*;

    pub(crate) fn serialize<S: Serializer>(rig: &Arc<Rig>, to: S) -> Result<S::Ok, S::Error> {
        rig.skeleton.joint_count().serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Arc<Rig>, D::Error> {
        let joints = usize::deserialize(from)?;
        let rig = around(|around| Some(around.rig.clone()), "rig")?;
        match rig.skeleton.joint_count() {
            count if count == joints => Ok(rig),
            count => Err(D::Error::custom(format_args!(
                "the character has {joints} joints, and the pack {count}"
            ))),
        }
    }
}

/// Writes nothing for the rig's legs.
pub(crate) mod legs {
    use super::*;

    pub(crate) fn serialize<S: Serializer>(_: &Arc<[Leg]>, to: S) -> Result<S::Ok, S::Error> {
        ().serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Arc<[Leg]>, D::Error> {
        <()>::deserialize(from)?;
        around(|around| Some(ik::legs(&around.rig.skeleton).into()), "rig")
    }
}

#[cfg(test)]
#[path = "saved_tests.rs"]
mod tests;
