use proptest::prelude::*;

use super::*;
use crate::ik::testing::*;
use crate::ik::{FootLock, legs, lock_feet};

type Frames = (Vec<Vec3>, Vec<Quat>, Vec<u8>);

/// A walk whose feet stand in contact.
fn flat(frames: usize) -> Frames {
    let (skeleton, mut motion) = (person(), walk(frames));
    lock_feet(
        &skeleton,
        &legs(&skeleton),
        &mut motion.0,
        &mut motion.1,
        &motion.2,
        &FootLock::default(),
    );
    motion
}

fn lifted(motion: &Frames, ground: impl FnMut(f32, f32) -> f32) -> (Frames, f32) {
    let skeleton = person();
    let mut made = motion.clone();
    let (legs, options) = (legs(&skeleton), Terrain::default());
    let short = lift_motion(
        &skeleton,
        &legs,
        &mut made.0,
        &mut made.1,
        &made.2,
        ground,
        &options,
    );
    (made, short)
}

fn lifts_of(motion: &Frames, known: &[Lift], ground: impl FnMut(f32, f32) -> f32) -> Vec<Lift> {
    let skeleton = person();
    let mut out = Vec::new();
    lifts(
        &skeleton,
        &legs(&skeleton),
        &motion.0,
        &motion.1,
        &motion.2,
        known,
        ground,
        &Terrain::default(),
        &mut out,
    );
    out
}

/// A ledge across the path.
fn ledge(z: f32, height: f32) -> impl Fn(f32, f32) -> f32 + Copy {
    move |_, at| if at > z { height } else { 0.0 }
}

#[test]
fn level_ground_changes_nothing() {
    let before = flat(80);
    assert_eq!(lifted(&before, |_, _| 0.0), (before.clone(), 0.0), "bit for bit");
    let (after, short) = lifted(&before, |_, _| 0.7);
    assert_eq!((&after.1, short), (&before.1, 0.0));
    assert!(
        after
            .0
            .iter()
            .zip(&before.0)
            .all(|(a, b)| (*a - *b - Vec3::Y * 0.7).length() < 1e-5)
    );
    assert_eq!(
        lifted(&before, |_, _| f32::NAN),
        (before, 0.0),
        "without ground: unchanged"
    );
}

#[test]
fn a_ledge_is_climbed_and_left_step_by_step() {
    let before = flat(120);
    let skeleton = person();
    let fast = fastest(&skeleton, &before.0, &before.1);
    for height in [0.1, 0.2, 0.4, -0.1, -0.2, -0.4] {
        let ground = ledge(2.1, height);
        let (after, short) = lifted(&before, ground);
        assert!(short < 0.012, "{height}: short by {short}");
        assert!(stretch(&skeleton, &after.1) < 1e-5);
        let speed = fastest(&skeleton, &after.0, &after.1);
        assert!(speed < fast + 0.16, "{height}: {speed} after {fast} m a frame");
        for (foot, bits, clearance) in [(15, 0b11, 0.0425), (19, 0b1100, 0.0425)] {
            let toes = track(&skeleton, &after.0, &after.1, foot + 1);
            let flat = track(&skeleton, &before.0, &before.1, foot + 1);
            for frame in 0..120_usize {
                let planted = |f: usize| after.2[f] & bits == bits;
                // The toes have at least their height over the flat ground, except for corners next
                // to contacts.
                let near = (frame.saturating_sub(6)..(frame + 7).min(120)).any(|f| after.2[f] & bits != 0);
                let over = toes[frame].y - ground(0.0, toes[frame].z) - (flat[frame].y - clearance).min(0.0);
                assert!(near || over > clearance - 0.01, "{height}: frame {frame}, {over}");
                if frame > 0 && planted(frame) && planted(frame - 1) && short < 1e-4 {
                    let (step, was) = (toes[frame] - toes[frame - 1], flat[frame] - flat[frame - 1]);
                    assert!(
                        (step - was).length() < 1e-4,
                        "{height}: planted feet stay planted"
                    );
                }
            }
        }
        assert!(
            (after.0[119].y - before.0[119].y - height).abs() < 1e-4,
            "it arrives"
        );
        assert_eq!(after.0[0].y, before.0[0].y);
        // The root does not jump.
        let up = |f: usize| after.0[f + 1].y - 2.0 * after.0[f].y + after.0[f - 1].y;
        assert!((1..119).all(|f| up(f).abs() * 900.0 < 16.0));
    }
}

#[test]
fn a_slope_and_stairs() {
    let before = flat(150);
    let skeleton = person();
    let slope = |_: f32, z: f32| 0.25 * z;
    let stairs = |_: f32, z: f32| (z / 0.6).floor().clamp(0.0, 5.0) * 0.15;
    let grounds: [&dyn Fn(f32, f32) -> f32; 2] = [&slope, &stairs];
    for ground in grounds {
        let (after, short) = lifted(&before, ground);
        assert!(short < 0.02, "{short}");
        assert!(fastest(&skeleton, &after.0, &after.1) < fastest(&skeleton, &before.0, &before.1) + 0.12);
        for toe in [16, 20] {
            for place in track(&skeleton, &after.0, &after.1, toe) {
                assert!(place.y > ground(place.x, place.z) - 0.05, "{place}");
            }
        }
    }
}

