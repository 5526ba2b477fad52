use std::collections::VecDeque;

use proptest::prelude::*;
use troupe_motion::{Quat, Vec3};

use super::cursor::SUB;
use super::*;
use crate::live::testing::still_buffer;
use crate::live::{Arrival, LivePlan, PlanTrace, SUB_FRAMES};

/// Rise in metres and turn in radians of the one joint for each metre of travel. Height and pose
/// fade in alike, so this shows whether both belong to the same frame. The value is small because
/// joints far from a plan fade in their own time.
const TURN: f32 = 0.1;
const WALKS: Policy = Policy {
    interval_frames: Some(9),
    pace: None,
    unfinished: false,
};
const STANDS: Policy = Policy {
    interval_frames: None,
    pace: None,
    unfinished: false,
};

/// A timeline and a planner whose plans go straight ahead, each at its own speed.
struct Harness {
    timeline: Timeline,
    policy: Policy,
    /// Plans that were asked for and not delivered yet, with their frames.
    asked: VecDeque<(Ticket, LivePlan)>,
    tickets: Vec<Ticket>,
    plan_frames: usize,
}

fn speed(number: u64) -> f32 {
    0.05 + 0.01 * ((number * 7 % 5) as f32 - 2.0) / 2.0
}

impl Harness {
    fn new(policy: Policy, plan_frames: usize) -> Self {
        Self {
            // With this phase the first interval is as long as all others.
            timeline: Timeline::new(still_buffer(), 4, 4),
            policy,
            asked: VecDeque::new(),
            tickets: Vec::new(),
            plan_frames,
        }
    }

    fn advance(&mut self, sub_frames: u32, clock: Clock) -> Stop {
        self.timeline.push(sub_frames);
        loop {
            let stop = self.timeline.run(clock, Barrier::default());
            let Stop::AtFrame(frame) = stop else { return stop };
            assert_eq!((frame, self.timeline.cursor() % SUB), (self.timeline.frame(), 0));
            if let Some(ticket) = self.timeline.settle(clock, self.policy) {
                let plan = self.plan(ticket);
                self.tickets.push(ticket);
                self.asked.push_back((ticket, plan));
            }
        }
    }

    fn plan(&self, ticket: Ticket) -> LivePlan {
        let buffer = self.timeline.buffer();
        let context = (0..4).map(|frame| buffer.root(ticket.splice - 3 + frame));
        let start = buffer.root(ticket.splice);
        let ahead = (1..=self.plan_frames - 4)
            .map(|frame| start + Vec3::new(0.0, TURN, 1.0) * (speed(ticket.number) * frame as f32));
        let roots: Vec<Vec3> = context.chain(ahead).collect();
        LivePlan {
            feet_glide: false,
            rotations: roots.iter().map(|root| Quat::from_rotation_x(root.y)).collect(),
            contacts: vec![0; roots.len()],
            roots,
            trace: PlanTrace::default(),
        }
    }

    /// Delivers the oldest plan that was asked for.
    fn deliver(&mut self) -> Option<Arrival> {
        let (ticket, plan) = self.asked.pop_front()?;
        Some(self.timeline.land(ticket.number, &plan))
    }

    fn sample(&self) -> Vec3 {
        let mut pose = Vec::new();
        let (root, _) = self.timeline.buffer().sample(self.timeline.cursor(), &mut pose);
        assert!(pose[0].angle_between(Quat::from_rotation_x(root.y)) < 0.002);
        root
    }

    /// A tick at 30 Hz whose plans arrive at once.
    fn tick(&mut self) -> Vec3 {
        assert_eq!(self.advance(SUB_FRAMES, Clock::Runs), Stop::Done);
        while self.deliver().is_some() {}
        self.sample()
    }
}

