//! Characters as bytes, and back: what a server keeps, so that they outlive it.
//!
//! A saved character is its whole state. What it shares with others is not in it: styles and
//! definitions are there by name, and its rig and scene are those that it is restored with
//! ([`Surroundings`]). A plan on its way is not saved; a restored character asks for another.

use std::sync::Arc;

use scoped_tls::scoped_thread_local;
use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer, de::Error as _};
use troupe_motion::ik::{self, Leg};
use troupe_motion::model::Rig;

use crate::live::{Character, World};
use crate::object::Definition;
use crate::skill::Skills;
use crate::style::Style;

/// Changes with what a saved character is. Bytes of another format are not read.
pub const FORMAT: u32 = 5;

/// What a restored character finds around it.
#[derive(Debug, Clone)]
pub struct Surroundings {
    /// Its skeleton, and how it is planned for.
    pub rig: Arc<Rig>,
    /// The styles that there are.
    pub styles: Arc<dyn Styles>,
    /// What it can do where it stands.
    pub skills: Arc<Skills>,
    /// Its scene, where it lives in one.
    pub world: Option<World>,
}

/// Styles by name.
pub trait Styles: Send + Sync + std::fmt::Debug {
    /// The style of this name.
    fn find(&self, name: &str) -> Option<Arc<Style>>;
}

/// Why a character cannot be restored.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreError {
    /// Another version of the server saved it.
    #[error("it was saved in format {found}; allowed: format {FORMAT}")]
    Format {
        /// The format that it was saved in.
        found: u32,
    },
    /// The bytes are not what was written.
    #[error("its bytes are damaged")]
    Damaged,
    /// Something that it names is gone, or its skeleton is another.
    #[error("it does not fit: {0}")]
    Unfit(String),
}

scoped_thread_local!(static AROUND: Surroundings);

/// The bytes of a character, which [`restore`] reads.
pub fn save(character: &Character, into: &mut Vec<u8>) {
    let start = into.len();
    into.extend_from_slice(&FORMAT.to_le_bytes());
    into.extend_from_slice(&[0; 4]);
    match postcard::to_extend(character, std::mem::take(into)) {
        Ok(bytes) => *into = bytes,
        // Every part of a character can be written, and a vector takes all of it.
        Err(error) => unreachable!("a character cannot be written: {error}"),
    }
    let sum = crc32fast::hash(&into[start + HEAD_BYTES..]);
    into[start + 4..start + HEAD_BYTES].copy_from_slice(&sum.to_le_bytes());
}

/// Format and checksum.
const HEAD_BYTES: usize = 8;

/// The character that [`save`] wrote.
///
/// # Errors
/// [`RestoreError`].
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

/// What is around the character that is being restored.
fn around<T, E: serde::de::Error>(find: impl FnOnce(&Surroundings) -> Option<T>, what: &str) -> Result<T, E> {
    let found = AROUND.is_set().then(|| AROUND.with(find)).flatten();
    found.ok_or_else(|| E::custom(format_args!("there is no {what}")))
}

/// A style by its name.
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

/// An object definition or a skill by its name.
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
        let find = |around: &Surroundings| {
            let listed = around.world.as_ref()?.definitions.get(&name).ok()?;
            Some(listed.definition)
        };
        around(find, &format!("object definition {name:?}"))
    }
}

/// The skills of the pack.
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

/// The scene that is around the character; level ground where it lives in none.
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

/// The rig, as far as to tell whether it is the same.
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
                "it has {joints} joints, and the pack {count}"
            ))),
        }
    }
}

/// The legs of the rig.
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
