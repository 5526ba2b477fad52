use std::collections::HashSet;

use proptest::prelude::*;

use super::*;
use crate::object::testing::definition;

/// Indices of the definition's sets: reach (hard), lift (soft by 6, held until ended), grab (hard,
/// held for 10), put-down (hard).
const REACH: usize = 0;
const LIFT: usize = 1;
const PUT_DOWN: usize = 3;

fn begun(variant: usize) -> (Interaction, Vec<Output>) {
    let mut interaction = Interaction::new(Arc::new(definition()), variant);
    let mut out = Vec::new();
    assert!(interaction.approaches() && interaction.want().is_none());
    interaction.on(Input::Arrived, &mut out);
    (interaction, out)
}

fn set(set: usize, from: Frame) -> Option<Want> {
    Some(Want::Set {
        set,
        from: Some(from),
    })
}

#[test]
fn sets_follow_one_another_to_the_end() {
    let (mut cup, mut out) = begun(0);
    assert_eq!(
        cup.want(),
        Some(Want::Set {
            set: REACH,
            from: None
        })
    );
    cup.on(Input::Planned { from: 104, key: 144 }, &mut out);
    assert_eq!((cup.want(), cup.now()), (None, None));
    cup.on(Input::At(103), &mut out);
    assert_eq!((out.as_slice(), cup.want()), (&[][..], None));
    cup.on(Input::At(104), &mut out);
    assert_eq!(out, [Output::Entered(104, REACH)]);
    // Hard, and not held.
    assert_eq!(cup.want(), set(LIFT, 144));
    cup.on(Input::Planned { from: 144, key: 164 }, &mut out);
    out.clear();
    cup.on(Input::At(144), &mut out);
    let (reached, left) = (Output::Reached(144, REACH), Output::Left(144, REACH));
    assert_eq!(out, [reached, left, Output::Entered(144, LIFT)]);
    // Held until a command.
    assert_eq!(cup.want(), None);
    out.clear();
    cup.on(Input::At(300), &mut out);
    assert_eq!(out, [Output::Reached(164, LIFT)]);
    cup.on(Input::End, &mut out);
    // Soft: it could have been left before its keyframe.
    assert_eq!(cup.want(), set(PUT_DOWN, 158));
    cup.on(Input::Planned { from: 304, key: 330 }, &mut out);
    out.clear();
    cup.on(Input::At(304), &mut out);
    assert_eq!(out, [Output::Left(304, LIFT), Output::Entered(304, PUT_DOWN)]);
    assert_eq!(cup.want(), Some(Want::Leave(330)));
    cup.on(Input::Leaving(330), &mut out);
    assert!(cup.leaves() && cup.want().is_none());
    out.clear();
    cup.on(Input::At(330), &mut out);
    let (reached, left) = (Output::Reached(330, PUT_DOWN), Output::Left(330, PUT_DOWN));
    assert_eq!(out, [reached, left, Output::Over(330)]);
    assert!(cup.is_over());
}

#[test]
fn a_soft_set_is_left_early_once_it_is_ended() {
    let (mut cup, mut out) = begun(0);
    cup.on(Input::Planned { from: 4, key: 40 }, &mut out);
    cup.on(Input::At(4), &mut out);
    cup.on(Input::Planned { from: 40, key: 70 }, &mut out);
    cup.on(Input::End, &mut out);
    cup.on(Input::At(41), &mut out);
    assert_eq!(cup.want(), set(PUT_DOWN, 64), "6 frames before its keyframe");
    cup.on(Input::Planned { from: 64, key: 90 }, &mut out);
    out.clear();
    cup.on(Input::At(64), &mut out);
    let (reached, left) = (Output::Reached(64, LIFT), Output::Left(64, LIFT));
    assert_eq!(out, [reached, left, Output::Entered(64, PUT_DOWN)]);
}

