use proptest::prelude::*;

use super::*;
use crate::ik::legs;
use crate::ik::testing::*;
use crate::rotation::angle_between;

fn standing_at(rotations: &[Quat]) -> Posed<'_> {
    Posed {
        root: Vec3::Y * STAND_M,
        rotations,
    }
}

fn fall(height: f32, velocity: Vec3, fps: f32) -> Fall {
    let (skeleton, pose) = (person(), standing());
    let from = Posed {
        root: Vec3::Y * (STAND_M + height),
        rotations: &pose,
    };
    let drop = Drop {
        velocity,
        floor_m: 0.0,
        wall_s: None,
        standing: standing_at(&pose),
        under_way: &[],
        air: None,
        fps,
    };
    fall_motion(&skeleton, &legs(&skeleton), from, &drop)
}

#[test]
fn a_throw_lands_where_the_ground_is() {
    let throw = Throw {
        position: Vec3::new(0.0, 2.0, 0.0),
        velocity: Vec3::new(0.0, 1.0, 3.0),
    };
    // A ledge at 2 m up to z = 0.3, and the floor.
    let mut asked = Vec::new();
    let ground = |from: Vec3, to: Vec3| {
        asked.push((from, to));
        let height = if to.z < 0.3 { 2.0 } else { 0.0 };
        (from.y >= height && to.y <= height).then_some(height)
    };
    let landing = throw.lands(30.0, 10.0, ground).unwrap();
    let seconds = (1.0 + (1.0_f32 + 2.0 * 9.81 * 2.0).sqrt()) / 9.81;
    assert!((landing.seconds - seconds).abs() < 1e-4, "{landing:?}");
    assert_eq!(landing.place.y, 0.0);
    assert!((landing.place.z - 3.0 * seconds).abs() < 1e-3);
    assert!((landing.velocity.y + (1.0_f32 + 2.0 * 9.81 * 2.0).sqrt()).abs() < 1e-3);
    assert!(
        asked.iter().all(|(from, to)| to.y < from.y),
        "only on the way down"
    );
    assert!(asked.windows(2).all(|w| w[0].1 == w[1].0), "without gaps");
}

#[test]
fn a_throw_without_ground_or_with_invalid_values_does_not_land() {
    let throw = |x, y| Throw {
        position: Vec3::new(x, 1.0, 0.0),
        velocity: Vec3::new(0.0, y, 0.0),
    };
    let floor = |_: Vec3, to: Vec3| (to.y <= 0.0).then_some(0.0);
    assert_eq!(throw(0.0, 0.0).lands(30.0, 5.0, |_, _| None), None);
    assert_eq!(throw(0.0, 0.0).lands(30.0, 0.3, floor), None, "not in time");
    assert_eq!(throw(0.0, 0.0).lands(30.0, 5.0, |_, _| Some(f32::NAN)), None);
    for fps in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(throw(0.0, 0.0).lands(fps, 5.0, floor), None);
    }
    assert_eq!(throw(f32::NAN, 0.0).lands(30.0, 5.0, floor), None);
    assert_eq!(throw(0.0, f32::INFINITY).lands(30.0, 5.0, floor), None);
    assert_eq!(throw(0.0, 0.0).lands(30.0, f32::NAN, floor), None);
    let mut asked = 0;
    let forever = throw(0.0, 0.0).lands(30.0, f32::INFINITY, |_, _| {
        asked += 1;
        None
    });
    assert_eq!((forever, asked), (None, 600), "20 seconds");
}

