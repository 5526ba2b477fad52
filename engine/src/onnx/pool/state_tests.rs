use super::*;

const BYTES: u64 = 10;

fn key(length: usize, rows: usize) -> Key {
    Key {
        graph: 1,
        length,
        rows,
    }
}

/// Idle networks, each with the time of its last use.
fn state(now: Instant, open: &[(Key, usize, Duration)]) -> State<Key> {
    let mut state = State::default();
    for &(key, count, ago) in open {
        for _ in 0..count {
            state.reserve(key, BYTES);
            let shape = state.shapes.get_mut(&key).unwrap();
            shape.idle.push(key);
            shape.used = Some(now - ago);
        }
    }
    state
}

fn now() -> Instant {
    // Earlier times must be representable.
    Instant::now() + Duration::from_secs(1000)
}

const LONG: Duration = Duration::from_secs(60);
const LATELY: Duration = Duration::from_secs(1);

#[test]
fn a_network_is_opened_after_several_misses() {
    let (mut state, now) = (State::<Key>::default(), now());
    let asked: Vec<bool> = (0..5).map(|_| state.miss(key(16, 8), 2, now)).collect();
    assert_eq!(asked, [false, false, true, false, false]);
}

#[test]
fn each_worker_may_have_one() {
    let now = now();
    let mut state = state(now, &[(key(16, 8), 1, LATELY)]);
    let asked = |state: &mut State<Key>, workers| (0..3).any(|_| state.miss(key(16, 8), workers, now));
    assert!(!asked(&mut state, 1));
    assert!(asked(&mut state, 2));
}

#[test]
fn a_network_without_room_is_tried_again_later() {
    let (mut state, now) = (State::<Key>::default(), now());
    for _ in 0..MISSES {
        state.miss(key(16, 8), 1, now);
    }
    let shape = state.shapes.get_mut(&key(16, 8)).unwrap();
    (shape.queued, shape.refused) = (false, Some(now));
    assert!(!state.miss(key(16, 8), 1, now + AGAIN / 2));
    assert!(state.miss(key(16, 8), 1, now + AGAIN));
}

#[test]
fn nothing_closes_while_there_is_room() {
    let now = now();
    let mut state = state(now, &[(key(9, 1), 1, LONG), (key(9, 4), 1, LONG)]);
    assert_eq!(state.make_room(key(16, 8), BYTES, 30, now), Some(vec![]));
}

#[test]
fn the_longest_unused_network_closes() {
    let now = now();
    let open = [
        (key(9, 1), 1, LATELY),
        (key(9, 4), 1, LONG),
        (key(9, 8), 1, 2 * LONG),
    ];
    let mut state = state(now, &open);
    assert_eq!(state.make_room(key(16, 8), BYTES, 30, now), Some(vec![key(9, 8)]));
    assert_eq!(state.used_bytes, 20);
    assert_eq!(state.shapes[&key(9, 8)].count, 0);
    assert!(!state.is_idle(key(9, 8)));
}

#[test]
fn a_recently_used_network_stays() {
    let now = now();
    let mut state = state(now, &[(key(9, 1), 1, LATELY), (key(9, 8), 1, LATELY)]);
    assert_eq!(state.make_room(key(16, 8), BYTES, 20, now), None);
    assert_eq!(state.used_bytes, 20);
}

#[test]
fn the_last_network_of_a_length_stays() {
    let now = now();
    let mut state = state(now, &[(key(9, 1), 1, LONG), (key(12, 8), 1, LONG)]);
    assert_eq!(state.make_room(key(16, 8), BYTES, 20, now), None);
}

#[test]
fn a_duplicate_closes_for_a_missing_network() {
    let now = now();
    let open = [(key(9, 1), 1, LATELY), (key(9, 8), 2, LATELY)];
    let mut first = state(now, &open);
    assert_eq!(first.make_room(key(16, 8), BYTES, 30, now), Some(vec![key(9, 8)]));
    assert_eq!(first.shapes[&key(9, 8)].count, 1);
    // Not for a second one.
    let mut second = state(now, &open);
    second.reserve(key(16, 8), BYTES);
    assert_eq!(second.make_room(key(16, 8), BYTES, 40, now), None);
}

#[test]
fn a_network_at_work_does_not_close() {
    let now = now();
    let mut state = state(now, &[(key(9, 1), 1, LONG), (key(9, 8), 1, LONG)]);
    let network = state.take(key(9, 8), now - LONG);
    assert_eq!(network, Some(key(9, 8)));
    // The other is not the last of its length while that one is open.
    assert_eq!(state.make_room(key(16, 8), BYTES, 20, now), Some(vec![key(9, 1)]));
    assert_eq!(state.make_room(key(16, 8), BYTES, 10, now), None);
}

#[test]
fn forbidden_calls_are_not_chosen() {
    let now = now();
    let mut state = state(now, &[(key(9, 1), 1, LATELY)]);
    state.forbid(key(9, 8));
    assert_eq!(state.lengths[&(1, 9)].calls.next(8, 8), 4);
}
