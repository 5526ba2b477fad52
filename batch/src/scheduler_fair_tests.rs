//! Clients that share the queue.

use troupe_base::turns::ClientId;

use super::*;

/// Requests of a client: a group and its own number.
fn from(client: (u64, u64), order: Order) -> Order {
    order.of(ClientId {
        group: client.0,
        own: client.1,
        share: 1,
    })
}

/// One worker with so large batches, and room for 1,000 waiting characters.
fn roomy(max_batch: usize) -> Limits {
    Limits {
        max_queued: 1000,
        max_live: 1000,
        ..limits(1, max_batch)
    }
}

#[test]
fn a_client_with_one_call_does_not_wait_for_the_crowd_of_another() {
    let mut setup = Setup::busy(roomy(8));
    for _ in 0..10 {
        setup.arrive(64, from((1, 1), Order::request(setup.now)));
    }
    setup.ready(0);
    setup.pass(50);
    let (late, _) = setup.arrive(1, from((2, 2), Order::request(setup.now)));
    let started = setup.ready(0);
    assert!(started.contains(&(late, 1)), "{started:?}");
}

#[test]
fn many_connections_of_one_address_share_what_it_gets() {
    let mut setup = Setup::busy(roomy(10));
    for connection in 0..50 {
        setup.arrive(10, from((1, connection), Order::request(setup.now)));
    }
    let (other, _) = setup.arrive(100, from((2, 1), Order::request(setup.now)));
    let first = setup.ready(0);
    assert_eq!(of(&first, other), 5, "{first:?}");
}

#[test]
fn an_urgent_flood_of_one_client_delays_no_plan_of_another() {
    let mut setup = Setup::busy(roomy(4));
    for owner in 0..100 {
        let order = Order::live(OwnerId(owner), setup.now);
        setup.arrive(1, from((1, 1), order));
    }
    setup.pass(10);
    let order = Order::live(OwnerId(1000), setup.at(200));
    let (plan, _) = setup.arrive(1, from((2, 1), order));
    let started = setup.ready(0);
    assert!(started.contains(&(plan, 1)), "{started:?}");
}

#[test]
fn dear_work_counts_for_more() {
    let mut setup = Setup::busy(limits(1, 11));
    let dear = Order {
        work: 10,
        ..from((1, 1), Order::request(setup.now))
    };
    let (dear, _) = setup.arrive(50, dear);
    let (cheap, _) = setup.arrive(50, from((2, 1), Order::request(setup.now)));
    let mut started = setup.ready(0);
    started.sort_unstable();
    assert_eq!(started, [(dear, 1), (cheap, 10)]);
}

#[test]
fn the_client_with_most_makes_room_in_a_full_queue() {
    let mut setup = Setup::busy(Limits {
        max_queued: 10,
        ..limits(1, 4)
    });
    let (first, _) = setup.arrive(6, from((1, 1), Order::request(setup.now)));
    let (second, _) = setup.arrive(4, from((1, 2), Order::request(setup.now)));
    let (third, actions) = setup.arrive(1, from((2, 1), Order::request(setup.now)));
    assert!(
        matches!(actions[..], [Action::PushOut { request, .. }] if request.0 == first),
        "{actions:?}"
    );
    // Its own group has most now, and it has most of the group.
    let order = from((1, 2), Order::request(setup.now));
    assert!(setup.scheduler.refuse(&order, 6).is_some());
    assert_eq!(setup.ready(0), [(second, 3), (third, 1)]);
}

#[test]
fn a_group_with_a_larger_share_gets_more() {
    let mut setup = Setup::busy(limits(1, 10));
    let mut order = from((1, 1), Order::request(setup.now));
    order.client.share = 4;
    let (large, _) = setup.arrive(40, order);
    let (small, _) = setup.arrive(40, from((2, 1), Order::request(setup.now)));
    let mut started = setup.ready(0);
    started.sort_unstable();
    assert_eq!(started, [(large, 8), (small, 2)]);
}

