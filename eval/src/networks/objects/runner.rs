//! Runs trials side by side, so that their plans share batches.

use std::sync::Arc;

use troupe_character::live::{
    Activity, Character, CharacterEvent, CharacterOptions, EventKind, FrameOut, Intent, Start, World,
};
use troupe_character::object::{Definition, Definitions};
use troupe_character::primitives::LocomotionCommand;
use troupe_character::scene::{Collider, ColliderShape, Holder, Scene, SceneCell, Shape, Transform};
use troupe_engine::Pipeline;
use troupe_engine::pack::Pack;
use troupe_motion::Quat;
use troupe_motion::Vec3;

use super::measure::{Outcome, Record};
use super::trials::Spec;
use crate::networks::clock::{HasCharacter, KeyframePlanner, tick};

/// Frames after which a trial is given up.
const LONGEST_FRAMES: u64 = 1200;
/// Frames for which a set is held before the interaction is ended.
const HOLD_FRAMES: u64 = 30;
/// Frames that are recorded after the end, because the way back to walking counts too.
const AFTER_FRAMES: u64 = 30;
const INSTANCE: &str = "it";
/// Height of the ground, metres.
pub const GROUND_M: f32 = 0.0;
/// Half the width of the stand under an object that does not stand on the ground, metres.
const STAND_M: f32 = 0.15;

/// Runs trials with one pack.
pub struct Runner {
    pack: Arc<Pack>,
    pipeline: Pipeline,
}

/// A trial under way.
struct Trial<'a> {
    spec: &'a Spec,
    character: Character,
    record: Record,
    held_since: Option<u64>,
    ended_at: Option<u64>,
    sequence: u64,
    out: FrameOut,
    events: Vec<CharacterEvent>,
}

impl Runner {
    pub fn new(pack: Arc<Pack>, pipeline: Pipeline) -> Self {
        Self { pack, pipeline }
    }

    /// Runs all of `specs` at once, each in a scene of its own.
    pub fn run(&mut self, definition: &Arc<Definition>, specs: &[Spec]) -> anyhow::Result<Vec<Outcome>> {
        let definitions = Arc::new(Definitions::new([definition.as_ref().clone()])?);
        let mut runs = specs
            .iter()
            .map(|spec| self.begin(spec, definition, &definitions))
            .collect::<anyhow::Result<Vec<_>>>()?;
        for frame in 1..=LONGEST_FRAMES {
            let mut open: Vec<&mut Trial> = runs.iter_mut().filter(|run| run.is_open(frame)).collect();
            if open.is_empty() {
                break;
            }
            for run in &mut open {
                run.command(frame)?;
            }
            let mut planner = KeyframePlanner {
                pipeline: &mut self.pipeline,
                rig: &self.pack.rig,
                holds_feet: false,
            };
            tick(&mut open, &mut planner)?;
            for run in &mut open {
                run.note(frame);
            }
        }
        Ok(runs
            .into_iter()
            .map(|run| run.record.outcome(&self.pack, definition, run.spec))
            .collect())
    }

    fn begin<'a>(
        &self,
        spec: &'a Spec,
        definition: &Definition,
        definitions: &Arc<Definitions>,
    ) -> anyhow::Result<Trial<'a>> {
        let mut scene = Scene::new(GROUND_M)?;
        if spec.object_height_m > GROUND_M {
            scene.set_colliders(&[stand(spec.object_height_m)])?;
        }
        let place = Transform::upright(Vec3::Y * spec.object_height_m, spec.object_heading);
        scene.add(INSTANCE, &definition.name, definition.body.clone(), place)?;
        let world = World {
            scene: Arc::new(SceneCell::new(scene)),
            definitions: definitions.clone(),
            holder: Holder::new("trial"),
            scale: 1.0,
        };
        let options = CharacterOptions {
            seed: spec.seed,
            look_ahead_frames: 4,
            replan_interval_frames: None,
            root_ratio: None,
            temperature: 0.0,
        };
        let command = LocomotionCommand {
            velocity: spec.velocity,
            facing: None,
            style: spec.style.clone(),
            gait: None,
            height_m: None,
        };
        let start = Start::Standing(spec.start);
        let character = Character::in_world(self.pack.rig.clone(), options, start, command, Some(world));
        Ok(Trial {
            spec,
            character,
            record: Record::new(place),
            held_since: None,
            ended_at: None,
            sequence: 0,
            out: FrameOut::default(),
            events: Vec::new(),
        })
    }
}

/// The stand under an object at a height.
fn stand(height_m: f32) -> Collider {
    let half = 0.5 * (height_m - GROUND_M);
    Collider {
        id: "stand".to_owned(),
        shape: ColliderShape::Solid(Shape::Box {
            center_m: Vec3::Y * (GROUND_M + half),
            half_extents_m: Vec3::new(STAND_M, half, STAND_M),
        }),
        transform: Transform::IDENTITY,
    }
}

impl HasCharacter for &mut Trial<'_> {
    fn character(&mut self) -> &mut Character {
        &mut self.character
    }
}

impl Trial<'_> {
    fn is_open(&self, frame: u64) -> bool {
        self.ended_at.is_none_or(|ended| frame <= ended + AFTER_FRAMES)
    }

    /// Gives the commands of a frame.
    fn command(&mut self, frame: u64) -> anyhow::Result<()> {
        let intent = if frame == self.spec.command_at {
            let instance = INSTANCE.into();
            self.record.commanded(frame);
            Some(Intent::Interact {
                instance,
                variant: None,
                approach: None,
            })
        } else if let Some((after, velocity)) = self.spec.broken_off
            && frame == self.spec.command_at + after
            && self.ended_at.is_none()
        {
            self.ended_at = Some(frame);
            self.record.broken_off(frame);
            Some(Intent::Locomote(LocomotionCommand {
                velocity,
                facing: None,
                style: self.spec.style.clone(),
                gait: None,
                height_m: None,
            }))
        } else if self.held_since.is_some_and(|since| frame == since + HOLD_FRAMES) {
            Some(Intent::EndInteraction)
        } else {
            None
        };
        if let Some(intent) = intent {
            self.sequence += 1;
            if let Err(refusal) = self.character.give(self.sequence, None, intent) {
                self.record.refused(refusal.to_string());
                self.ended_at = Some(frame);
            }
        }
        Ok(())
    }

    /// Records the frame and its events.
    fn note(&mut self, frame: u64) {
        self.character.sample(&mut self.out);
        let pose: &[Quat] = &self.out.rotations;
        self.record.frame(self.out.root, pose, self.out.contacts);
        self.character.take_events(&mut self.events);
        for event in self.events.drain(..) {
            if matches!(event.kind, EventKind::Done { .. } | EventKind::Failed { .. }) {
                self.ended_at.get_or_insert(frame);
            }
            self.record.event(event);
        }
        match self.character.activity() {
            Activity::Held { .. } => {
                self.held_since.get_or_insert(frame);
            }
            _ => self.held_since = None,
        }
    }
}
