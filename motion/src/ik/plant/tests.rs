use super::schedule::flat;
use super::*;
use crate::ik::legs;
use crate::ik::testing::*;
use crate::skeleton::{ContactParams, Joint};

const FPS: f32 = 30.0;
const TOES: [usize; 2] = [16, 20];

type Frames = (Vec<Vec3>, Vec<Quat>, Vec<u8>);

/// A walk whose feet glide: the network's steps are shorter than the way of its body.
fn glide(frames: usize, speed_mps: f32) -> Frames {
    let (mut roots, rotations, contacts) = walk(frames);
    for (frame, root) in roots.iter_mut().enumerate() {
        root.z = speed_mps * frame as f32 / FPS;
    }
    (roots, rotations, vec![0; contacts.len()])
}

fn plant(motion: &Frames, range: Range<usize>, carried: Option<&Carried>) -> (Frames, Planted) {
    let skeleton = person();
    let mut made = motion.clone();
    let options = FootPlant {
        fps: FPS,
        range,
        floor_m: 0.0,
        height_m: f32::INFINITY,
    };
    let (roots, rotations, contacts) = (&mut made.0, &mut made.1, &mut made.2);
    let planted = plant_feet(
        &skeleton,
        &legs(&skeleton),
        roots,
        rotations,
        contacts,
        (&options, carried),
    );
    (made, planted)
}