#[test]
fn plans_follow_the_interval() {
    let mut rig = Harness::new(WALKS, 34);
    for _ in 0..40 {
        rig.tick();
    }
    let splices: Vec<(i64, i64)> = rig.tickets.iter().map(|t| (t.asked_at, t.splice)).collect();
    assert_eq!(splices, [(0, 2), (7, 11), (16, 20), (25, 29), (34, 38)]);
    assert_eq!(rig.tickets[0].cause, PlanCause::Command);
    assert!(rig.tickets[1..].iter().all(|t| t.cause == PlanCause::Interval));
    let stats = rig.timeline.stats();
    assert_eq!((stats.plans_for_command, stats.plans_for_interval), (1, 4));
    assert_eq!((stats.late_plans, stats.underruns, stats.failed_plans), (0, 0, 0));
}

#[test]
fn the_interval_after_a_command_depends_on_the_phase() {
    let first_interval = |phase| {
        let mut rig = Harness::new(WALKS, 34);
        rig.timeline.phase = phase;
        for _ in 0..60 {
            rig.tick();
        }
        let gaps: Vec<i64> = rig
            .tickets
            .windows(2)
            .map(|pair| pair[1].splice - pair[0].splice)
            .collect();
        assert!(gaps[1..].iter().all(|&gap| gap == 9), "{gaps:?}");
        gaps[0]
    };
    let mut firsts: Vec<i64> = (0..10).map(first_interval).collect();
    firsts.sort_unstable();
    assert_eq!(firsts, [5, 5, 6, 6, 7, 7, 8, 8, 9, 9]);
}

#[test]
fn a_static_style_plans_for_a_low_buffer_only() {
    let mut rig = Harness::new(STANDS, 34);
    for _ in 0..100 {
        rig.tick();
    }
    assert!(rig.tickets[1..].iter().all(|t| t.cause == PlanCause::LowBuffer));
    // Each plan has 30 frames after its splice frame; look-ahead and margin stay unused.
    let asked: Vec<i64> = rig.tickets.iter().map(|t| t.asked_at).collect();
    // They are asked for up to seven frames early, each by a different number.
    assert_eq!(asked, [0, 15, 31, 46, 68, 89]);
    assert_eq!(rig.timeline.stats().underruns, 0);
}

#[test]
fn a_command_takes_over_sooner_than_a_plan_in_flight_or_waits_for_it() {
    // A plan is asked for at frame 7, to take over at 11.
    for (commanded_at, asked_at, splice) in [(8, 8, 10), (9, 9, 11), (10, 11, 13)] {
        for delivered in [true, false] {
            // A plan that the command must wait for arrives.
            let delivered = delivered || asked_at > commanded_at;
            let mut rig = Harness::new(WALKS, 34);
            for _ in 1..7 {
                rig.tick();
            }
            while rig.timeline.frame() + 1 < commanded_at {
                if delivered {
                    rig.tick();
                } else {
                    rig.advance(SUB_FRAMES, Clock::Runs);
                }
            }
            rig.timeline.command_changed();
            while rig.tickets.len() < 3 {
                rig.advance(SUB_FRAMES, Clock::Runs);
            }
            let ticket = rig.tickets[2];
            assert_eq!(
                (ticket.cause, ticket.asked_at, ticket.splice),
                (PlanCause::Command, asked_at, splice)
            );
            while rig.timeline.frame() < splice {
                rig.tick();
            }
            let stats = rig.timeline.stats();
            let waited = u64::from(asked_at > commanded_at);
            assert_eq!((stats.plans_for_command, stats.plans_for_interval), (2, waited));
            assert_eq!(stats.late_plans, 0);
        }
    }
}

#[test]
fn commands_at_every_frame_are_answered() {
    for clock in [Clock::Runs, Clock::Waits] {
        let mut rig = Harness::new(WALKS, 34);
        for _ in 0..60 {
            rig.timeline.command_changed();
            let mut sub_frames = SUB_FRAMES;
            while rig.advance(sub_frames, clock) == Stop::NeedsPlan {
                sub_frames = 0;
                rig.deliver();
            }
            while rig.deliver().is_some() {}
        }
        assert!(
            rig.timeline.stats().plans_for_command > 25,
            "{:?}",
            rig.timeline.stats()
        );
    }
}

