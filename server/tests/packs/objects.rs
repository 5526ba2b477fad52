//! Smart objects: the example definitions, on the real networks.

use std::f32::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use troupe_character::live::{
    Advance, Character, CharacterEvent, CharacterOptions, Clock, EventKind, FrameOut, Intent, KeyframeError,
    SUB_FRAMES, Start, World, finish_live,
};
use troupe_character::object::{self, Definitions};
use troupe_character::primitives::LocomotionCommand;
use troupe_character::scene::{
    self, Collider, ColliderShape, Holder, Scene, SceneCell, Shape, State, Transform,
};
use troupe_character::style::{Style, StyleTable};
use troupe_engine::pack::Pack;
use troupe_engine::{EngineKind, Pipeline};
use troupe_motion::fk::{joint_transform, world_transforms};
use troupe_motion::{GlobalRoot, Quat, Vec3};
use troupe_server::config::Config;

use crate::pack_folder;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

/// A pack with its networks, styles and the example definitions.
struct Studio {
    pack: Arc<Pack>,
    pipeline: Pipeline,
    styles: StyleTable,
    definitions: Arc<Definitions>,
}

impl Studio {
    fn new() -> Self {
        let models = pack_folder();
        let pack = Pack::load(&models).unwrap();
        let selector = Config::local(&models).unwrap().selector(1).unwrap();
        let stages = selector.load(&pack, EngineKind::Cpu).unwrap();
        let definitions = object::load_folder(&folder("examples/objects"), &pack.rig).unwrap();
        Self {
            pipeline: Pipeline::new(pack.rig.dims, Box::new(stages), 1),
            styles: StyleTable::load(&pack.rig, &pack.folder, None).unwrap(),
            definitions: Arc::new(Definitions::new(definitions).unwrap()),
            pack: Arc::new(pack),
        }
    }

    fn courtyard(&self) -> Scene {
        let file = folder("examples/scenes/courtyard.toml");
        scene::load_file(&file, &*self.definitions.snapshot())
            .unwrap()
            .scene
    }

    fn style(&self, name: &str) -> Arc<Style> {
        self.styles.get(name).unwrap()
    }

    /// A character that stands at `place`, facing `heading`.
    fn actor<'a>(&'a mut self, scene: Scene, style: &str, place: Vec3, heading: f32) -> Actor<'a> {
        let scene = Arc::new(SceneCell::new(scene));
        let world = World {
            scene: Arc::clone(&scene),
            definitions: Arc::clone(&self.definitions),
            holder: Holder::new("hero"),
            scale: 1.0,
        };
        let options = CharacterOptions {
            seed: 5,
            look_ahead_frames: 4,
            replan_interval_frames: None,
            root_ratio: None,
            temperature: 0.0,
        };
        let style = self.style(style);
        let standing = LocomotionCommand::standing(&style);
        let start = Start::Standing(GlobalRoot::new(place, heading));
        Actor {
            character: Character::in_world(Arc::clone(&self.pack.rig), options, start, standing, Some(world)),
            studio: self,
            scene,
            style,
            sequence: 0,
            frames: Vec::new(),
            events: Vec::new(),
        }
    }
}

/// A character whose plans the networks make at once, and all that came out of it.
struct Actor<'a> {
    studio: &'a mut Studio,
    character: Character,
    scene: Arc<SceneCell>,
    style: Arc<Style>,
    sequence: u64,
    frames: Vec<FrameOut>,
    events: Vec<CharacterEvent>,
}

