use super::*;
use crate::batch::order::OwnerId;

fn limits() -> Limits {
    Limits {
        max_batch: 8,
        max_queued: 20,
        max_live: 20,
        live_slice: Duration::ZERO,
        ..Limits::default()
    }
}

/// Room for all; calls wait as long as this, and in an overload as that.
fn waits(max_wait_ms: u64, max_standing_wait_ms: u64) -> Limits {
    Limits {
        max_queued: 10_000,
        max_wait: Duration::from_millis(max_wait_ms),
        max_standing_wait: Duration::from_millis(max_standing_wait_ms),
        ..limits()
    }
}

/// A batch: its lane, why it was cut, and its parts as (request, first character, characters).
type Seen = (usize, CutReason, Vec<(u64, usize, usize)>);

/// A scheduler with a clock.
struct Setup {
    scheduler: Scheduler,
    now: Instant,
    next: u64,
}

impl Setup {
    /// All lanes are free.
    fn new(limits: Limits) -> Self {
        let mut setup = Self::busy(limits);
        for lane in 0..limits.lanes {
            setup.free(lane);
        }
        setup
    }

    /// No lane has reported yet.
    fn busy(limits: Limits) -> Self {
        Self {
            scheduler: Scheduler::new(limits),
            now: Instant::now(),
            next: 0,
        }
    }

    fn pass(&mut self, ms: u64) {
        self.now += Duration::from_millis(ms);
    }

    fn after(&self, ms: u64) -> Instant {
        self.now + Duration::from_millis(ms)
    }

    fn step(&mut self, event: Event) -> Vec<Action> {
        let mut actions = Vec::new();
        self.scheduler.step(self.now, event, &mut actions);
        actions
    }

    fn arrive(&mut self, characters: usize, order: Order) -> (u64, Vec<Action>) {
        self.next += 1;
        let arrived = Event::Arrived {
            request: RequestId(self.next),
            characters,
            order,
        };
        (self.next, self.step(arrived))
    }

    /// A call that is admitted, due now.
    fn call(&mut self, characters: usize) -> u64 {
        let (request, actions) = self.arrive(characters, Order::request(self.now));
        assert_eq!(actions, []);
        request
    }

    /// So many calls of one character each.
    fn calls(&mut self, count: usize) {
        for _ in 0..count {
            self.call(1);
        }
    }

    /// A plan, due in `ms`.
    fn plan(&mut self, owner: u64, ms: u64) -> (u64, Vec<Action>) {
        self.arrive(1, Order::live(OwnerId(owner), self.after(ms)))
    }

    fn free(&mut self, lane: usize) {
        assert_eq!(self.step(Event::LaneFree { lane }), []);
    }

    fn refused(&mut self, characters: usize) -> Option<Refusal> {
        let before = self.scheduler.refuse(self.now, characters);
        let (request, actions) = self.arrive(characters, Order::request(self.now));
        match actions[..] {
            [] => {
                self.step(Event::Gone {
                    request: RequestId(request),
                });
                assert_eq!(before, None);
                None
            }
            [Action::Refuse { refusal, .. }] => {
                assert_eq!(before, Some(refusal));
                Some(refusal)
            }
            _ => panic!("{actions:?}"),
        }
    }

    /// Settles, and gives the sizes of what is cut.
    fn cut_sizes(&mut self) -> Vec<usize> {
        self.cuts().iter().map(|cut| cut.2.len()).collect()
    }

    /// Settles, and gives what is cut.
    fn cuts(&mut self) -> Vec<Seen> {
        let cut = |action| match action {
            Action::Cut(Cut { lane, parts, reason }) => {
                let parts = parts
                    .iter()
                    .map(|part| (part.request.0, part.first, part.characters));
                Some((lane, reason, parts.collect()))
            }
            Action::WakeAt(_) => None,
            other => panic!("unexpected {other:?}"),
        };
        self.step(Event::Settled).into_iter().filter_map(cut).collect()
    }

    /// The requests of the one batch that is cut for the one lane, which is free at once.
    fn batch(&mut self) -> Vec<u64> {
        let cuts = self.cuts();
        assert!(cuts.len() <= 1);
        self.free(0);
        cuts.into_iter()
            .flat_map(|cut| cut.2)
            .map(|part| part.0)
            .collect()
    }
}

