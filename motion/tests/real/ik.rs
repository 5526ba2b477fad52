//! Feet, seats, falls and ledges on the default pack's skeleton: with the example walk, and with
//! real motion capture. `cargo test -p troupe-motion --test real -- ik --nocapture` prints the
//! figures.

use std::sync::Arc;

use troupe_motion::ballistic::{Drop, fall_motion};
use troupe_motion::contacts::detect;
use troupe_motion::fk::WorldMotion;
use troupe_motion::ik::{
    FootLock, Locked, Motion, Posed, ReachOptions, arms, legs, lock_feet, pose_at, reach_pose,
};
use troupe_motion::metrics::{foot_skate_m_per_frame, joint_acceleration_percentile_mps2};
use troupe_motion::stance::stance_transition;
use troupe_motion::terrain::{Terrain, lift_motion};
use troupe_motion::{Clip, Quat, Skeleton, Vec3};

use crate::{data_folder, in_repository, read, skeleton};

/// Walks of several styles.
const WALKS: [&str; 8] = [
    "dataset-2_walk_normal_001",
    "dataset-2_walk_elderly_008",
    "dataset-2_walk_masculine_003",
    "dataset-2_walk_feminine_004",
    "dataset-2_walk_youthful_002",
    "dataset-1_walk_normal_001",
    "dataset-1_walk_sad_001",
    "dataset-1_walk-left_tired_001",
];

fn example() -> Clip {
    read(&in_repository("examples/walk.bvh")).unwrap()
}