#[test]
fn falls_of_all_heights() {
    let (skeleton, pose) = (person(), standing());
    let mut depths = Vec::new();
    for height in [0.0, 0.05, 0.3, 0.6, 1.0, 2.0, 3.0, 6.0] {
        for speed in [0.0, 1.2, 3.5] {
            let fall = fall(height, Vec3::new(0.0, 0.0, speed), 30.0);
            let (motion, what) = (&fall.motion, format!("{height} m at {speed} m/s"));
            let count = motion.frames();
            assert!(count > 20 && motion.rotations.len() == count * JOINTS, "{what}");
            assert_eq!(motion.contacts.len(), count);
            // Exactly standing at the end, over its feet.
            let end = *motion.roots.last().unwrap();
            assert!((end.y - STAND_M).abs() < 1e-6 && end.x == 0.0, "{what}: {end}");
            assert!(same(&motion.rotations[(count - 1) * JOINTS..], &pose), "{what}");
            assert!(
                motion.short_m < 1e-3,
                "{what}: legs are {} m too short",
                motion.short_m
            );
            assert!(stretch(&skeleton, &motion.rotations) < 1e-5);
            for joint in [15, 16, 19, 20] {
                let track = track(&skeleton, &motion.roots, &motion.rotations, joint);
                let still = track[fall.touch_down..]
                    .windows(2)
                    .all(|w| w[0].distance(w[1]) < 1e-4);
                assert!(still, "{what}: feet stand from touch-down on");
                let clearance = if joint % 4 == 3 { 0.1174 } else { 0.0425 };
                let lowest = track.iter().map(|p| p.y).fold(f32::INFINITY, f32::min);
                assert!(lowest > clearance - 0.01, "{what}: joint {joint} at {lowest}");
            }
            for frame in 0..count {
                assert_eq!(
                    motion.contacts[frame] == 0b1111,
                    frame >= fall.touch_down,
                    "{what}"
                );
            }
            let lowest = STAND_M - motion.roots[fall.lowest].y;
            assert!(lowest <= fall.depth_m + 1e-4 && fall.depth_m <= 0.37, "{what}");
            assert!(
                lowest > 0.7 * fall.depth_m,
                "{what}: {lowest} of {}",
                fall.depth_m
            );
            depths.push(fall.depth_m);
        }
    }
    assert!(depths.is_sorted(), "the higher the deeper: {depths:?}");
}

#[test]
fn flight_follows_gravity() {
    let fall = fall(2.0, Vec3::new(0.3, 1.0, 1.2), 30.0);
    let throw = Throw {
        position: Vec3::Y * (STAND_M + 2.0),
        velocity: Vec3::new(0.3, 1.0, 1.2),
    };
    for frame in 0..fall.touch_down {
        let at = throw.at((frame + 1) as f32 / 30.0);
        assert!(fall.motion.roots[frame].distance(at) < 1e-5, "frame {frame}");
    }
    // The root makes no jump: it is braked no harder than the depth requires, and over the ground
    // in a tenth of a second.
    let roots = [&[throw.position], &fall.motion.roots[..]].concat();
    let most = fall.impact_mps.powi(2) / (2.0 * (fall.depth_m - 0.04)) + 40.0;
    for w in roots.windows(3) {
        assert!((w[2] - 2.0 * w[1] + w[0]).length() * 900.0 < most);
    }
}

#[test]
fn a_pose_in_the_air_and_a_heading_are_kept() {
    let (skeleton, stand) = (person(), standing());
    let turned: Vec<Quat> = [&[yaw(1.0)], &stand[1..]].concat();
    let mut air = stand.clone();
    air[6] = Quat::from_rotation_z(0.5);
    let drop = Drop {
        velocity: Vec3::ZERO,
        floor_m: -4.0,
        wall_s: None,
        standing: standing_at(&stand),
        under_way: &[],
        air: Some(&air),
        fps: 60.0,
    };
    let from = Posed {
        root: Vec3::new(1.0, STAND_M, 2.0),
        rotations: &turned,
    };
    let fall = fall_motion(&skeleton, &legs(&skeleton), from, &drop);
    let last = &fall.motion.rotations[(fall.motion.frames() - 1) * JOINTS..];
    assert!(angle_between(last[0], yaw(1.0)) < 1e-4);
    assert!(
        fall.motion
            .roots
            .last()
            .unwrap()
            .distance(Vec3::new(1.0, STAND_M - 4.0, 2.0))
            < 1e-5
    );
    let middle = &fall.motion.rotations[20 * JOINTS..21 * JOINTS];
    assert!(angle_between(middle[6], air[6]) < 1e-3 && angle_between(middle[0], yaw(1.0)) < 1e-3);
}