impl Actor<'_> {
    fn give(&mut self, intent: Intent) {
        self.sequence += 1;
        self.character.give(self.sequence, None, intent).unwrap();
    }

    fn interact(&mut self, instance: &str, variant: &str) {
        self.give(Intent::Interact {
            instance: instance.into(),
            variant: Some(variant.to_owned()),
            approach: None,
        });
    }

    fn walk(&mut self, x: f32, z: f32) {
        let command = LocomotionCommand {
            velocity: Vec3::new(x, 0.0, z),
            ..LocomotionCommand::standing(&self.style)
        };
        self.give(Intent::Locomote(command));
    }

    fn tick(&mut self) {
        let mut left = SUB_FRAMES;
        loop {
            let moved = self.character.advance(left, Clock::Waits);
            left = 0;
            if let Some(request) = self.character.take_request() {
                let studio = &mut *self.studio;
                let (mut answers, _) = studio
                    .pipeline
                    .run(std::slice::from_ref(request.item.keyframes().unwrap()))
                    .unwrap();
                let raw = answers.remove(0).unwrap();
                let mut plan = finish_live(&raw, &request.shape, &studio.pack.rig).unwrap();
                if let Some(pins) = &request.pins {
                    pins.pin_to_targets(&mut plan, &studio.pack.rig.skeleton);
                }
                self.character.plan_arrived(request.number, Ok(plan));
            }
            if moved == Advance::Moved {
                break;
            }
        }
        self.character.take_events(&mut self.events);
        let mut out = FrameOut::default();
        self.character.sample(&mut out);
        self.frames.push(out);
    }

    fn run(&mut self, frames: usize) {
        (0..frames).for_each(|_| self.tick());
    }

    /// Goes on until something of that kind has happened, at most `frames` frames: its frame.
    fn until(&mut self, frames: usize, is: impl Fn(&EventKind) -> bool) -> u64 {
        let known = self.events.len();
        for _ in 0..frames {
            self.tick();
            if let Some(event) = self.events[known..].iter().find(|event| is(&event.kind)) {
                return event.frame;
            }
        }
        panic!("it did not happen: {:?}", self.events);
    }

    fn joint(&self, index: usize, name: &str) -> Vec3 {
        let (frame, skeleton) = (&self.frames[index], &self.studio.pack.rig.skeleton);
        let joint = skeleton.joint_index(name).unwrap();
        joint_transform(skeleton, frame.root, &frame.rotations, joint).0
    }

    fn joints(&self, from: usize, to: usize) -> Vec<Vec<Vec3>> {
        let skeleton = &self.studio.pack.rig.skeleton;
        let count = skeleton.joint_count();
        let mut turns = vec![Quat::IDENTITY; count];
        let places = |frame: &FrameOut| {
            let mut places = vec![Vec3::ZERO; count];
            world_transforms(skeleton, frame.root, &frame.rotations, &mut places, &mut turns);
            places
        };
        self.frames[from..to].iter().map(places).collect()
    }

    /// How the motion from frame to frame is.
    fn quality(&self, from: usize, to: usize) -> Quality {
        let contacts = self.studio.pack.rig.skeleton.contacts.as_ref().unwrap();
        let all = self.joints(from, to);
        let mut accelerations: Vec<f32> = Vec::new();
        for three in all.windows(3) {
            for ((a, b), c) in three[0].iter().zip(&three[1]).zip(&three[2]) {
                let bend = *c - 2.0 * *b + *a;
                accelerations.push(bend.length() * 900.0);
            }
        }
        accelerations.sort_by(f32::total_cmp);
        let mut skate = 0.0;
        let mut step = 0.0_f32;
        for pair in all.windows(2) {
            for (&joint, clearance) in contacts.joints.iter().zip(&contacts.clearance_m) {
                let (a, b) = (pair[0][joint], pair[1][joint]);
                let near = (2.0 - 2.0_f32.powf((b.y - clearance) / 0.025)).clamp(0.0, 1.0);
                skate += (b - a).with_y(0.0).length() * near * 1000.0;
            }
            let apart = pair[0].iter().zip(&pair[1]).map(|(a, b)| a.distance(*b));
            step = step.max(apart.fold(0.0, f32::max));
        }
        let at = |share: f32| accelerations[((accelerations.len() - 1) as f32 * share) as usize];
        Quality {
            skate_mm: skate / (contacts.joints.len() * (all.len() - 1)) as f32,
            acceleration: at(0.995),
            most: at(1.0),
            step,
        }
    }

    fn reached(&self) -> Vec<(u64, String, KeyframeError, KeyframeError)> {
        let of = |event: &CharacterEvent| match &event.kind {
            EventKind::Reached {
                set, before, after, ..
            } => Some((event.frame, set.clone(), *before, *after)),
            _ => None,
        };
        self.events.iter().filter_map(of).collect()
    }
}

