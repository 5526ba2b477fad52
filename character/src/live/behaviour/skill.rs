//! Skills: how one begins where the character stands, and what a command does meanwhile.

use std::sync::Arc;

use super::super::{CommandError, EventKind, Intent};
use super::check::{check_length, variant};
use super::using::Using;
use super::{Behaviour, CharacterParts, Doing};
use crate::object::Definition;
use crate::primitives::LocomotionCommand;
use crate::primitives::object::Interaction;
use crate::skill::Skills;

/// A skill of a pack and the index of its variant, by name. Without a variant's name: one by weight
/// and `seed`.
///
/// # Errors
/// [`CommandError::UnknownSkill`], [`CommandError::TooShort`] or
/// [`CommandError::UnknownSkillVariant`].
pub(in crate::live) fn find<'a>(
    skills: &'a Skills,
    pack: &str,
    name: &Arc<str>,
    wanted: Option<&str>,
    seed: u64,
) -> Result<(&'a Arc<Definition>, usize), CommandError> {
    let definition = skills.get(name).ok_or_else(|| CommandError::UnknownSkill {
        pack: pack.to_owned(),
        name: Arc::clone(name),
        there_are: skills.names(),
    })?;
    check_length(definition)?;
    Ok((definition, variant(definition, wanted, seed)?))
}

impl Behaviour {
    /// Begins a skill once the character stands. Both names were checked with the command.
    pub(super) fn begin_skill(
        &mut self,
        name: &Arc<str>,
        wanted: Option<&str>,
        frame: i64,
        parts: &mut CharacterParts<'_>,
    ) {
        let seed = self.seed(parts);
        let Ok((definition, variant)) = find(parts.skills, parts.rig.name(), name, wanted, seed) else {
            return;
        };
        self.begun += 1;
        self.events.push(
            frame,
            EventKind::Started {
                instance: Arc::clone(name),
                definition: definition.name.clone(),
                variant: definition.variants[variant].name.clone(),
                approach: None,
                seed,
            },
        );
        let interaction = Interaction::new(Arc::clone(definition), variant);
        let using = Using::where_it_stands(Arc::clone(name), interaction, frame, parts);
        self.doing = Doing::Using(Box::new(using));
    }

    /// Keeps a command for the end of the skill that is under way, and ends a held skill by its
    /// exit: locomotion cannot go on from the middle of a jump or from the floor. Returns the
    /// command if it need not wait.
    pub(super) fn after_skill(
        &mut self,
        intent: Intent,
        frame: i64,
        parts: &CharacterParts<'_>,
    ) -> Option<Intent> {
        let Doing::Using(using) = &mut self.doing else {
            return Some(intent);
        };
        let waits = !matches!(intent, Intent::EndInteraction | Intent::Drop | Intent::Perform(_));
        let has_begun = using.interaction.now().is_some() && !using.leaves();
        if !waits || !using.is_skill() || !has_begun {
            if waits {
                // A later command replaces the one that waits.
                self.waiting = None;
            }
            return Some(intent);
        }
        using.end();
        self.waiting = Some(match intent {
            Intent::Cancel => {
                self.let_go(frame, parts);
                Intent::Locomote(LocomotionCommand::standing(&parts.locomotion.command().style))
            }
            intent => intent,
        });
        None
    }
}
