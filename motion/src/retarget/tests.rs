//! One body's motion on another.

use std::sync::Arc;

use glam::{Quat, Vec3};
use proptest::prelude::*;

use super::*;
use crate::anatomy::{LimbDoc, Parts, PartsDoc, world_of};
use crate::clip::Clip;
use crate::fk::WorldMotion;
use crate::glb;
use crate::read::tests::people::Person;
use crate::read::{Options, RestPose, Source, character, read};
use crate::skeleton::{Joint, Skeleton};

const NUMBERS: [f32; 7] = [0.3, 0.8, 0.1, 0.6, 0.9, 0.2, 0.45];
/// Height of the hips of [`Person`] over its soles, by its size, metres.
pub(super) const HIPS_M: f32 = 0.93;

pub(super) fn person(words: usize, size: f32, spine: usize, rest: RestPose) -> Person {
    Person {
        words,
        size,
        spine,
        rest,
    }
}

pub(super) fn figure(skeleton: &Arc<Skeleton>, size: f32) -> Figure {
    let rest = vec![Quat::IDENTITY; skeleton.joint_count()];
    let skeleton = Arc::clone(skeleton);
    Figure::new(skeleton, &rest, Some(HIPS_M * size), &PartsDoc::default()).unwrap()
}

/// The example of the repository: a walk with its own skeleton.
pub(super) fn example() -> (Clip, Figure) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/walk.bvh");
    let bytes = std::fs::read(path).unwrap();
    let found = read(&Source::new("walk.bvh", &bytes), &Options::default()).unwrap();
    let figure = found.figure(&PartsDoc::default()).unwrap();
    (found.clip, figure)
}

#[test]
fn a_body_keeps_its_own_motion() {
    let of = person(0, 1.0, 3, RestPose::T);
    let mut clip = of.walk(60, 30.0, &NUMBERS);
    let figure = figure(&clip.skeleton, 1.0);
    // Arms and legs point along their bones at rest; elbows bend forwards and knees backwards.
    for (name, axis) in [
        ("LeftForeArm", Vec3::NEG_Y),
        ("RightForeArm", Vec3::Y),
        ("LeftLeg", Vec3::X),
        ("RightLeg", Vec3::X),
    ] {
        let joint = clip.skeleton.joint_index(&format!("mixamorig:{name}")).unwrap();
        for frame in 0..clip.frames() {
            let rotation = &mut clip.rotations_at_mut(frame)[joint];
            let angle = rotation.to_scaled_axis().length();
            *rotation = Quat::from_axis_angle(axis, angle);
        }
    }
    let mut retargeter = Retargeter::new(figure.clone(), figure).unwrap();
    let (made, figures) = retarget(&mut retargeter, &clip).unwrap();
    let worlds = [&clip, &made].map(WorldMotion::from_clip);
    // A knee moves by centimetres if a straight leg is bent by a hair.
    let knees = ["mixamorig:LeftLeg", "mixamorig:RightLeg"];
    for (joint, of) in clip.skeleton.joints.iter().enumerate() {
        for frame in 0..clip.frames() {
            let [a, b] = [0, 1].map(|which: usize| worlds[which].positions_at(frame)[joint]);
            assert!(
                a.distance(b) < 0.02 || knees.contains(&&*of.name),
                "{}: {a} {b}",
                of.name
            );
        }
    }
    assert!(figures.directions_deg < 1.5, "{figures:?}");
}

#[test]
fn walks_are_kept_by_bodies_of_other_sizes_poses_and_names() {
    let (clip, source) = example();
    for (words, size, spine, rest) in [
        (0, 1.0, 3, RestPose::T),
        (1, 0.5, 1, RestPose::A),
        (2, 1.6, 4, RestPose::Standing),
        (3, 1.0, 2, RestPose::A),
    ] {
        let target = figure(&person(words, size, spine, rest).skeleton(), size);
        let mut retargeter = Retargeter::new(source.clone(), target).unwrap();
        let (made, figures) = retarget(&mut retargeter, &clip).unwrap();
        assert_eq!(figures.faults(), [""; 0], "{figures:?}");
        assert!(figures.directions_deg < 3.0, "{figures:?}");
        // The way is as long as the legs say.
        let way = |clip: &Clip| {
            let [first, .., last] = clip.root_positions[..] else {
                unreachable!()
            };
            (last - first).with_y(0.0).length()
        };
        let scaled = way(&clip) * retargeter.scale();
        assert!((way(&made) - scaled).abs() < 0.03 * scaled, "{size}");
    }
}