#[derive(Debug, Clone, Copy)]
struct Quality {
    /// Mean way of a contact joint that is near the ground, mm a frame.
    skate_mm: f32,
    /// 99.5 % of the joints' accelerations, and the largest, m/s².
    acceleration: f32,
    most: f32,
    /// Farthest that a joint goes in a frame, metres.
    step: f32,
}

fn is_done(kind: &EventKind) -> bool {
    matches!(kind, EventKind::Done { .. })
}

/// A cup on a column, to be had from every side.
fn column(studio: &Studio) -> Scene {
    let mut scene = Scene::new(0.0).unwrap();
    let column = Collider {
        id: "column".to_owned(),
        shape: ColliderShape::Solid(Shape::Box {
            center_m: Vec3::ZERO,
            half_extents_m: Vec3::new(0.12, 0.45, 0.12),
        }),
        transform: Transform::new(Vec3::new(0.0, 0.45, 0.0), Quat::IDENTITY),
    };
    scene.set_colliders(&[column]).unwrap();
    let cup = studio.definitions.get("cup").unwrap().definition;
    let at = Transform::new(Vec3::new(0.0, 0.9, 0.0), Quat::IDENTITY);
    scene.add("cup", "cup", Arc::clone(&cup.body), at).unwrap();
    scene
}

#[test]
fn a_greeter_is_waved_at_from_any_heading() {
    let mut studio = Studio::new();
    for (heading, variant, hand) in [
        (0.0, "right", "Hand_R"),
        (2.0, "left", "Hand_L"),
        (-2.8, "right", "Hand_R"),
    ] {
        let scene = studio.courtyard();
        let mut actor = studio.actor(scene, "normal", Vec3::new(2.5, 0.0, 5.5), heading);
        actor.run(20);
        actor.interact("gate", variant);
        let up = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set.ends_with("-up"));
        let frame = actor.until(400, up) as usize;
        let hand = actor.joint(frame - 1, hand);
        assert!((hand.y - 1.6).abs() < 0.01, "{hand}");
        actor.until(400, is_done);
        let quality = actor.quality(20, actor.frames.len());
        println!("greeter from {heading}: {quality:?}");
        for (_, set, before, after) in actor.reached() {
            println!("  {set}: before {before:?} after {after:?}");
        }
        assert!(quality.most < 120.0 && quality.step < 0.2, "{quality:?}");
        let faces = GlobalRoot::of_pose(
            actor.frames.last().unwrap().root,
            actor.frames.last().unwrap().rotations[0],
            actor.studio.pack.rig.skeleton.left_axis,
        );
        let toward = Vec3::new(4.0, 0.0, 5.0) - faces.position.with_y(0.0);
        assert!(faces.forward().angle_between(toward) < 0.4, "it faces the place");
    }
}

