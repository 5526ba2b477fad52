use std::f32::consts::PI;

use proptest::prelude::*;

use super::*;
use crate::primitives::object::recipe::{APPROACH_FRAMES, STOP_FRAMES};
use crate::style::testing::walker_style;

const FPS: f32 = 30.0;

/// A point that follows every command at once, within its acceleration.
struct TestWalker {
    approach: Approach,
    frame: Frame,
    place: Vec3,
    velocity: Vec3,
    heading: f32,
    wanted: Vec3,
    facing: Option<f32>,
    stand_at: Option<Vec3>,
    commands: Vec<LocomotionCommand>,
}

impl TestWalker {
    fn new(entry: Entry, place: Vec3, velocity: Vec3) -> Self {
        Self {
            approach: Approach::new(entry, Arc::new(walker_style()), 0),
            frame: 0,
            place,
            velocity,
            heading: 0.0,
            wanted: velocity,
            facing: None,
            stand_at: None,
            commands: Vec::new(),
        }
    }

    fn here(&self) -> Here {
        Here {
            frame: self.frame,
            root: GlobalRoot::new(self.place, self.heading),
            velocity: self.velocity,
        }
    }

    /// Goes on until the approach ends, and returns how it ended.
    fn go(&mut self) -> Going {
        loop {
            match self.approach.step(&self.here()) {
                Going::On => {}
                Going::Command {
                    command, stand_at, ..
                } => {
                    (self.wanted, self.facing, self.stand_at) = (command.velocity, command.facing, stand_at);
                    self.commands.push(command);
                }
                end => return end,
            }
            let wanted = match self.stand_at {
                Some(place) => (place - self.place) * 4.0,
                None => self.wanted,
            };
            self.velocity += (wanted - self.velocity).clamp_length_max(0.1);
            self.place += self.velocity / FPS;
            if let Some(facing) = self.facing {
                self.heading += wrap_angle(facing - self.heading).clamp(-0.1, 0.1);
            }
            self.frame += 1;
        }
    }
}

fn entry(x: f32, z: f32, heading: f32) -> Entry {
    Entry {
        key: GlobalRoot::new(Vec3::new(x, 0.0, z), heading),
        via: None,
        from_stand: false,
        anywhere: false,
    }
}

#[test]
fn a_walking_character_hands_over_on_the_way() {
    let mut walker = TestWalker::new(entry(0.0, 6.0, PI), Vec3::ZERO, Vec3::ZERO);
    assert_eq!(walker.go(), Going::HandOver);
    let (left, speed) = (6.0 - walker.place.z, walker.velocity.length());
    assert!(
        (left / speed - HAND_OVER_S).abs() < 0.1,
        "{left} m at {speed} m/s"
    );
    assert!(speed <= NEAR_MPS + 1e-3 && speed > 1.0);
    assert!(walker.commands.len() <= 3, "{:?}", walker.commands);
}

#[test]
fn a_run_is_slowed_down_in_time() {
    let mut walker = TestWalker::new(entry(0.0, 9.0, 0.0), Vec3::ZERO, Vec3::Z * 3.5);
    assert_eq!(walker.go(), Going::HandOver);
    assert!(walker.velocity.length() < NEAR_MPS + 0.05, "{}", walker.velocity);
}

/// A character that runs past or away still arrives, and is slow enough when the first set begins.
#[test]
fn a_character_that_runs_past_turns_around_first() {
    for (velocity, place) in [
        (Vec3::X * 4.0, Vec3::ZERO),
        (Vec3::NEG_Z * 3.0, Vec3::ZERO),
        (Vec3::Z * 4.0, Vec3::Z * 1.5),
        (Vec3::X * 1.5, Vec3::Z * 2.6),
    ] {
        let mut walker = TestWalker::new(entry(0.0, 3.0, 0.0), place, velocity);
        assert_eq!(walker.go(), Going::HandOver);
        let left = Vec3::Z * 3.0 - walker.place;
        let (speed, off) = (walker.velocity.length(), walker.velocity.angle_between(left));
        assert!(
            speed <= HAND_OVER_MPS && off <= HAND_OVER_TURN,
            "{velocity}: {speed} m/s, {off} rad off"
        );
    }
}

/// A character that cannot take the right direction, or cannot slow down, does not run on for ever:
/// it stops first.
#[test]
fn a_character_that_cannot_slow_down_stops() {
    let mut approach = Approach::new(entry(0.0, 0.0, 0.0), Arc::new(walker_style()), 0);
    let circling = |frame: Frame| {
        let angle = frame as f32 * 0.1;
        Here {
            frame,
            root: GlobalRoot::new(Vec3::new(angle.sin(), 0.0, angle.cos()) * 1.2, 0.0),
            velocity: Vec3::new(angle.cos(), 0.0, -angle.sin()) * 3.6,
        }
    };
    let stops = |frame: &Frame| {
        let Going::Command { command, .. } = approach.step(&circling(*frame)) else {
            return false;
        };
        command.velocity == Vec3::ZERO
    };
    let stopped = (0..APPROACH_FRAMES).find(stops);
    assert!(stopped.is_some_and(|frame| frame > NEAR_FRAMES && frame < NEAR_FRAMES + 10));
}

