//! Beginning to use an object: the conditions, the errors, and the reservation.

use std::sync::Arc;

use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_motion::Vec3;

use super::super::{CommandError, EventKind, FailReason};
use super::hand::Refused;
use super::using::Using;
use super::{Behaviour, CharacterParts, Doing};
use crate::object::{Action, Definition};
use crate::primitives::object::Interaction;
use crate::scene::{Instance, ScaledScene, Scene, SceneError, State};

/// What is settled about an interaction before it begins.
pub(super) struct Checked {
    definition: Arc<Definition>,
    instance: Arc<Instance>,
    variant: usize,
    /// Index of the approach that the command names.
    approach: Option<usize>,
}

impl Behaviour {
    /// The seed of the next interaction: each has its own.
    pub(super) fn seed(&self, parts: &CharacterParts<'_>) -> u64 {
        let mut generator = ChaCha8Rng::seed_from_u64(parts.options.seed);
        // Plans take the streams from 0 up.
        generator.set_stream(u64::MAX - self.begun);
        generator.next_u64()
    }

    /// Whether the object can be used now, and by which variant and approach. `root` is the
    /// character's; `names` are those of variant and approach that the command gives.
    ///
    /// # Errors
    /// [`CommandError`] for the first condition that does not hold.
    pub(super) fn checked(
        &self,
        id: &Arc<str>,
        names: (Option<&str>, Option<&str>),
        seed: u64,
        root: Vec3,
        parts: &CharacterParts<'_>,
    ) -> Result<Checked, CommandError> {
        let scene = self.world.snapshot();
        let unknown = || CommandError::UnknownObject { id: Arc::clone(id) };
        let instance = scene.instance(id).ok_or_else(unknown)?;
        let definition = self.world.definition(&instance.object).ok_or_else(unknown)?;
        if definition.pack != parts.rig.name() {
            return Err(CommandError::WrongPack {
                id: Arc::clone(id),
                pack: definition.pack.clone(),
            });
        }
        check_length(&definition)?;
        let variant = variant(&definition, names.0, seed)?;
        let approach = approach(&definition, names.1)?;
        self.check_free(id, instance, &definition, variant)?;
        let checked = Checked {
            instance: Arc::clone(instance),
            definition,
            variant,
            approach,
        };
        let using = checked.using(&scene, root, parts, 0);
        match using.blocked(&scene, root, parts.post.footing.level()) {
            Some(by) => Err(CommandError::Blocked {
                id: Arc::clone(id),
                by,
            }),
            None => Ok(checked),
        }
    }

    /// Checks that no other character has the object, and that the hand is free if the variant
    /// needs it.
    fn check_free(
        &self,
        id: &Arc<str>,
        instance: &Instance,
        definition: &Definition,
        variant: usize,
    ) -> Result<(), CommandError> {
        let own = &self.world.holder;
        match &instance.state {
            State::Reserved(by) | State::Held(by) if by != own => {
                return Err(CommandError::Taken {
                    id: Arc::clone(id),
                    by: by.clone(),
                });
            }
            State::Held(_) => return Err(CommandError::HandFull { id: Arc::clone(id) }),
            State::Free | State::Reserved(_) => {}
        }
        let takes = definition.variants.get(variant).is_some_and(|variant| {
            let sets = variant.entry.iter().chain(&variant.exit);
            sets.filter_map(|&set| definition.sets.get(set))
                .flat_map(|set| &set.events)
                .any(|event| matches!(event.action, Action::Attach(_)))
        });
        match &self.hand {
            Some(hand) if takes => Err(CommandError::HandFull {
                id: Arc::clone(&hand.instance),
            }),
            _ => Ok(()),
        }
    }