/// The skeleton with names that say nothing.
fn nameless(skeleton: &Skeleton) -> Arc<Skeleton> {
    let mut made = skeleton.clone();
    for (nth, joint) in made.joints.iter_mut().enumerate() {
        joint.name = format!("bone{nth}");
    }
    Arc::new(made)
}

#[test]
fn bodies_without_known_names_are_found_by_their_shape() {
    for rest in [RestPose::T, RestPose::A] {
        let named = person(0, 1.0, 3, rest).skeleton();
        let [by_name, by_shape] = [&named, &nameless(&named)].map(|skeleton| figure(skeleton, 1.0));
        assert_eq!(by_name.parts().legs, by_shape.parts().legs);
        let arms = |figure: &Figure| figure.parts().arms.clone().unwrap().map(|arm| arm.chain());
        assert_eq!(arms(&by_name), arms(&by_shape));
        assert_eq!(by_name.parts().trunk, by_shape.parts().trunk);
    }
}

#[test]
fn a_document_corrects_the_parts() {
    let skeleton = nameless(&person(0, 1.0, 1, RestPose::T).skeleton());
    let found = figure(&skeleton, 1.0);
    let doc = PartsDoc::of(found.parts(), &skeleton);
    let rest = vec![Quat::IDENTITY; skeleton.joint_count()];
    let with = |doc: &PartsDoc| Figure::new(Arc::clone(&skeleton), &rest, None, doc);
    assert_eq!(with(&doc).unwrap().parts(), found.parts());
    let wrong = PartsDoc {
        left_arm: Some(LimbDoc {
            lower: Some(vec!["wing".to_owned()]),
            ..LimbDoc::default()
        }),
        ..PartsDoc::default()
    };
    let error = with(&wrong).unwrap_err().to_string();
    assert_eq!(
        error,
        "left_arm.lower names \"wing\"; allowed: a joint of the skeleton"
    );
}

#[test]
fn a_document_says_that_a_body_has_no_arms() {
    let skeleton = person(0, 1.0, 1, RestPose::T).skeleton();
    let rest = vec![Quat::IDENTITY; skeleton.joint_count()];
    let none = || {
        Some(LimbDoc {
            end: Some(String::new()),
            ..LimbDoc::default()
        })
    };
    let doc = PartsDoc {
        left_arm: none(),
        right_arm: none(),
        ..PartsDoc::default()
    };
    let parts = |doc: &PartsDoc| Parts::with(&skeleton, &world_of(&skeleton, &rest), doc);
    let bare = parts(&doc).unwrap();
    assert!(parts(&PartsDoc::default()).unwrap().arms.is_some());
    assert_eq!(bare.arms, None);
    assert_eq!(parts(&PartsDoc::of(&bare, &skeleton)).unwrap(), bare);
    let legless = PartsDoc {
        left_leg: none(),
        ..PartsDoc::default()
    };
    assert_eq!(
        parts(&legless).unwrap_err(),
        "left_leg.end names \"\"; allowed: a joint of the skeleton"
    );
}