#[test]
fn a_character_at_its_goal_begins_at_once() {
    let mut walker = TestWalker::new(entry(0.1, 0.0, 2.0), Vec3::ZERO, Vec3::ZERO);
    assert_eq!((walker.go(), walker.frame), (Going::HandOver, 0));
    // It does not begin while it walks past.
    let mut walker = TestWalker::new(entry(0.0, 0.1, 0.0), Vec3::ZERO, Vec3::Z * 1.2);
    assert_eq!(walker.go(), Going::HandOver);
}

#[test]
fn a_character_that_stands_near_goes_there_and_stops() {
    for (x, z) in [(0.5, 0.3), (-0.9, 0.0), (0.0, -0.4)] {
        let mut walker = TestWalker::new(entry(x, z, 2.0), Vec3::ZERO, Vec3::ZERO);
        assert_eq!(walker.go(), Going::HandOver);
        let left = walker.place.distance(Vec3::new(x, 0.0, z));
        assert!(left < 0.15 && walker.velocity.length() < STOPPED_MPS, "{left} m");
        assert!(wrap_angle(walker.heading - 2.0).abs() < STOPPED_TURN);
    }
}

#[test]
fn a_set_may_ask_for_a_stop() {
    let stops = Entry {
        from_stand: true,
        ..entry(0.0, 5.0, PI)
    };
    let mut walker = TestWalker::new(stops, Vec3::ZERO, Vec3::ZERO);
    assert_eq!(walker.go(), Going::HandOver);
    assert!(walker.velocity.length() < STOPPED_MPS && (walker.place.z - 5.0).abs() < 0.1);
    assert_eq!(walker.commands.last().unwrap().velocity, Vec3::ZERO);
}

#[test]
fn a_goal_anywhere_only_stops_the_character() {
    let anywhere = Entry {
        anywhere: true,
        ..entry(50.0, 50.0, 1.0)
    };
    let mut walker = TestWalker::new(anywhere, Vec3::ZERO, Vec3::ZERO);
    assert_eq!((walker.go(), walker.frame), (Going::HandOver, 0));
    let mut walker = TestWalker::new(anywhere, Vec3::ZERO, Vec3::Z * 1.5);
    assert_eq!(walker.go(), Going::HandOver);
    assert!(walker.velocity.length() < STOPPED_MPS && walker.frame >= STOP_FRAMES.0);
    assert_eq!(walker.heading, 0.0, "it does not turn");
}

#[test]
fn it_passes_the_place_on_the_way() {
    let via = Vec3::new(3.0, 0.0, 0.0);
    let around = Entry {
        via: Some(via),
        ..entry(3.0, 5.0, 0.0)
    };
    let mut walker = TestWalker::new(around, Vec3::ZERO, Vec3::ZERO);
    let mut nearest = f32::INFINITY;
    while walker.approach.step(&walker.here()) != Going::HandOver && walker.frame < 400 {
        // Takes the same steps as `go`, one by one.
        let mut one = TestWalker {
            approach: walker.approach.clone(),
            commands: Vec::new(),
            ..walker
        };
        one.wanted = one
            .approach
            .commanded
            .as_ref()
            .map_or(Vec3::ZERO, |(c, _)| c.velocity);
        one.velocity += (one.wanted - one.velocity).clamp_length_max(0.1);
        one.place += one.velocity / FPS;
        one.frame += 1;
        nearest = nearest.min(one.place.distance(via));
        walker = one;
    }
    assert!(nearest < 0.9, "{nearest}");
    assert!(walker.frame < 400);
}

#[test]
fn it_gives_up() {
    let mut walker = TestWalker::new(entry(0.0, 5000.0, 0.0), Vec3::ZERO, Vec3::ZERO);
    assert_eq!(walker.go(), Going::TimedOut);
    assert_eq!(walker.frame, APPROACH_FRAMES + 1);
}

#[test]
fn it_follows_an_object_that_moves() {
    let mut walker = TestWalker::new(entry(0.0, 6.0, 0.0), Vec3::ZERO, Vec3::ZERO);
    for _ in 0..20 {
        walker.approach.step(&walker.here());
        walker.frame += 1;
    }
    walker.approach.redirect(entry(6.0, 0.0, 0.0));
    let Going::Command { command, replan, .. } = walker.approach.step(&walker.here()) else {
        panic!("it goes on unchanged");
    };
    assert!(replan && command.velocity.x > 1.0 && command.velocity.z.abs() < 0.1);
}

proptest! {
    #[test]
    fn every_approach_ends(
        x in -8.0_f32..8.0, z in -8.0_f32..8.0, heading in -3.0_f32..3.0, vx in -3.0_f32..3.0, vz in -3.0_f32..3.0,
        from_stand: bool,
    ) {
        let entry = Entry { from_stand, ..entry(x, z, heading) };
        let mut walker = TestWalker::new(entry, Vec3::ZERO, Vec3::new(vx, 0.0, vz));
        prop_assert_eq!(walker.go(), Going::HandOver);
        prop_assert!(walker.frame < APPROACH_FRAMES);
    }
}