#[test]
fn a_late_plan_fades_in_where_the_cursor_is() {
    let mut rig = Harness::new(STANDS, 34);
    for _ in 0..7 {
        rig.advance(SUB_FRAMES, Clock::Runs);
    }
    rig.advance(100, Clock::Runs);
    assert_eq!(rig.tickets.len(), 1, "one plan in flight, and it is awaited");
    let (before, expected) = (rig.sample(), rig.asked[0].1.roots[3 + 20 - 2]);
    assert_eq!(rig.deliver(), Some(Arrival::Late));
    assert_eq!(rig.sample(), before, "the cursor's own frames stay");
    assert_eq!(rig.timeline.stats().late_plans, 1);
    // After the fade, the timeline's frames are the plan's.
    assert!(rig.timeline.buffer().root(20).abs_diff_eq(expected, 1e-6));
    assert_eq!(rig.timeline.stats().plans_for_command, 1);
}

#[test]
fn a_plan_with_too_little_left_is_dropped() {
    let mut rig = Harness::new(WALKS, 12);
    while rig.timeline.frame() < 6 {
        rig.advance(SUB_FRAMES, Clock::Runs);
    }
    assert_eq!(rig.deliver(), Some(Arrival::Dropped));
    rig.advance(SUB_FRAMES, Clock::Runs);
    let again = rig.tickets[1];
    assert_eq!(
        (again.number, again.cause, again.asked_at),
        (1, PlanCause::Command, 7)
    );
    let stats = rig.timeline.stats();
    assert_eq!((stats.late_plans, stats.plans_for_command), (1, 0));
}

#[test]
fn without_its_plan_the_character_slows_down_and_recovers() {
    let mut rig = Harness::new(WALKS, 34);
    for _ in 0..10 {
        rig.tick();
    }
    let way = |rig: &mut Harness| {
        let before = rig.timeline.cursor();
        assert_eq!(rig.advance(SUB_FRAMES, Clock::Runs), Stop::Done);
        rig.timeline.cursor() - before
    };
    let paces: Vec<i64> = (0..120).map(|_| way(&mut rig)).collect();
    assert!(paces.windows(2).all(|pair| pair[1] <= pair[0]), "{paces:?}");
    assert!(
        paces.windows(2).all(|pair| pair[0] - pair[1] <= 38),
        "no abrupt stop: {paces:?}"
    );
    assert!(
        paces[25..60].iter().all(|&way| way > 0),
        "it never freezes: {paces:?}"
    );
    assert!(rig.timeline.slowing());
    assert_eq!(rig.timeline.stats().underruns, 1);

    // Little is left of the plan that arrives now; the next is in time.
    assert_eq!(rig.deliver(), Some(Arrival::Late));
    let mut paces = vec![];
    for _ in 0..30 {
        paces.push(way(&mut rig));
        rig.deliver();
    }
    assert!(
        paces.windows(2).all(|pair| pair[1] - pair[0] <= 50),
        "no abrupt start: {paces:?}"
    );
    assert_eq!(paces[29], SUB, "{paces:?}");
    let stats = rig.timeline.stats();
    assert_eq!((stats.underruns, rig.timeline.slowing()), (1, false));

    for _ in 0..60 {
        way(&mut rig);
    }
    assert_eq!(rig.timeline.stats().underruns, 2, "another episode");
}

