use proptest::prelude::*;
use troupe_motion::rotation::angle_between;

use super::*;
use crate::style::testing::{walker, walker_style};

fn wanted(left_mps: f32, forward_mps: f32, turn_rps: f32) -> Wanted {
    Wanted {
        left_mps,
        forward_mps,
        turn_rps,
        height_m: None,
    }
}

fn blend<'a>(style: &'a Style, only: Option<&str>, wanted: &Wanted) -> Blend<'a> {
    let only = only.map(|name| style.gaits.iter().position(|gait| gait.name == name).unwrap());
    Blend::new(style, style.cycles(&walker()), only, wanted)
}

fn weight(blend: &Blend<'_>, name: &str) -> f32 {
    let named = blend.named();
    named
        .iter()
        .find(|(there, _)| there == name)
        .map_or(0.0, |(_, weight)| *weight)
}

/// A style of the gaits with these names.
fn of(names: &[&str]) -> Style {
    let mut style = walker_style();
    style.gaits.retain(|gait| names.contains(&gait.name.as_str()));
    style
}

#[test]
fn a_gait_is_alone_at_its_own_velocity() {
    let style = walker_style();
    for gait in &style.gaits {
        let blend = blend(
            &style,
            None,
            &wanted(gait.left_mps, gait.forward_mps, gait.turn_rps),
        );
        assert!(
            weight(&blend, &gait.name) > 0.999,
            "{}: {:?}",
            gait.name,
            blend.named()
        );
        if !gait.stands() {
            assert!(
                (blend.rate * gait.period_frames - 1.0).abs() < 1e-3,
                "{}",
                gait.name
            );
        }
    }
}

#[test]
fn between_two_gaits_both_count() {
    let style = walker_style();
    let middle = blend(&style, None, &wanted(0.0, 2.1, 0.0));
    assert!(
        (weight(&middle, "walk") - 0.5).abs() < 0.02,
        "{:?}",
        middle.named()
    );
    assert!((weight(&middle, "run") - 0.5).abs() < 0.02);
    let curve = blend(&style, None, &wanted(0.3, 0.9, 0.0));
    assert!(
        weight(&curve, "walk") > 0.15 && weight(&curve, "walk-left") > 0.15,
        "{:?}",
        curve.named()
    );
    assert!(weight(&curve, "walk-right") < 0.01);
}

#[test]
fn beyond_the_fastest_gait_that_gait_is_alone() {
    let style = walker_style();
    assert!(weight(&blend(&style, None, &wanted(0.0, 9.0, 0.0)), "run") > 0.99);
    assert!(weight(&blend(&style, None, &wanted(0.0, -5.0, 0.0)), "walk-back") > 0.99);
}

#[test]
fn slow_gaits_fade_into_standing() {
    let style = walker_style();
    let half = blend(&style, None, &wanted(0.0, 0.6, 0.0));
    assert!(
        (weight(&half, "walk") - 0.5f32.powf(STRIDE_POWER)).abs() < 0.01,
        "{:?}",
        half.named()
    );
    assert!((half.moving + weight(&half, "idle") - 1.0).abs() < 1e-4);
    assert!((half.hurry() - 0.5f32.powf(RATE_POWER)).abs() < 0.01);
    let still = blend(&style, None, &wanted(0.0, 0.0, 0.0));
    assert_eq!(still.named(), [("idle".to_owned(), 1.0)]);
    assert_eq!((still.moving, still.rate), (0.0, 0.0));
}

#[test]
fn a_command_may_name_the_only_gait() {
    let style = walker_style();
    let walk = blend(&style, Some("walk"), &wanted(0.0, 2.0, 0.0));
    assert_eq!(walk.named(), [("walk".to_owned(), 1.0)]);
    assert!(walk.hurry() > 1.1, "it hurries instead of running");
    let slow = blend(&style, Some("run"), &wanted(0.0, 0.5, 0.0));
    assert_eq!(weight(&slow, "walk"), 0.0);
    assert!(weight(&slow, "run") > 0.5 && weight(&slow, "idle") > 0.2);
    let idle = blend(&style, Some("idle"), &wanted(0.0, 1.2, 0.0));
    assert_eq!(idle.named(), [("idle".to_owned(), 1.0)]);
}

#[test]
fn a_turn_on_the_spot_takes_the_gait_for_it() {
    let style = walker_style();
    let turn = blend(&style, None, &wanted(0.0, 0.0, 1.5));
    assert!(weight(&turn, "turn-left") > 0.99);
    let other = blend(&of(&["idle", "walk"]), None, &wanted(0.0, 0.0, 1.5)).named();
    assert_eq!(other, [("idle".to_owned(), 1.0)], "without one it stands");
    let walking = blend(&style, None, &wanted(0.0, 1.2, 0.3));
    assert!(weight(&walking, "walk") > 0.8, "{:?}", walking.named());
}

