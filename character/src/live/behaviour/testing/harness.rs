//! A character in a scene that is driven frame by frame, with plans that go straight.

use std::sync::Arc;

use troupe_motion::fk::world_transforms;
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::super::super::{
    Advance, Character, CharacterEvent, CharacterOptions, Clock, CommandError, EventKind, FrameOut, Intent,
    LivePlan, PerformCommand, PlanFailed, PlanRequest, PlanTrace, SUB_FRAMES, Start, WordsPart, WordsRequest,
    World,
};
use super::{definitions, doll_rig, doll_style, room, skills};
use crate::Path;
use crate::object::Definitions;
use crate::primitives::path::AskedPoint;
use crate::primitives::{LocomotionCommand, PathCommand};
use crate::scene::{Holder, Instance, SceneCell, Transform};
use crate::skill::Skills;
use crate::style::Style;
use troupe_motion::model::Rig;

pub(crate) fn options() -> CharacterOptions {
    CharacterOptions {
        seed: 1,
        look_ahead_frames: 4,
        replan_interval_frames: None,
        root_ratio: None,
        temperature: 0.0,
    }
}

/// When plans arrive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Plans {
    /// At once.
    AtOnce,
    /// This many frames after their request.
    After(u32),
    /// Never for the keyframes of objects, otherwise at once.
    Never,
}

/// The words of a pack: frames that go ahead by 0.02 m each, and when they arrive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Words {
    /// Frames in all.
    pub(crate) frames: usize,
    /// Frames of a part.
    pub(crate) part: usize,
    /// Ticks until the first part.
    pub(crate) first: u32,
    /// Ticks between two parts.
    pub(crate) every: u32,
    /// The words fail after this many parts.
    pub(crate) fails_after: Option<usize>,
}

impl Default for Words {
    fn default() -> Self {
        Self {
            frames: 90,
            part: 32,
            first: 0,
            every: 0,
            fails_after: None,
        }
    }
}

/// Words that are still arriving.
struct Stream {
    request: WordsRequest,
    words: Words,
    parts: usize,
    wait: u32,
}

/// A character in a scene, and everything that came out of it.
pub(crate) struct Harness {
    pub(crate) character: Character,
    pub(crate) scene: Arc<SceneCell>,
    pub(crate) definitions: Arc<Definitions>,
    pub(crate) skills: Arc<Skills>,
    pub(crate) rig: Arc<Rig>,
    pub(crate) style: Arc<Style>,
    /// Metres of the scene in a metre of the character.
    pub(crate) scale: f32,
    pub(crate) clock: Clock,
    pub(crate) plans: Plans,
    /// Sub-frames of a tick.
    pub(crate) sub_frames: u32,
    open: Option<(PlanRequest, u32)>,
    /// How the words of later requests arrive.
    pub(crate) words_come: Words,
    stream: Option<Stream>,
    pub(crate) words_requests: Vec<WordsRequest>,
    sequence: u64,
    pub(crate) frames: Vec<FrameOut>,
    pub(crate) events: Vec<CharacterEvent>,
    /// Every plan request so far.
    pub(crate) requests: Vec<PlanRequest>,
}

impl Harness {
    pub(crate) fn new() -> Self {
        let definitions = definitions(&doll_rig());
        let scene = Arc::new(SceneCell::new(room(&definitions)));
        Self::in_scene(scene, definitions, "a", Vec3::ZERO)
    }

    /// A character of session `name` that stands at `place`.
    pub(crate) fn in_scene(
        scene: Arc<SceneCell>,
        definitions: Arc<Definitions>,
        name: &str,
        place: Vec3,
    ) -> Self {
        Self::of_size(scene, definitions, name, (place, 1.0))
    }

    /// As [`Harness::in_scene`], with the place in metres of the scene, of which the character's
    /// metre has `scale`.
    pub(crate) fn of_size(
        scene: Arc<SceneCell>,
        definitions: Arc<Definitions>,
        name: &str,
        (place, scale): (Vec3, f32),
    ) -> Self {
        let world = World {
            scene: Arc::clone(&scene),
            definitions: Arc::clone(&definitions),
            holder: Holder::new(name),
            scale,
        };
        Self::in_world(Some(world), scene, definitions, place / scale)
    }