    /// Begins to use an object, or emits the event that says why not.
    pub(super) fn begin(
        &mut self,
        id: &Arc<str>,
        variant: Option<&str>,
        approach: Option<&str>,
        frame: i64,
        parts: &mut CharacterParts<'_>,
    ) {
        let seed = self.seed(parts);
        let root = parts.timeline.buffer().root(frame);
        let begun = self
            .checked(id, (variant, approach), seed, root, parts)
            .map_err(|refusal| Refused::from(&refusal))
            .and_then(|checked| self.reserve(id).map(|()| checked));
        let checked = match begun {
            Ok(checked) => checked,
            Err(Refused { reason, message }) => {
                let instance = Arc::clone(id);
                self.events.push(
                    frame,
                    EventKind::Failed {
                        instance,
                        reason,
                        message,
                    },
                );
                return;
            }
        };
        self.begun += 1;
        let scene = self.world.snapshot();
        let using = checked.using(&scene, root, parts, frame);
        self.events.push(
            frame,
            EventKind::Started {
                instance: Arc::clone(id),
                definition: checked.definition.name.clone(),
                variant: checked.definition.variants[checked.variant].name.clone(),
                approach: using.approach_name(),
                seed,
            },
        );
        self.doing = Doing::Using(Box::new(using));
    }

    fn reserve(&self, id: &str) -> Result<(), Refused> {
        let reserve = |scene: &mut Scene| scene.reserve(id, &self.world.holder);
        self.world.scene.update(reserve).map_err(|error| Refused {
            reason: match error {
                SceneError::Unknown { .. } => FailReason::Removed,
                _ => FailReason::Taken,
            },
            message: error.to_string(),
        })
    }

    /// Begins the way out of a variant whose object is in the hand, if the variant has one.
    pub(super) fn begin_way_out(&mut self, frame: i64, parts: &mut CharacterParts<'_>) {
        let Some(hand) = &self.hand else { return };
        let (definition, variant) = (Arc::clone(&hand.definition), hand.variant);
        let has_exit = (definition.variants.get(variant)).is_some_and(|variant| !variant.exit.is_empty());
        if !has_exit {
            self.drop_held(frame, parts);
            return;
        }
        let instance = Arc::clone(&hand.instance);
        let interaction = Interaction::way_out(definition, variant);
        self.doing = Doing::Using(Box::new(Using::where_it_stands(
            instance,
            interaction,
            frame,
            parts,
        )));
    }
}

impl Checked {
    fn using(&self, scene: &ScaledScene, root: Vec3, parts: &CharacterParts<'_>, frame: i64) -> Using {
        let interaction = Interaction::new(Arc::clone(&self.definition), self.variant);
        Using::new(
            &self.instance,
            interaction,
            self.approach,
            (scene, root),
            frame,
            parts,
        )
    }
}

/// Checks that the pack can make all sets.
pub(super) fn check_length(definition: &Definition) -> Result<(), CommandError> {
    let Some(short) = &definition.too_short else {
        return Ok(());
    };
    Err(CommandError::TooShort {
        what: match definition.is_skill {
            true => "skill",
            false => "object definition",
        },
        name: definition.name.clone(),
        short: Box::new(short.clone()),
    })
}

/// Index of the variant of this name. Without a name: one by weight and seed.
pub(super) fn variant(definition: &Definition, name: Option<&str>, seed: u64) -> Result<usize, CommandError> {
    let Some(name) = name else {
        return Ok(definition.variant_for(seed));
    };
    definition.variant_named(name).ok_or_else(|| {
        let there_are = (definition.variants.iter())
            .map(|variant| variant.name.clone())
            .collect();
        match definition.is_skill {
            true => CommandError::UnknownSkillVariant {
                skill: definition.name.clone(),
                name: name.to_owned(),
                there_are,
            },
            false => CommandError::UnknownVariant {
                definition: definition.name.clone(),
                name: name.to_owned(),
                there_are,
            },
        }
    })
}

fn approach(definition: &Definition, name: Option<&str>) -> Result<Option<usize>, CommandError> {
    let Some(name) = name else { return Ok(None) };
    match definition.approach_named(name) {
        Some(index) => Ok(Some(index)),
        None => Err(CommandError::UnknownApproach {
            definition: definition.name.clone(),
            name: name.to_owned(),
            there_are: (definition.approaches.iter())
                .map(|approach| approach.name.clone())
                .collect(),
        }),
    }
}

impl From<&CommandError> for Refused {
    fn from(refusal: &CommandError) -> Self {
        let reason = match refusal {
            CommandError::Taken { .. } | CommandError::HandFull { .. } => FailReason::Taken,
            CommandError::Blocked { .. } => FailReason::Blocked,
            _ => FailReason::Removed,
        };
        Self {
            reason,
            message: refusal.to_string(),
        }
    }
}