#[test]
fn shown_lifts_are_kept_and_continued_without_a_jump() {
    let motion = flat(120);
    let all = lifts_of(&motion, &[], ledge(2.1, 0.3));
    // With nothing changed the result is the same, wherever it is cut.
    for cut in [1, 17, 40, 58, 61, 90, 119, 120] {
        let again = lifts_of(&motion, &all[..cut], ledge(2.1, 0.3));
        assert_eq!(again[..cut], all[..cut]);
        for (frame, (a, b)) in again.iter().zip(&all).enumerate() {
            assert!(
                (a.root_m - b.root_m).abs() < 0.05,
                "cut at {cut}, frame {frame}: {a:?} {b:?}"
            );
        }
    }
    // If the ground changes during the walk, planted feet stay until they leave it.
    let cut = 50;
    let changed = lifts_of(&motion, &all[..cut], |_, _| 0.2);
    assert_eq!(changed[..cut], all[..cut]);
    for (nth, bits) in [0b11, 0b1100].into_iter().enumerate() {
        let mut frame = cut;
        while frame < 120 && motion.2[cut - 1] & bits != 0 && motion.2[frame] & bits != 0 {
            assert_eq!(changed[frame].feet_m[nth], all[cut - 1].feet_m[nth]);
            frame += 1;
        }
    }
    for w in changed[cut - 1..].windows(2) {
        assert!((w[1].root_m - w[0].root_m).abs() < 0.03, "{w:?}");
        assert!(
            (0..2).all(|nth| (w[1].feet_m[nth] - w[0].feet_m[nth]).abs() < 0.1),
            "{w:?}"
        );
    }
    assert_eq!(changed[119].feet_m[..2], [0.2; 2]);
}

/// Lifts as they are shown if plans come every 9 frames and only known frames are kept: of
/// `motion`, with `ahead` frames of each plan and the last `behind` that were shown.
fn replanned(motion: &Frames, behind: usize, ahead: usize, ground: impl Fn(f32, f32) -> f32) -> Vec<Lift> {
    let frames = motion.0.len();
    let mut shown: Vec<Lift> = Vec::new();
    while shown.len() < frames {
        let from = shown.len().saturating_sub(behind);
        let to = (shown.len() + ahead).min(frames);
        let window = (
            motion.0[from..to].to_vec(),
            motion.1[from * JOINTS..to * JOINTS].to_vec(),
            motion.2[from..to].to_vec(),
        );
        let made = lifts_of(&window, &shown[from..], &ground);
        let known = shown.len() - from;
        shown.extend(made[known..].iter().take(9));
    }
    shown
}

#[test]
fn plans_that_come_often_do_not_add_up() {
    let step = ledge(0.9, 0.15);
    let mut motion = flat(200);
    motion.2.fill(0);
    for behind in [1, 13] {
        let flown = replanned(&motion, behind, 40, step);
        for (frame, lift) in flown.iter().enumerate() {
            let highest = lift.feet_m[..2].iter().copied().fold(lift.root_m, f32::max);
            assert!(highest < 0.15 + 0.06, "{behind} known, frame {frame}: {lift:?}");
        }
        for lift in &flown[110..] {
            let off = (lift.feet_m[..2].iter())
                .fold((lift.root_m - 0.15).abs(), |most, f| most.max((f - 0.15).abs()));
            assert!(off < 0.02, "{behind} known: {lift:?}");
        }
    }
    // With steps, a swing continues as it began, the better the more of it is known.
    let motion = flat(200);
    let all = lifts_of(&motion, &[], step);
    let walked = replanned(&motion, 30, 60, step);
    for (frame, (a, b)) in walked.iter().zip(&all).enumerate() {
        for nth in 0..2 {
            let off = (a.feet_m[nth] - b.feet_m[nth]).abs();
            assert!(off < 1e-4, "frame {frame}: {a:?}, not {b:?}");
        }
    }
}

