//! Random events for property tests.

use std::sync::Arc;

use proptest::prelude::*;
use troupe_motion::Vec3;

use super::super::super::Intent;
use super::{Harness, Plans, Words};
use crate::scene::Transform;

/// Something that happens to a character or its scene.
#[derive(Debug, Clone)]
pub(crate) enum Event {
    Frames(usize),
    Walk(i8, i8),
    Follow(i8, i8, bool),
    Interact(&'static str),
    Skill(&'static str),
    End,
    Cancel,
    Drop,
    Perform(Words),
    Plans(Plans),
    Move(&'static str, i8),
    Remove(&'static str),
    Back,
}

/// Any event.
pub(crate) fn event() -> impl Strategy<Value = Event> {
    let object = || prop::sample::select(vec!["cup", "sign", "bench"]);
    let speed = || -12i8..=12;
    prop_oneof![
        10 => (1usize..60).prop_map(Event::Frames),
        2 => (speed(), speed()).prop_map(|(x, z)| Event::Walk(x, z)),
        1 => (speed(), speed(), any::<bool>()).prop_map(|(x, z, is_loop)| Event::Follow(x, z, is_loop)),
        4 => object().prop_map(Event::Interact),
        2 => prop::sample::select(vec!["lie", "spring"]).prop_map(Event::Skill),
        2 => Just(Event::End),
        1 => Just(Event::Cancel),
        1 => Just(Event::Drop),
        2 => words().prop_map(Event::Perform),
        2 => prop_oneof![
            Just(Plans::AtOnce),
            (0u32..20).prop_map(Plans::After),
            Just(Plans::Never),
        ].prop_map(Event::Plans),
        2 => (object(), -20i8..20).prop_map(|(object, by)| Event::Move(object, by)),
        1 => object().prop_map(Event::Remove),
        1 => Just(Event::Back),
    ]
}

/// Words that come in any way.
pub(crate) fn words() -> impl Strategy<Value = Words> {
    let fails = prop::option::weighted(0.2, 0usize..3);
    (1usize..120, 3usize..40, 0u32..40, 0u32..40, fails).prop_map(
        |(frames, part, first, every, fails_after)| Words {
            frames,
            part,
            first,
            every,
            fails_after,
        },
    )
}

pub(crate) fn carry_out(rig: &mut Harness, event: &Event) {
    // A refused command changes nothing.
    match *event {
        Event::Frames(frames) => rig.run(frames),
        Event::Walk(x, z) => rig.walk(f32::from(x) / 10.0, f32::from(z) / 10.0),
        Event::Follow(x, z, is_loop) => drop(rig.follow(f32::from(x) / 5.0, f32::from(z) / 5.0, is_loop)),
        Event::Interact(object) => drop(rig.interact(object, "")),
        Event::Skill(name) => drop(rig.skill(name, "")),
        Event::End => drop(rig.give(Intent::EndInteraction)),
        Event::Cancel => drop(rig.give(Intent::Cancel)),
        Event::Drop => drop(rig.give(Intent::Drop)),
        Event::Perform(words) => {
            rig.words_come = words;
            rig.perform("wave");
        }
        Event::Plans(plans) => rig.plans = plans,
        Event::Move(object, by) => drop(rig.scene.update(|scene| {
            let there = scene.instance(object).map(|it| it.transform).unwrap_or_default();
            let to = there.position + Vec3::X * f32::from(by) / 100.0;
            scene.move_to(object, Transform::new(to, there.rotation))
        })),
        Event::Remove(object) => drop(rig.scene.update(|scene| scene.remove(object))),
        Event::Back => drop(rig.scene.update(|scene| {
            let body = Arc::clone(&rig.definitions.get("cup").unwrap().definition.body);
            scene.add(
                "cup",
                "cup",
                body,
                Transform::new(Vec3::new(0.0, 0.8, 3.0), Default::default()),
            )
        })),
    }
}
