use std::f32::consts::FRAC_PI_2;

use proptest::prelude::*;

use super::*;

const FPS: f32 = 30.0;

/// A walk along +Z that sways, at `metres` a frame.
fn walk(frames: usize, metres: f32) -> Vec<GlobalRoot> {
    let root = |frame: usize| {
        let sway = 0.02 * (frame as f32 * 0.3).sin();
        GlobalRoot::new(Vec3::new(sway, 0.9, frame as f32 * metres), 0.1 * sway)
    };
    (0..frames).map(root).collect()
}

fn end_at(frames: usize, x: f32, z: f32, heading: Option<f32>) -> [Place; 1] {
    [Place {
        frame: frames - 1,
        ground: Vec2::new(x, z),
        heading,
    }]
}

/// The largest change of a step from one frame to the next, metres, and of a turn, radians.
fn jerks(roots: &[GlobalRoot]) -> [f32; 2] {
    let mut most = [0.0_f32; 2];
    for three in roots.windows(3) {
        let [before, after] = [step(three[0], three[1]), step(three[1], three[2])];
        most[0] = most[0].max(before.distance(after));
        let turns = [0, 1].map(|nth: usize| wrap_angle(three[nth + 1].heading - three[nth].heading));
        most[1] = most[1].max((turns[1] - turns[0]).abs());
    }
    most
}

#[test]
fn a_way_that_is_there_already_does_not_change() {
    let made = walk(90, 0.04);
    let last = made[89];
    let places = end_at(90, last.position.x, last.position.z, Some(last.heading));
    for (bent, made) in bend_through(&made, &places).iter().zip(&made) {
        assert!(bent.position.distance(made.position) < 1e-4, "{bent:?} {made:?}");
        assert!(wrap_angle(bent.heading - made.heading).abs() < 1e-5);
    }
}

#[test]
fn a_body_that_walks_to_its_side_turns_there() {
    // 3.56 m along +Z become a quarter of a circle, whose radius is 2.27 m.
    let made = walk(90, 0.04);
    let bent = bend_through(&made, &end_at(90, 2.27, 2.27, Some(FRAC_PI_2)));
    for pair in bent.windows(2).skip(10).take(68) {
        let way = step(pair[0], pair[1]);
        let ahead = way.x.atan2(way.y);
        let aside = wrap_angle(ahead - pair[0].heading).abs();
        // The made walk sways by up to 9 degrees beside its heading.
        assert!(aside < 0.45, "it goes {aside} rad beside its heading");
    }
    let sped = fastest_mps(&bent, FPS) / fastest_mps(&made, FPS);
    assert!(sped < 1.35, "{sped} times as fast");
}

#[test]
fn steps_become_longer_without_a_jump() {
    let made = walk(90, 0.04);
    let bent = bend_through(&made, &end_at(90, 0.0, 5.0, None));
    assert!(
        (bent[1].position - made[1].position).length() < 1e-3,
        "it begins as it did"
    );
    let sped = fastest_mps(&bent, FPS) / fastest_mps(&made, FPS);
    assert!((1.3..1.7).contains(&sped), "{sped}");
}

#[test]
fn places_on_the_way_are_passed_and_the_rest_follows() {
    let made = walk(100, 0.04);
    let places = [
        Place {
            frame: 40,
            ground: Vec2::new(0.5, 1.5),
            heading: None,
        },
        Place {
            frame: 80,
            ground: Vec2::new(-0.2, 3.0),
            heading: Some(-0.5),
        },
    ];
    let bent = bend_through(&made, &places);
    assert_eq!(bent.len(), 100);
    for place in &places {
        let at = bent[place.frame].position;
        assert!(Vec2::new(at.x, at.z).distance(place.ground) < 1e-5);
    }
    assert!((bent[80].heading + 0.5).abs() < 1e-4);
    // Behind the last place nothing changes but where it happens.
    for frame in 81..99 {
        let [was, is] = [&made, &bent].map(|roots| step(roots[frame], roots[frame + 1]).length());
        assert!((was - is).abs() < 1e-4);
    }
}

#[test]
fn a_place_that_no_frame_has_is_ignored() {
    let made = walk(10, 0.04);
    for frames in [1, 11] {
        let bent = bend_through(&made, &end_at(frames, 1.0, 1.0, None));
        let mut pairs = bent.iter().zip(&made);
        assert!(pairs.all(|(bent, made)| bent.position.distance(made.position) < 1e-5));
        assert_eq!(bent.len(), 10);
    }
    assert!(bend_through(&[], &end_at(1, 1.0, 1.0, None)).is_empty());
}

proptest! {
    #[test]
    fn any_place_is_met_smoothly(
        frames in 30_usize..200,
        metres in 0.0_f32..0.06,
        x in -3.0_f32..3.0,
        z in -3.0_f32..3.0,
        heading in prop::option::of(-3.0_f32..3.0),
    ) {
        let made = walk(frames, metres);
        let bent = bend_through(&made, &end_at(frames, x, z, heading));
        let last = bent[frames - 1];
        prop_assert!(Vec2::new(last.position.x, last.position.z).distance(Vec2::new(x, z)) < 1e-5);
        if let Some(heading) = heading {
            prop_assert!(wrap_angle(last.heading - heading).abs() < 1e-3);
        }
        prop_assert_eq!(bent[0], made[0]);
        for (bent, made) in bent.iter().zip(&made) {
            prop_assert_eq!(bent.position.y, made.position.y);
        }
        // A turn by pi and a bulge of pi / 2 over all frames change a turn by at most 6 pi and 16
        // pi / n² a frame, a shift of at most 16 m a step by 96 m / n², and steps of at most 0.13 m
        // by their own turns and ramps.
        let count = (frames - 1) as f32;
        let [moved, turned] = jerks(&bent);
        let [moved_before, turned_before] = jerks(&made);
        prop_assert!(turned < turned_before + 80.0 / (count * count), "{turned} rad");
        let most = 2.0 * moved_before + 100.0 / (count * count) + 2.0 / count + 0.02;
        prop_assert!(moved < most, "{moved} of {most} m");
    }
}
