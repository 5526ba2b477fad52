//! Plans to given keyframes, held poses, and frames that no plan made.

use troupe_motion::{Quat, Vec3};

use super::super::super::{Arrival, Clock, LivePlan, PlanTrace, SUB_FRAMES, Stats};
use super::super::{Barrier, Stop};
use super::*;
use crate::live::testing::still_buffer;

fn timeline() -> Timeline {
    Timeline::new(still_buffer(), 4, 4)
}

/// `count` frames that advance by `step` metres each from `start`.
fn columns(start: f32, step: f32, count: usize) -> (Vec<Vec3>, Vec<Quat>, Vec<u8>) {
    let roots = (1..=count).map(|frame| Vec3::Z * (start + step * frame as f32));
    (roots.collect(), vec![Quat::IDENTITY; count], vec![1; count])
}

/// A plan whose frames advance by 0.05 m each from `start`.
fn plan(start: f32, frames: usize) -> LivePlan {
    let (roots, rotations, contacts) = columns(start - 0.2, 0.05, frames);
    LivePlan {
        feet_glide: false,
        roots,
        rotations,
        contacts,
        trace: PlanTrace::default(),
    }
}

/// Settles every frame with this wish until the cursor is at `frame`. Returns the tickets.
fn go(timeline: &mut Timeline, frame: i64, clock: Clock, wish: Option<Wish>) -> Vec<Ticket> {
    let mut tickets = Vec::new();
    while timeline.frame() < frame {
        timeline.push(SUB_FRAMES);
        loop {
            match timeline.run(clock, Barrier::default()) {
                Stop::AtFrame(_) => tickets.extend(timeline.settle_for(wish)),
                Stop::NeedsPlan => return tickets,
                Stop::Done => break,
            }
        }
    }
    tickets
}

const WISH: Wish = Wish {
    splice: 8,
    still: true,
};

#[test]
fn without_a_wish_no_plan_is_asked_for() {
    let mut timeline = timeline();
    timeline.command_changed();
    timeline.hold(60);
    assert_eq!(go(&mut timeline, 30, Clock::Runs, None), []);
    assert!(timeline.is_free());
    assert_eq!(timeline.stats(), Stats::default());
}

#[test]
fn a_wish_is_asked_for_once_and_takes_over_at_its_frame() {
    let mut timeline = timeline();
    timeline.hold(60);
    let tickets = go(&mut timeline, 2, Clock::Runs, Some(WISH));
    assert_eq!(tickets.len(), 1);
    assert_eq!((tickets[0].cause, tickets[0].splice), (PlanCause::Object, 8));
    assert!(matches!(
        timeline.land(tickets[0].number, &plan(0.0, 24)),
        Arrival::InTime { .. }
    ));
    assert_eq!((timeline.last_splice(), timeline.buffer().last()), (Some(8), 28));
    assert!(!timeline.is_free());
    go(&mut timeline, 8, Clock::Runs, None);
    assert!(timeline.is_free());
    assert_eq!(timeline.stats().plans_for_object, 1);
    // Its last frame is the plan's last, wherever it faded in.
    assert_eq!(timeline.buffer().root(28), Vec3::Z);
}

#[test]
fn a_late_plan_loses_no_frames_if_the_character_stood_still() {
    for (still, last) in [(true, 8 + 20 + 5), (false, 8 + 20)] {
        let mut timeline = timeline();
        timeline.hold(60);
        let tickets = go(&mut timeline, 13, Clock::Runs, Some(Wish { still, ..WISH }));
        assert_eq!(timeline.land(tickets[0].number, &plan(0.0, 24)), Arrival::Late);
        assert_eq!(timeline.buffer().last(), last);
        assert_eq!(timeline.buffer().root(last), Vec3::Z);
        assert_eq!(timeline.stats().underruns, 0);
    }
}

#[test]
fn a_plan_too_late_to_fade_in_before_its_keyframe_is_dropped() {
    let mut timeline = timeline();
    timeline.hold(60);
    let moving = Wish { still: false, ..WISH };
    let tickets = go(&mut timeline, 20, Clock::Runs, Some(moving));
    // 12 frames late: 8 of 20 are left, which is what the fade takes.
    assert_eq!(timeline.land(tickets[0].number, &plan(0.0, 24)), Arrival::Dropped);
    assert!(timeline.is_free());
}

#[test]
fn a_clock_that_waits_does_so_for_a_wished_plan() {
    let mut timeline = timeline();
    timeline.hold(60);
    let tickets = go(&mut timeline, 30, Clock::Waits, Some(WISH));
    assert_eq!((tickets.len(), timeline.frame()), (1, 8));
    timeline.land(tickets[0].number, &plan(0.0, 24));
    // A buffer that ends without a wish repeats its last frame.
    assert_eq!(go(&mut timeline, 60, Clock::Waits, None), []);
    assert_eq!((timeline.frame(), timeline.buffer().root(60)), (60, Vec3::Z));
}

#[test]
fn holding_a_pose_does_not_grow_the_buffer() {
    let mut timeline = timeline();
    for frame in 1..2000 {
        timeline.hold(frame + 40);
        go(&mut timeline, frame, Clock::Runs, None);
        let buffer = timeline.buffer();
        assert!(buffer.last() - buffer.first() < 80);
        assert!(buffer.first() <= (frame - HISTORY_FRAMES).max(-3));
    }
    assert_eq!(timeline.buffer().root(1999), Vec3::ZERO);
}

#[test]
fn frames_are_put_in_at_once_or_fade_in() {
    for fades in [false, true] {
        let mut timeline = timeline();
        timeline.hold(60);
        go(&mut timeline, 10, Clock::Runs, None);
        let (roots, rotations, contacts) = columns(0.0, 0.1, 20);
        let frames = Frames {
            roots: &roots,
            rotations: &rotations,
            contacts: &contacts,
        };
        timeline.put(12, frames, fades);
        let buffer = timeline.buffer();
        assert_eq!((buffer.last(), buffer.root(12)), (32, Vec3::ZERO));
        assert_eq!(buffer.root(13).z < 0.05, fades);
        assert_eq!((buffer.root(21), buffer.root(32)), (roots[8], roots[19]));
    }
}

#[test]
fn a_forgotten_plan_changes_nothing_when_it_arrives() {
    let mut timeline = timeline();
    timeline.hold(60);
    let tickets = go(&mut timeline, 2, Clock::Runs, Some(WISH));
    timeline.forget_flight();
    assert_eq!(timeline.land(tickets[0].number, &plan(0.0, 24)), Arrival::Stray);
    assert_eq!(timeline.fail(tickets[0].number), Arrival::Stray);
    assert_eq!(timeline.buffer().root(30), Vec3::ZERO);
    let again = go(&mut timeline, 3, Clock::Runs, Some(WISH));
    assert_eq!(again[0].number, tickets[0].number + 1);
}

#[test]
fn plans_take_over_as_far_ahead_as_they_take() {
    let mut timeline = timeline();
    timeline.hold(60);
    assert_eq!((timeline.ahead(), timeline.soonest(0)), (4, 4));
    timeline.expect(9, 6);
    assert_eq!((timeline.ahead(), timeline.soonest(0)), (10, 10));
    // But not beyond what the buffer lasts.
    assert_eq!(timeline.soonest(45), 52);
    assert_eq!(timeline.soonest(55), 59);
}
