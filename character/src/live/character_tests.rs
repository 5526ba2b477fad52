use proptest::prelude::*;
use troupe_motion::rotation::{angle_between, yaw};
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::*;
use crate::live::{FrameOut, PlanCause, PlanTrace, SUB_FRAMES, Stats};
use crate::style::{Gait, StyleKey};
use crate::testing::toy_rig;

fn key(left_mps: f32, forward_mps: f32, swing: f32) -> StyleKey {
    StyleKey {
        rotations: vec![Quat::IDENTITY, Quat::from_rotation_x(swing)],
        height_m: 0.85,
        left_mps,
        forward_mps,
        turn_rps: 0.0,
    }
}

fn gait(name: &str, forward_mps: f32, keys: Vec<StyleKey>) -> Gait {
    Gait {
        name: name.to_owned(),
        left_mps: 0.0,
        forward_mps,
        turn_rps: 0.0,
        period_frames: if keys.len() > 1 { 30.0 } else { 0.0 },
        keys,
        built: false,
    }
}

/// A style that stands with its foot at 0.1 rad and walks at 1.2 m/s.
fn style(name: &str) -> Arc<Style> {
    let walk = (0..10)
        .map(|k| key(0.0, 1.2, 0.3 * (k as f32 * 0.628).sin()))
        .collect();
    Arc::new(Style {
        name: name.to_owned(),
        default_speed_mps: 1.2,
        replan_interval_frames: 9,
        allowed_token_counts: Vec::new(),
        is_static: false,
        root_ratio: 0.0,
        gaits: vec![
            gait("walk", 1.2, walk),
            gait("idle", 0.0, vec![key(0.0, 0.0, 0.1)]),
        ],
        words: None,
        takes: Arc::default(),
        built_in: true,
        cache: Default::default(),
    })
}

fn going(style: &Arc<Style>, x: f32, z: f32) -> LocomotionCommand {
    LocomotionCommand {
        velocity: Vec3::new(x, 0.0, z),
        facing: None,
        style: Arc::clone(style),
        gait: None,
        height_m: None,
    }
}

fn options() -> CharacterOptions {
    CharacterOptions {
        seed: 1,
        look_ahead_frames: 4,
        replan_interval_frames: None,
        root_ratio: None,
        temperature: 0.0,
    }
}

fn standing_character(style: &Arc<Style>) -> Character {
    let root = GlobalRoot::new(Vec3::new(3.0, 77.0, -1.0), 0.5);
    Character::new(
        Arc::new(toy_rig()),
        options(),
        Start::Standing(root),
        going(style, 0.0, 0.0),
    )
}

/// A plan that goes straight from its context to its target.
fn answer(request: &PlanRequest) -> LivePlan {
    let shape = &request.shape;
    let frames = shape.targets.frames.unwrap();
    let (start, end) = (
        shape.context_roots[3],
        shape.targets.targets.last().unwrap().root.unwrap(),
    );
    let ahead = |frame: usize| start.lerp(end.position, (frame - 3) as f32 / (frames - 4) as f32);
    let roots: Vec<Vec3> = shape
        .context_roots
        .into_iter()
        .chain((4..frames).map(ahead))
        .collect();
    let joints = shape.context_rotations.len() / 4;
    let mut rotations = shape.context_rotations.clone();
    rotations.extend(shape.context_rotations[3 * joints..].repeat(frames - 4));
    LivePlan {
        feet_glide: false,
        contacts: vec![1; frames],
        roots,
        rotations,
        trace: PlanTrace {
            tokens: vec![request.number as u32],
            ..PlanTrace::default()
        },
    }
}

fn serve(character: &mut Character) -> Option<PlanRequest> {
    let request = character.take_request()?;
    character.plan_arrived(request.number, Ok(answer(&request)));
    Some(request)
}

fn frame(character: &Character) -> FrameOut {
    let mut out = FrameOut::default();
    character.sample(&mut out);
    out
}