#[test]
fn joints_go_on_as_they_moved() {
    let skeleton = person();
    let (roots, rotations, _) = walk(60);
    let stand = standing();
    // Largest extra acceleration of a joint about the root in the fall's first frames over the
    // walk, m/s².
    let roughest = |start: usize, goes_on: usize| {
        let from = Posed {
            root: roots[start] + Vec3::Y * 2.0,
            rotations: &rotations[start * JOINTS..][..JOINTS],
        };
        let drop = Drop {
            velocity: (roots[start] - roots[start - 1]) * 30.0,
            floor_m: 0.0,
            wall_s: None,
            standing: standing_at(&stand),
            under_way: &rotations[(start + 1) * JOINTS..][..goes_on * JOINTS],
            air: None,
            fps: 30.0,
        };
        let fall = fall_motion(&skeleton, &legs(&skeleton), from, &drop);
        assert!(
            (17..21).contains(&fall.touch_down),
            "it takes no longer: {}",
            fall.touch_down
        );
        let mut all = rotations[(start - 1) * JOINTS..(start + 1) * JOINTS].to_vec();
        all.extend_from_slice(&fall.motion.rotations[..2 * JOINTS]);
        let walk = &rotations[(start - 1) * JOINTS..][..4 * JOINTS];
        let bend = |w: &[Vec3]| (w[2] - 2.0 * w[1] + w[0]) * 900.0;
        let mut most = 0.0_f32;
        for joint in 0..JOINTS {
            let [fell, walked] =
                [&all[..], walk].map(|poses| track(&skeleton, &[Vec3::ZERO; 4], poses, joint));
            for (a, b) in fell.windows(3).zip(walked.windows(3)) {
                most = most.max((bend(a) - bend(b)).length());
            }
        }
        most
    };
    let worst = |goes_on: usize| (10..40).map(|start| roughest(start, goes_on)).fold(0.0, f32::max);
    let (stops, goes_on) = (worst(0), worst(8));
    assert!(stops > 50.0 && goes_on < 25.0, "{stops} to {goes_on} m/s²");
}

#[test]
fn without_a_pose_the_arms_go_up_and_the_feet_are_drawn_up() {
    let fall = fall(4.0, Vec3::ZERO, 30.0);
    let skeleton = person();
    let at = |frame: usize| {
        let pose = &fall.motion.rotations[frame * JOINTS..][..JOINTS];
        positions(&skeleton, Vec3::ZERO, pose)
    };
    let (first, air) = (at(0), at(12));
    for hand in [HAND_L, HAND_R] {
        assert!(air[hand].y > first[hand].y + 0.05 && air[hand].x.abs() > first[hand].x.abs() + 0.1);
    }
    assert!(air[15].y > first[15].y + 0.05);
}

#[test]
fn a_wall_ends_the_way_over_the_ground() {
    let (skeleton, pose) = (person(), standing());
    let from = Posed {
        root: Vec3::Y * (STAND_M + 2.0),
        rotations: &pose,
    };
    for wall_s in [0.0, 0.1, 0.4] {
        let drop = Drop {
            velocity: Vec3::Z * 3.0,
            floor_m: 0.0,
            wall_s: Some(wall_s),
            standing: standing_at(&pose),
            under_way: &[],
            air: None,
            fps: 30.0,
        };
        let fall = fall_motion(&skeleton, &legs(&skeleton), from, &drop);
        let roots = &fall.motion.roots;
        let far = roots.iter().map(|root| root.z).fold(0.0, f32::max);
        assert!((far - 3.0 * wall_s).abs() < 5e-3, "{wall_s} s: {far}");
        // The way down is the same.
        let free = fall_motion(&skeleton, &legs(&skeleton), from, &Drop { wall_s: None, ..drop });
        for (root, other) in roots.iter().zip(&free.motion.roots).take(fall.touch_down) {
            assert_eq!(root.y, other.y);
        }
        assert_eq!(fall.touch_down, free.touch_down);
    }
}

#[test]
fn odd_input_makes_no_frames() {
    let (skeleton, pose) = (person(), standing());
    let legs = legs(&skeleton);
    let good = Drop {
        velocity: Vec3::ZERO,
        floor_m: 0.0,
        wall_s: None,
        standing: standing_at(&pose),
        under_way: &[],
        air: None,
        fps: 30.0,
    };
    let from = standing_at(&pose);
    let nan = [Quat::NAN; JOINTS];
    let bad = [
        Drop {
            velocity: Vec3::NAN,
            ..good
        },
        Drop {
            floor_m: f32::NEG_INFINITY,
            ..good
        },
        Drop {
            floor_m: -1e9,
            ..good
        },
        Drop {
            wall_s: Some(-0.1),
            ..good
        },
        Drop { fps: 0.0, ..good },
        Drop {
            fps: f32::NAN,
            ..good
        },
        Drop { fps: 1e9, ..good },
        Drop {
            air: Some(&pose[..4]),
            ..good
        },
        Drop {
            air: Some(&nan),
            ..good
        },
        Drop {
            under_way: &pose[..4],
            ..good
        },
        Drop {
            under_way: &nan,
            ..good
        },
        Drop {
            standing: Posed {
                root: Vec3::NAN,
                rotations: &pose,
            },
            ..good
        },
        Drop {
            standing: Posed {
                root: Vec3::ZERO,
                rotations: &[],
            },
            ..good
        },
        Drop {
            velocity: Vec3::Y * 1e6,
            ..good
        },
    ];
    for drop in &bad {
        assert_eq!(
            fall_motion(&skeleton, &legs, from, drop),
            Fall::default(),
            "{drop:?}"
        );
    }
    let lost = Posed {
        root: Vec3::NAN,
        ..from
    };
    assert_eq!(fall_motion(&skeleton, &legs, lost, &good), Fall::default());
    // Below the ground, without legs: odd, but a motion that ends standing.
    let below = Posed {
        root: Vec3::Y * -3.0,
        rotations: &pose,
    };
    for legs in [&legs[..], &[]] {
        let fall = fall_motion(&skeleton, legs, below, &good);
        assert_eq!(fall.touch_down, 5);
        assert!((fall.motion.roots.last().unwrap().y - STAND_M).abs() < 1e-6);
        assert!(fall.motion.rotations.iter().all(|q| q.is_finite()));
    }
}

