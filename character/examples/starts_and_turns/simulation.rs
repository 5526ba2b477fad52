//! Plays several characters at once, frame by frame, so that their plans share batches.

use std::sync::Arc;

use anyhow::{Context as _, ensure};
use troupe_character::live::{
    Advance, CONTEXT_FRAMES, Character, CharacterOptions, Clock, EventKind, FrameOut, Intent, LivePlan,
    PlanCause, PlanFailed, PlanRequest, SUB_FRAMES, Start, finish_live,
};
use troupe_character::post::hold_live;
use troupe_character::primitives::LocomotionCommand;
use troupe_character::style::{Gait, Style, StyleTable};
use troupe_engine::onnx::{Growth, NetworkPool, OnnxStages, Runtime, SessionOptions};
use troupe_engine::pack::Pack;
use troupe_engine::{EngineKind, Pipeline};
use troupe_motion::clip::Clip;
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use crate::Args;

/// Most plans of one batch.
const MAX_BATCH: usize = 32;
/// A gait that turns faster than this does not go straight, rad/s.
const TURNING_RPS: f32 = 0.3;
/// A gait whose travel differs by more than this from its heading goes aside, radians.
const ASIDE: f32 = 0.2;
/// A gait slower than this counts as standing, m/s.
const STANDING_MPS: f32 = 0.1;

/// One character and its commands.
pub struct Role {
    pub style: Arc<Style>,
    /// None: the seed of the whole run.
    pub seed: Option<u64>,
    /// Where the character faces, radians. None: where it goes.
    pub facing: Option<f32>,
    /// Velocities, m/s, and the frames at which they are commanded.
    pub orders: Vec<(usize, Vec3)>,
    pub frames: usize,
}

/// What one character did.
pub struct Take {
    pub clip: Clip,
    /// The plans for commands, each with its last context frame.
    pub plans: Vec<(usize, LivePlan)>,
    /// The speed that the character announced for a command that it cannot follow, m/s.
    pub bounded_mps: Option<f32>,
}

/// A pack and the networks that plan for its characters.
pub struct Simulation {
    pack: Pack,
    pipeline: Pipeline,
    pub styles: Vec<Arc<Style>>,
    look_ahead: u32,
    seed: u64,
}

struct Playing<'a> {
    role: &'a Role,
    character: Character,
    roots: Vec<Vec3>,
    rotations: Vec<Quat>,
    plans: Vec<(usize, LivePlan)>,
    bounded_mps: Option<f32>,
    sequence: u64,
}

impl Simulation {
    pub fn load(args: &Args) -> anyhow::Result<Self> {
        let pack = Pack::load(&args.pack)?;
        let options = SessionOptions {
            engine: EngineKind::Cpu,
            threads: 1,
            spin: false,
            fixed_shapes: false,
            growth: Growth::AtOnce,
        };
        let pool = NetworkPool::new(u64::MAX);
        let stages = OnnxStages::load(&Runtime::new(None)?, &pack, options, &pool)?;
        let styles = StyleTable::load(&pack.rig, &pack.folder, None)?.list();
        let named = |style: &Arc<Style>| args.styles.is_empty() || args.styles.contains(&style.name);
        let goes = |style: &Arc<Style>| slowest_ahead(style).is_some();
        Ok(Self {
            pipeline: Pipeline::new(pack.rig.dims, Box::new(stages), MAX_BATCH),
            pack,
            styles: styles
                .into_iter()
                .filter(|style| named(style) && goes(style))
                .collect(),
            look_ahead: args.look_ahead,
            seed: args.seed,
        })
    }

    pub fn skeleton(&self) -> Arc<Skeleton> {
        self.pack.rig.skeleton.clone()
    }

    pub fn fps(&self) -> f32 {
        self.pack.rig.fps
    }

    /// Plays characters that stand at first, and returns what they did.
    pub fn play(&mut self, roles: &[Role]) -> anyhow::Result<Vec<Take>> {
        let mut actors: Vec<Playing<'_>> = roles.iter().map(|role| self.actor(role)).collect();
        let longest = roles.iter().map(|role| role.frames).max().unwrap_or(0);
        for frame in 0..longest {
            for actor in &mut actors {
                actor.note(frame);
                actor.tell(frame)?;
            }
            self.tick(&mut actors, frame)?;
        }
        let takes = actors.into_iter().map(|actor| {
            Ok(Take {
                clip: Clip::new(self.skeleton(), self.fps(), actor.roots, actor.rotations)?,
                plans: actor.plans,
                bounded_mps: actor.bounded_mps,
            })
        });
        takes.collect()
    }

