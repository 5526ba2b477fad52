//! Timelines whose plans take long: how far ahead they are asked for, and which plan replaces
//! another.

use proptest::prelude::*;

use super::super::*;
use super::{Harness, WALKS};
use crate::live::budget::Pace;
use crate::live::{Arrival, SUB_FRAMES};

#[test]
fn slow_plans_are_asked_for_further_ahead_as_far_as_the_buffer_lasts() {
    for (expected, reach) in [(0, 4), (3, 4), (4, 5), (9, 10), (19, 20)] {
        let mut rig = Harness::new(WALKS, 34);
        rig.timeline.expect(expected, expected + 1);
        let latency = i64::from(expected);
        for _ in 0..200 {
            assert_eq!(rig.advance(SUB_FRAMES, Clock::Runs), Stop::Done);
            let now = rig.timeline.frame();
            if rig
                .asked
                .front()
                .is_some_and(|(ticket, _)| ticket.asked_at + latency <= now)
            {
                assert!(matches!(rig.deliver(), Some(Arrival::InTime { .. })));
            }
        }
        let reaches = |ticket: &Ticket| ticket.splice - ticket.asked_at;
        assert_eq!(
            reaches(&rig.tickets[0]),
            latency.max(1) + 1,
            "the first is for a command"
        );
        assert!(rig.tickets[1..].iter().all(|t| reaches(t) == reach), "{expected}");
        let stats = rig.timeline.stats();
        assert_eq!((stats.late_plans, stats.underruns), (0, 0), "{expected}");
    }
    // The first may take as long as it needs. The others take over when eight frames of the plan
    // before are left.
    let mut rig = Harness::new(WALKS, 34);
    rig.timeline.expect(60, 0);
    for _ in 0..200 {
        rig.tick();
    }
    let splices: Vec<i64> = rig.tickets.iter().map(|t| t.splice).collect();
    assert_eq!(
        splices,
        [61, 83, 105, 127, 149, 171, 193, 215],
        "{:?}",
        rig.tickets
    );
}

#[test]
fn what_plans_usually_take_is_waited_for_in_advance() {
    let mut rig = Harness::new(WALKS, 34);
    rig.timeline.expect(2, 12);
    for _ in 0..60 {
        rig.tick();
    }
    assert!(rig.tickets[1..].iter().all(|t| t.splice - t.asked_at == 12));
    assert!(rig.tickets[1..].iter().all(|t| t.cause == PlanCause::Interval));
}

const QUEUED: u32 = 9;

#[test]
fn a_command_replaces_a_plan_in_a_long_queue() {
    let mut rig = Harness::new(WALKS, 34);
    rig.timeline.expect(QUEUED, 0);
    rig.advance(SUB_FRAMES, Clock::Runs);
    rig.timeline.command_changed();
    rig.advance(SUB_FRAMES, Clock::Runs);
    let [first, second] = rig.tickets[..] else {
        panic!("{:?}", rig.tickets)
    };
    assert_eq!(
        (first.splice, second.asked_at, second.splice),
        (10, 2, 10),
        "it keeps the place in the queue"
    );
    // A plan that would take over within the look-ahead takes over later.
    rig.timeline.expect(QUEUED, 0);
    for _ in 0..6 {
        rig.advance(SUB_FRAMES, Clock::Runs);
    }
    rig.timeline.command_changed();
    rig.advance(SUB_FRAMES, Clock::Runs);
    assert_eq!((rig.tickets[2].asked_at, rig.tickets[2].splice), (9, 13));

    // The scheduler says that the older plans will not arrive, which is no failure.
    for number in [0, 1] {
        assert_eq!(rig.timeline.fail(number), Arrival::Stray);
        rig.asked.pop_front();
    }
    assert!(matches!(rig.deliver(), Some(Arrival::InTime { .. })));
    for _ in 0..4 {
        rig.advance(SUB_FRAMES, Clock::Runs);
    }
    let stats = rig.timeline.stats();
    assert_eq!(
        (stats.plans_for_command, stats.failed_plans, stats.late_plans),
        (1, 0, 0)
    );
}

#[test]
fn a_replaced_plan_that_was_under_way_counts() {
    let mut rig = Harness::new(WALKS, 34);
    rig.timeline.expect(QUEUED, 0);
    rig.advance(SUB_FRAMES, Clock::Runs);
    rig.timeline.command_changed();
    rig.advance(SUB_FRAMES, Clock::Runs);
    assert!(matches!(rig.deliver(), Some(Arrival::InTime { .. })), "the first");
    assert!(rig.timeline.awaits_plan());
    rig.advance(SUB_FRAMES, Clock::Runs);
    assert!(
        matches!(rig.deliver(), Some(Arrival::InTime { .. })),
        "and the second"
    );
    assert!(!rig.timeline.awaits_plan());
    while rig.timeline.frame() < 10 {
        rig.advance(SUB_FRAMES, Clock::Runs);
    }
    assert_eq!(rig.timeline.stats().plans_for_command, 2);
}