#[test]
fn a_lone_request_is_cut_at_once() {
    let mut setup = Setup::new(limits());
    assert_eq!(setup.cuts(), []);
    setup.call(1);
    assert_eq!(setup.cuts(), [(0, CutReason::Idle, vec![(1, 0, 1)])]);
}

#[test]
fn what_waits_while_the_lane_is_busy_is_cut_together() {
    let mut setup = Setup::new(limits());
    setup.call(1);
    assert_eq!(setup.cuts().len(), 1);
    setup.call(1);
    setup.call(1);
    assert_eq!(setup.cuts(), []);
    setup.pass(5);
    setup.free(0);
    let actions = setup.step(Event::Settled);
    let [Action::Cut(cut)] = &actions[..] else {
        panic!("{actions:?}")
    };
    assert_eq!(cut.reason, CutReason::Backlog);
    let parts: Vec<_> = cut
        .parts
        .iter()
        .map(|part| (part.request.0, part.waited))
        .collect();
    assert_eq!(
        parts,
        [(2, Duration::from_millis(5)), (3, Duration::from_millis(5))]
    );
}

#[test]
fn a_large_request_is_split_and_shares_its_last_batch() {
    let mut setup = Setup::new(limits());
    setup.call(11);
    setup.call(2);
    assert_eq!(setup.cuts(), [(0, CutReason::Full, vec![(1, 0, 8)])]);
    setup.free(0);
    assert_eq!(
        setup.cuts(),
        [(0, CutReason::Backlog, vec![(1, 8, 3), (2, 0, 2)])]
    );
}

#[test]
fn free_lanes_share_what_waits() {
    let lanes = Limits { lanes: 3, ..limits() };
    let mut setup = Setup::new(lanes);
    setup.call(4);
    setup.call(3);
    let parts = |cuts: &[Seen]| cuts.iter().map(|cut| cut.2.clone()).collect::<Vec<_>>();
    let cuts = setup.cuts();
    assert!(cuts.iter().all(|cut| cut.1 == CutReason::Backlog));
    assert_eq!(
        parts(&cuts),
        [vec![(1, 0, 3)], vec![(1, 3, 1), (2, 0, 1)], vec![(2, 1, 2)]]
    );
    // One is free, and takes all; then two lanes find more than they can take.
    setup.call(5);
    setup.free(1);
    assert_eq!(setup.cuts(), [(1, CutReason::Backlog, vec![(3, 0, 5)])]);
    setup.call(20);
    setup.free(0);
    setup.free(2);
    let cuts = setup.cuts();
    assert_eq!(parts(&cuts), [vec![(4, 0, 8)], vec![(4, 8, 8)]]);
    assert_eq!(cuts[1].1, CutReason::Full);
    // A lost lane is not counted on.
    setup.step(Event::LaneLost { lane: 1 });
    setup.free(1);
    assert_eq!((setup.cuts(), setup.scheduler.lanes()), (vec![], 2));
}

#[test]
fn the_earliest_deadline_goes_first_and_classes_keep_their_distance_until_they_age() {
    let mut setup = Setup::busy(Limits {
        max_batch: 1,
        ..limits()
    });
    setup.call(1);
    setup.pass(1500);
    setup.plan(1, 400);
    setup.plan(2, 300);
    setup.plan(3, 600);
    setup.call(1);
    setup.free(0);
    // The first call is due 2 s after its arrival, 500 ms from now.
    let order: Vec<u64> = (0..5).flat_map(|_| setup.batch()).collect();
    assert_eq!(order, [3, 2, 1, 4, 5]);
}

#[test]
fn a_deadline_long_past_does_not_jump_the_queue_of_those_that_came_before() {
    let mut setup = Setup::busy(Limits {
        max_batch: 1,
        ..limits()
    });
    setup.plan(1, 0);
    setup.pass(10);
    let past = setup.now - Duration::from_millis(500);
    setup.arrive(1, Order::live(OwnerId(2), past));
    setup.free(0);
    assert_eq!((setup.batch(), setup.batch()), (vec![1], vec![2]));
}