/// The clips of motion capture with these names that are present.
fn captured(names: &[&'static str]) -> Vec<(&'static str, Clip)> {
    let folder = data_folder();
    let found: Vec<_> = names
        .iter()
        .filter_map(|name| Some((*name, read(&folder.join(format!("{name}.bvh")))?)))
        .collect();
    if found.is_empty() {
        println!("no motion capture in {}", folder.display());
    }
    found
}

/// Contacts of a clip as a byte a frame.
fn contacts(clip: &Clip) -> Vec<u8> {
    let params = clip.skeleton.contacts.as_ref().unwrap();
    let found = detect(&WorldMotion::from_clip(clip), params, 0.0, clip.fps);
    let bits = |on: &[bool]| {
        on.iter()
            .enumerate()
            .fold(0, |bits, (nth, &on)| bits | u8::from(on) << nth)
    };
    found.chunks_exact(params.len()).map(bits).collect()
}

fn clip_of(skeleton: &Arc<Skeleton>, roots: Vec<Vec3>, rotations: Vec<Quat>) -> Clip {
    Clip::new(Arc::clone(skeleton), 30.0, roots, rotations).unwrap()
}

/// A constructed motion after the pose that it starts from.
fn after(skeleton: &Arc<Skeleton>, from: Posed<'_>, motion: &Motion) -> Clip {
    clip_of(
        skeleton,
        [&[from.root], &motion.roots[..]].concat(),
        [from.rotations, &motion.rotations[..]].concat(),
    )
}

fn skate_mm(clip: &Clip) -> f64 {
    let motion = WorldMotion::from_clip(clip);
    1000.0 * foot_skate_m_per_frame(&clip.skeleton, &motion, 0..clip.frames()).unwrap()
}

fn acceleration(clip: &Clip, share: f64) -> f64 {
    let motion = WorldMotion::from_clip(clip);
    joint_acceleration_percentile_mps2(&motion, 0..clip.frames(), clip.fps, share).unwrap()
}

/// Farthest that a foot in contact moves over the ground in a frame, millimetres: its toe while
/// that is in contact, otherwise its ankle.
fn slide_mm(clip: &Clip, contacts: &[u8]) -> f32 {
    let (motion, params) = (
        WorldMotion::from_clip(clip),
        clip.skeleton.contacts.as_ref().unwrap(),
    );
    let mut worst = 0.0_f32;
    for (nth, leg) in params.joints.chunks_exact(2).enumerate() {
        for frame in 1..clip.frames() {
            let bits = [frame - 1, frame].map(|f| contacts[f] >> (2 * nth) & 0b11);
            let joint = match bits {
                [0b10 | 0b11, 0b10 | 0b11] => leg[1],
                [0b01, 0b01] => leg[0],
                _ => continue,
            };
            let step = motion.positions_at(frame)[joint] - motion.positions_at(frame - 1)[joint];
            worst = worst.max(1000.0 * Vec3::new(step.x, 0.0, step.z).length());
        }
    }
    worst
}

fn locked(clip: &Clip) -> (Clip, Vec<u8>, Locked) {
    let (mut made, contacts) = (clip.clone(), contacts(clip));
    let legs = legs(&clip.skeleton);
    let options = FootLock {
        min_frames: 2,
        ..FootLock::default()
    };
    let (roots, rotations) = (&mut made.root_positions, &mut made.rotations);
    let locked = lock_feet(&clip.skeleton, &legs, roots, rotations, &contacts, &options);
    (made, contacts, locked)
}

/// Locks the feet of a clip, prints the figures, and checks what must hold for every clip.
fn check_lock(name: &str, clip: &Clip) {
    let (made, contacts, report) = locked(clip);
    let [skates, high, most] = [
        [skate_mm(clip), skate_mm(&made)],
        [acceleration(clip, 0.999), acceleration(&made, 0.999)],
        [acceleration(clip, 1.0), acceleration(&made, 1.0)],
    ];
    println!(
        "{name}: skate {:.2} -> {:.2} mm/frame, worst slide in contact {:.1} -> {:.3} mm, acceleration p99.9 {:.0} -> {:.0}, \
         max {:.0} -> {:.0} m/s2, {report:?}",
        skates[0],
        skates[1],
        slide_mm(clip, &contacts),
        slide_mm(&made, &contacts),
        high[0],
        high[1],
        most[0],
        most[1]
    );
    if report.max_short_m < 1e-4 && report.max_offset_m < 0.249 {
        assert!(slide_mm(&made, &contacts) < 0.1, "{name}");
    }
    assert!(skates[1] < skates[0], "{name}");
    assert!(high[1] < 1.5 * high[0], "{name}");
}

#[test]
fn limbs_of_the_default_pack() {
    let skeleton = skeleton();
    let name = |joint: usize| skeleton.joints[joint].name.as_str();
    let found = legs(&skeleton);
    assert_eq!(found.len(), 2);
    assert_eq!(found[0].chain().map(name), ["UpperLeg_L", "LowerLeg_L", "Foot_L"]);
    assert_eq!(found[1].chain().map(name), ["UpperLeg_R", "LowerLeg_R", "Foot_R"]);
    assert_eq!(found[1].toe.map(name), Some("Toes_R"));
    assert_eq!(
        (found[0].contact_bits(), found[1].contact_bits()),
        (0b0011, 0b1100)
    );
    let arms: Vec<_> = arms(&skeleton).into_iter().map(|arm| arm.map(name)).collect();
    assert_eq!(
        arms,
        [
            ["UpperArm_L", "LowerArm_L", "Hand_L"],
            ["UpperArm_R", "LowerArm_R", "Hand_R"]
        ]
    );
}

#[test]
fn feet_of_the_example_walk_stand() {
    check_lock("example", &example());
}

#[test]
fn feet_of_real_walks_stand() {
    for (name, clip) in captured(&WALKS) {
        check_lock(name, &clip);
    }
}

/// The pose of a clip's first frame, at the origin, with its height.
fn posed(clip: &Clip) -> Posed<'_> {
    Posed {
        root: clip.root_positions[0],
        rotations: clip.rotations_at(0),
    }
}

