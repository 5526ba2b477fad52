use proptest::prelude::*;

use super::*;
use crate::testing::toy_rig;

const FPS: f32 = 30.0;

/// Sizes of the default pack: 3 to 16 tokens of four frames.
fn dims() -> Dims {
    toy_rig().dims
}

fn pace(stretch: f32, interval: Option<u32>, phase: u64) -> Option<(u32, u32)> {
    let pace = Pace::new(stretch, interval, phase, &dims(), FPS);
    pace.map(|pace| (pace.interval_frames, pace.plan_frames))
}

#[test]
fn priorities_count_within_a_stream() {
    assert_eq!(own_priority(1.0, 1.0), own_priority(0.0, 0.0));
    assert_eq!(own_priority(1.0, 0.5), 1.0);
    assert_eq!(own_priority(0.0, 1.0), 0.0);
}

#[test]
fn without_pressure_all_is_as_usual() {
    for priority in [0.0, 0.5, 1.0] {
        assert_eq!(stretch(0.0, priority), 0.0);
    }
    assert_eq!(pace(0.0, Some(9), 3), None);
    assert_eq!(pace(0.0, None, 3), None);
}

#[test]
fn intervals_grow_first_then_plans_and_all_reach_one_second_before_any_goes_further() {
    // Phase 0 takes the lower of two steps.
    let at = |stretch| pace(stretch, Some(9), 0).unwrap();
    assert_eq!(at(0.01), (9, 34));
    assert_eq!(at(0.5), (16, 34));
    assert_eq!(at(0.9), (26, 36));
    assert_eq!(at(1.0), (30, 40));
    assert_eq!(at(1.5), (38, 48));
    assert_eq!(at(2.0), (54, 64));
    // An interval longer than the usual plan lasts gets the plan that lasts for it.
    assert_eq!(pace(0.1, Some(30), 0), Some((30, 40)));
    // Standing characters only get longer plans, and the longest at once.
    assert_eq!(pace(0.01, None, 0), Some((26, 36)));
    assert_eq!(pace(1.0, None, 0), Some((54, 64)));

    assert_eq!(stretch(1.0, 1.0), 1.0, "the most important plan once a second");
    assert_eq!(stretch(1.0, 0.0), 1.0, "and the least important no less often");
    assert_eq!((stretch(0.5, 1.0), stretch(0.5, 0.0)), (0.0, 1.0));
    assert_eq!((stretch(2.0, 1.0), stretch(2.0, 0.0)), (2.0, 2.0));
}

#[test]
fn characters_change_steps_one_by_one() {
    let longer = |stretch: f32| {
        (0..1000)
            .filter(|&phase| pace(stretch, Some(9), phase).unwrap().0 > 26)
            .count()
    };
    // From 26 frames to 30.
    let (low, high) = ((26.0f32 / 9.0).ln() / (30.0f32 / 9.0).ln(), 1.0);
    for part in 0..=10 {
        let there = low + (high - low) * part as f32 / 10.0;
        let interval = 9.0 * (30.0f32 / 9.0).powf(there);
        let want = 1000.0 * (interval - 26.0) / 4.0;
        assert!((longer(there) as f32 - want).abs() < 20.0, "{part}");
    }
}

proptest! {
    #[test]
    fn more_pressure_and_less_priority_never_plan_more_often(
        pressures in (0.0f32..=2.0, 0.0f32..=2.0), priorities in (0.0f32..=1.0, 0.0f32..=1.0),
        interval in proptest::option::of(3u32..=30), phase: u64,
    ) {
        let (low, high) = (pressures.0.min(pressures.1), pressures.0.max(pressures.1));
        let (less, more) = (priorities.0.min(priorities.1), priorities.0.max(priorities.1));
        prop_assert!(stretch(low, more) <= stretch(high, less));
        prop_assert!((0.0..=2.0).contains(&stretch(high, less)));
        prop_assert!(stretch(high, more) - stretch(low, more) <= 2.0 * (high - low) + 1e-5);

        let (a, b) = (pace(stretch(low, more), interval, phase), pace(stretch(high, less), interval, phase));
        if let (Some(a), Some(b)) = (a, b) {
            prop_assert!(a.0 <= b.0 && a.1 <= b.1, "{a:?} {b:?}");
        }
        if let Some((every, frames)) = b {
            prop_assert!(every >= interval.unwrap_or(0));
            prop_assert!((34..=64).contains(&frames));
            prop_assert!(frames >= every + CONTEXT_FRAMES as u32 + LEFT_FRAMES, "the next takes over in time");
        }
    }
}

#[path = "crowd_tests.rs"]
mod crowd;