#[test]
fn a_foot_that_comes_down_sooner_than_planned_does_not_jump() {
    let motion = flat(120);
    let mut most_left = 0.0_f32;
    for (nth, bits) in [0b11, 0b1100].into_iter().enumerate() {
        for height in [0.3, -0.3] {
            let ground = ledge(2.1, height);
            let all = lifts_of(&motion, &[], ground);
            let lands = |f: &usize| motion.2[f - 1] & bits == 0 && motion.2[*f] & bits != 0;
            for land in (20..110).filter(lands) {
                // The plan that arrives two frames before has the foot down at once.
                let cut = land - 2;
                let mut sooner = motion.clone();
                sooner.2[cut..land]
                    .iter_mut()
                    .for_each(|contacts| *contacts |= bits);
                let mut shown = all[..cut].to_vec();
                for more in [1, 2, 3, 5] {
                    let made = lifts_of(&sooner, &shown, ground);
                    shown.extend_from_slice(&made[shown.len()..][..more]);
                }
                most_left = most_left.max((all[cut - 1].feet_m[nth] - all[land].feet_m[nth]).abs());
                for w in shown[cut - 1..].windows(2) {
                    let step = (w[1].feet_m[nth] - w[0].feet_m[nth]).abs();
                    assert!(step < 0.0701, "down at {cut}: {step} in a frame");
                }
                let (last, want) = (shown.last().unwrap().feet_m[nth], all[land].feet_m[nth]);
                assert!((last - want).abs() < 1e-4, "down at {cut}: {last}, not {want}");
            }
        }
    }
    assert!(most_left > 0.05, "a foot was on its way: {most_left}");
}

#[test]
fn without_legs_or_contacts() {
    let (skeleton, mut motion) = (person(), flat(60));
    let before = motion.clone();
    let ramp = |_: f32, z: f32| 0.1 * z;
    lift_motion(
        &skeleton,
        &[],
        &mut motion.0,
        &mut motion.1,
        &motion.2,
        ramp,
        &Terrain::default(),
    );
    assert_eq!(motion.1, before.1);
    let up = motion.0[50].y - before.0[50].y;
    assert!(
        (up - 0.1 * before.0[50].z).abs() < 0.02,
        "the body follows the ground: {up}"
    );
    motion = before.clone();
    motion.2.fill(0);
    let (after, _) = lifted(&motion, |_, _| 0.4);
    assert!((after.0[30].y - before.0[30].y - 0.4).abs() < 1e-5);
    assert_eq!(lifts_of(&(vec![], vec![], vec![]), &[], |_, _| 1.0), []);
    assert_eq!(lifts_of(&flat(1), &[], |_, _| 1.0)[0].root_m, 1.0);
}

#[test]
fn invalid_input() {
    let skeleton = person();
    let legs = legs(&skeleton);
    let (mut root, mut pose) = (Vec3::Y * STAND_M, standing());
    let before = pose.clone();
    for lift in [f32::NAN, f32::INFINITY] {
        let lift = Lift::even(lift);
        assert_eq!(
            lift_frame(&skeleton, &legs, &mut root, &mut pose, &lift),
            f32::INFINITY
        );
    }
    assert_eq!(
        lift_frame(&skeleton, &legs, &mut root, &mut pose[..3], &Lift::even(1.0)),
        f32::INFINITY
    );
    assert_eq!((root, &pose), (Vec3::Y * STAND_M, &before));
    let mut motion = flat(60);
    motion.0[20] = Vec3::NAN;
    motion.1[41 * JOINTS + 13] = Quat::NAN;
    let (after, _) = lifted(&motion, |x, z| if x.is_nan() { f32::INFINITY } else { 0.1 * z });
    for frame in (0..60).filter(|frame| ![20, 41].contains(frame)) {
        assert!(after.0[frame].is_finite(), "frame {frame}");
    }
    let wild = Terrain {
        clear_m: f32::NAN,
        half_window: usize::MAX,
        min_frames: usize::MAX,
    };
    let mut made = flat(40);
    lift_motion(
        &skeleton,
        &legs,
        &mut made.0,
        &mut made.1,
        &made.2,
        |_, z| z,
        &wild,
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn any_ground_is_walked_within_reach(
        heights in proptest::collection::vec(-0.15f32..0.15, 12), cut in 0usize..100, shift in 0.0f32..0.5,
    ) {
        let skeleton = person();
        let motion = flat(100);
        let ground = |_: f32, z: f32| {
            let place = ((z + 0.5) / 0.5).max(0.0) as usize;
            heights[place.min(11)] * 0.5 + shift
        };
        let (after, short) = lifted(&motion, ground);
        prop_assert!(short < 0.03, "short by {short}");
        prop_assert!(stretch(&skeleton, &after.1) < 1e-5);
        prop_assert!(lifted(&motion, ground) == (after, short), "the same again");
        let all = lifts_of(&motion, &[], ground);
        let again = lifts_of(&motion, &all[..cut], ground);
        prop_assert_eq!(&again[..cut], &all[..cut]);
        for w in again.windows(2) {
            prop_assert!((w[1].root_m - w[0].root_m).abs() < 0.04);
        }
        for lift in &all {
            // Root and feet stay within the heights of the ground and a swing's clearance.
            let (low, high) = (shift - 0.075 - 1e-4, shift + 0.075 + 1e-4);
            prop_assert!(lift.feet_m[..2].iter().all(|&f| f > low && f < high + 0.051 + 0.08), "{lift:?}");
            prop_assert!(lift.root_m < high + 0.07 && lift.root_m > low - 0.2);
        }
    }
}