#[test]
fn a_new_character_stands_in_its_styles_idle_pose() {
    let character = standing_character(&style("calm"));
    let out = frame(&character);
    assert_eq!((out.frame, out.root), (0, Vec3::new(3.0, 0.85, -1.0)));
    assert!(angle_between(out.rotations[0], yaw(0.5)) < 1e-5);
    assert!(angle_between(out.rotations[1], Quat::from_rotation_x(0.1)) < 1e-5);
    let view = character.view();
    assert!((view.root.heading - 0.5).abs() < 1e-5);
    assert_eq!(
        (view.speed_mps, view.last_sequence, view.stats),
        (0.0, 0, Stats::default())
    );
    assert!(character.peek(9).plan.is_none());
}

#[test]
fn a_moving_character_asks_at_once_and_continues_its_context() {
    let roots = std::array::from_fn(|frame| Vec3::new(0.0, 0.9, 0.04 * frame as f32));
    let start = Start::Context {
        roots,
        rotations: vec![Quat::IDENTITY; 8],
    };
    let walk = going(&style("calm"), 0.0, 1.2);
    let mut character = Character::new(Arc::new(toy_rig()), options(), start, walk);
    assert_eq!(character.advance(SUB_FRAMES, Clock::Waits), Advance::NeedsPlan);
    let request = serve(&mut character).unwrap();
    assert_eq!(
        (
            request.number,
            request.splice_in_frames,
            request.shape.context_roots
        ),
        (0, 0, roots)
    );
    assert_eq!(character.advance(0, Clock::Waits), Advance::Moved);
    let out = frame(&character);
    assert!(out.root.z > 0.12 && out.root.z < 0.2, "{}", out.root);
}

#[test]
fn commands_hold_once_and_in_order() {
    let calm = style("calm");
    let mut character = standing_character(&calm);
    let mut tell = |sequence, x| character.command(sequence, None, going(&calm, x, 0.0));
    assert_eq!(tell(5, 1.0), CommandOutcome::Accepted);
    assert_eq!(tell(5, 2.0), CommandOutcome::Repeated);
    assert_eq!(tell(4, 3.0), CommandOutcome::Late);
    let waiting = character.peek(0).waiting.unwrap();
    assert_eq!(
        (waiting.sequence, waiting.frame, waiting.intent),
        (5, 0, Intent::Locomote(going(&calm, 1.0, 0.0)))
    );
    character.advance(SUB_FRAMES, Clock::Waits);
    let request = character.take_request().unwrap();
    assert_eq!(
        (request.cause, request.item.frames()),
        (PlanCause::Command, Some(34))
    );
    assert_eq!(character.view().last_sequence, 5);
    assert!(character.peek(0).waiting.is_none() && character.peek(0).in_flight);
}

#[test]
fn a_bounded_command_is_an_event_once_a_second() {
    let calm = style("calm");
    let mut character = standing_character(&calm);
    let mut events = Vec::new();
    // Within the style's speed, then far beyond it, changing a little every frame, and within it
    // again.
    for frame in 0..90 {
        let z = match frame {
            0..10 => 1.2,
            10..80 => 6.0 + 0.01 * frame as f32,
            _ => 1.0,
        };
        character.command(1 + frame, None, going(&calm, 0.0, z));
        character.advance(SUB_FRAMES, Clock::Waits);
        serve(&mut character);
        character.take_events(&mut events);
    }
    let frames: Vec<u64> = events.iter().map(|event| event.frame).collect();
    assert_eq!(frames.len(), 3, "{events:?}");
    assert_eq!((frames[1] - frames[0], frames[2] - frames[1]), (30, 30));
    let EventKind::Bounded {
        wanted_mps,
        speed_mps,
        facing,
    } = events[0].kind
    else {
        panic!("{events:?}")
    };
    assert!((6.0..6.3).contains(&wanted_mps) && (1.2..1.4).contains(&speed_mps));
    assert_eq!(facing, None, "no command says where to face");
}