#[test]
fn what_a_limb_of_a_document_leaves_out_stays_as_it_was_found() {
    let skeleton = person(0, 1.0, 1, RestPose::T).skeleton();
    let found = figure(&skeleton, 1.0);
    let rest = vec![Quat::IDENTITY; skeleton.joint_count()];
    let with = |leg: LimbDoc| {
        let doc = PartsDoc {
            left_leg: Some(leg),
            ..PartsDoc::default()
        };
        Figure::new(Arc::clone(&skeleton), &rest, None, &doc)
    };
    let known = &found.parts().legs[0];
    let name = |joint: usize| skeleton.joints[joint].name.clone();
    let same = with(LimbDoc {
        end: Some(name(known.end)),
        ..LimbDoc::default()
    });
    assert_eq!(same.unwrap().parts(), found.parts());
    let bare = with(LimbDoc {
        toe: Some(String::new()),
        ..LimbDoc::default()
    });
    let bare = bare.unwrap();
    assert_eq!(
        (bare.parts().legs[0].toe, bare.parts().legs[0].end),
        (None, known.end)
    );
    let other = found.parts().legs[1].lower[0];
    let crossed = with(LimbDoc {
        lower: Some(vec![name(other)]),
        ..LimbDoc::default()
    });
    let error = crossed.unwrap_err().to_string();
    let [other, top] = [other, known.top].map(name);
    let wanted = format!("left_leg.lower names {other:?}, which does not hang on {top:?}");
    assert!(error.starts_with(&wanted), "{error}");
}

#[test]
fn what_is_no_body_is_refused() {
    let mut chain = (*person(0, 1.0, 1, RestPose::T).skeleton()).clone();
    chain.joints.truncate(4);
    let rest = vec![Quat::IDENTITY; 4];
    let none = PartsDoc::default();
    let error = Figure::new(Arc::new(chain), &rest, None, &none)
        .unwrap_err()
        .to_string();
    assert!(error.contains("no body is found"), "{error}");
    let skeleton = person(0, 1.0, 3, RestPose::T).skeleton();
    let mut lying = vec![Quat::IDENTITY; skeleton.joint_count()];
    lying[0] = Quat::from_rotation_x(1.5);
    let error = Figure::new(skeleton, &lying, None, &none)
        .unwrap_err()
        .to_string();
    assert!(error.contains("87° away from upwards"), "{error}");
}

