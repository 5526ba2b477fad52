//! Live characters in virtual time: no clock, no thread, one pipeline for all of them, so a run is
//! the same every time.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;

use troupe_character::live::{
    Advance, Arrival, Character, CharacterOptions, Clock, CommandOutcome, FrameOut, Intent, PlanRequest,
    SUB_FRAMES, Start, Stats, finish_live,
};
use troupe_character::primitives::LocomotionCommand;
use troupe_character::style::StyleTable;
use troupe_engine::pack::Pack;
use troupe_engine::{EngineKind, Pipeline};
use troupe_motion::fk::WorldMotion;
use troupe_motion::model::KeyframeTask;
use troupe_motion::root::heading_of;
use troupe_motion::{Clip, GlobalRoot, Quat, Skeleton, Vec3};
use troupe_server::config::Config;

use crate::pack_folder;

/// Most characters of a batch.
pub const MAX_BATCH: usize = 64;

/// A pack with its styles and networks.
pub struct Networks {
    pub pack: Arc<Pack>,
    pub styles: StyleTable,
    pipeline: Pipeline,
}

impl Networks {
    pub fn load() -> Self {
        let pack = Pack::load(&pack_folder()).unwrap();
        let mut config = Config::local(Path::new("unused")).unwrap();
        // All threads for the one pipeline. The figures that tests compare with are f32's.
        config.workers = 1;
        let stages = config.selector(1).unwrap().load(&pack, EngineKind::Cpu).unwrap();
        Self {
            styles: StyleTable::load(&pack.rig, &pack.folder, None).unwrap(),
            pipeline: Pipeline::new(pack.rig.dims, Box::new(stages), MAX_BATCH),
            pack: Arc::new(pack),
        }
    }

    /// Makes the plans of these requests, in batches.
    fn serve(&mut self, troop: &mut [Actor], requests: Vec<(usize, PlanRequest)>) {
        for batch in requests.chunks(MAX_BATCH) {
            let items: Vec<KeyframeTask> = batch
                .iter()
                .map(|(_, request)| request.item.keyframes().unwrap().clone())
                .collect();
            let (answers, _) = self.pipeline.run(&items).unwrap();
            for ((index, request), raw) in batch.iter().zip(answers) {
                let plan = finish_live(&raw.unwrap(), &request.shape, &self.pack.rig).unwrap();
                let actor = &mut troop[*index];
                let arrival = actor.character.plan_arrived(request.number, Ok(plan));
                match arrival {
                    Arrival::InTime { .. } | Arrival::Late => {
                        actor.take.seams.push(actor.asked_for(request));
                    }
                    // A command has had another plan asked for in the place of this one.
                    Arrival::Stray => assert!(actor.newest > request.number),
                    Arrival::Dropped | Arrival::Failed => panic!("{arrival:?}"),
                }
            }
        }
    }
}

/// A command of a script: from this frame on.
#[derive(Debug, Clone)]
pub struct Cue {
    pub frame: u64,
    pub velocity: Vec3,
    pub facing: Option<f32>,
    pub style: String,
}

impl Cue {
    pub fn new(frame: u64, x: f32, z: f32, style: &str) -> Self {
        Self {
            frame,
            velocity: Vec3::new(x, 0.0, z),
            facing: None,
            style: style.to_owned(),
        }
    }
}

/// What a character did.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Take {
    pub roots: Vec<Vec3>,
    /// `frames * joints`.
    pub rotations: Vec<Quat>,
    pub contacts: Vec<u8>,
    /// Splice frames of its plans.
    pub seams: Vec<u64>,
}

impl Take {
    pub fn frames(&self) -> usize {
        self.roots.len()
    }

    pub fn pose(&self, frame: usize, joints: usize) -> &[Quat] {
        &self.rotations[frame * joints..][..joints]
    }

    /// Mean velocity over the ground of the frames `from..to`, m/s.
    pub fn velocity(&self, from: usize, to: usize) -> Vec3 {
        (self.roots[to] - self.roots[from]).with_y(0.0) * (30.0 / (to - from) as f32)
    }

    /// Mean heading of the frames `from..to`, radians: a step's sway cancels out.
    pub fn heading(&self, from: usize, to: usize, skeleton: &Skeleton) -> f32 {
        let joints = skeleton.joint_count();
        let (sin, cos) = (from..to)
            .map(|frame| heading_of(self.pose(frame, joints)[0], skeleton.left_axis).sin_cos())
            .fold((0.0, 0.0), |sum, (sin, cos)| (sum.0 + sin, sum.1 + cos));
        sin.atan2(cos)
    }