#[test]
fn a_cup_is_taken_from_all_sides_carried_and_put_down() {
    let mut studio = Studio::new();
    let mut all = Vec::new();
    for (nth, variant) in (0..8).zip(["bend", "upright"].into_iter().cycle()) {
        let side = TAU * nth as f32 / 8.0;
        let place = Vec3::new(side.sin(), 0.0, side.cos()) * 4.0;
        let scene = column(&studio);
        let mut actor = studio.actor(scene, "normal", place, side + 3.1);
        actor.run(10);
        actor.interact("cup", variant);
        let entered = |kind: &EventKind| matches!(kind, EventKind::Entered { .. });
        let from = actor.until(400, entered) as usize;
        let attached = |kind: &EventKind| matches!(kind, EventKind::Attached { .. });
        let taken = actor.until(200, attached) as usize;
        let (_, set, before, after) = actor.reached()[0].clone();
        assert!(
            after.root_m < 1e-3 && after.heading < 1e-3 && after.joint_m < 1e-3,
            "{set}: {after:?}"
        );
        let hand = actor.joint(taken - 1, "Hand_R");
        let cup = Vec3::new(0.0, 0.95, 0.0);
        assert!(hand.distance(cup) < 0.25, "the hand is at {hand}");
        let quality = actor.quality(from - 1, taken);
        println!(
            "cup from {nth}, {variant}: {} frames, before {before:?}, {quality:?}",
            taken - from
        );
        assert!(quality.step < 0.3 && quality.acceleration < 100.0, "{quality:?}");
        all.push(quality);

        // Up, a walk with it in the hand, and down again where the column is no more: onto the
        // ground below is too far.
        let lifted = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set == "lift");
        actor.until(100, lifted);
        assert!(matches!(
            actor.scene.snapshot().instance("cup").unwrap().state,
            State::Held(_)
        ));
        actor.give(Intent::EndInteraction);
        actor.until(200, is_done);
        let snapshot = actor.scene.snapshot();
        let cup = snapshot.instance("cup").unwrap();
        assert_eq!(cup.state, State::Free);
        println!("  it is at {}", cup.transform.position);
        let rest = actor.quality(taken, actor.frames.len());
        println!("  behind: {rest:?}");
        assert!(rest.most < 250.0 && rest.step < 0.2, "{rest:?}");
    }
    all.sort_by(|a, b| a.skate_mm.total_cmp(&b.skate_mm));
    let middle = all[all.len() / 2];
    // Walks of the same style skate by 5.5 mm a frame by this measure.
    assert!(middle.skate_mm < 9.0, "{all:?}");
}

/// How far a held object leans, degrees.
fn lean(actor: &Actor<'_>) -> f32 {
    let held = actor.character.held().unwrap();
    (held.transform.rotation * Vec3::Y)
        .angle_between(Vec3::Y)
        .to_degrees()
}

#[test]
fn a_cup_is_carried_off_upright() {
    let mut studio = Studio::new();
    for (variant, (x, z)) in [
        ("upright", (0.0, 1.2)),
        ("upright", (1.0, 0.5)),
        ("bend", (-0.9, 0.4)),
    ] {
        let scene = column(&studio);
        let mut actor = studio.actor(scene, "normal", Vec3::new(0.0, 0.0, 3.0), 3.1);
        actor.run(5);
        actor.interact("cup", variant);
        let attached = |kind: &EventKind| matches!(kind, EventKind::Attached { .. });
        let taken = actor.until(300, attached) as usize;
        let mut slip = lean(&actor);
        for _ in 0..4 {
            actor.run(1);
            slip = slip.max(lean(&actor));
        }
        let lifted = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set == "lift");
        actor.until(100, lifted);
        actor.run(10);
        let (from, before) = (actor.frames.len(), lean(&actor));
        actor.walk(x, z);
        let (mut least, mut most) = (before, before);
        for _ in 0..60 {
            actor.run(1);
            let now = lean(&actor);
            (least, most) = (least.min(now), most.max(now));
        }
        let quality = actor.quality(from - 5, actor.frames.len());
        println!(
            "{variant} to {x} {z}: taken at {taken}, leans by {slip:.1} degrees at most as it is taken, {before:.1} lifted, \
             {least:.1} to {most:.1} on the way; {quality:?}"
        );
        // It stood on the column, and is held in front of the hips as it was lifted.
        assert!(slip < 8.0 && before < 30.0, "{slip}, {before}");
        assert!(most - before < 3.0 && before - least < 3.0, "{least} to {most}");
        assert!(quality.most < 250.0 && quality.step < 0.3, "{quality:?}");
    }
}

#[test]
fn a_bow_at_the_sign() {
    let mut studio = Studio::new();
    for style in ["normal", "elderly"] {
        let scene = studio.courtyard();
        let mut actor = studio.actor(scene, style, Vec3::new(-1.0, 0.0, 1.0), 3.0);
        actor.run(10);
        actor.interact("sign", "bow");
        let bowed = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set == "bow");
        let frame = actor.until(500, bowed) as usize;
        let (_, _, before, after) = actor.reached()[0].clone();
        assert!(after.joint_m < 1e-3, "{after:?}");
        actor.until(200, is_done);
        actor.run(30);
        let quality = actor.quality(frame - 40, actor.frames.len());
        println!("bow in {style}: before {before:?}, {quality:?}");
        assert!(quality.most < 400.0 && quality.step < 0.3, "{quality:?}");
    }
}