/// How far the slower of both toes moves over the ground in each frame, metres.
fn slower(motion: &Frames) -> Vec<f32> {
    let skeleton = person();
    let toes = TOES.map(|toe| track(&skeleton, &motion.0, &motion.1, toe));
    let step = |toe: &[Vec3], frame: usize| flat(toe[frame + 1] - toe[frame]).length();
    (0..motion.0.len() - 1)
        .map(|frame| step(&toes[0], frame).min(step(&toes[1], frame)))
        .collect()
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

/// Mean acceleration of all joints, m/s².
fn acceleration(motion: &Frames) -> f32 {
    let skeleton = person();
    let mut found = Vec::new();
    for joint in 0..skeleton.joint_count() {
        let places = track(&skeleton, &motion.0, &motion.1, joint);
        let bends = places
            .windows(3)
            .map(|w| (w[2] - w[1] * 2.0 + w[0]).length() * FPS * FPS);
        found.extend(bends);
    }
    mean(&found)
}

#[test]
fn a_foot_stands_while_the_other_steps() {
    for speed in [0.6, 1.2, 1.6] {
        let before = glide(120, speed);
        let (after, _) = plant(&before, 0..120, None);
        let [was, is] = [&before, &after].map(|motion| 1000.0 * mean(&slower(motion)));
        let bends = [&before, &after].map(acceleration);
        println!("{speed} m/s: {was} {is} mm a frame, {bends:?} m/s²");
        assert!(was > 4.0 && is < 1.5, "{speed} m/s: {was} {is} mm a frame");
        assert!(bends[1] < 1.8 * bends[0], "{speed} m/s: {bends:?}");
        for (root, made) in before.0.iter().zip(&after.0) {
            assert_eq!((root.x, root.z), (made.x, made.z), "the root keeps its way");
            assert!(root.y - made.y < 0.08 && root.y >= made.y);
        }
    }
}

#[test]
fn a_contact_ends_before_the_body_is_too_far_even_if_only_one_foot_steps() {
    // Both feet glide: no leg moves.
    let frames = 90;
    let roots: Vec<Vec3> = (0..frames)
        .map(|frame| Vec3::new(0.0, STAND_M, 0.04 * frame as f32))
        .collect();
    let before = (roots, standing().repeat(frames), vec![0; frames]);
    let (after, _) = plant(&before, 0..frames, None);
    assert!(mean(&slower(&before)) > 0.039);
    assert!(mean(&slower(&after)) < 2e-3, "{}", mean(&slower(&after)));
    for bits in [0b0011_u8, 0b1100] {
        let longest = after
            .2
            .split(|contacts| contacts & bits == 0)
            .map(<[u8]>::len)
            .max();
        assert!((8..26).contains(&longest.unwrap()), "{longest:?} frames at 4 cm");
    }
}

#[test]
fn feet_that_stand_stay_and_a_body_at_rest_is_unchanged() {
    let frames = 40;
    let still = (
        vec![Vec3::Y * STAND_M; frames],
        standing().repeat(frames),
        vec![0b1111; frames],
    );
    let (after, _) = plant(&still, 4..frames, None);
    let skeleton = person();
    for toe in TOES {
        let [was, is] = [&still, &after].map(|motion| track(&skeleton, &motion.0, &motion.1, toe));
        let most = was
            .iter()
            .zip(&is)
            .map(|(a, b)| flat(*a - *b).length())
            .fold(0.0, f32::max);
        assert!(most < 1e-3, "{most} m");
    }
    assert!(
        after.2.iter().all(|&bits| bits & 0b1010 == 0b1010),
        "{:?}",
        after.2
    );
}

#[test]
fn soles_come_onto_the_ground() {
    let (mut roots, rotations, contacts) = glide(90, 1.0);
    roots.iter_mut().for_each(|root| root.y -= 0.03);
    let before = (roots, rotations, contacts);
    let (after, _) = plant(&before, 0..90, None);
    let skeleton = person();
    let lowest = |motion: &Frames| {
        let above = TOES.map(|toe| {
            let places = track(&skeleton, &motion.0, &motion.1, toe);
            places
                .iter()
                .map(|place| place.y - 0.0425)
                .fold(f32::INFINITY, f32::min)
        });
        above[0].min(above[1])
    };
    assert!(lowest(&before) < -0.02, "{}", lowest(&before));
    assert!(lowest(&after) > -0.005, "{}", lowest(&after));
}

#[test]
fn fixed_frames_keep_their_feet_and_hold_those_beside_them() {
    let before = glide(90, 1.2);
    let (after, _) = plant(&before, 10..70, None);
    let joints = JOINTS;
    for frame in (0..10).chain(70..90) {
        assert_eq!(after.0[frame], before.0[frame]);
        assert_eq!(
            after.1[frame * joints..][..joints],
            before.1[frame * joints..][..joints]
        );
    }
    let skeleton = person();
    for joint in 0..joints {
        let places = track(&skeleton, &after.0, &after.1, joint);
        let steps = places.windows(2).map(|pair| pair[0].distance(pair[1]));
        let most = steps.fold(0.0, f32::max);
        assert!(most < 0.16, "joint {joint} jumps by {most} m");
    }
}

#[test]
fn frames_that_are_shown_say_what_feet_do() {
    let (skeleton, speed_mps) = (person(), 1.2);
    let (roots, rotations, _) = glide(10, speed_mps);
    let leg = legs(&skeleton)[0];
    let track = LegTrack::of(&skeleton, &leg, &(0..10), &roots, &rotations);
    let shown = |text: &str| {
        let bits = |c: u8| if c == b'x' { leg.contact_bits() } else { 0 };
        let contacts: Vec<u8> = text.bytes().map(bits).collect();
        CarriedLeg::as_shown(&leg, &track, &contacts)
    };
    let stands = shown("...xxxxxxx");
    assert_eq!((stands.held, stands.aloft), (Some(track.toes[9]), None));
    // Hips sway a little on their way.
    assert!(
        (stands.gone_m - 6.0 * speed_mps / FPS).abs() < 0.02,
        "{}",
        stands.gone_m
    );
    let left = shown("xxxx...");
    assert_eq!((left.held, left.aloft, left.gone_m), (None, Some(3), 0.0));
    assert_eq!(shown("......").aloft, None, "it never stood");
}

#[test]
fn what_is_made_in_parts_is_as_smooth_as_in_one_piece() {
    let before = glide(160, 1.2);
    let (whole, _) = plant(&before, 0..160, None);
    // Each part sees twenty frames more than it keeps, as a motion made window by window does.
    let mut parts = before.clone();
    let mut carried: Option<Carried> = None;
    for (from, to) in [(0, 60), (60, 100), (100, 160)] {
        let end = (to + 20).min(160);
        let cut = |motion: &Frames| {
            (
                motion.0[..end].to_vec(),
                motion.1[..end * JOINTS].to_vec(),
                motion.2[..end].to_vec(),
            )
        };
        let (made, planted) = plant(&cut(&before), from..end, carried.as_ref());
        parts.0[from..to].copy_from_slice(&made.0[from..to]);
        parts.1[from * JOINTS..to * JOINTS].copy_from_slice(&made.1[from * JOINTS..to * JOINTS]);
        carried = Some(planted.at(to - 1));
    }
    assert!(mean(&slower(&parts)) < 1.5e-3, "{}", mean(&slower(&parts)));
    let [one, several] = [&whole, &parts].map(acceleration);
    assert!(several < 1.1 * one, "{one} {several} m/s²");
}

#[test]
fn poses_that_are_not_finite_change_nothing() {
    let mut before = glide(30, 1.2);
    before.1[40] = Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0);
    let (after, planted) = plant(&before, 0..30, None);
    assert_eq!(after.0, before.0);
    assert_eq!(planted, Planted::default());
}