#[test]
fn depth_grows_with_the_impact_up_to_what_legs_allow() {
    let depth = |impact| landing_depth(impact, 0.8);
    assert!((depth(0.0) - 0.04).abs() < 1e-6 && (depth(4.0) - 0.24).abs() < 1e-6);
    assert!((depth(20.0) - 0.36).abs() < 1e-6);
    assert_eq!(landing_depth(5.0, 0.0), 0.0);
    assert_eq!(landing_depth(f32::NAN, 0.8), 0.04);
}

proptest! {
    #[test]
    fn energy_is_kept(position in place(10.0), velocity in place(8.0), s in 0.0f32..3.0) {
        let throw = Throw { position, velocity };
        let energy = |p: Vec3, v: Vec3| 0.5 * v.length_squared() + GRAVITY_MPS2 * p.y;
        let (start, end) = (energy(position, velocity), energy(throw.at(s), throw.velocity_at(s)));
        prop_assert!((start - end).abs() < 1e-3 * (1.0 + velocity.length_squared() + 900.0));
        // The velocity is the change of the place.
        let moved = (throw.at(s + 1e-2) - throw.at(s - 1e-2)) / 2e-2;
        prop_assert!(moved.distance(throw.velocity_at(s)) < 2e-2);
    }

    #[test]
    fn a_throw_over_a_level_floor_lands_on_it(height in 0.0f32..20.0, velocity in place(5.0), fps in 15.0f32..120.0) {
        let throw = Throw { position: Vec3::Y * height, velocity };
        let floor = |_: Vec3, to: Vec3| (to.y <= 0.0).then_some(0.0);
        let landing = throw.lands(fps, 20.0, floor).unwrap();
        prop_assert!(landing.place.distance(throw.at(landing.seconds)) < 2e-3);
        prop_assert!(landing.velocity.y <= 1e-3);
    }

    #[test]
    fn any_fall_ends_standing_with_its_legs_in_reach(
        pose in near_standing(0.2), height in 0.0f32..8.0, velocity in place(2.5), fps in 20.0f32..90.0,
    ) {
        let (skeleton, stand) = (person(), standing());
        let from = Posed { root: Vec3::new(3.0, STAND_M + height, -2.0), rotations: &pose };
        let drop = Drop { velocity, floor_m: 0.0, wall_s: None, standing: standing_at(&stand), under_way: &[], air: None, fps };
        let fall = fall_motion(&skeleton, &legs(&skeleton), from, &drop);
        prop_assert!(fall.motion.frames() > 0 && fall.motion.short_m < 5e-3, "short {}", fall.motion.short_m);
        prop_assert!(stretch(&skeleton, &fall.motion.rotations) < 1e-5);
        let (roots, rotations) = (
            [&[from.root], &fall.motion.roots[..]].concat(),
            [&pose[..], &fall.motion.rotations[..]].concat(),
        );
        // No joint exceeds the root's fall by more than limbs can.
        let most = (fall.impact_mps + velocity.length() + 8.0) / fps;
        prop_assert!(fastest(&skeleton, &roots, &rotations) < most);
        prop_assert!(rotations.chunks_exact(JOINTS).collect::<Vec<_>>().windows(2)
            .all(|w| w[0].iter().zip(w[1]).all(|(a, b)| a.dot(*b) >= 0.0)));
    }
}
