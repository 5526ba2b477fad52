//! Anything at any time: commands, a changing scene, plans that are late or fail.

use std::collections::HashSet;
use std::sync::Arc;

use proptest::prelude::*;
use troupe_motion::Vec3;

use super::super::{Activity, Clock, EventKind, FailReason, Intent, PerformanceEnd, SUB_FRAMES};
use super::testing::*;
use crate::scene::{Holder, State};

/// Which objects are in use, according to the events.
#[derive(Debug, Default)]
struct Ends {
    /// Their use began.
    open: HashSet<Arc<str>>,
    /// They were taken into the hand and may still be there, so their way out needs no beginning.
    taken: HashSet<Arc<str>>,
    /// A set of their way out began.
    out: HashSet<Arc<str>>,
    /// Commands to perform that began and have not ended.
    performs: HashSet<u64>,
    /// There was no place to put them down. That ends their use, but not if they were only to be
    /// dropped.
    no_place: HashSet<Arc<str>>,
}

impl Ends {
    /// Notes the next event. Answers whether it may come now.
    fn allow(&mut self, kind: &EventKind) -> bool {
        match kind {
            EventKind::Started { instance, .. } => {
                self.no_place.remove(instance);
                self.open.insert(Arc::clone(instance))
            }
            EventKind::Attached { instance, .. } => {
                self.taken.insert(Arc::clone(instance));
                self.open.contains(instance)
            }
            EventKind::Entered { instance, .. } | EventKind::Reached { instance, .. } => {
                let begun = self.open.contains(instance) || self.no_place.contains(instance);
                let is_out = !begun && self.taken.contains(instance);
                if is_out {
                    self.out.insert(Arc::clone(instance));
                }
                begun || is_out
            }
            EventKind::Done { instance } => self.end(instance),
            EventKind::Interrupted { instance } => self.end(instance) || self.taken.contains(instance),
            EventKind::Failed { instance, reason, .. } => {
                if self.end(instance) && *reason == FailReason::NoPlace {
                    self.no_place.insert(Arc::clone(instance));
                }
                true
            }
            EventKind::Performing { number, .. } => self.performs.insert(*number),
            EventKind::Performed { number, end } => {
                self.performs.remove(number) || *end != PerformanceEnd::Done
            }
            _ => true,
        }
    }

    /// Whether there was something to end.
    fn end(&mut self, instance: &str) -> bool {
        let sets = [&mut self.open, &mut self.out, &mut self.no_place];
        sets.into_iter().any(|set| set.remove(instance))
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn a_character_goes_on_whatever_happens(events in prop::collection::vec(event(), 1..40), runs: bool) {
        let mut rig = Harness::new();
        rig.clock = if runs { Clock::Runs } else { Clock::Waits };
        rig.run(1);
        for event in &events {
            carry_out(&mut rig, event);
            let own = Holder::new("a");
            let scene = rig.scene.snapshot();
            let mine: Vec<_> = scene.of_holder(&own).collect();
            prop_assert!(mine.len() <= 2, "{mine:?}");
            // Changes of the scene show in the next frame.
            if matches!(event, Event::Frames(_))
                && let Some(held) = rig.character.held()
                && let Some(there) = scene.instance(&held.instance)
            {
                prop_assert_eq!(&there.state, &State::Held(own.clone()));
            }
        }
        rig.plans = Plans::AtOnce;
        rig.give(Intent::Cancel).unwrap();
        rig.run(150);
        prop_assert_eq!(rig.character.activity(), Activity::Locomotion);
        prop_assert!(rig.character.held().is_none());
        prop_assert_eq!(rig.scene.snapshot().of_holder(&Holder::new("a")).count(), 0);
        // A late plan takes over after its splice frame if the clock runs. If it turns round, the
        // fade closes up to 2 * 1.2 m/s * 20 frames within 8 frames: 0.3 m a frame at its steepest,
        // plus the turning limbs. In time, the farthest step (0.28 m in 1000 cases) is made by the
        // knee of a swinging leg as the character goes down to the floor.
        let late = runs && events.iter().any(|event| matches!(event, Event::Plans(Plans::After(4..))));
        let most = if late { 0.5 } else { 0.3 };
        let (acceleration, step) = rig.roughness(0);
        prop_assert!(acceleration < 400.0 && step < most, "{} m/s², {} m", acceleration, step);
        // Events come in order, and every interaction that began ends once.
        prop_assert!(rig.events.is_sorted_by_key(|event| event.frame), "{:?}", rig.event_words());
        prop_assert!(rig.events.last().is_none_or(|last| last.frame <= rig.character.frame()));
        let mut ends = Ends::default();
        for event in &rig.events {
            prop_assert!(ends.allow(&event.kind), "{:?} in {:?}", event, rig.events);
        }
        prop_assert!(ends.performs.is_empty(), "{:?} of {:?}", ends, rig.events);
        prop_assert!(ends.open.is_empty(), "{:?} of {:?}", ends, rig.events);
    }

    #[test]
    fn a_waiting_clock_does_not_depend_on_when_plans_arrive(
        events in prop::collection::vec(event(), 1..40),
        delays in prop::collection::vec(0u32..8, 1..5),
        rate_hz in prop::sample::select(vec![30, 50, 60]),
    ) {
        let (at_once, later) = (shared_scene(&events, &[0], rate_hz), shared_scene(&events, &delays, rate_hz));
        for (at_once, later) in at_once.iter().zip(&later) {
            prop_assert_eq!(&at_once.events, &later.events);
            let shown = |rig: &Harness| -> Vec<_> {
                let frames = rig.frames.iter();
                frames.map(|frame| (frame.root, frame.rotations.clone(), frame.contacts)).collect()
            };
            let differs = shown(at_once).iter().zip(shown(later)).position(|(a, b)| *a != b);
            prop_assert_eq!(differs, None);
        }
    }
}

/// Two characters in one scene that take turns tick by tick. Each gets every other event; plans
/// arrive a number of ticks after their request.
fn shared_scene(events: &[Event], delays: &[u32], rate_hz: u32) -> [Harness; 2] {
    let first = Harness::new();
    let (scene, definitions) = (Arc::clone(&first.scene), Arc::clone(&first.definitions));
    let mut rigs = [
        first,
        Harness::in_scene(scene, definitions, "b", Vec3::new(1.5, 0.0, 0.5)),
    ];
    let delays = delays.iter().cycle();
    for (nth, (event, &delay)) in events.iter().zip(delays).enumerate() {
        for rig in &mut rigs {
            rig.sub_frames = SUB_FRAMES * 30 / rate_hz;
            rig.plans = Plans::After(delay);
        }
        match *event {
            Event::Frames(frames) => (0..frames).for_each(|_| rigs.iter_mut().for_each(Harness::tick)),
            Event::Plans(_) => {}
            _ => carry_out(&mut rigs[nth % 2], event),
        }
    }
    rigs
}