#[test]
fn a_failed_plan_is_asked_for_again() {
    let mut rig = Harness::new(WALKS, 34);
    rig.advance(SUB_FRAMES, Clock::Runs);
    assert_eq!(rig.timeline.fail(7), Arrival::Stray);
    assert_eq!(rig.timeline.fail(0), Arrival::Failed);
    assert_eq!(rig.timeline.fail(0), Arrival::Stray);
    rig.asked.clear();
    assert!(!rig.timeline.awaits_plan());
    rig.tick();
    let again = rig.tickets[1];
    assert_eq!(
        (again.cause, again.asked_at, again.splice),
        (PlanCause::Command, 2, 4)
    );
    assert_eq!(rig.timeline.stats().failed_plans, 1);
}

#[test]
fn a_clock_that_waits_asks_again_even_at_the_buffers_end() {
    let mut rig = Harness::new(WALKS, 34);
    rig.advance(1000 * SUB_FRAMES, Clock::Waits);
    for tries in 1..100 {
        let number = rig.asked.pop_front().unwrap().0.number;
        assert_eq!(rig.timeline.fail(number), Arrival::Failed);
        assert_eq!(
            rig.advance(0, Clock::Waits),
            Stop::NeedsPlan,
            "after {tries} tries"
        );
    }
    assert!(rig.timeline.frame() <= 32, "it does not go past its frames");
    assert!(matches!(rig.deliver(), Some(Arrival::InTime { .. })));
    assert_eq!(rig.advance(0, Clock::Waits), Stop::NeedsPlan);
    assert_eq!(rig.timeline.stats().underruns, 0);
}

#[test]
fn plans_in_time_make_no_difference_by_when_they_arrive() {
    let mut at_once = Harness::new(WALKS, 34);
    let mut in_time = Harness::new(WALKS, 34);
    for tick in 1..300 {
        let one = at_once.tick();
        in_time.advance(SUB_FRAMES, Clock::Runs);
        if tick % 9 == 1 {
            assert!(!matches!(in_time.deliver(), Some(Arrival::Late)));
        }
        assert_eq!(one, in_time.sample());
    }
    assert_eq!(at_once.tickets, in_time.tickets);
}

/// Runs `ticks` ticks at `rate` Hz. A plan arrives after as many attempts to go on as `delays`
/// says. Returns the position at every tick.
fn waited(rate: u32, ticks: usize, delays: &[usize]) -> (Vec<Vec3>, Vec<Ticket>) {
    let mut rig = Harness::new(WALKS, 20);
    let mut delays = delays.iter().cycle();
    let mut wait = *delays.next().unwrap();
    let mut roots = Vec::new();
    let mut pass = |rig: &mut Harness| {
        if wait == 0 {
            rig.deliver();
            wait = *delays.next().unwrap();
        } else if !rig.asked.is_empty() {
            wait -= 1;
        }
    };
    for tick in 0..ticks {
        if tick % 17 == 5 {
            rig.timeline.command_changed();
        }
        let mut sub_frames = SUB_FRAMES * 30 / rate;
        while rig.advance(sub_frames, Clock::Waits) == Stop::NeedsPlan {
            sub_frames = 0;
            pass(&mut rig);
        }
        pass(&mut rig);
        roots.push(rig.sample());
    }
    (roots, rig.tickets)
}

#[test]
fn rates_show_the_same_motion() {
    let run = |rate: u32| {
        let mut rig = Harness::new(WALKS, 34);
        let ticks = 10 * rate as usize;
        let roots: Vec<Vec3> = (0..ticks)
            .map(|_| {
                assert_eq!(rig.advance(SUB_FRAMES * 30 / rate, Clock::Runs), Stop::Done);
                while rig.deliver().is_some() {}
                rig.sample()
            })
            .collect();
        (roots, rig.tickets)
    };
    let (at_30, tickets) = run(30);
    for rate in [50, 60] {
        let (roots, same) = run(rate);
        assert_eq!(same, tickets, "{rate} Hz asks for the same plans");
        // Frames that both show: at 60 Hz every frame of 30 Hz, at 50 Hz every third.
        let (step, every) = if rate == 60 { (1, 2) } else { (3, 5) };
        for (a, b) in at_30
            .iter()
            .skip(step - 1)
            .step_by(step)
            .zip(roots.iter().skip(every - 1).step_by(every))
        {
            assert_eq!(a, b);
        }
    }
}