#[test]
fn an_end_before_the_held_set_is_remembered() {
    let (mut cup, mut out) = begun(0);
    cup.on(Input::End, &mut out);
    cup.on(Input::End, &mut out);
    cup.on(Input::Planned { from: 4, key: 40 }, &mut out);
    cup.on(Input::At(10), &mut out);
    assert_eq!(cup.want(), set(LIFT, 40), "it goes through the sets before");
    cup.on(Input::Planned { from: 40, key: 70 }, &mut out);
    cup.on(Input::At(40), &mut out);
    assert_eq!(cup.want(), set(PUT_DOWN, 64));
}

/// The exit's motion is made before it takes over. A second end in between asks for nothing more.
#[test]
fn a_second_end_does_not_bring_the_exit_again() {
    for entered in [false, true] {
        let (mut cup, mut out) = begun(0);
        cup.on(Input::Planned { from: 4, key: 40 }, &mut out);
        cup.on(Input::At(4), &mut out);
        cup.on(Input::Planned { from: 40, key: 70 }, &mut out);
        cup.on(Input::At(100), &mut out);
        cup.on(Input::End, &mut out);
        cup.on(Input::Planned { from: 104, key: 130 }, &mut out);
        if entered {
            cup.on(Input::At(104), &mut out);
        }
        cup.on(Input::End, &mut out);
        cup.on(Input::At(104), &mut out);
        assert_eq!(cup.want(), Some(Want::Leave(130)), "entered: {entered}");
    }
}

#[test]
fn an_exit_held_until_ended_needs_its_own_end() {
    let mut definition = definition();
    definition.sets[PUT_DOWN].hold = Hold::UntilEnded;
    let mut cup = Interaction::way_out(Arc::new(definition), 0);
    let mut out = Vec::new();
    cup.on(Input::Arrived, &mut out);
    cup.on(Input::End, &mut out);
    cup.on(Input::Planned { from: 4, key: 40 }, &mut out);
    cup.on(Input::At(50), &mut out);
    assert_eq!(cup.want(), None, "an earlier end does not count");
    cup.on(Input::End, &mut out);
    assert_eq!(cup.want(), Some(Want::Leave(40)));
}

#[test]
fn a_hold_of_frames_is_not_ended_by_a_command() {
    let (mut cup, mut out) = begun(1);
    cup.on(Input::Planned { from: 4, key: 40 }, &mut out);
    cup.on(Input::At(4), &mut out);
    assert_eq!(cup.want(), Some(Want::Leave(50)));
    cup.on(Input::End, &mut out);
    assert_eq!(cup.want(), Some(Want::Leave(50)));
}

#[test]
fn late_motion_takes_over_late() {
    let (mut cup, mut out) = begun(0);
    cup.on(Input::Planned { from: 4, key: 40 }, &mut out);
    cup.on(Input::At(50), &mut out);
    assert_eq!(cup.want(), set(LIFT, 40));
    cup.on(Input::Planned { from: 55, key: 75 }, &mut out);
    out.clear();
    cup.on(Input::At(54), &mut out);
    assert!(out.is_empty());
    cup.on(Input::At(80), &mut out);
    assert_eq!(
        out,
        [
            Output::Left(55, REACH),
            Output::Entered(55, LIFT),
            Output::Reached(75, LIFT)
        ]
    );
}

#[test]
fn motion_is_made_again_for_an_object_that_moved() {
    let (mut cup, mut out) = begun(0);
    cup.on(Input::Planned { from: 4, key: 40 }, &mut out);
    cup.on(Input::Again, &mut out);
    assert_eq!(
        cup.want(),
        Some(Want::Set {
            set: REACH,
            from: None
        }),
        "before it began"
    );
    cup.on(Input::Planned { from: 8, key: 44 }, &mut out);
    cup.on(Input::At(10), &mut out);
    cup.on(Input::Again, &mut out);
    assert_eq!(
        cup.want(),
        Some(Want::Set {
            set: REACH,
            from: None
        })
    );
    cup.on(Input::Planned { from: 16, key: 60 }, &mut out);
    cup.on(Input::At(70), &mut out);
    let once = [Output::Entered(8, REACH), Output::Reached(60, REACH)];
    assert_eq!(out, once, "it was entered once and reached once");
    // The set to come.
    cup.on(Input::Planned { from: 74, key: 90 }, &mut out);
    cup.on(Input::Again, &mut out);
    assert_eq!(cup.want(), set(LIFT, 60));
}