#[test]
fn a_client_has_a_part_of_a_batch_while_another_calls_for_little() {
    // The client of another call, its characters, its age, and what the large call has of the next
    // batch.
    let cases = [
        ((1, 1), 1, 0, 50),
        ((1, 2), 1, 0, 10),
        ((2, 2), 1, 0, 10),
        ((2, 2), 1, 4_000, 49),
        ((2, 2), 13, 0, 37),
    ];
    for (client, small, age_ms, characters) in cases {
        let mut setup = Setup::busy(Limits {
            max_batch_time: MS * 101 / 2,
            calls_batch_time: MS * 101 / 2,
            shared_batch_time: MS * 21 / 2,
            ..limits(1, 64)
        });
        setup.take_a_ms_each();
        let (large, _) = setup.arrive(60, from((1, 1), Order::request(setup.now)));
        setup.arrive(small, from(client, Order::request(setup.now)));
        setup.pass(age_ms);
        let taken = setup.ready(0);
        assert_eq!(of(&taken, large), characters, "{small} of {client:?}, {age_ms}");
    }
}

#[test]
fn many_clients_fill_a_batch_together() {
    let mut setup = with_parts();
    for client in 0..60 {
        setup.arrive(1, from((client, client), Order::request(setup.now)));
    }
    assert_eq!(setup.ready(0).len(), 60);
}

#[test]
fn a_batch_of_dear_work_is_short_too() {
    let mut setup = Setup::busy(Limits {
        max_batch_time: MS * 66,
        calls_batch_time: MS * 66,
        ..limits(1, 64)
    });
    setup.take_a_ms_each();
    let dear = Order {
        work: 30,
        ..Order::request(setup.now)
    };
    let (dear, _) = setup.arrive(50, dear);
    assert_eq!(setup.ready(0), [(dear, 2)]);
}

#[test]
fn a_call_that_has_started_makes_room_if_all_have() {
    let mut setup = Setup::busy(Limits {
        max_queued: 10,
        ..limits(1, 2)
    });
    let (first, _) = setup.arrive(6, from((1, 1), Order::request(setup.now)));
    let (second, _) = setup.arrive(4, from((1, 2), Order::request(setup.now)));
    assert_eq!(setup.ready(0), [(first, 1), (second, 1)]);
    setup.arrive(2, from((3, 3), Order::request(setup.now)));
    let (small, actions) = setup.arrive(1, from((2, 1), Order::request(setup.now)));
    assert!(
        matches!(actions[..], [Action::PushOut { request, .. }] if request.0 == first),
        "{actions:?}"
    );
    assert!(setup.ready(0).iter().any(|(request, _)| *request == small));
}

/// One worker that needs a millisecond for each character of the least work. A part of a batch is
/// ten of them.
fn with_parts() -> Setup {
    let mut setup = Setup::busy(Limits {
        shared_batch_time: MS * 21 / 2,
        max_queued: 1000,
        ..limits(1, 64)
    });
    setup.take_a_ms_each();
    setup
}

/// How many characters of a request were taken.
fn of(taken: &[(u64, usize)], request: u64) -> usize {
    let own = taken.iter().filter(|(other, _)| *other == request);
    own.map(|(_, characters)| characters).sum()
}

#[test]
fn clients_that_had_their_part_are_passed_over() {
    let mut setup = with_parts();
    // A plan is more urgent than all calls.
    let order = Order::live(OwnerId(1), setup.now);
    let (plans, _) = setup.arrive(30, from((1, 1), order));
    let (large, _) = setup.arrive(40, from((2, 2), Order::request(setup.now)));
    let small: Vec<u64> = (0..6)
        .map(|client| {
            setup
                .arrive(2, from((9 + client, 9), Order::request(setup.now)))
                .0
        })
        .collect();
    let taken = setup.ready(0);
    assert_eq!((of(&taken, plans), of(&taken, large)), (10, 10), "{taken:?}");
    assert!(small.iter().all(|call| of(&taken, *call) == 2), "{taken:?}");
}

#[test]
fn a_part_counts_as_often_as_its_share() {
    let mut setup = with_parts();
    let mut order = from((1, 1), Order::request(setup.now));
    order.client.share = 3;
    let (large, _) = setup.arrive(60, order);
    for client in 0..3 {
        setup.arrive(1, from((9 + client, 9), Order::request(setup.now)));
    }
    assert_eq!(of(&setup.ready(0), large), 30);
}