#[test]
fn a_newer_plan_takes_the_place_of_the_one_that_waits() {
    let mut setup = Setup::busy(Limits {
        max_batch: 1,
        ..limits()
    });
    setup.plan(1, 100);
    setup.plan(2, 200);
    let (third, actions) = setup.plan(1, 300);
    let older = RequestId(1);
    assert_eq!(actions, [Action::Supersede { request: older }]);
    assert_eq!(setup.scheduler.pending_characters(), 2);
    setup.free(0);
    assert_eq!((setup.batch(), setup.batch()), (vec![third], vec![2]));
    // Nothing is left of the older one.
    assert_eq!(setup.step(Event::Gone { request: older }), []);
    assert_eq!(setup.scheduler.pending_requests(), 0);
}

#[test]
fn an_owner_has_one_plan_with_the_engine_and_one_that_waits() {
    let mut setup = Setup::new(Limits { lanes: 2, ..limits() });
    setup.plan(1, 100);
    assert_eq!(setup.cuts().len(), 1);
    // Lane 1 is free, but this owner's turn has not come.
    setup.plan(1, 100);
    assert_eq!(setup.cuts(), []);
    let (third, actions) = setup.plan(1, 100);
    assert_eq!(actions.len(), 1);
    assert_eq!((setup.cuts(), setup.scheduler.pending_characters()), (vec![], 1));
    setup.free(0);
    let cuts = setup.cuts();
    assert_eq!((cuts.len(), &cuts[0].2), (1, &vec![(third, 0, 1)]));
    // One that waits behind an active one can be given up.
    let (fourth, _) = setup.plan(1, 100);
    let request = RequestId(fourth);
    assert_eq!(
        setup.step(Event::Gone { request }),
        [Action::Drop {
            request,
            characters: 1
        }]
    );
    setup.free(0);
    assert_eq!((setup.cuts(), setup.scheduler.pending_requests()), (vec![], 0));
}

#[test]
fn a_full_queue_refuses_and_a_leaver_makes_room() {
    let mut setup = Setup::busy(limits());
    let first = RequestId(setup.call(15));
    let refusal = setup.refused(6).unwrap();
    assert_eq!((refusal.pending_characters, refusal.full), (15, true));
    assert!(refusal.retry_after() >= Duration::from_millis(10));
    assert_eq!(setup.refused(5), None);
    let dropped = Action::Drop {
        request: first,
        characters: 15,
    };
    assert_eq!(setup.step(Event::Gone { request: first }), [dropped]);
    assert_eq!(setup.step(Event::Gone { request: first }), []);
    assert_eq!(setup.refused(20), None);
}

/// Sizes of the cuts of a lane that was busy while so many characters came one by one.
fn backlog(padded: bool, characters: usize) -> usize {
    let mut setup = Setup::busy(Limits {
        max_batch: 32,
        max_queued: 100,
        padded,
        ..limits()
    });
    setup.calls(characters);
    setup.free(0);
    let cuts = setup.cuts();
    cuts[0].2.len()
}

#[test]
fn a_backlog_is_cut_to_a_size_without_much_padding() {
    let cases = [
        (3, 3),
        (7, 7),
        (9, 8),
        (14, 12),
        (15, 15),
        (17, 16),
        (22, 16),
        (23, 23),
        (29, 24),
        (31, 31),
        (40, 32),
    ];
    for (waiting, cut) in cases {
        assert_eq!(backlog(true, waiting), cut, "{waiting} wait");
        assert_eq!(
            backlog(false, waiting),
            waiting.min(32),
            "{waiting} wait, no padding"
        );
    }
}

#[test]
fn a_batch_is_one_call_until_lengths_differ() {
    let mut setup = Setup::new(Limits {
        lanes: 2,
        max_batch: 32,
        max_queued: 200,
        padded: false,
        call_rows: 8,
        ..limits()
    });
    setup.calls(120);
    assert_eq!(setup.cut_sizes(), [8, 8]);
    for (characters, alike, cut) in [(8, 8, 8), (8, 1, 8), (8, 1, 8), (8, 1, 8), (8, 1, 32)] {
        setup.pass(4);
        assert_eq!(setup.step(Event::Ran { characters, alike }), []);
        setup.free(0);
        assert_eq!(setup.cut_sizes(), [cut], "{alike} of {characters} alike");
    }
}