#[derive(Debug, Clone)]
enum Event {
    Advance(u32),
    Command,
    Deliver,
    Fail,
    Again,
    Stray(u64),
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        8 => prop_oneof![Just(150u32), Just(180), Just(300), 1u32..900].prop_map(Event::Advance),
        1 => Just(Event::Command),
        3 => Just(Event::Deliver),
        1 => Just(Event::Fail),
        1 => Just(Event::Again),
        1 => (0u64..100).prop_map(Event::Stray),
    ]
}

proptest! {
    #[test]
    fn waiting_makes_frames_independent_of_delays(
        delays in proptest::collection::vec(0usize..12, 1..20), rate in prop_oneof![Just(30u32), Just(50), Just(60)],
    ) {
        prop_assert!(waited(rate, 150, &[0]) == waited(rate, 150, &delays));
    }

    #[test]
    fn motion_goes_on_whatever_happens(
        events in proptest::collection::vec(event(), 1..300), plan_frames in 12usize..=64, walks: bool,
    ) {
        let mut rig = Harness::new(if walks { WALKS } else { STANDS }, plan_frames);
        let (mut cursor, mut root) = (0, rig.sample());
        let mut last: Option<(Ticket, LivePlan)> = None;
        for event in events {
            let (tickets, stats) = (rig.tickets.len(), rig.timeline.stats());
            // A command may have a plan asked for instead of one under way.
            let free = usize::from(!rig.timeline.awaits_plan()) + usize::from(rig.timeline.command_waits());
            match event {
                Event::Advance(sub_frames) => {
                    prop_assert_eq!(rig.advance(sub_frames, Clock::Runs), Stop::Done);
                    prop_assert!(rig.tickets.len() <= tickets + free, "a second plan in flight");
                    prop_assert!(rig.timeline.stats().underruns <= stats.underruns + 1);
                }
                Event::Command => rig.timeline.command_changed(),
                Event::Deliver => {
                    last = rig.asked.front().cloned().or(last);
                    let arrival = rig.deliver();
                    prop_assert_ne!(arrival, Some(Arrival::Stray));
                }
                Event::Fail => {
                    if let Some((ticket, _)) = rig.asked.pop_front() {
                        prop_assert_eq!(rig.timeline.fail(ticket.number), Arrival::Failed);
                    }
                }
                Event::Again => {
                    if let Some((ticket, plan)) = &last {
                        prop_assert_eq!(rig.timeline.land(ticket.number, plan), Arrival::Stray);
                    }
                }
                Event::Stray(ahead) => {
                    let number = rig.tickets.len() as u64 + ahead;
                    prop_assert_eq!(rig.timeline.fail(number), Arrival::Stray);
                }
            }
            while rig.asked.len() > 1 {
                prop_assert_eq!(rig.deliver(), Some(Arrival::Stray));
            }
            let now = rig.timeline.cursor();
            prop_assert!(now >= cursor, "the cursor goes back");
            let buffer = rig.timeline.buffer();
            prop_assert!(now <= buffer.last() * SUB && rig.timeline.frame() - 3 >= buffer.first());
            prop_assert!(buffer.last() - buffer.first() < 120, "the buffer grows");
            // Plans differ by at most 0.02 m a frame, and fade over 9 frames.
            let frames = (now - cursor) as f32 / SUB as f32;
            let moved = rig.sample().distance(root);
            prop_assert!(moved <= frames * (0.06 + 0.02 * 70.0 / 6.0) + 1e-4, "{moved} m in {frames} frames");
            (cursor, root) = (now, rig.sample());
        }
    }
}

#[path = "load_tests.rs"]
mod load;