#[test]
fn a_foot_that_comes_down_beside_a_fixed_frame_does_not_jump() {
    let before = glide(120, 1.2);
    let skeleton = person();
    // Wherever the motion is cut, also where a foot has just come down.
    for from in 20..60 {
        let (after, _) = plant(&before, from..100, None);
        for toe in TOES {
            let [was, is] = [&before, &after].map(|motion| track(&skeleton, &motion.0, &motion.1, toe));
            let first = flat(is[from] - was[from]).length();
            assert!(first < 0.045, "frame {from}: {first} m");
        }
    }
}

/// Height of the root of [`crawler`] over the ground, metres.
const CRAWLER_M: f32 = 0.12;
/// The tips of its legs.
const TIPS: [usize; 4] = [4, 8, 12, 16];

/// A body low over the ground between four legs whose knees are higher than its hips.
fn crawler() -> Skeleton {
    let joint = |name: String, parent, offset: [f32; 3]| Joint {
        name,
        parent,
        offset_m: Vec3::from(offset),
    };
    let mut joints = vec![joint("Body".to_owned(), None, [0.0; 3])];
    for (nth, (x, z)) in [(1.0, 0.15), (-1.0, 0.15), (1.0, -0.15), (-1.0, -0.15)]
        .into_iter()
        .enumerate()
    {
        let first = joints.len();
        let offsets = [
            [0.08 * x, 0.0, z],
            [0.28 * x, 0.2, 0.0],
            [0.26 * x, -0.06, 0.0],
            [0.0, -0.26, 0.0],
        ];
        for (part, offset) in offsets.into_iter().enumerate() {
            let parent = if part == 0 { 0 } else { first + part - 1 };
            joints.push(joint(format!("Leg{nth}_{part}"), Some(parent), offset));
        }
    }
    let contacts = ContactParams {
        joints: TIPS.to_vec(),
        max_height_m: vec![0.05; 4],
        max_speed_mps: 0.4,
        clearance_m: vec![0.0; 4],
    };
    Skeleton::new(joints, Vec3::X, 0.0, Some(contacts)).unwrap()
}

#[test]
fn spread_legs_stand_and_their_feet_stay_out_of_the_ground() {
    let (skeleton, frames) = (crawler(), 90);
    let roots: Vec<Vec3> = (0..frames)
        .map(|frame| Vec3::new(0.0, CRAWLER_M, 0.03 * frame as f32))
        .collect();
    let rotations = vec![Quat::IDENTITY; frames * skeleton.joint_count()];
    let planted = |height_m: f32| {
        let (mut roots, mut rotations) = (roots.clone(), rotations.clone());
        let mut contacts = vec![0; frames];
        let options = FootPlant {
            fps: FPS,
            range: 0..frames,
            floor_m: 0.0,
            height_m,
        };
        let legs = legs(&skeleton);
        let how = (&options, None);
        plant_feet(&skeleton, &legs, &mut roots, &mut rotations, &mut contacts, how);
        TIPS.map(|tip| track(&skeleton, &roots, &rotations, tip))
    };
    let slowest = |tips: &[Vec<Vec3>; 4]| {
        let step = |tip: &Vec<Vec3>, frame: usize| flat(tip[frame + 1] - tip[frame]).length();
        let steps = (0..frames - 1).map(|frame| tips.iter().map(|tip| step(tip, frame)).fold(1.0, f32::min));
        mean(&steps.collect::<Vec<f32>>())
    };
    let tips = planted(CRAWLER_M);
    assert!(slowest(&tips) < 2e-3, "{} m a frame", slowest(&tips));
    let lowest = tips.iter().flatten().map(|tip| tip.y).fold(1.0, f32::min);
    assert!(lowest > -2e-3, "{lowest} m");
    // As on straight legs it would be sitting.
    assert!(slowest(&planted(f32::INFINITY)) > 0.029);
}
