use std::f32::consts::PI;

use proptest::prelude::*;

use super::*;
use crate::root::heading_of;

/// Roots that walk along +Z at 1 m/s, heading along `heading`.
fn walk(frames: usize, heading: f32) -> Vec<GlobalRoot> {
    let place = |frame: usize| Vec3::new(0.0, 0.9, frame as f32 / 30.0);
    (0..frames)
        .map(|frame| GlobalRoot::new(place(frame), heading))
        .collect()
}

fn flat(roots: &[GlobalRoot]) -> Vec<f32> {
    roots.iter().flat_map(|root| root.to_array()).collect()
}

fn aside(frame: usize, x: f32) -> RootKey {
    RootKey {
        frame,
        ground: Some([x, frame as f32 / 30.0]),
        ..RootKey::default()
    }
}

/// The walk bent through keys.
fn drawn(keys: &[RootKey], frames: usize) -> Vec<GlobalRoot> {
    let mut roots = flat(&walk(frames, 0.3));
    RootOverride::new(keys.iter().copied(), 3).draw(&mut roots);
    let frames = roots.as_chunks::<GLOBAL_ROOT>().0;
    frames.iter().map(|&root| GlobalRoot::from_array(root)).collect()
}

#[test]
fn a_key_moves_only_the_parts_that_it_gives() {
    let (made, free) = (drawn(&[aside(10, 0.4)], 24), walk(24, 0.3));
    assert_eq!(made[..4], drawn(&[], 24)[..4], "the context is unchanged");
    assert!((made[10].position.x - 0.4).abs() < 1e-6);
    // Half way in time is half of a curve that is at rest at both ends.
    assert!(made[7].position.x > 0.2 && made[6].position.x < 0.2);
    assert!(
        (made[23].position.x - 0.4).abs() < 1e-6,
        "it is constant after the last key"
    );
    for (made, free) in made.iter().zip(&free) {
        assert_eq!(
            (made.position.y, made.position.z),
            (free.position.y, free.position.z)
        );
        assert!((made.heading - free.heading).abs() < 1e-6);
    }
    let lifted = RootKey {
        frame: 12,
        height: Some(0.7),
        heading: Some(1.0),
        ..RootKey::default()
    };
    let made = drawn(&[lifted], 24);
    assert!((made[12].position.y - 0.7).abs() < 1e-6 && (made[12].heading - 1.0).abs() < 1e-6);
    assert_eq!(made[12].position.with_y(0.9), free[12].position);
}

#[test]
fn keys_of_one_part_do_not_affect_another() {
    // Heights at 8 and 20; the key between them gives only a place.
    let low = |frame| RootKey {
        frame,
        height: Some(0.6),
        ..RootKey::default()
    };
    let made = drawn(&[low(8), aside(14, 0.3), low(20)], 24);
    for root in &made[8..=20] {
        assert!((root.position.y - 0.6).abs() < 1e-5, "{}", root.position.y);
    }
}

#[test]
fn a_bend_leaves_and_arrives_without_a_kick() {
    let (free, root) = (walk(40, 0.0), |frame| RootKey::whole(frame, walk(40, 0.0)[frame]));
    let made = drawn(&[aside(20, 0.5), root(39)], 40);
    let step = |frame: usize| made[frame].position - made[frame - 1].position;
    let steps = (5..40).map(|frame| (step(frame) - step(frame - 1)).length());
    // A cubic over 17 frames changes its speed by at most 6 m/17² a frame for each metre.
    let most = steps.fold(0.0, f32::max);
    assert!(most < 0.5 * 6.0 / (17.0 * 17.0) + 1e-4, "{most}");
    assert_eq!(made[39].position, free[39].position);
}

#[test]
fn evenly_spaced_keys_give_an_even_speed() {
    // A steady drift to the side, with a key every 8 frames: between keys it neither stops nor
    // speeds up.
    let keys: Vec<RootKey> = (1..=7).map(|nth| aside(3 + 8 * nth, 0.08 * nth as f32)).collect();
    let made = drawn(&keys, 64);
    for frame in 12..=51 {
        let step = made[frame].position.x - made[frame - 1].position.x;
        assert!((step - 0.01).abs() < 2e-4, "frame {frame}: {step}");
    }
}

#[test]
fn headings_turn_the_short_way() {
    let heading = |frame, heading| RootKey {
        frame,
        heading: Some(heading),
        ..RootKey::default()
    };
    let made = drawn(
        &[heading(10, 3.0), heading(16, -3.0), heading(22, 3.0 + 2.0 * PI)],
        24,
    );
    for (frame, wanted) in [(10, 3.0), (16, -3.0), (22, 3.0)] {
        assert!(wrap_angle(made[frame].heading - wanted).abs() < 1e-5, "{frame}");
    }
    for root in &made[10..=22] {
        let off = wrap_angle(root.heading - PI).abs();
        assert!(off <= PI - 3.0 + 1e-3, "{}", root.heading);
    }
}

#[test]
fn keys_in_the_context_and_after_the_end_change_nothing() {
    assert_eq!(drawn(&[aside(0, 5.0), aside(3, 5.0)], 12), drawn(&[], 12));
    assert_eq!(drawn(&[aside(12, 5.0), aside(40, 5.0)], 12), drawn(&[], 12));
    RootOverride::new([aside(5, 1.0)], 3).draw(&mut []);
}

proptest! {
    #[test]
    fn every_key_is_met_by_drawn_roots_and_by_pinned_ones(
        frames in proptest::collection::btree_set(4_usize..40, 1..36),
        places in proptest::collection::vec(([-2.0f32..2.0, 0.5f32..1.5, -2.0f32..2.0], -3.1f32..3.1), 36),
        heading in -3.1f32..3.1,
    ) {
        let keys: Vec<RootKey> = frames
            .iter()
            .zip(&places)
            .map(|(&frame, &(place, heading))| RootKey::whole(frame, GlobalRoot::new(Vec3::from(place), heading)))
            .collect();
        let over = RootOverride::new(keys.iter().copied(), 3);
        let mut flat = flat(&walk(40, heading));
        over.draw(&mut flat);
        let mut roots = walk(40, heading);
        let mut rotations: Vec<Quat> = roots.iter().flat_map(|root| [yaw(root.heading), yaw(1.0)]).collect();
        over.pin(&mut roots, &mut rotations, 2);
        for key in &keys {
            let made = GlobalRoot::from_array(flat.as_chunks::<GLOBAL_ROOT>().0[key.frame]);
            for root in [made, roots[key.frame]] {
                let ground = [root.position.x, root.position.z];
                prop_assert!(ground.iter().zip(key.ground.unwrap()).all(|(a, b)| (a - b).abs() < 1e-4));
                prop_assert!((root.position.y - key.height.unwrap()).abs() < 1e-4);
                prop_assert!(wrap_angle(root.heading - key.heading.unwrap()).abs() < 1e-4);
            }
        }
        for (frame, root) in roots.iter().enumerate() {
            prop_assert!(wrap_angle(heading_of(rotations[2 * frame], Vec3::X) - root.heading).abs() < 1e-3);
            prop_assert_eq!(rotations[2 * frame + 1], yaw(1.0), "parent-relative rotations are unchanged");
            let drawn = GlobalRoot::from_array(flat.as_chunks::<GLOBAL_ROOT>().0[frame]);
            prop_assert!(drawn.position.abs_diff_eq(root.position, 1e-3), "both follow the same path");
        }
    }
}