#[test]
fn without_a_gait_for_it_a_gait_runs_backwards() {
    let style = of(&["idle", "walk"]);
    let back = blend(&style, None, &wanted(0.0, -1.2, 0.0));
    assert!(weight(&back, "walk") > 0.99 && back.hurry() < -0.99);
    assert!(
        blend(&style, None, &wanted(0.6, -0.1, 0.0)).rate > 0.0,
        "not sideways"
    );
}

#[test]
fn a_style_that_cannot_stand_holds_its_slowest_gait() {
    let style = of(&["walk", "run"]);
    let still = blend(&style, None, &wanted(0.0, 0.0, 0.0));
    assert_eq!(still.named(), [("walk".to_owned(), 1.0)]);
    let mut pose = vec![Quat::IDENTITY; 6];
    let moment = still.sample(0.3, 7, &mut pose);
    assert_eq!(moment.height_m, style.idle().height_m);
    assert_eq!(
        (moment.sway, moment.turn_rps, moment.forward_mps),
        (0.0, 0.0, 0.0)
    );
    for (a, b) in pose.iter().zip(&style.idle().rotations) {
        assert!(angle_between(*a, *b) < 1e-3);
    }
    // A name comes once, however many of its gaits take part.
    let slow = blend(&style, None, &wanted(0.0, 0.5, 0.0)).named();
    assert_eq!(slow.len(), 1);
    assert!((slow[0].1 - 1.0).abs() < 1e-5);
}

/// Walks at 0.95 m and at 0.6 m, stands at 0.97 m and at 0.6 m.
fn crouching() -> Style {
    let mut style = of(&["idle", "walk"]);
    let low = |name: &str, height: f32| {
        let mut gait = style.gait(name).unwrap().clone();
        gait.name = format!("crouch-{name}");
        let mean = gait.height_m();
        for key in &mut gait.keys {
            key.height_m += height - mean;
            key.rotations[1] = Quat::from_rotation_x(0.8);
        }
        gait
    };
    let low = [low("idle", 0.6), low("walk", 0.6)];
    style.gaits.extend(low);
    style
}

#[test]
fn height_chooses_between_gaits() {
    let style = crouching();
    let at = |forward, height_m| {
        let wanted = Wanted {
            height_m,
            ..wanted(0.0, forward, 0.0)
        };
        let blend = blend(&style, None, &wanted);
        let mut pose = vec![Quat::IDENTITY; 6];
        let moment = blend.sample(0.0, 0, &mut pose);
        (blend.named(), moment.height_m, pose)
    };
    let (walk, high, _) = at(1.2, None);
    assert!(
        walk[0].0 == "walk" && walk[0].1 > 0.9,
        "the gait's own height without a command: {walk:?}"
    );
    let (crouch, low, pose) = at(1.2, Some(0.6));
    assert!(crouch[0].0 == "crouch-walk" && crouch[0].1 > 0.999, "{crouch:?}");
    assert!(angle_between(pose[1], Quat::from_rotation_x(0.8)) < 1e-3);
    let (_, middle, pose) = at(1.2, Some(0.775));
    assert!((middle - 0.5 * (high + low)).abs() < 0.02, "{middle}");
    assert!((angle_between(pose[1], Quat::IDENTITY) - 0.4).abs() < 0.05);
    assert_eq!(at(1.2, Some(0.1)).0, crouch, "below the range the lowest");
    let (standing, height, _) = at(0.0, Some(0.785));
    assert_eq!(standing.len(), 2);
    assert!((height - 0.785).abs() < 0.01);
}

#[test]
fn gaits_at_one_point_count_once() {
    let mut style = walker_style();
    let mut twin = style.gait("walk").unwrap().clone();
    twin.name = "walk-again".to_owned();
    style.gaits.push(twin);
    let blend = blend(&style, None, &wanted(0.0, 1.2, 0.0));
    assert_eq!(blend.named(), [("walk".to_owned(), 1.0)]);
}