#[test]
fn a_lane_takes_whole_calls_or_half_of_one() {
    for (waiting, cut) in [(3, 3), (4, 4), (5, 4), (7, 4), (8, 8), (9, 8)] {
        let mut setup = Setup::new(Limits {
            padded: false,
            call_rows: 8,
            max_queued: 100,
            max_batch: 32,
            ..limits()
        });
        setup.calls(1);
        assert_eq!(setup.cut_sizes(), [1]);
        setup.calls(waiting);
        setup.free(0);
        assert_eq!(setup.cut_sizes(), [cut], "{waiting} wait");
    }
}

#[test]
fn a_lane_that_has_answered_many_waits_for_them_to_come_back() {
    let mut setup = Setup::new(Limits {
        lanes: 2,
        max_batch: 32,
        max_queued: 100,
        ..limits()
    });
    // 24 callers in three groups of 8: two with lanes, one that waits.
    setup.calls(16);
    assert_eq!(setup.cut_sizes(), [8, 8]);
    setup.calls(8);
    setup.pass(40);
    setup.free(0);
    // Those that were answered come back within a tenth of that, and are shared with the lane that is still busy.
    let until = setup.after(4);
    assert_eq!(setup.step(Event::Settled), [Action::WakeAt(until)]);
    setup.pass(2);
    setup.calls(8);
    assert_eq!(setup.cut_sizes(), [12]);
    setup.free(1);
    assert_eq!(setup.cut_sizes(), Vec::<usize>::new());
    setup.calls(8);
    assert_eq!(setup.cut_sizes(), [12]);
    // Two groups from now on; and nobody waits for those that do not come.
    setup.pass(50);
    setup.free(0);
    let until = setup.after(5);
    assert_eq!(setup.step(Event::Settled), [Action::WakeAt(until)]);
    setup.calls(3);
    setup.pass(5);
    assert_eq!(setup.cut_sizes(), [3]);
    // A lone caller waits for nobody, nor do live characters.
    setup.free(1);
    setup.pass(10);
    setup.cuts();
    setup.calls(1);
    assert_eq!(setup.cut_sizes(), [1]);
    setup.pass(50);
    setup.free(0);
    setup.plan(1, 100);
    assert_eq!(setup.cut_sizes(), [1]);
}

#[test]
fn a_lane_waits_for_those_alone_that_it_has_answered_last() {
    let answered = |characters| Event::Answered {
        lane: 0,
        characters,
        callers: characters,
    };
    // Three of sixteen are back when the lane is free, and four more come then.
    for (early, at_once, then) in [(0, vec![], vec![]), (12, vec![], vec![7]), (14, vec![3], vec![])] {
        let mut setup = Setup::new(Limits {
            max_batch: 32,
            max_queued: 100,
            ..limits()
        });
        setup.calls(16);
        assert_eq!(setup.cut_sizes(), [16]);
        setup.pass(40);
        setup.step(answered(early));
        setup.calls(3);
        setup.free(0);
        assert_eq!(setup.cut_sizes(), at_once, "{early} early");
        setup.calls(4);
        assert_eq!(setup.cut_sizes(), then, "{early} early");
    }
}

#[test]
fn a_lane_that_waits_counts_what_the_one_before_it_has_left() {
    let mut setup = Setup::new(Limits {
        lanes: 2,
        max_batch: 32,
        max_queued: 100,
        ..limits()
    });
    let size = |cuts: &[Seen]| cuts.iter().map(|cut| (cut.0, cut.2.len())).collect::<Vec<_>>();
    setup.calls(16);
    assert_eq!(size(&setup.cuts()), [(0, 8), (1, 8)]);
    setup.pass(40);
    setup.free(0);
    setup.calls(6);
    assert_eq!(size(&setup.cuts()), []);
    // The first lane has waited long enough, and shares what is ready with the second.
    setup.pass(4);
    setup.free(1);
    assert_eq!(size(&setup.cuts()), [(0, 3)]);
    // Of the three that are left and the eight that it has answered, ten are not all.
    setup.calls(7);
    assert_eq!(size(&setup.cuts()), []);
    setup.calls(1);
    assert_eq!(setup.cuts()[0].0, 1);
}

