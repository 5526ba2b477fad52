//! What a command asks of a character, and in which scene.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::{MAX_WAITING_COMMANDS, PerformCommand};
use crate::object::{Definition, Definitions, TooShort};
use crate::primitives::{LocomotionCommand, PathCommand};
use crate::scene::{Holder, ScaledScene, SceneCell};

/// The scene that a character lives in.
#[derive(Debug, Clone)]
pub struct World {
    /// The scene, which several characters share and change.
    pub scene: Arc<SceneCell>,
    /// The definitions of the scene's objects.
    pub definitions: Arc<Definitions>,
    /// The character's name in the scene, which marks what it reserves and holds.
    pub holder: Holder,
    /// Metres of the scene in a metre of the character, above 0: 1 unless the character is shown on
    /// a body of another size. Everything that goes into or comes out of a [`Character`] is in its
    /// own metres.
    ///
    /// [`Character`]: super::Character
    pub scale: f32,
}

impl World {
    /// Empty level ground at height 0, for one character alone.
    pub fn level() -> Self {
        Self {
            scene: Arc::default(),
            definitions: Arc::default(),
            holder: Holder::new(""),
            scale: 1.0,
        }
    }

    /// The scene as it is now, in the character's metres.
    pub(super) fn snapshot(&self) -> ScaledScene {
        ScaledScene::new(self.scene.snapshot(), self.scale)
    }

    /// The definition of this name in the character's metres; none if it does not exist.
    pub(crate) fn definition(&self, name: &str) -> Option<Arc<Definition>> {
        let definition = self.definitions.get(name).ok()?.definition;
        Some(match self.scale {
            1.0 => definition,
            scale => Arc::new(definition.scaled(scale)),
        })
    }
}

impl Intent {
    /// Whether it says how to move over the ground. Only the newest such command counts.
    pub(super) fn moves(&self) -> bool {
        matches!(self, Self::Locomote(_) | Self::FollowPath(_))
    }

    /// Whether it ends a performance.
    pub(super) fn ends_performance(&self) -> bool {
        !matches!(self, Self::EndInteraction | Self::Drop)
    }
}

/// What a command asks of a character, in the native convention.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Intent {
    /// Move over the ground.
    Locomote(LocomotionCommand),
    /// Follow a path over the ground.
    FollowPath(PathCommand),
    /// Go to an object of the scene and use it.
    Interact {
        /// Id of the object in the scene.
        instance: Arc<str>,
        /// Name of the variant. `None`: one by weight and seed.
        variant: Option<String>,
        /// Name of the approach. `None`: the nearest.
        approach: Option<String>,
    },
    /// Do a skill of the pack where the character stands.
    Skill {
        /// Name of the skill.
        name: Arc<str>,
        /// Name of the variant. `None`: one by weight and seed.
        variant: Option<String>,
    },
    /// Perform a text, then go on as before.
    Perform(PerformCommand),
    /// Leave what is held by the variant's exit. Does nothing without an interaction.
    EndInteraction,
    /// Break off everything at once, let go of the object in the hand, and stand.
    Cancel,
    /// Put down the object in the hand by its definition's rule. Does nothing if the hand is empty.
    Drop,
}

/// Why a command is refused: the character could not carry it out now. Nothing has changed, and the
/// sequence number is free. A reason that is found later comes as [`EventKind::Failed`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CommandError {
    /// The session has no scene.
    #[error("the session has no scene; set `scene` when you create it")]
    NoScene,
    /// The session's pack plans by paths, so it cannot go to the keyframes of an object.
    #[error("the session's pack follows paths, and cannot use objects")]
    ByPath,
    /// A path begins too far from the character.
    #[error("the path begins {off_m:.2} m from the character")]
    PathTooFar {
        /// Distance from the character, metres.
        off_m: f32,
        /// Farthest that it may be, metres.
        most_m: f32,
    },
    /// The session's pack plans by paths, so it has no skills.
    #[error("the session's pack follows paths, and has no skills")]
    SkillByPath,
    /// The pack has no skill of this name.
    #[error("pack {pack} has no skill {name:?}")]
    UnknownSkill {
        /// Name of the pack.
        pack: String,
        /// The unknown name.
        name: Arc<str>,
        /// The skills of the pack.
        there_are: Vec<String>,
    },
    /// The skill or object definition has a set that is shorter than what the pack's networks make
    /// at once.
    #[error(
        "{what} {name:?} has a set of {} frames ({:?}), and pack {} makes at least {} at a time",
        .short.frames,
        .short.set,
        .short.pack,
        .short.least
    )]
    TooShort {
        /// `skill` or `object definition`.
        what: &'static str,
        /// Name of the skill or definition.
        name: String,
        /// The set. Boxed, to keep the error small.
        short: Box<TooShort>,
    },
    /// The skill has no variant of this name.
    #[error("skill {skill:?} has no variant {name:?}")]
    UnknownSkillVariant {
        /// Name of the skill.
        skill: String,
        /// The unknown name.
        name: String,
        /// The variants of the skill.
        there_are: Vec<String>,
    },
    /// The scene has no object of this id.
    #[error("the scene has no object {id:?}")]
    UnknownObject {
        /// The unknown id.
        id: Arc<str>,
    },
    /// The object's definition is for characters of another pack.
    #[error("object {id:?} can be used by characters of pack {pack} only")]
    WrongPack {
        /// Id of the object in the scene.
        id: Arc<str>,
        /// The pack that the definition was checked for.
        pack: String,
    },
    /// The definition has no variant of this name.
    #[error("object definition {definition:?} has no variant {name:?}")]
    UnknownVariant {
        /// Name of the definition.
        definition: String,
        /// The unknown name.
        name: String,
        /// The variants of the definition.
        there_are: Vec<String>,
    },
    /// The definition has no approach of this name.
    #[error("object definition {definition:?} has no approach {name:?}")]
    UnknownApproach {
        /// Name of the definition.
        definition: String,
        /// The unknown name.
        name: String,
        /// The approaches of the definition.
        there_are: Vec<String>,
    },
    /// Another character has reserved or holds the object.
    #[error("object {id:?} is reserved or held by {by}")]
    Taken {
        /// Id of the object in the scene.
        id: Arc<str>,
        /// The other character.
        by: Holder,
    },
    /// Something stands between the character and the place where it would start.
    #[error("the way to object {id:?} is blocked by {by}")]
    Blocked {
        /// Id of the object in the scene.
        id: Arc<str>,
        /// What stands in the way, for example `object "crate"` or `collider "wall"`.
        by: String,
    },
    /// [`MAX_WAITING_COMMANDS`] commands wait for their frames already.
    #[error(
        "{MAX_WAITING_COMMANDS} commands of the session wait for their frames; at most {MAX_WAITING_COMMANDS} may, beside a \
         locomote"
    )]
    TooManyCommands,
    /// The hand holds another object.
    #[error("the character already holds object {id:?}; drop it first")]
    HandFull {
        /// Id of the object in the hand.
        id: Arc<str>,
    },
}
