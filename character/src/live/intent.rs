//! What a character is asked to do, and in which scene.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::{MAX_WAITING_COMMANDS, PerformCommand};
use crate::object::Definitions;
use crate::primitives::{LocomotionCommand, PathCommand};
use crate::scene::{Holder, SceneCell};

/// The scene that a character lives in.
#[derive(Debug, Clone)]
pub struct World {
    /// The scene; shared with others, and changed by them.
    pub scene: Arc<SceneCell>,
    /// What its objects can be used for.
    pub definitions: Arc<Definitions>,
    /// The character's name in the scene: what it reserves and holds is reserved and held by this.
    pub holder: Holder,
}

impl World {
    /// Level ground at height 0 with nothing on it, of one character alone.
    pub fn level() -> Self {
        Self {
            scene: Arc::default(),
            definitions: Arc::default(),
            holder: Holder::new(""),
        }
    }
}

impl Intent {
    /// Whether it says how to move over the ground; of those, the newest alone counts.
    pub(super) fn moves(&self) -> bool {
        matches!(self, Self::Locomote(_) | Self::FollowPath(_))
    }

    /// Whether it ends what is acted out.
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
        /// The object.
        instance: Arc<str>,
        /// Name of the variant. `None`: one by weight and seed.
        variant: Option<String>,
        /// Name of the approach. `None`: the nearest.
        approach: Option<String>,
    },
    /// Do a skill of the pack where the character stands.
    Skill {
        /// The skill.
        name: Arc<str>,
        /// Name of the variant. `None`: one by weight and seed.
        variant: Option<String>,
    },
    /// Act out words, and go on in locomotion.
    Perform(PerformCommand),
    /// Leave what is held by the variant's exit; nothing where there is no interaction.
    EndInteraction,
    /// Break off whatever it does, at once, let go of what is in the hand, and stand.
    Cancel,
    /// Put down what is in the hand, by its definition's rule; nothing where the hand is empty.
    Drop,
}

/// Why a command is not accepted: the character could not do it now. Nothing has changed then, and
/// its sequence number is free. What is found out later is told by [`EventKind::Failed`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The session is in no scene.
    #[error("the session has no scene; set `scene` when you create it")]
    NoScene,
    /// The session's pack plans by paths, and cannot go to the keyframes of an object.
    #[error("the session's pack follows paths, and cannot use objects")]
    ByPath,
    /// A path begins too far from the character.
    #[error("the path begins {off_m:.2} m from the character")]
    PathTooFar {
        /// How far, metres.
        off_m: f32,
    },
    /// The session's pack plans by paths, and cannot do skills.
    #[error("the session's pack follows paths, and has no skills")]
    SkillByPath,
    /// The pack has no such skill.
    #[error("pack {pack} has no skill {name:?}")]
    UnknownSkill {
        /// The pack.
        pack: String,
        /// What was asked for.
        name: Arc<str>,
        /// The skills that there are.
        there_are: Vec<String>,
    },
    /// The skill has no such variant.
    #[error("skill {skill:?} has no variant {name:?}")]
    UnknownSkillVariant {
        /// The skill.
        skill: String,
        /// What was asked for.
        name: String,
        /// The variants that there are.
        there_are: Vec<String>,
    },
    /// No such object in the scene.
    #[error("the scene has no object {id:?}")]
    UnknownObject {
        /// Its id.
        id: Arc<str>,
    },
    /// The object's definition is for characters of another pack.
    #[error("object {id:?} can be used by characters of pack {pack} only")]
    WrongPack {
        /// The object.
        id: Arc<str>,
        /// The pack that its definition was checked for.
        pack: String,
    },
    /// The definition has no such variant.
    #[error("object definition {definition:?} has no variant {name:?}")]
    UnknownVariant {
        /// The definition.
        definition: String,
        /// What was asked for.
        name: String,
        /// The variants that there are.
        there_are: Vec<String>,
    },
    /// The definition has no such approach.
    #[error("object definition {definition:?} has no approach {name:?}")]
    UnknownApproach {
        /// The definition.
        definition: String,
        /// What was asked for.
        name: String,
        /// The approaches that there are.
        there_are: Vec<String>,
    },
    /// Another character has reserved or holds the object.
    #[error("object {id:?} is reserved or held by {by}")]
    Taken {
        /// The object.
        id: Arc<str>,
        /// Who has it.
        by: Holder,
    },
    /// Something stands between the character and where it would start.
    #[error("the way to object {id:?} is blocked by {by}")]
    Blocked {
        /// The object.
        id: Arc<str>,
        /// What is in the way, for example `object "crate"` or `collider "wall"`.
        by: String,
    },
    /// As many commands as may wait for their frames do.
    #[error(
        "{MAX_WAITING_COMMANDS} commands of the session wait for their frames; at most {MAX_WAITING_COMMANDS} may, beside a \
         locomote"
    )]
    TooManyCommands,
    /// The hand holds another object.
    #[error("the character already holds object {id:?}; drop it first")]
    HandFull {
        /// What it holds.
        id: Arc<str>,
    },
}