#[test]
fn a_lane_of_an_engine_that_does_not_pad_waits_for_no_more_than_a_few() {
    for (call_rows, cut) in [(0, 9), (8, 8)] {
        let mut setup = Setup::new(Limits {
            lanes: 2,
            max_batch: 32,
            max_queued: 100,
            padded: false,
            call_rows,
            ..limits()
        });
        setup.calls(16);
        assert_eq!(setup.cut_sizes(), [8, 8]);
        setup.calls(7);
        setup.pass(40);
        setup.free(0);
        let until = setup.after(4);
        assert_eq!(setup.step(Event::Settled), [Action::WakeAt(until)]);
        setup.calls(1);
        assert_eq!(setup.cut_sizes(), [8]);
        // Of ten that wait, an even share beside the eight that run; whole calls where batches are cut into calls.
        setup.calls(10);
        setup.free(1);
        assert_eq!(setup.cut_sizes(), [cut]);
    }
}

#[test]
fn a_lane_waits_for_no_more_than_its_largest_batch() {
    for padded in [true, false] {
        let mut setup = Setup::new(Limits {
            max_batch: 4,
            padded,
            ..limits()
        });
        setup.calls(4);
        assert_eq!(setup.cut_sizes(), [4]);
        setup.calls(4);
        setup.pass(40);
        setup.free(0);
        assert_eq!(setup.cut_sizes(), [4], "padded: {padded}");
    }
}

#[test]
fn an_idle_lane_takes_all_that_came_padding_or_not() {
    let mut setup = Setup::new(Limits {
        max_batch: 32,
        max_queued: 100,
        ..limits()
    });
    assert_eq!(setup.cuts(), []);
    setup.calls(17);
    assert_eq!(setup.cuts()[0].2.len(), 17);
}

#[test]
fn calls_do_not_take_the_room_of_live_characters() {
    let mut setup = Setup::busy(limits());
    setup.call(20);
    assert!(setup.refused(1).is_some());
    for owner in 0..20 {
        assert_eq!(setup.plan(owner, 100).1, []);
    }
    assert!(matches!(setup.plan(20, 100).1[..], [Action::Refuse { .. }]));
    // A newer plan needs no room.
    assert!(matches!(setup.plan(19, 100).1[..], [Action::Supersede { .. }]));
}

#[test]
fn what_free_lanes_take_does_not_count_as_waiting() {
    let mut setup = Setup::new(Limits { lanes: 2, ..limits() });
    setup.call(20);
    setup.call(16);
    assert!(setup.refused(1).is_some());
    assert_eq!(setup.cuts().len(), 2);
    assert_eq!(setup.scheduler.pending_characters(), 20);
}

#[test]
fn a_queue_that_is_too_slow_refuses_calls_but_no_plans() {
    let mut setup = Setup::new(Limits {
        max_queued: 1000,
        ..limits()
    });
    setup.call(1);
    assert_eq!(setup.cuts().len(), 1);
    // The guess is 5 ms a character.
    setup.call(190);
    assert_eq!(setup.refused(100), None);
    setup.call(100);
    let refusal = setup.refused(1).unwrap();
    assert!(!refusal.full && refusal.retry_after() > Duration::from_secs(1));
    assert_eq!(setup.plan(1, 100).1, []);
    // The lane turns out to do 8 in a millisecond.
    for _ in 0..10 {
        setup.pass(1);
        setup.free(0);
        setup.cuts();
    }
    assert_eq!(setup.refused(700), None);
}