/// The G1 of the repository's pack.
pub(super) fn g1() -> Arc<Skeleton> {
    #[derive(serde::Deserialize)]
    struct Tables {
        skeleton: Skeleton,
        robot: crate::robot::RobotDoc,
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../models/g1/pack.toml");
    let tables: Tables = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    Arc::new(tables.skeleton.with_robot(&tables.robot).unwrap())
}

#[test]
fn a_robot_keeps_its_limits() {
    let g1 = g1();
    let (clip, source) = example();
    let target = Figure::of_robot(Arc::clone(&g1), &PartsDoc::default()).unwrap();
    // The document of its parts gives the same parts again.
    let doc = PartsDoc::of(target.parts(), &g1);
    let again = Figure::of_robot(Arc::clone(&g1), &doc).unwrap();
    assert_eq!(again.parts(), target.parts());
    let mut retargeter = Retargeter::new(source, target).unwrap();
    let (made, figures) = retarget(&mut retargeter, &clip).unwrap();
    assert_eq!(figures.faults(), [""; 0], "{figures:?}");
    let robot = g1.robot.as_ref().unwrap();
    let mut fitted = crate::robot::Fitted::default();
    for frame in 0..made.frames() {
        let mut pose = made.rotations_at(frame).to_vec();
        robot.fit(&mut pose, &mut fitted);
        assert!(
            fitted.residual_rad < 1e-3 && fitted.clamped == 0,
            "frame {frame}: {fitted:?}"
        );
    }
}

#[test]
fn a_character_gets_one_animation_more() {
    let (clip, source) = example();
    let hero = person(1, 0.7, 2, RestPose::A).walk(1, 30.0, &NUMBERS);
    let file = glb::write_glb(&hero).unwrap();
    let mut retargeter = Retargeter::new(source, figure(&hero.skeleton, 0.7)).unwrap();
    let (made, _) = retarget(&mut retargeter, &clip).unwrap();
    let dressed = glb::add_animation_at(&file, &glb::FileJoints::default(), &made, "walk").unwrap();
    let dressed = glb::add_animation_at(&dressed, &glb::FileJoints::default(), &made, "walk").unwrap();
    let names = glb::animation_names(&dressed).unwrap();
    assert_eq!(names[names.len() - 2..], ["walk", "walk_2"]);
    let options = Options {
        animation: Some("walk".to_owned()),
        ..Options::default()
    };
    let again = read(&Source::new("hero.glb", &dressed), &options).unwrap().clip;
    assert_eq!(again.frames(), made.frames());
    let worlds = [&again, &made].map(WorldMotion::from_clip);
    for (joint, of) in made.skeleton.joints.iter().enumerate() {
        let read = again.skeleton.joint_index(&of.name).unwrap();
        for frame in 0..made.frames() {
            let (a, b) = (
                worlds[0].positions_at(frame)[read],
                worlds[1].positions_at(frame)[joint],
            );
            assert!(a.distance(b) < 1e-4, "{}: {a} {b}", of.name);
        }
    }
    let unknown = Clip::new(
        nameless(&made.skeleton),
        30.0,
        made.root_positions.clone(),
        made.rotations.clone(),
    );
    let error = glb::add_animation_at(&file, &glb::FileJoints::default(), &unknown.unwrap(), "walk")
        .unwrap_err()
        .to_string();
    assert!(error.contains("\"bone0\" is not the name of one node"), "{error}");
    // Without a skin it is read by its animation.
    assert!(character(&Source::new("hero.glb", &file), &Options::default()).is_ok());
}

#[test]
fn poses_of_the_same_motion_are_the_same_again() {
    let (clip, source) = example();
    let target = figure(&person(0, 0.8, 3, RestPose::T).skeleton(), 0.8);
    let mut retargeter = Retargeter::new(source, target).unwrap();
    let first = retarget(&mut retargeter, &clip).unwrap().0;
    assert_eq!(retarget(&mut retargeter, &clip).unwrap().0, first);
    assert!(first.root_positions.iter().all(|root: &Vec3| root.is_finite()));
}

/// Random turns, one a joint.
/// A clip at another rate.
fn resampled(clip: &Clip, fps: f32) -> Clip {
    let count = ((clip.frames() - 1) as f32 / clip.fps * fps) as usize + 1;
    let (mut roots, mut rotations) = (Vec::new(), Vec::new());
    for frame in 0..count {
        let at = frame as f32 * clip.fps / fps;
        let from = (at as usize).min(clip.frames() - 2);
        let share = at - from as f32;
        roots.push(clip.root_positions[from].lerp(clip.root_positions[from + 1], share));
        let pairs = clip.rotations_at(from).iter().zip(clip.rotations_at(from + 1));
        rotations.extend(pairs.map(|(a, b)| crate::rotation::slerp(*a, *b, share)));
    }
    Clip::new(clip.skeleton.clone(), fps, roots, rotations).unwrap()
}

#[test]
fn feet_turn_as_fast_at_every_rate() {
    let (clip, source) = example();
    let target = person(0, 1.4, 3, RestPose::T).walk(2, 30.0, &NUMBERS);
    let mut retargeter = Retargeter::new(source, figure(&target.skeleton, 1.4)).unwrap();
    // Headings of both feet, ten times a second.
    let mut headings = |fps: f32, every: usize| {
        let clip = resampled(&clip, fps);
        let mut pose = vec![Quat::IDENTITY; target.skeleton.joint_count()];
        retargeter.reset();
        retargeter.set_step(1.0 / fps);
        let each = 0..clip.frames();
        let headings = each.map(|frame| {
            retargeter.pose(clip.root_positions[frame], clip.rotations_at(frame), &mut pose);
            let [left, right, ..] = retargeter.memory.headings;
            [left.unwrap(), right.unwrap()]
        });
        headings.step_by(every).collect::<Vec<_>>()
    };
    let usual = headings(30.0, 3);
    let most = usual.iter().map(|two| two[0]).fold(f32::MIN, f32::max);
    let least = usual.iter().map(|two| two[0]).fold(f32::MAX, f32::min);
    assert!(most - least > 0.2, "they turn: {least} to {most}");
    for (fps, every) in [(50.0, 5), (60.0, 6)] {
        let other = headings(fps, every);
        let pairs = usual.iter().flatten().zip(other.iter().flatten());
        let apart = pairs.map(|(a, b)| wrap_angle(a - b).abs()).fold(0.0, f32::max);
        assert!(apart < 0.03, "{fps} Hz: {apart} rad");
    }
    // The same moment again changes nothing.
    let before = retargeter.memory();
    retargeter.set_step(0.0);
    let mut pose = vec![Quat::IDENTITY; target.skeleton.joint_count()];
    retargeter.pose(clip.root_positions[9], clip.rotations_at(9), &mut pose);
    assert_eq!(retargeter.memory(), before);
}

fn any_turns(joints: usize) -> impl Strategy<Value = Vec<Vec3>> {
    let turn = [-1.2_f32..1.2, -1.2_f32..1.2, -1.2_f32..1.2];
    proptest::collection::vec(turn.prop_map(Vec3::from), joints)
}

proptest! {
    #[test]
    fn knees_never_bend_the_wrong_way(
        mut turns in any_turns(24),
        (size, spine) in (0.5_f32..1.6, 1_usize..4),
    ) {
        let source = figure(&person(0, 1.0, 3, RestPose::T).skeleton(), 1.0);
        let target = figure(&person(2, size, spine, RestPose::A).skeleton(), size);
        // Knees bend either way, and a little to the sides.
        source.parts.legs.iter().for_each(|leg| turns[leg.lower[0]] *= Vec3::new(1.0, 0.2, 0.2));
        let turned = turns[..source.skeleton.joint_count()].iter();
        let pose: Vec<Quat> = turned.map(|turn| Quat::from_scaled_axis(*turn)).collect();
        let mut out = vec![Quat::IDENTITY; target.skeleton.joint_count()];
        let mut retargeter = Retargeter::new(source, target.clone()).unwrap();
        retargeter.pose(Vec3::Y * HIPS_M, &pose, &mut out);
        let world = world_of(&target.skeleton, &out);
        for limb in &target.parts.legs {
            let turn = |joint: usize| world[joint] * target.neutral[joint].conjugate();
            let lower = turn(limb.upper[0]).conjugate() * turn(limb.lower[0]) * Vec3::NEG_Y;
            prop_assert!(lower.z < 0.09, "{lower}");
        }
    }
}

#[test]
fn hands_hold_on_to_places() {
    let (clip, source) = example();
    let target = figure(&person(0, 0.7, 3, RestPose::T).skeleton(), 0.7);
    let mut retargeter = Retargeter::new(source, target.clone()).unwrap();
    let mut out = vec![Quat::IDENTITY; target.skeleton.joint_count()];
    let mut pose = |hands: [Option<Vec3>; 2]| {
        retargeter.reset();
        let holds = Holds { hands, hips: 0.0 };
        let root = retargeter.pose_holding(clip.root_positions[0], clip.rotations_at(0), holds, &mut out);
        let world = WorldMotion::from_clip(
            &Clip::new(Arc::clone(&target.skeleton), 30.0, vec![root], out.clone()).unwrap(),
        );
        (
            world,
            retargeter.short_m(),
            retargeter.short_joint(),
            retargeter.scale(),
        )
    };
    let wrists = target.parts.arms.as_ref().unwrap().each_ref().map(|arm| arm.end);
    let (free, ..) = pose([None; 2]);
    let ahead = yaw(clip.root_at(0).heading) * Vec3::new(0.15, 1.2, 0.3);
    let place = clip.root_positions[0].with_y(0.0) + ahead;
    let (held, short_m, _, scale) = pose([Some(place), None]);
    let [left, right] = wrists.map(|wrist| held.positions_at(0)[wrist]);
    assert!(
        left.distance(place * scale) < 1e-3 && short_m < 1e-3,
        "{left} {place} {short_m}"
    );
    assert_eq!(right, free.positions_at(0)[wrists[1]]);
    let [before, after] = [&free, &held].map(|world| world.rotations_at(0)[wrists[0]]);
    assert!(before.angle_between(after) < 2e-3);
    // Out of reach: as near as the arm comes.
    let far = place + Vec3::Y;
    let (held, short_m, joint, _) = pose([None, Some(far)]);
    let left_m = held.positions_at(0)[wrists[1]].distance(far * scale);
    assert!(
        short_m > 0.3 && (short_m - left_m).abs() < 1e-3,
        "{short_m} {left_m}"
    );
    assert_eq!(joint, Some(wrists[1]));
}

#[test]
fn hips_on_a_seat_are_as_far_above_the_ground_as_the_sources() {
    let (clip, source) = example();
    let target = person(0, 1.8, 3, RestPose::T).skeleton();
    // Its hips are 15 cm higher over its soles than the other's in that size: thick soles.
    let rest = vec![Quat::IDENTITY; target.joint_count()];
    let root_y_m = Some(1.8 * HIPS_M + 0.15);
    let target = Figure::new(target, &rest, root_y_m, &PartsDoc::default()).unwrap();
    let mut retargeter = Retargeter::new(source.clone(), target.clone()).unwrap();
    let mut out = rest.clone();
    let mut height = |hips: f32| {
        let down = clip.root_positions[0] - 0.35 * Vec3::Y;
        retargeter.reset();
        let holds = Holds {
            hips,
            ..Holds::default()
        };
        let root = retargeter.pose_holding(down, clip.rotations_at(0), holds, &mut out);
        let place = |skeleton: &Arc<Skeleton>, root: Vec3, pose: &[Quat], hips: [usize; 2]| {
            let made = Clip::new(Arc::clone(skeleton), 30.0, vec![root], pose.to_vec()).unwrap();
            let world = WorldMotion::from_clip(&made);
            0.5 * (world.positions_at(0)[hips[0]].y + world.positions_at(0)[hips[1]].y)
        };
        let from = place(&clip.skeleton, down, clip.rotations_at(0), source.hips());
        let to = place(&target.skeleton, root, &out, target.hips());
        to - retargeter.scale() * from
    };
    let [free, half, held] = [0.0, 0.5, 1.0].map(&mut height);
    assert!(held.abs() < 1e-4, "{held}");
    assert!(
        free.abs() > 0.03 && (half - 0.5 * free).abs() < 1e-4,
        "{free} {half}"
    );
}

#[test]
fn twists_share_the_roll_of_the_next_joint() {
    let source = figure(&person(0, 1.0, 1, RestPose::T).skeleton(), 1.0);
    // A twist between elbow and wrist, and one beside the wrist.
    let mut skeleton = (*source.skeleton).clone();
    let elbow = skeleton.joint_index("mixamorig:LeftForeArm").unwrap();
    let hand = skeleton.joint_index("mixamorig:LeftHand").unwrap();
    let bone = skeleton.joints[hand].offset_m;
    for (name, at) in [("LeftForeArmTwist", 0.5), ("LeftForeArmRoll", 0.75)] {
        skeleton.joints.push(Joint {
            name: name.to_owned(),
            parent: Some(elbow),
            offset_m: bone * at,
        });
    }
    let target = figure(&Arc::new(skeleton), 1.0);
    let mut pose = vec![Quat::IDENTITY; source.skeleton.joint_count()];
    pose[hand] = Quat::from_rotation_x(0.8) * Quat::from_rotation_y(0.3);
    let mut out = vec![Quat::IDENTITY; target.skeleton.joint_count()];
    let mut retargeter = Retargeter::new(source, target).unwrap();
    retargeter.pose(Vec3::Y * HIPS_M, &pose, &mut out);
    for (joint, share) in [(out.len() - 2, 0.5), (out.len() - 1, 0.75)] {
        let wanted = Quat::from_rotation_x(0.8 * share);
        assert!(out[joint].angle_between(wanted) < 0.02, "{}", out[joint]);
    }
    assert!(out[elbow].angle_between(Quat::IDENTITY) < 1e-3);
}