    /// A character without a scene.
    pub(crate) fn nowhere() -> Self {
        let world = World::level();
        Self::in_world(None, world.scene, world.definitions, Vec3::ZERO)
    }

    fn in_world(
        world: Option<World>,
        scene: Arc<SceneCell>,
        definitions: Arc<Definitions>,
        place: Vec3,
    ) -> Self {
        let (rig, style) = (doll_rig(), doll_style());
        let scale = world.as_ref().map_or(1.0, |world| world.scale);
        let start = Start::Standing(GlobalRoot::new(place, 0.0));
        let standing = LocomotionCommand::standing(&style);
        let skills = skills(&rig);
        let character = Character::in_world(Arc::clone(&rig), options(), start, standing, world);
        Self {
            character: character.with_skills(Arc::clone(&skills)),
            scene,
            definitions,
            skills,
            rig,
            style,
            scale,
            clock: Clock::Waits,
            plans: Plans::AtOnce,
            sub_frames: SUB_FRAMES,
            open: None,
            words_come: Words::default(),
            stream: None,
            words_requests: Vec::new(),
            sequence: 0,
            frames: Vec::new(),
            events: Vec::new(),
            requests: Vec::new(),
        }
    }

    pub(crate) fn give(&mut self, intent: Intent) -> Result<(), CommandError> {
        self.sequence += 1;
        self.character.give(self.sequence, None, intent).map(|_| ())
    }

    /// Follows a path from here by way of a point `(x, z)` metres away to the origin.
    pub(crate) fn follow(&mut self, x: f32, z: f32, is_loop: bool) -> Result<(), CommandError> {
        let here = self.character.view().root.position;
        let point = |position| AskedPoint {
            position,
            heading: None,
            time_s: None,
        };
        let points = [here, here + Vec3::new(x, 0.0, z), Vec3::ZERO].map(point);
        let style = Arc::clone(&self.style);
        let path = PathCommand::new(&Path::root(), &points, Some(1.2), is_loop, style).unwrap();
        self.give(Intent::FollowPath(path))
    }

    pub(crate) fn interact(&mut self, instance: &str, variant: &str) -> Result<(), CommandError> {
        self.give(Intent::Interact {
            instance: instance.into(),
            variant: (!variant.is_empty()).then(|| variant.to_owned()),
            approach: None,
        })
    }

    pub(crate) fn skill(&mut self, name: &str, variant: &str) -> Result<(), CommandError> {
        self.give(Intent::Skill {
            name: name.into(),
            variant: (!variant.is_empty()).then(|| variant.to_owned()),
        })
    }

    pub(crate) fn walk(&mut self, x: f32, z: f32) {
        let command = LocomotionCommand {
            velocity: Vec3::new(x, 0.0, z),
            ..LocomotionCommand::standing(&self.style)
        };
        self.give(Intent::Locomote(command)).unwrap();
    }

    /// Advances by one tick.
    pub(crate) fn tick(&mut self) {
        let mut left = self.sub_frames;
        loop {
            let moved = self.character.advance(left, self.clock);
            left = 0;
            if let Some(request) = self.character.take_request() {
                let delay = match self.plans {
                    Plans::After(frames) => frames,
                    _ => 0,
                };
                self.requests.push(request.clone());
                self.open = Some((request, delay));
            }
            self.hear_words();
            let waits = moved == Advance::NeedsPlan;
            self.answer(waits);
            self.answer_words(waits);
            if !waits {
                break;
            }
        }
        self.character.take_events(&mut self.events);
        let mut out = FrameOut::default();
        self.character.sample(&mut out);
        self.frames.push(out);
    }

    fn answer(&mut self, waits: bool) {
        let Some((request, delay)) = &mut self.open else {
            return;
        };
        if *delay > 0 && !waits {
            *delay -= 1;
            return;
        }
        let plan = match self.plans {
            Plans::Never if request.pins.is_some() => Err(PlanFailed),
            _ => Ok(straight(request, &self.rig)),
        };
        let number = request.number;
        self.open = None;
        self.character.plan_arrived(number, plan);
        // The answer may have led to another request.
        if let Some(request) = self.character.take_request() {
            self.requests.push(request.clone());
            self.open = Some((request, 0));
        }
    }