#[test]
fn before_the_first_batch_a_wait_follows_what_lanes_tried() {
    for (took_ms, fits, too_many) in [(8, 600, 300), (800, 8, 4)] {
        let mut setup = Setup::busy(Limits {
            max_queued: 1000,
            ..limits()
        });
        let took = Duration::from_millis(took_ms);
        assert_eq!(setup.step(Event::Tried { characters: 8, took }), []);
        setup.free(0);
        setup.call(1);
        assert_eq!(setup.cuts().len(), 1);
        setup.call(fits);
        assert_eq!(setup.refused(1), None, "{took_ms} ms");
        setup.call(too_many);
        assert!(!setup.refused(1).unwrap().full, "{took_ms} ms");
    }
}

#[test]
fn the_longest_wait_falls_with_what_comes_beyond() {
    let longest =
        |limits: Limits, beyond: u64| limits.longest_wait(Duration::from_millis(beyond)).as_millis();
    let falls = [0, 100, 200, 334, 9000];
    assert_eq!(
        falls.map(|beyond| longest(waits(1000, 200), beyond)),
        [1000, 760, 520, 200, 200]
    );
    for beyond in falls {
        assert_eq!(longest(waits(1000, 0), beyond), 1000, "no difference is made");
        assert_eq!(longest(waits(100, 200), beyond), 100, "never more than the other");
        assert_eq!(longest(waits(0, 200), beyond), 0, "no limit");
    }
}

/// Offers so many calls of one character each; gives how many are let in.
fn offer(setup: &mut Setup, calls: usize) -> usize {
    let let_in = |_: &usize| {
        let place = setup.refused(1).is_none();
        if place {
            setup.call(1);
        }
        place
    };
    (0..calls).filter(let_in).count()
}

/// The lane is done with its batch of 8, which took so long, and takes the next.
fn serve(setup: &mut Setup, ms: u64) {
    setup.pass(ms);
    setup.free(0);
    setup.cuts();
}

/// All that waits is served, and then nothing comes for a few seconds.
fn rest(setup: &mut Setup) {
    while setup.scheduler.pending_characters() > 0 {
        serve(setup, 8);
    }
    serve(setup, 8);
    setup.pass(6000);
    setup.cuts();
}

#[test]
fn callers_who_wait_for_their_answers_are_no_overload() {
    let mut setup = Setup::busy(waits(1000, 50));
    // 8 characters leave every 8 ms; 200 callers come within 200 ms, and again when they are answered.
    for round in 0..1000 {
        let calls = if round < 24 { 16 } else { 8 };
        assert_eq!(offer(&mut setup, calls), calls, "round {round}");
        serve(&mut setup, 8);
    }
    assert!(setup.scheduler.pending_characters() > 180);
}

#[test]
fn an_overload_fills_no_more_of_the_queue_than_a_burst_that_is_evened_out() {
    let mut setup = Setup::busy(waits(1000, 200));
    let mut longest = 0;
    // 8 characters leave every 8 ms. As many come, then five times as many.
    for round in 0..300 {
        offer(&mut setup, if round < 100 { 8 } else { 40 });
        longest = longest.max(setup.scheduler.pending_characters());
        serve(&mut setup, 8);
    }
    assert!((270..=330).contains(&longest), "{longest} wait at most");
}

#[test]
fn an_overload_does_not_fill_the_queue_anew_where_lanes_empty_it() {
    let mut setup = Setup::busy(waits(1000, 50));
    let burst = |setup: &mut Setup| {
        // A lane that is free takes the first at once.
        let first = offer(setup, 8);
        setup.cuts();
        first + offer(setup, 472)
    };
    for _ in 0..100 {
        offer(&mut setup, 8);
        serve(&mut setup, 8);
    }
    // Every 104 ms 104 characters leave, or all that wait, and five times as many come at once.
    let mut let_in = Vec::new();
    for _ in 0..50 {
        let_in.push(burst(&mut setup));
        (0..13).for_each(|_| serve(&mut setup, 8));
    }
    assert!((250..=400).contains(&let_in[0]), "{let_in:?}");
    assert!(
        let_in[10..].iter().all(|calls| (30..=110).contains(calls)),
        "{let_in:?}"
    );
    // When it has been over for a few seconds, a burst has room again.
    rest(&mut setup);
    assert_eq!(burst(&mut setup), 480);
}