#[test]
fn seats_tables_and_falls_from_a_real_stand() {
    for (name, clip) in captured(&["dataset-2_raise-up-right-hand_normal_001"]) {
        let (skeleton, stand) = (Arc::clone(&clip.skeleton), posed(&clip));
        let legs = legs(&skeleton);
        let forward = clip.root_at(0).forward();
        let report = |what: &str, from: Posed<'_>, motion: &Motion, most: f64| {
            let made = after(&skeleton, from, motion);
            println!(
                "{name}: {what}: slide in contact {:.3} mm, acceleration p99.5 {:.0} max {:.0} m/s2, short {:.4} m",
                slide_mm(&made, &[&[0], &motion.contacts[..]].concat()),
                acceleration(&made, 0.995),
                acceleration(&made, 1.0),
                motion.short_m
            );
            assert!(acceleration(&made, 1.0) < most, "{what}");
            assert!(motion.short_m < 2e-3, "{what}");
        };
        let mut seat = stand.root - forward * 0.36;
        seat.y = 0.45;
        let sit = pose_at(&skeleton, &legs, stand, seat, 0.15);
        assert!(sit.short_m < 1e-4);
        let down = stance_transition(&skeleton, &legs, stand, sit.posed(), 36, 0.7);
        report("sit down", stand, &down, 25.0);
        let up = stance_transition(&skeleton, &legs, sit.posed(), stand, 36, 0.7);
        report("stand up", sit.posed(), &up, 25.0);

        let hand = skeleton.joint_index("Hand_R").unwrap();
        let right = forward.cross(Vec3::Y);
        for (height, ahead, frames) in [(0.9, 0.4, 24), (0.7, 0.4, 24), (0.4, 0.4, 33), (0.05, 0.3, 33)] {
            let mut point = stand.root + forward * ahead + right * 0.15;
            point.y = height;
            let key = reach_pose(
                &skeleton,
                &legs,
                stand,
                &[(hand, point)],
                &ReachOptions::default(),
            );
            println!(
                "{name}: hand at {height} m, {ahead} m ahead: missed by {:.4} m, bow {:.1}, crouch {:.2} m",
                key.errors_m[0], key.bow, key.crouch_m
            );
            assert!(key.errors_m[0] < if height < 0.4 { 0.12 } else { 2e-3 });
            let pick = stance_transition(&skeleton, &legs, stand, key.posed(), frames, 0.0);
            report("pick up", stand, &pick, 16.0);
        }
        for height in [0.3, 0.6, 1.0, 2.0, 3.0] {
            let drop = Drop {
                velocity: forward * 1.2,
                floor_m: -height,
                wall_s: None,
                standing: stand,
                under_way: &[],
                air: None,
                fps: 30.0,
            };
            let fall = fall_motion(&skeleton, &legs, stand, &drop);
            println!(
                "{name}: fall {height} m: {} frames, lands at {:.1} m/s, depth {:.2} m",
                fall.motion.frames(),
                fall.impact_mps,
                fall.depth_m
            );
            report("fall", stand, &fall.motion, 260.0);
        }
    }
}

/// Walks a clip over a ledge half way, and prints and returns the figures: short (m), and 99.5th
/// percentile of the acceleration relative to flat.
fn over_a_ledge(name: &str, clip: &Clip, height: f32) -> (f32, f64) {
    let (flat, contacts, _) = locked(clip);
    let mut made = flat.clone();
    let (first, last) = (clip.root_positions[0], *clip.root_positions.last().unwrap());
    let (middle, way) = ((first + last) / 2.0, last - first);
    let ground = |x: f32, z: f32| {
        let beyond = (x - middle.x) * way.x + (z - middle.z) * way.z > 0.0;
        if beyond { height } else { 0.0 }
    };
    let legs = legs(&clip.skeleton);
    let (roots, rotations) = (&mut made.root_positions, &mut made.rotations);
    let options = Terrain::default();
    let short = lift_motion(
        &clip.skeleton,
        &legs,
        roots,
        rotations,
        &contacts,
        ground,
        &options,
    );
    let (before, now) = (acceleration(&flat, 0.995), acceleration(&made, 0.995));
    let up =
        |f: usize| (made.root_positions[f + 1] - 2.0 * made.root_positions[f] + made.root_positions[f - 1]).y;
    let root = (1..made.frames() - 1)
        .map(|f| up(f).abs() * 900.0)
        .fold(0.0, f32::max);
    println!(
        "{name}: ledge {height:+.1} m: short {:.1} mm, acceleration p99.5 {before:.0} -> {now:.0}, max {:.0} -> {:.0} m/s2, \
         root up {root:.0} m/s2, slide in contact {:.3} -> {:.3} mm",
        1000.0 * short,
        acceleration(&flat, 1.0),
        acceleration(&made, 1.0),
        slide_mm(&flat, &contacts),
        slide_mm(&made, &contacts)
    );
    (short, now / before)
}

#[test]
fn ledges() {
    for height in [0.0, 0.2, -0.2] {
        let (short, times) = over_a_ledge("example", &example(), height);
        assert!(short < 0.02 && times < 1.5, "{height}: {short} {times}");
    }
}

#[test]
fn real_walks_over_ledges() {
    for (name, clip) in captured(&WALKS) {
        for height in [0.1, 0.2, 0.4, -0.2, -0.4] {
            let (short, times) = over_a_ledge(name, &clip, height);
            assert!(short < 0.03 && times < 1.6, "{name} {height}: {short} {times}");
        }
    }
}