#[test]
fn the_newest_command_gets_the_plan() {
    let calm = style("calm");
    let mut character = standing_character(&calm);
    for frame in 0..2 {
        character.advance(SUB_FRAMES, Clock::Waits);
        serve(&mut character);
        let way = going(&calm, 0.3 * frame as f32, 0.3);
        assert_eq!(character.command(1 + frame, None, way), CommandOutcome::Accepted);
    }
    assert_eq!(character.view().stats.plans_for_command, 1);
    character.advance(SUB_FRAMES, Clock::Waits);
    let request = serve(&mut character).unwrap();
    assert_eq!((request.cause, request.number), (PlanCause::Command, 1));
    let toward = request.shape.targets.r_g1.position - request.shape.context_roots[3];
    assert!(
        (toward.x / toward.z - 1.0).abs() < 0.2,
        "it follows the last command: {toward}"
    );
    let record = character.peek(1).plan.unwrap();
    assert_eq!(
        (
            record.number,
            record.asked_at,
            record.splice,
            record.trace.tokens[0]
        ),
        (1, 2, 4, 1)
    );
}

#[test]
fn a_command_waits_for_its_frame_and_a_newer_one_takes_its_place() {
    let calm = style("calm");
    let mut character = standing_character(&calm);
    character.command(1, Some(12), going(&calm, 1.0, 0.0));
    character.command(2, Some(20), going(&calm, 0.0, 1.0));
    let mut asked = Vec::new();
    for _ in 0..30 {
        while character.advance(SUB_FRAMES, Clock::Waits) == Advance::NeedsPlan {}
        asked.extend(serve(&mut character));
        if character.view().frame <= 20 {
            assert_eq!(character.peek(0).waiting.map(|w| w.frame), Some(20));
        }
    }
    let at: Vec<u64> = asked
        .iter()
        .filter(|request| request.cause == PlanCause::Command)
        .map(|request| request.number)
        .collect();
    assert_eq!(at.len(), 2, "the first plan and the second command's");
    assert!(frame(&character).root.z > -1.0);
    assert!(
        (frame(&character).root.x - 3.0).abs() < 1e-4,
        "the first command never held"
    );
}

#[test]
fn the_same_command_again_asks_for_nothing() {
    let calm = style("calm");
    let mut character = standing_character(&calm);
    for tick in 0..60 {
        character.command(1 + tick, None, going(&style("calm"), 0.0, 1.0));
        character.advance(SUB_FRAMES, Clock::Runs);
        serve(&mut character);
    }
    let stats = character.view().stats;
    assert_eq!((stats.plans_for_command, stats.plans_for_interval), (1, 7));
}

#[test]
fn peek_shows_the_future_and_changes_nothing() {
    let calm = style("calm");
    let mut character = standing_character(&calm);
    character.command(1, None, going(&calm, 0.0, 1.0));
    for _ in 0..10 {
        character.advance(SUB_FRAMES, Clock::Runs);
        serve(&mut character);
    }
    character.advance(100, Clock::Runs);
    let peek = character.peek(5);
    assert_eq!((peek.first_frame, peek.roots.len()), (11, 5));
    assert_eq!((peek.rotations.len(), peek.contacts.len()), (10, 5));
    let all = character.peek(usize::MAX);
    assert_eq!(all.roots.len() as u32, character.view().buffered_frames + 1);
    for root in &peek.roots[..2] {
        let to_next = SUB_FRAMES - (character.timeline.cursor() % i64::from(SUB_FRAMES)) as u32;
        character.advance(to_next, Clock::Runs);
        assert_eq!(frame(&character).root, *root);
    }
}

#[derive(Debug, Clone)]
enum Event {
    Advance(u32),
    Command(u64, Option<u64>, i8, i8),
    Arrive,
    Fail,
    Duplicate,
}

fn event() -> impl Strategy<Value = Event> {
    let velocity = || -12i8..=12;
    prop_oneof![
        6 => prop_oneof![Just(150u32), Just(180), Just(300)].prop_map(Event::Advance),
        3 => (0u64..60, proptest::option::of(0u64..80), velocity(), velocity())
            .prop_map(|(sequence, at, x, z)| Event::Command(sequence, at, x, z)),
        4 => Just(Event::Arrive),
        1 => Just(Event::Fail),
        1 => Just(Event::Duplicate),
    ]
}