#[test]
fn slow_lanes_may_always_have_their_next_batches_waiting() {
    let mut setup = Setup::busy(waits(20_000, 200));
    let mut most = 0;
    for _ in 0..30 {
        offer(&mut setup, 40);
        most = setup.scheduler.pending_characters();
        serve(&mut setup, 1000);
    }
    assert_eq!(most, 9, "one batch waits, and what came when there was none more");
}

#[test]
fn an_overload_that_lasts_has_a_short_queue() {
    let mut setup = Setup::busy(waits(1000, 250));
    for _ in 0..100 {
        offer(&mut setup, 8);
        serve(&mut setup, 8);
    }
    let burst = offer(&mut setup, 2000);
    assert!((980..=1010).contains(&burst), "{burst} wait in a burst");
    for _ in 0..200 {
        offer(&mut setup, 40);
        serve(&mut setup, 8);
    }
    offer(&mut setup, 40);
    let standing = setup.scheduler.pending_characters();
    assert!((240..=260).contains(&standing), "{standing} wait in an overload");
    // When nothing has waited for a few seconds, the next burst has its room again.
    rest(&mut setup);
    setup.call(8);
    setup.cuts();
    let burst = offer(&mut setup, 2000);
    assert!((900..=1010).contains(&burst), "{burst} wait in the next burst");
}

#[test]
fn what_expires_is_not_run() {
    let mut setup = Setup::busy(limits());
    let order = Order::request(setup.now).expiring(setup.after(50));
    let (first, _) = setup.arrive(3, order);
    setup.call(1);
    setup.pass(50);
    setup.free(0);
    let actions = setup.step(Event::Settled);
    let [Action::Expire { request, waited }, Action::Cut(cut)] = &actions[..] else {
        panic!("{actions:?}")
    };
    assert_eq!((request.0, *waited), (first, Duration::from_millis(50)));
    assert_eq!(cut.parts[0].request, RequestId(2));
    assert_eq!(setup.scheduler.pending_characters(), 0);
}

#[test]
fn an_idle_lane_waits_for_the_preferred_batch_but_not_for_long() {
    let mut setup = Setup::new(Limits {
        lanes: 2,
        batch_delay: Duration::from_millis(2),
        preferred_batch: 4,
        ..limits()
    });
    assert_eq!(setup.cuts(), []);
    setup.call(1);
    let until = setup.after(2);
    assert_eq!(setup.step(Event::Settled), [Action::WakeAt(until)]);
    setup.pass(1);
    setup.call(1);
    assert_eq!(setup.step(Event::Settled), [Action::WakeAt(until)]);
    setup.pass(1);
    // Time is up, and one lane takes them: two batches of one would not be what is preferred.
    assert_eq!(
        setup.cuts(),
        [(0, CutReason::Delayed, vec![(1, 0, 1), (2, 0, 1)])]
    );
    // Enough at once need not wait, and what has waited for a lane that long does not wait for company.
    setup.call(4);
    assert_eq!(setup.cuts(), [(1, CutReason::Idle, vec![(3, 0, 4)])]);
    setup.call(1);
    setup.pass(3);
    setup.free(1);
    assert_eq!(setup.cuts().len(), 1);
}

#[test]
fn beside_live_characters_batches_end_soon() {
    let mut setup = Setup::new(Limits {
        max_batch: 64,
        max_queued: 1000,
        live_slice: Duration::from_millis(60),
        ..limits()
    });
    setup.call(100);
    assert_eq!(setup.cuts()[0].2[0].2, 64);
    // The lane takes 4 ms a character.
    setup.pass(256);
    setup.free(0);
    setup.plan(1, 100);
    // 15 would end in time, and 12 is a size that the engine need not pad.
    let cuts = setup.cuts();
    assert_eq!(cuts[0].2, [(2, 0, 1), (1, 64, 11)]);
    setup.pass(48);
    setup.free(0);
    setup.call(100);
    assert_eq!(setup.cuts()[0].2, [(1, 75, 12)]);
    // They are gone for a while.
    setup.pass(2000);
    setup.free(0);
    assert_eq!(setup.cuts()[0].2.iter().map(|part| part.2).sum::<usize>(), 64);
}