#[test]
fn an_end_survives_motion_that_is_made_again() {
    let (mut cup, mut out) = begun(0);
    cup.on(Input::Planned { from: 4, key: 40 }, &mut out);
    cup.on(Input::At(4), &mut out);
    cup.on(Input::Planned { from: 40, key: 70 }, &mut out);
    cup.on(Input::At(40), &mut out);
    cup.on(Input::End, &mut out);
    cup.on(Input::Planned { from: 64, key: 90 }, &mut out);
    cup.on(Input::Again, &mut out);
    assert_eq!(cup.want(), set(PUT_DOWN, 64));
}

#[test]
fn the_way_out_alone() {
    let mut cup = Interaction::way_out(Arc::new(definition()), 0);
    let mut out = Vec::new();
    cup.on(Input::Arrived, &mut out);
    assert_eq!(
        cup.want(),
        Some(Want::Set {
            set: PUT_DOWN,
            from: None
        })
    );
    // A variant without an exit is over at once.
    let mut cup = Interaction::way_out(Arc::new(definition()), 1);
    cup.on(Input::Arrived, &mut out);
    assert_eq!(cup.want(), Some(Want::Leave(Frame::MIN)));
    cup.on(Input::Leaving(9), &mut out);
    cup.on(Input::At(9), &mut out);
    assert_eq!((out.as_slice(), cup.is_over()), (&[Output::Over(9)][..], true));
}

#[derive(Debug, Clone)]
enum Event {
    Frames(i64),
    Plan(i64, i64),
    Again,
    End,
    Leave,
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        6 => (1_i64..20).prop_map(Event::Frames),
        4 => (0_i64..6, 8_i64..40).prop_map(|(late, long)| Event::Plan(late, long)),
        1 => Just(Event::Again),
        1 => Just(Event::End),
        2 => Just(Event::Leave),
    ]
}

proptest! {
    /// Every set is entered before it is reached, and reached before it is left, in the order of
    /// frames, and none is entered twice.
    #[test]
    fn outputs_come_in_order(events in prop::collection::vec(event(), 1..120), variant in 0_usize..2) {
        let (mut cup, mut out) = begun(variant);
        let mut frame = 0;
        for event in events {
            match event {
                Event::Frames(frames) => {
                    frame += frames;
                    cup.on(Input::At(frame), &mut out);
                }
                Event::Plan(late, long) => {
                    if let Some(Want::Set { from, .. }) = cup.want() {
                        let from = from.unwrap_or(frame).max(frame + 1) + late;
                        cup.on(Input::Planned { from, key: from + long }, &mut out);
                    }
                }
                Event::Again => cup.on(Input::Again, &mut out),
                Event::End => cup.on(Input::End, &mut out),
                Event::Leave => {
                    if let Some(Want::Leave(from)) = cup.want() {
                        cup.on(Input::Leaving(from.max(frame + 1)), &mut out);
                    }
                }
            }
            cup.on(Input::At(frame), &mut out);
        }
        let mut last = Frame::MIN;
        let mut inside: Option<(usize, bool)> = None;
        let mut entered = HashSet::new();
        for (nth, output) in out.iter().enumerate() {
            let at = match *output {
                Output::Entered(at, set) => {
                    prop_assert_eq!(inside.replace((set, false)), None);
                    prop_assert!(entered.insert(set), "{:?}", out);
                    at
                }
                Output::Reached(at, set) => {
                    prop_assert_eq!(inside.replace((set, true)), Some((set, false)));
                    at
                }
                Output::Left(at, set) => {
                    prop_assert_eq!(inside.take(), Some((set, true)));
                    at
                }
                Output::Over(at) => {
                    prop_assert!(nth + 1 == out.len() && inside.is_none() && cup.is_over());
                    at
                }
            };
            prop_assert!(at >= last && at <= frame, "{:?}", out);
            last = at;
        }
    }
}