    /// World transforms of all joints.
    pub fn world(&self, skeleton: &Arc<Skeleton>) -> WorldMotion {
        let (roots, rotations) = (self.roots.clone(), self.rotations.clone());
        WorldMotion::from_clip(&Clip::new(Arc::clone(skeleton), 30.0, roots, rotations).unwrap())
    }
}

/// Accelerations of all joints (m/s²) around every frame but the first and last: second differences
/// of positions.
pub fn accelerations(motion: &WorldMotion) -> Vec<f32> {
    let joints = motion.joints;
    let middle = motion.positions.windows(2 * joints + 1);
    middle
        .map(|w| (w[0] - 2.0 * w[joints] + w[2 * joints]).length() * 900.0)
        .collect()
}

/// The value that `share` of `values` do not exceed.
pub fn percentile(mut values: Vec<f32>, share: f64) -> f32 {
    values.sort_by(f32::total_cmp);
    let index = (share * (values.len() - 1) as f64).round() as usize;
    values[index]
}

/// A character and its script.
pub struct Actor {
    character: Character,
    cues: Vec<Cue>,
    sequence: u64,
    /// Number of the plan that it asked for last.
    newest: u64,
    take: Take,
    out: FrameOut,
}

impl Actor {
    /// A character that stands at the origin with heading 0 in the style of its first cue.
    pub fn new(networks: &Networks, seed: u64, cues: Vec<Cue>) -> Self {
        let command = LocomotionCommand {
            velocity: Vec3::ZERO,
            facing: None,
            style: networks.styles.resolve(&cues[0].style).unwrap(),
            gait: None,
            height_m: None,
        };
        let options = CharacterOptions {
            seed,
            look_ahead_frames: 4,
            replan_interval_frames: None,
            root_ratio: None,
            temperature: 0.0,
        };
        let start = Start::Standing(GlobalRoot::new(Vec3::ZERO, 0.0));
        Self {
            character: Character::new(Arc::clone(&networks.pack.rig), options, start, command),
            newest: 0,
            cues,
            sequence: 0,
            take: Take::default(),
            out: FrameOut::default(),
        }
    }

    fn tell(&mut self, networks: &Networks, frame: u64) {
        for cue in self.cues.iter().filter(|cue| cue.frame == frame) {
            self.sequence += 1;
            let command = LocomotionCommand {
                velocity: cue.velocity,
                facing: cue.facing,
                style: networks.styles.resolve(&cue.style).unwrap(),
                gait: None,
                height_m: None,
            };
            let outcome = self
                .character
                .give(self.sequence, None, Intent::Locomote(command))
                .unwrap();
            assert_eq!(outcome, CommandOutcome::Accepted);
        }
    }

    fn record(&mut self) {
        self.character.sample(&mut self.out);
        self.take.roots.push(self.out.root);
        self.take.rotations.extend_from_slice(&self.out.rotations);
        self.take.contacts.push(self.out.contacts);
    }

    fn asked_for(&self, request: &PlanRequest) -> u64 {
        let record = self.character.peek(0).plan.unwrap();
        assert_eq!(record.number, request.number);
        record.splice
    }
}

/// Plays all scripts at once for `frames` frames at 30 Hz. Plans come `latency_ticks` after they
/// were asked for. Gives what each character did, frame 0 first.
pub fn play(
    networks: &mut Networks,
    mut troop: Vec<Actor>,
    frames: u64,
    latency_ticks: usize,
) -> Vec<(Take, Stats)> {
    let mut underway: VecDeque<Vec<(usize, PlanRequest)>> = vec![Vec::new(); latency_ticks].into();
    for frame in 0..frames {
        let mut requests = Vec::new();
        for (index, actor) in troop.iter_mut().enumerate() {
            actor.record();
            actor.tell(networks, frame);
            assert_eq!(actor.character.advance(SUB_FRAMES, Clock::Runs), Advance::Moved);
            if let Some(request) = actor.character.take_request() {
                actor.newest = request.number;
                requests.push((index, request));
            }
        }
        underway.push_back(requests);
        if let Some(due) = underway.pop_front() {
            networks.serve(&mut troop, due);
        }
    }
    troop
        .into_iter()
        .map(|actor| (actor.take, actor.character.view().stats))
        .collect()
}