#[test]
fn one_dear_character_is_little() {
    let mut setup = with_parts();
    let (large, _) = setup.arrive(60, from((1, 1), Order::request(setup.now)));
    for client in 0..3 {
        let dear = Order {
            work: 9,
            ..from((9 + client, 9), Order::request(setup.now))
        };
        setup.arrive(1, dear);
    }
    assert_eq!(of(&setup.ready(0), large), 10);
}

#[test]
fn small_calls_beside_large_ones_of_their_own_address_limit_no_other() {
    let mut setup = with_parts();
    let (other, _) = setup.arrive(30, from((2, 2), Order::request(setup.now)));
    let (large, _) = setup.arrive(30, from((1, 1), Order::request(setup.now)));
    for client in 0..3 {
        setup.arrive(1, from((1, 9 + client), Order::request(setup.now)));
    }
    let taken = setup.ready(0);
    assert_eq!((of(&taken, large), of(&taken, other)), (10, 30), "{taken:?}");
}

#[test]
fn no_call_leaves_for_one_that_would_wait_for_too_long() {
    let mut setup = Setup::busy(Limits {
        max_queued: 20,
        max_wait: MS * 18,
        ..limits(1, 4)
    });
    setup.take_a_ms_each();
    for client in 1..=4 {
        let (_, actions) = setup.arrive(5, from((client, 1), Order::request(setup.now)));
        assert_eq!(actions, []);
    }
    let small = from((5, 1), Order::request(setup.now));
    assert_eq!(setup.scheduler.refuse(&small, 1), None, "it makes room");
    let refusal = setup.scheduler.refuse(&small, 6).unwrap();
    assert!(!refusal.full && refusal.expected_wait > MS * 18, "{refusal:?}");
}

#[test]
fn being_passed_over_earns_no_credit() {
    let mut setup = with_parts();
    let dear = |setup: &Setup| Order {
        work: 8,
        ..from((1, 1), Order::request(setup.now))
    };
    for _ in 0..200 {
        setup.arrive(2, dear(&setup));
        setup.arrive(20, from((2, 2), Order::request(setup.now)));
        setup.arrive(1, from((3, 3), Order::request(setup.now)));
        setup.ready(0);
        setup.take_a_ms_each();
        setup.pass(20);
    }
    // No call for little any more, and so no parts: all get the same from now on.
    setup.pass(4_000);
    let (newcomer, _) = setup.arrive(60, from((4, 4), Order::request(setup.now)));
    let taken = setup.ready(0);
    assert!(of(&taken, newcomer) >= 10, "{taken:?}");
}

#[test]
fn many_small_calls_hide_no_large_client() {
    let mut setup = with_parts();
    // Many calls of one client are much, and the few of another are still little.
    for number in 0..500 {
        setup.arrive(1, from((1, 1), Order::request(setup.now)));
        if number % 100 == 0 {
            setup.arrive(1, from((2, 2), Order::request(setup.now)));
        }
    }
    let taken = setup.ready(0);
    let characters: usize = taken.iter().map(|(_, characters)| characters).sum();
    assert_eq!(characters, 10 + 5, "{taken:?}");
}

#[test]
fn many_connections_with_a_character_each_are_much() {
    let mut setup = with_parts();
    for connection in 0..64 {
        setup.arrive(1, from((1, connection), Order::request(setup.now)));
    }
    let (small, _) = setup.arrive(1, from((2, 2), Order::request(setup.now)));
    let taken = setup.ready(0);
    assert_eq!((taken.len(), of(&taken, small)), (11, 1), "{taken:?}");
}

#[test]
fn many_connections_that_had_the_part_of_their_address_hide_no_other() {
    let mut setup = with_parts();
    for connection in 0..60 {
        setup.arrive(1, from((1, connection), Order::request(setup.now)));
    }
    for group in 2..8 {
        setup.arrive(2, from((group, 1), Order::request(setup.now)));
    }
    let characters: usize = setup.ready(0).iter().map(|(_, characters)| characters).sum();
    assert_eq!(characters, 10 + 6 * 2);
}