#[test]
fn a_use_is_interrupted_without_a_jump() {
    let mut studio = Studio::new();
    for stop in (15..200).step_by(17) {
        let scene = column(&studio);
        let mut actor = studio.actor(scene, "normal", Vec3::new(0.0, 0.0, 3.0), 3.1);
        actor.run(5);
        actor.interact("cup", "bend");
        actor.run(stop);
        actor.walk(1.0, 0.5);
        actor.run(45);
        let quality = actor.quality(0, actor.frames.len());
        assert!(
            quality.most < 500.0 && quality.step < 0.3,
            "at {stop}: {quality:?}"
        );
        let snapshot = actor.scene.snapshot();
        let state = &snapshot.instance("cup").unwrap().state;
        assert_eq!(actor.character.held().is_some(), matches!(state, State::Held(_)));
        assert!(!matches!(state, State::Reserved(_)));
    }
}

#[test]
fn a_walk_over_the_courtyard_steps_up_and_down_and_falls() {
    let mut studio = Studio::new();
    let mut scene = studio.courtyard();
    let stage = Collider {
        id: "stage".to_owned(),
        shape: ColliderShape::Solid(Shape::Box {
            center_m: Vec3::ZERO,
            half_extents_m: Vec3::new(1.5, 0.5, 1.5),
        }),
        transform: Transform::new(Vec3::new(0.0, 0.5, 0.0), Quat::IDENTITY),
    };
    let step = Collider {
        id: "step".to_owned(),
        shape: ColliderShape::Solid(Shape::Box {
            center_m: Vec3::ZERO,
            half_extents_m: Vec3::new(1.5, 0.1, 1.0),
        }),
        transform: Transform::new(Vec3::new(0.0, 0.1, 5.5), Quat::IDENTITY),
    };
    scene.set_colliders(&[stage, step]).unwrap();
    let mut actor = studio.actor(scene, "normal", Vec3::new(0.0, 1.0, 0.0), 0.0);
    actor.run(10);
    assert!(actor.frames[5].root.y > 1.8, "it stands on the stage");
    actor.walk(0.0, 1.2);
    let landed = |kind: &EventKind| matches!(kind, EventKind::Landed { .. });
    let landed = actor.until(200, landed) as usize;
    actor.run(240);
    println!("{:?}", actor.events);
    assert_eq!(actor.events.len(), 2, "one fall: {:?}", actor.events);
    let on_step = actor
        .frames
        .iter()
        .filter(|frame| (4.8..6.2).contains(&frame.root.z));
    let heights: Vec<f32> = on_step.map(|frame| frame.root.y).collect();
    let mean = heights.iter().sum::<f32>() / heights.len() as f32;
    assert!((mean - 1.12).abs() < 0.06, "it walks over the step at {mean}");
    let end = actor.frames.last().unwrap().root;
    assert!(end.z > 6.8 && (end.y - 0.92).abs() < 0.06, "{end}");
    // Feet stay out of the ground.
    let skeleton = &actor.studio.pack.rig.skeleton;
    let contacts = skeleton.contacts.as_ref().unwrap();
    let snapshot = actor.scene.snapshot();
    let mut deepest = 0.0_f32;
    for joints in actor.joints(landed, actor.frames.len()) {
        for (&joint, clearance) in contacts.joints.iter().zip(&contacts.clearance_m) {
            let at = joints[joint];
            let below = snapshot.support(at.with_y(1.5), 5.0, None).unwrap().point.y;
            deepest = deepest.max(below - (at.y - clearance));
        }
    }
    let quality = actor.quality(landed + 30, actor.frames.len());
    println!("steps: {quality:?}, feet {deepest} m in the ground");
    assert!(
        quality.most < 120.0 && quality.step < 0.2 && deepest < 0.06,
        "{quality:?} {deepest}"
    );
}
