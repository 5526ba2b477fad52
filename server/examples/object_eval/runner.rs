//! Runs trials side by side, so that their plans share batches.

use std::sync::Arc;

use anyhow::Context as _;
use troupe_character::live::{
    Activity, Advance, Character, CharacterEvent, CharacterOptions, Clock, EventKind, FrameOut, Intent,
    PlanFailed, PlanRequest, SUB_FRAMES, Start, World, finish_live,
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

/// Frames after which a trial is given up.
const LONGEST_FRAMES: u64 = 1200;
/// Frames for which a set is held before the interaction is ended.
const HOLD_FRAMES: u64 = 30;
/// Frames that are kept after the end: the way back to walking counts too.
const AFTER_FRAMES: u64 = 30;
const INSTANCE: &str = "it";
/// Height of the ground.
pub const GROUND_M: f32 = 0.0;
/// Half the width of what objects stand on that do not stand on the ground, metres.
const STAND_M: f32 = 0.15;

/// Runs trials with one pack.
pub struct Runner {
    pack: Arc<Pack>,
    pipeline: Pipeline,
}

/// One trial under way.
struct Run<'a> {
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
            let mut open: Vec<&mut Run> = runs.iter_mut().filter(|run| run.is_open(frame)).collect();
            if open.is_empty() {
                break;
            }
            for run in &mut open {
                run.tell(frame)?;
            }
            self.tick(&mut open)?;
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
    ) -> anyhow::Result<Run<'a>> {
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
        Ok(Run {
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

    /// Advances every character by a frame, and makes the plans that they wait for.
    fn tick(&mut self, runs: &mut [&mut Run<'_>]) -> anyhow::Result<()> {
        let mut behind: Vec<usize> = Vec::new();
        for (index, run) in runs.iter_mut().enumerate() {
            if run.character.advance(SUB_FRAMES, Clock::Waits) == Advance::NeedsPlan {
                behind.push(index);
            }
        }
        loop {
            let mut asked: Vec<(usize, PlanRequest)> = Vec::new();
            for (index, run) in runs.iter_mut().enumerate() {
                asked.extend(run.character.take_request().map(|request| (index, request)));
            }
            if asked.is_empty() && behind.is_empty() {
                return Ok(());
            }
            anyhow::ensure!(
                !asked.is_empty(),
                "a character waits for a plan that it did not ask for"
            );
            self.plan(asked, runs)?;
            behind.retain(|&index| runs[index].character.advance(0, Clock::Waits) == Advance::NeedsPlan);
        }
    }

    fn plan(&mut self, asked: Vec<(usize, PlanRequest)>, runs: &mut [&mut Run<'_>]) -> anyhow::Result<()> {
        for some in asked.chunks(self.pipeline.max_batch()) {
            let items: Vec<_> = some
                .iter()
                .filter_map(|(_, request)| request.item.keyframes().cloned())
                .collect();
            let (answers, _) = self.pipeline.run(&items).context("the networks failed")?;
            for ((index, request), answer) in some.iter().zip(answers) {
                let plan = answer
                    .map_err(|_| PlanFailed)
                    .and_then(|raw| finish_live(&raw, &request.shape, &self.pack.rig).map_err(|_| PlanFailed))
                    .map(|mut plan| {
                        if let Some(pins) = &request.pins {
                            pins.pin_to_targets(&mut plan, &self.pack.rig.skeleton);
                        }
                        plan
                    });
                runs[*index].character.plan_arrived(request.number, plan);
            }
        }
        Ok(())
    }
}

/// What an object stands on at a height.
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

impl Run<'_> {
    fn is_open(&self, frame: u64) -> bool {
        self.ended_at.is_none_or(|ended| frame <= ended + AFTER_FRAMES)
    }

    /// Gives the commands of a frame.
    fn tell(&mut self, frame: u64) -> anyhow::Result<()> {
        let intent = if frame == self.spec.told_at {
            let instance = INSTANCE.into();
            self.record.told(frame);
            Some(Intent::Interact {
                instance,
                variant: None,
                approach: None,
            })
        } else if let Some((after, velocity)) = self.spec.broken_off
            && frame == self.spec.told_at + after
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

    /// Takes down what the frame shows.
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