    /// Takes a request for words, which replaces the one before.
    fn hear_words(&mut self) {
        if let Some(request) = self.character.take_words_request() {
            self.words_requests.push(request.clone());
            self.stream = Some(Stream {
                request,
                words: self.words_come,
                parts: 0,
                wait: self.words_come.first,
            });
        }
        let character = &self.character;
        self.stream
            .take_if(|stream| !character.wants_words(stream.request.number));
    }

    fn answer_words(&mut self, waits: bool) {
        let Some(stream) = &mut self.stream else {
            return;
        };
        if stream.wait > 0 && !waits {
            stream.wait -= 1;
            return;
        }
        let (words, number) = (stream.words, stream.request.number);
        if words.fails_after.is_some_and(|parts| stream.parts >= parts) {
            self.character.words_failed(number, "the test says so".to_owned());
            self.stream = None;
            return;
        }
        let first = stream.parts * words.part;
        let last = (first + words.part).min(words.frames);
        stream.parts += 1;
        stream.wait = words.every;
        let is_last = last >= words.frames;
        let pose = &self.style.idle().rotations;
        let part = WordsPart {
            roots: (first..last)
                .map(|frame| Vec3::new(0.0, 0.9, 0.02 * (frame + 1) as f32))
                .collect(),
            rotations: pose.repeat(last - first),
            contacts: vec![1; last - first],
        };
        self.character.words_arrived(number, part, is_last);
        if is_last {
            self.stream = None;
        }
    }

    /// Performs `text`.
    pub(crate) fn perform(&mut self, text: &str) {
        self.give(Intent::Perform(PerformCommand {
            text: text.into(),
            pack: "words".into(),
            past_frames: 16,
            frames: None,
            temperature: None,
            unknown_words: vec!["zog".to_owned()],
        }))
        .unwrap();
    }

    /// Whether a plan was asked for and has not arrived.
    pub(crate) fn awaits_plan(&self) -> bool {
        self.open.is_some()
    }

    /// The plan that was asked for will not arrive.
    pub(crate) fn forget_plan(&mut self) {
        self.open = None;
    }

    pub(crate) fn run(&mut self, frames: usize) {
        (0..frames).for_each(|_| self.tick());
    }

    /// Runs until an event of this kind, for at most `frames` frames. Returns its frame.
    pub(crate) fn until(&mut self, frames: usize, is: impl Fn(&EventKind) -> bool) -> Option<u64> {
        let known = self.events.len();
        for _ in 0..frames {
            self.tick();
            if let Some(event) = self.events[known..].iter().find(|event| is(&event.kind)) {
                return Some(event.frame);
            }
        }
        None
    }

    pub(crate) fn object(&self, id: &str) -> Arc<Instance> {
        Arc::clone(self.scene.snapshot().instance(id).unwrap())
    }

    pub(crate) fn move_object(&self, id: &str, to: Vec3) {
        self.scene
            .update(|scene| scene.move_to(id, Transform::new(to, Quat::IDENTITY)))
            .unwrap();
    }

    /// Joints of a frame that was shown, in the world.
    pub(crate) fn joints(&self, index: usize) -> Vec<Vec3> {
        let frame = &self.frames[index];
        let count = self.rig.skeleton.joint_count();
        let (mut places, mut turns) = (vec![Vec3::ZERO; count], vec![Quat::IDENTITY; count]);
        world_transforms(
            &self.rig.skeleton,
            frame.root,
            &frame.rotations,
            &mut places,
            &mut turns,
        );
        places
    }