#[test]
fn standing_poses_take_turns() {
    let mut style = of(&["idle"]);
    let mut other = style.gaits[0].keys[0].clone();
    other.rotations[1] = Quat::from_rotation_z(0.2);
    style.gaits[0].keys.push(other);
    let still = blend(&style, None, &wanted(0.0, 0.0, 0.0));
    let spine = |frame| {
        let mut pose = vec![Quat::IDENTITY; 6];
        still.sample(0.0, frame, &mut pose);
        angle_between(pose[1], Quat::IDENTITY)
    };
    assert!(spine(0) < 1e-3 && spine(STAND_FRAMES - 1) < 1e-3);
    assert!((spine(STAND_FRAMES) - 0.2).abs() < 1e-3);
    assert!(spine(2 * STAND_FRAMES) < 1e-3);
}

#[test]
fn matching_a_mix_finds_its_own_phase() {
    let style = walker_style();
    for wanted in [
        wanted(0.0, 1.2, 0.0),
        wanted(0.0, 2.1, 0.0),
        wanted(0.3, 0.8, 0.0),
    ] {
        let blend = blend(&style, None, &wanted);
        let joints = 6;
        for step in [3, 11, 20, 30] {
            // The mix's own positions and velocities at that step, by the definition of the
            // distances.
            let (mut p, mut v) = (vec![Vec3::ZERO; joints], vec![Vec3::ZERO; joints]);
            for share in blend.shares() {
                let cycle = &blend.cycles.gaits[share.gait];
                let at = if share.stands.is_some() { 0 } else { step };
                for joint in 0..joints {
                    p[joint] += cycle.positions[at * joints + joint] * share.weight;
                    v[joint] += cycle.velocities[at * joints + joint] * share.weight;
                }
            }
            let mut distances = [0.0; MATCH_STEPS];
            blend.distances(&p, &v, 0.1, 0, &mut distances);
            let least = (0..MATCH_STEPS).min_by(|&a, &b| distances[a].total_cmp(&distances[b]));
            assert_eq!(least, Some(step), "{wanted:?}");
            assert!(distances[step] < 1e-6);
        }
    }
}

fn any_wanted() -> impl Strategy<Value = Wanted> {
    (-4.0f32..4.0, -4.0f32..4.0, -3.0f32..3.0).prop_map(|(left, forward, turn)| wanted(left, forward, turn))
}

proptest! {
    #[test]
    fn weights_sum_to_one(wanted in any_wanted(), only in proptest::option::of(0usize..7)) {
        let style = walker_style();
        let blend = Blend::new(&style, style.cycles(&walker()), only, &wanted);
        let named = blend.named();
        let sum: f32 = named.iter().map(|(_, weight)| weight).sum();
        prop_assert!((sum - 1.0).abs() < 1e-4, "{named:?}");
        prop_assert!(named.iter().all(|(_, weight)| (0.0..=1.0001).contains(weight)), "{named:?}");
        prop_assert!(blend.rate.is_finite() && blend.hurry().abs() < 1.3);
    }

    #[test]
    fn weights_are_continuous_in_the_velocity(
        wanted in any_wanted(), scale in 0.0f32..1.0, angle in 0.0f32..6.3, turn in -1.0f32..1.0,
    ) {
        let style = walker_style();
        // Low speeds too: directions change fast there.
        let a = Wanted { left_mps: wanted.left_mps * scale, forward_mps: wanted.forward_mps * scale, ..wanted };
        let step = 1e-3;
        let b = Wanted {
            left_mps: a.left_mps + step * angle.sin(),
            forward_mps: a.forward_mps + step * angle.cos(),
            turn_rps: a.turn_rps + step * turn,
            ..a
        };
        let (a, b) = (blend(&style, None, &a), blend(&style, None, &b));
        for gait in &style.gaits {
            let (a, b) = (weight(&a, &gait.name), weight(&b, &gait.name));
            prop_assert!((a - b).abs() < 0.03, "{}: {a} {b}", gait.name);
        }
        prop_assert!((a.moving - b.moving).abs() < 0.03);
    }

    #[test]
    fn poses_are_unit_and_continuous_in_the_phase(wanted in any_wanted(), phase in -2.0f32..2.0) {
        let style = walker_style();
        let blend = blend(&style, None, &wanted);
        let (mut a, mut b) = (vec![Quat::IDENTITY; 6], vec![Quat::IDENTITY; 6]);
        let first = blend.sample(phase, 3, &mut a);
        let second = blend.sample(phase + 1e-3, 3, &mut b);
        for (a, b) in a.iter().zip(&b) {
            prop_assert!((a.length() - 1.0).abs() < 1e-5);
            prop_assert!(angle_between(*a, *b) < 0.02);
        }
        prop_assert!((first.sway - second.sway).abs() < 0.01 && first.height_m > 0.5);
        prop_assert_eq!(first, blend.moment(phase, 3));
    }
}