    fn actor<'a>(&self, role: &'a Role) -> Playing<'a> {
        let options = CharacterOptions {
            seed: role.seed.unwrap_or(self.seed),
            look_ahead_frames: self.look_ahead,
            replan_interval_frames: None,
            root_ratio: None,
            temperature: 0.0,
        };
        let start = Start::Standing(GlobalRoot::new(Vec3::ZERO, 0.0));
        let standing = LocomotionCommand::standing(&role.style);
        Playing {
            role,
            character: Character::new(self.pack.rig.clone(), options, start, standing),
            roots: Vec::new(),
            rotations: Vec::new(),
            plans: Vec::new(),
            bounded_mps: None,
            sequence: 0,
        }
    }

    /// Advances every character by a frame, and makes the plans that they asked for.
    fn tick(&mut self, actors: &mut [Playing<'_>], frame: usize) -> anyhow::Result<()> {
        let mut behind: Vec<usize> = Vec::new();
        for (index, actor) in actors.iter_mut().enumerate() {
            if actor.character.advance(SUB_FRAMES, Clock::Waits) == Advance::NeedsPlan {
                behind.push(index);
            }
        }
        loop {
            let mut asked: Vec<(usize, PlanRequest)> = Vec::new();
            for (index, actor) in actors.iter_mut().enumerate() {
                asked.extend(actor.character.take_request().map(|request| (index, request)));
            }
            if asked.is_empty() {
                ensure!(
                    behind.is_empty(),
                    "a character waits for a plan that it did not ask for"
                );
                return Ok(());
            }
            for some in asked.chunks(MAX_BATCH) {
                self.plan(some, actors, frame)?;
            }
            behind.retain(|&index| actors[index].character.advance(0, Clock::Waits) == Advance::NeedsPlan);
        }
    }

    fn plan(
        &mut self,
        asked: &[(usize, PlanRequest)],
        actors: &mut [Playing<'_>],
        frame: usize,
    ) -> anyhow::Result<()> {
        let items: Vec<_> = asked
            .iter()
            .filter_map(|(_, request)| request.item.keyframes().cloned())
            .collect();
        ensure!(items.len() == asked.len(), "the pack plans by paths");
        let (answers, _) = self.pipeline.run(&items).context("the networks failed")?;
        for ((index, request), answer) in asked.iter().zip(answers) {
            let actor = &mut actors[*index];
            let made = answer
                .map_err(|_| PlanFailed)
                .and_then(|raw| finish_live(&raw, &request.shape, &self.pack.rig).map_err(|_| PlanFailed));
            let made = made.map(|mut plan| {
                let LivePlan {
                    roots,
                    rotations,
                    contacts,
                    ..
                } = &mut plan;
                hold_live(&self.pack.rig, roots, rotations, contacts, CONTEXT_FRAMES);
                plan
            });
            if let (Ok(plan), PlanCause::Command) = (&made, request.cause) {
                let splice = frame + request.splice_in_frames as usize;
                actor.plans.push((splice, plan.clone()));
            }
            actor.character.plan_arrived(request.number, made);
        }
        Ok(())
    }
}

impl Playing<'_> {
    /// Records what the character shows at a frame.
    fn note(&mut self, frame: usize) {
        if frame < self.role.frames {
            let mut out = FrameOut::default();
            self.character.sample(&mut out);
            self.roots.push(out.root);
            self.rotations.extend_from_slice(&out.rotations);
        }
        let mut events = Vec::new();
        self.character.take_events(&mut events);
        for event in events {
            if let EventKind::Bounded { speed_mps, .. } = event.kind {
                self.bounded_mps = Some(speed_mps);
            }
        }
    }

    fn tell(&mut self, frame: usize) -> anyhow::Result<()> {
        for (_, velocity) in self.role.orders.iter().filter(|(at, _)| *at == frame) {
            self.sequence += 1;
            let command = LocomotionCommand {
                velocity: *velocity,
                facing: self.role.facing,
                ..LocomotionCommand::standing(&self.role.style)
            };
            self.character
                .give(self.sequence, None, Intent::Locomote(command))?;
        }
        Ok(())
    }
}

/// The slowest gait of a style that goes straight ahead.
pub fn slowest_ahead(style: &Style) -> Option<&Gait> {
    let ahead = style.gaits.iter().filter(|gait| is_straight(gait));
    ahead.min_by(|a, b| a.forward_mps.total_cmp(&b.forward_mps))
}

/// Whether a gait goes straight ahead.
pub fn is_straight(gait: &Gait) -> bool {
    gait.forward_mps > STANDING_MPS
        && gait.turn_rps.abs() <= TURNING_RPS
        && gait.left_mps.atan2(gait.forward_mps).abs() < ASIDE
}