#[test]
fn a_command_does_not_wait_for_a_plan_that_was_asked_for_far_ahead() {
    let mut rig = Harness::new(WALKS, 34);
    rig.tick();
    for _ in 0..12 {
        rig.tick();
    }
    rig.timeline.expect(2, 16);
    while rig.tickets.last().unwrap().splice - rig.timeline.frame() < 14 {
        rig.tick();
    }
    let far = *rig.tickets.last().unwrap();
    rig.timeline.command_changed();
    rig.timeline.expect(2, 0);
    rig.tick();
    let now = *rig.tickets.last().unwrap();
    assert_eq!(
        (now.number, now.cause, now.splice),
        (far.number + 1, PlanCause::Command, now.asked_at + 3)
    );
    assert!(now.splice < far.splice);
    for _ in 0..40 {
        rig.tick();
    }
    assert_eq!(
        (rig.timeline.stats().late_plans, rig.timeline.stats().underruns),
        (0, 0)
    );
}

#[test]
fn an_unfinished_turn_is_continued_at_the_usual_interval() {
    let dims = crate::testing::toy_rig().dims;
    let spacing = |unfinished| {
        let pace = Pace::new(1.0, Some(9), 0, &dims, 30.0);
        let policy = Policy {
            pace,
            unfinished,
            ..WALKS
        };
        let mut rig = Harness::new(policy, 40);
        for _ in 0..100 {
            rig.tick();
        }
        rig.tickets[2].splice - rig.tickets[1].splice
    };
    assert_eq!((spacing(false), spacing(true)), (30, 12));
}

#[test]
fn a_clock_that_waits_never_replaces_a_plan() {
    let mut rig = Harness::new(WALKS, 34);
    rig.timeline.expect(QUEUED, 0);
    rig.advance(SUB_FRAMES, Clock::Waits);
    rig.timeline.command_changed();
    rig.advance(5 * SUB_FRAMES, Clock::Waits);
    assert_eq!(rig.tickets.len(), 1);
}

/// Frames that a plan of 64 leaves for waiting, if 6 are left when the next takes over.
const LASTS: i64 = 54;

proptest! {
    #[test]
    fn plans_that_take_no_longer_than_expected_are_never_missed(
        latencies in proptest::collection::vec(0i64..=30, 1..40), stretch in 0.05f32..=2.0, phase: u64,
        commands in proptest::collection::vec(1i64..60, 1..8),
    ) {
        let most = *latencies.iter().max().unwrap();
        let dims = crate::testing::toy_rig().dims;
        let pace = Pace::new(stretch, Some(9), phase, &dims, 30.0).unwrap();
        prop_assume!(most + 1 < i64::from(pace.interval_frames));
        let mut rig = Harness::new(Policy { pace: Some(pace), ..WALKS }, pace.plan_frames as usize);
        rig.timeline.phase = phase;
        rig.timeline.expect(most as u32, most as u32 + 1);
        let (mut latency, mut command) = (latencies.iter().cycle(), commands.iter().cycle());
        let mut next_command = *command.next().unwrap();
        // The frames at which plans arrive. A plan that replaces another arrives when that one
        // would have.
        let mut coming: Vec<i64> = Vec::new();
        for frame in 1..600 {
            if frame == next_command {
                rig.timeline.command_changed();
                next_command += command.next().unwrap();
            }
            let asked = rig.tickets.len();
            prop_assert_eq!(rig.advance(SUB_FRAMES, Clock::Runs), Stop::Done);
            if rig.tickets.len() > asked {
                let mut at = frame + latency.next().unwrap();
                if let (Some(replaced), Some((ticket, _))) = (coming.pop(), rig.asked.front()) {
                    at = replaced;
                    prop_assert_eq!(rig.timeline.fail(ticket.number), Arrival::Stray);
                    rig.asked.pop_front();
                }
                coming.push(at);
            }
            while coming.first().is_some_and(|at| *at <= frame) {
                coming.remove(0);
                prop_assert!(matches!(rig.deliver(), Some(Arrival::InTime { .. })), "{:?}", rig.tickets);
            }
            let stats = rig.timeline.stats();
            prop_assert_eq!((stats.late_plans, stats.underruns), (0, 0));
        }
        let gap = rig.tickets.windows(2).map(|pair| pair[1].splice - pair[0].splice).max();
        prop_assert!(gap <= Some(LASTS));
    }

    #[test]
    fn a_late_plan_does_not_slow_down_a_character_with_a_long_buffer(late in 1i64..=6, plan_frames in 34usize..=64) {
        // Of 30 frames, 9 are an interval and 8 are kept. The rest covers the late plan and the
        // next.
        let mut rig = Harness::new(WALKS, plan_frames);
        for _ in 0..200 {
            prop_assert_eq!(rig.advance(SUB_FRAMES, Clock::Runs), Stop::Done);
            let now = rig.timeline.frame();
            if rig.asked.front().is_some_and(|(ticket, _)| now >= ticket.splice + late) || rig.tickets.len() == 1 {
                rig.deliver();
            }
            prop_assert_eq!(rig.timeline.stats().underruns, 0);
        }
        prop_assert!(rig.timeline.stats().late_plans > 0);
    }
}