proptest! {
    #[test]
    fn a_character_goes_on_whatever_happens(events in proptest::collection::vec(event(), 1..200), runs: bool) {
        let calm = style("calm");
        let clock = if runs { Clock::Runs } else { Clock::Waits };
        let mut character = standing_character(&calm);
        let (mut open, mut answered): (Option<PlanRequest>, Option<PlanRequest>) = (None, None);
        let (mut highest, mut before) = (0, frame(&character));
        for event in events {
            match event {
                Event::Advance(sub_frames) => {
                    let waits = character.advance(sub_frames, clock) == Advance::NeedsPlan;
                    prop_assert!(!waits || !runs);
                }
                Event::Command(sequence, at_frame, x, z) => {
                    let waiting = character.peek(0).waiting;
                    let outcome = character.command(sequence, at_frame, going(&calm, f32::from(x) / 10.0, f32::from(z) / 10.0));
                    let want = match sequence.cmp(&highest) {
                        std::cmp::Ordering::Greater => CommandOutcome::Accepted,
                        std::cmp::Ordering::Equal => CommandOutcome::Repeated,
                        std::cmp::Ordering::Less => CommandOutcome::Late,
                    };
                    prop_assert_eq!(outcome, want);
                    if want != CommandOutcome::Accepted {
                        prop_assert_eq!(character.peek(0).waiting, waiting, "an old command changes nothing");
                    }
                    highest = highest.max(sequence);
                }
                Event::Arrive => {
                    if let Some(request) = open.take() {
                        let arrival = character.plan_arrived(request.number, Ok(answer(&request)));
                        prop_assert_ne!(arrival, Arrival::Stray);
                        answered = Some(request);
                    }
                }
                Event::Fail => {
                    if let Some(request) = open.take() {
                        prop_assert_eq!(character.plan_arrived(request.number, Err(PlanFailed)), Arrival::Failed);
                    }
                }
                Event::Duplicate => {
                    if let Some(request) = &answered {
                        let again = character.plan_arrived(request.number, Ok(answer(request)));
                        prop_assert_eq!(again, Arrival::Stray);
                    }
                }
            }
            if let Some(request) = character.take_request() {
                prop_assert!(character.take_request().is_none());
                // A command had it requested instead of the open one.
                if let Some(given_up) = open.take() {
                    let arrival = character.plan_arrived(given_up.number, Ok(answer(&given_up)));
                    prop_assert_eq!((request.cause, arrival), (PlanCause::Command, Arrival::Stray));
                }
                open = Some(request);
            }
            let now = frame(&character);
            prop_assert!(now.frame >= before.frame && character.view().last_sequence == highest);
            let moved = now.root.distance(before.root);
            prop_assert!(moved < 0.5, "a jump of {moved} m at frame {}", now.frame);
            for (a, b) in now.rotations.iter().zip(&before.rotations) {
                prop_assert!(angle_between(*a, *b) < 0.3);
            }
            before = now;
        }
    }

    #[test]
    fn a_waiting_clock_does_not_depend_on_when_plans_arrive(
        delays in proptest::collection::vec(0u32..9, 1..12), rate in prop_oneof![Just(30u32), Just(50), Just(60)],
    ) {
        let run = |delays: &[u32]| {
            let calm = style("calm");
            let mut character = standing_character(&calm);
            let mut open: Option<(PlanRequest, u32)> = None;
            let mut delay = delays.iter().cycle();
            let mut frames = Vec::new();
            for tick in 0..120u64 {
                if tick % 7 == 0 {
                    let angle = tick as f32;
                    character.command(tick + 1, (tick % 3 == 0).then_some(tick + 5), going(&calm, angle.sin(), angle.cos()));
                }
                let mut left = SUB_FRAMES * 30 / rate;
                loop {
                    let advance = character.advance(left, Clock::Waits);
                    left = 0;
                    if let Some(request) = character.take_request() {
                        open = Some((request, *delay.next().unwrap()));
                    }
                    match &mut open {
                        Some((request, 0)) => {
                            character.plan_arrived(request.number, Ok(answer(request)));
                            open = None;
                        }
                        Some((_, left)) => *left -= 1,
                        None => {}
                    }
                    if advance == Advance::Moved {
                        break;
                    }
                }
                frames.push((frame(&character).frame, frame(&character).root, frame(&character).rotations));
            }
            frames
        };
        let (at_once, later) = (run(&[0]), run(&delays));
        let differs = at_once.iter().zip(&later).position(|(a, b)| a != b);
        prop_assert_eq!(differs, None);
    }
}