    /// Largest acceleration of a joint from frame `from` on, m/s², and its largest movement in a
    /// frame, metres.
    pub(crate) fn roughness(&self, from: usize) -> (f32, f32) {
        let all: Vec<Vec<Vec3>> = (from..self.frames.len())
            .map(|index| self.joints(index))
            .collect();
        let mut acceleration = 0.0_f32;
        for three in all.windows(3) {
            for ((a, b), c) in three[0].iter().zip(&three[1]).zip(&three[2]) {
                let bend = *c - 2.0 * *b + *a;
                acceleration = acceleration.max(bend.length() * 900.0);
            }
        }
        let way = |pair: &[Vec<Vec3>]| {
            let apart = pair[0].iter().zip(&pair[1]).map(|(a, b)| a.distance(*b));
            apart.fold(0.0, f32::max)
        };
        (acceleration, all.windows(2).map(way).fold(0.0, f32::max))
    }

    /// The events so far, as words with their frames.
    pub(crate) fn event_words(&self) -> Vec<(u64, &'static str)> {
        let word = |kind: &EventKind| match kind {
            EventKind::Started { .. } => "started",
            EventKind::Entered { .. } => "entered",
            EventKind::Reached { .. } => "reached",
            EventKind::Attached { .. } => "attached",
            EventKind::Released { .. } => "released",
            EventKind::Done { .. } => "done",
            EventKind::Failed { .. } => "failed",
            EventKind::Interrupted { .. } => "interrupted",
            EventKind::Fell { .. } => "fell",
            EventKind::Landed { .. } => "landed",
            EventKind::Arrived { .. } => "arrived",
            EventKind::Bounded { .. } => "bounded",
            EventKind::Performing { .. } => "performing",
            EventKind::Performed { .. } => "performed",
        };
        self.events
            .iter()
            .map(|event| (event.frame, word(&event.kind)))
            .collect()
    }

    pub(crate) fn words(&self) -> Vec<&'static str> {
        self.event_words().into_iter().map(|(_, word)| word).collect()
    }
}

/// A plan as the networks might make it: straight from the context to near the target, with the
/// pose blending into the target's. Both feet stand if the root hardly moves. Otherwise they
/// alternate, and neither stands in a plan that must meet keyframes.
pub(crate) fn straight(request: &PlanRequest, rig: &Rig) -> LivePlan {
    let shape = &request.shape;
    let target = shape.targets.targets.last().unwrap();
    let listed = request
        .item
        .keyframes()
        .unwrap()
        .allowed_counts
        .iter()
        .position(|&allowed| allowed);
    let tokens = rig.dims.min_tokens + listed.unwrap_or(0);
    let frames = shape.targets.frames.unwrap_or(tokens * rig.dims.frames_per_token);
    let joints = rig.skeleton.joint_count();
    let (start, end) = (shape.context_roots[3], target.root.unwrap());
    let off = match request.pins {
        Some(_) => Vec3::new(0.03, 0.01, -0.04),
        None => Vec3::ZERO,
    };
    let mut roots = shape.context_roots.to_vec();
    let mut rotations = shape.context_rotations.clone();
    let from = shape.context_rotations[3 * joints..].to_vec();
    let to = target.rotations.clone().unwrap();
    let tilt = if request.pins.is_some() { 0.05 } else { 0.0 };
    for frame in 4..frames {
        let part = (frame - 3) as f32 / (frames - 4) as f32;
        roots.push(start.lerp(end.position + off, part));
        let pose = from.iter().zip(&to).map(|(a, b)| a.slerp(*b, part).normalize());
        rotations.extend(pose);
        let pelvis = &mut rotations[frame * joints];
        *pelvis = (yaw(tilt * part) * *pelvis).normalize();
    }
    let moves = (end.position - start).with_y(0.0).length() > 0.3;
    // The feet alternate along the way.
    let steps = |root: &Vec3| 1 << (((root.x + root.z) / 0.4).floor() as i32).rem_euclid(2);
    let contacts = match (moves, &request.pins) {
        (false, _) => vec![3; frames],
        (true, Some(_)) => vec![0; frames],
        (true, None) => roots.iter().map(steps).collect(),
    };
    let mut plan = LivePlan {
        feet_glide: false,
        contacts,
        roots,
        rotations,
        trace: PlanTrace::default(),
    };
    if let Some(pins) = &request.pins {
        pins.pin_to_targets(&mut plan, &rig.skeleton);
    }
    plan
}
