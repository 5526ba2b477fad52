//! Actions of characters, apart from moving over the ground.

use troupe_proto::v1;

use super::path::LivePath;
use super::performance::Performance;

/// An action that a character does once: use an object of its scene, do a skill, follow a path, or
/// act out a sentence. It goes to the server with the next step or tick, or when it is sent.
///
/// ```
/// use troupe_client::Act;
///
/// let sit = Act::interact("chair-3").variant("slowly").approach("front");
/// # assert_ne!(sit, Act::Cancel);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub enum Act {
    /// Go to an object and use it.
    Interact {
        /// Id of the object in the scene.
        instance: String,
        /// Name of the variant. None: weights and seed decide.
        variant: Option<String>,
        /// Name of the approach. None: the nearest.
        approach: Option<String>,
    },
    /// Do a skill of the pack on the spot.
    Skill {
        /// Name of the skill.
        name: String,
        /// Name of the variant. None: weights and seed decide.
        variant: Option<String>,
    },
    /// Leave an interaction or a skill that is held, such as sitting, by its exit.
    EndInteraction,
    /// Stop everything at once, drop the object in the hand, and stand.
    Cancel,
    /// Put down the object in the hand.
    Drop,
    /// Follow a path, and stand at its end.
    FollowPath(LivePath),
    /// Act out a sentence, and go on as before.
    Perform(Performance),
}

impl Act {
    /// Go to the object of this id and use it.
    pub fn interact(instance: impl Into<String>) -> Self {
        Self::Interact {
            instance: instance.into(),
            variant: None,
            approach: None,
        }
    }

    /// Do the skill of this name, such as jumping or lying down.
    pub fn skill(name: impl Into<String>) -> Self {
        Self::Skill {
            name: name.into(),
            variant: None,
        }
    }

    /// Sets the variant of an interaction or a skill. Other actions do not change.
    #[must_use]
    pub fn variant(mut self, name: impl Into<String>) -> Self {
        if let Self::Interact { variant, .. } | Self::Skill { variant, .. } = &mut self {
            *variant = Some(name.into());
        }
        self
    }

    /// Sets the approach of an interaction. Other actions do not change.
    #[must_use]
    pub fn approach(mut self, name: impl Into<String>) -> Self {
        if let Self::Interact { approach, .. } = &mut self {
            *approach = Some(name.into());
        }
        self
    }

    /// Whether the character keeps moving.
    pub(crate) fn lets_move(&self) -> bool {
        matches!(self, Self::Drop)
    }

    pub(crate) fn to_message(&self) -> v1::command::Intent {
        use v1::command::Intent;
        match self {
            Self::Interact {
                instance,
                variant,
                approach,
            } => Intent::Interact(v1::Interact {
                instance: instance.clone(),
                variant: variant.clone().unwrap_or_default(),
                approach: approach.clone().unwrap_or_default(),
            }),
            Self::Skill { name, variant } => Intent::Skill(v1::UseSkill {
                name: name.clone(),
                variant: variant.clone().unwrap_or_default(),
            }),
            Self::EndInteraction => Intent::EndInteraction(v1::EndInteraction {}),
            Self::Cancel => Intent::Cancel(v1::Cancel {}),
            Self::Drop => Intent::Drop(v1::DropHeld {}),
            Self::FollowPath(path) => Intent::FollowPath(path.to_message()),
            Self::Perform(words) => Intent::Perform(words.to_message()),
        }
    }
}

impl From<Act> for v1::command::Intent {
    fn from(act: Act) -> Self {
        act.to_message()
    }
}
