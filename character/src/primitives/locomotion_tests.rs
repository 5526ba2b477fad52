use std::f32::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use proptest::prelude::*;
use troupe_motion::root::heading_of;
use troupe_motion::rotation::angle_between;
use troupe_motion::{LocalRoot, Skeleton};

use super::*;
use crate::primitives::recipe::{CHANGE_RATIO, GAMMA, MAX_TURN, MOST_TURN_RPS, TARGET_KEYS};
use crate::style::testing::{walker, walker_style};

const FPS: f32 = 30.0;
const LAST: usize = 33;

fn command(style: &Arc<Style>, x: f32, z: f32, facing: Option<f32>) -> LocomotionCommand {
    LocomotionCommand {
        velocity: Vec3::new(x, 0.0, z),
        facing,
        style: Arc::clone(style),
        gait: None,
        height_m: None,
    }
}

/// A context in the pose of `style`'s blend for a velocity straight ahead, moving at that velocity,
/// at a given phase.
struct Scene {
    skeleton: Arc<Skeleton>,
    roots: [GlobalRoot; 4],
    rotations: Vec<Quat>,
    velocity: Vec3,
}

impl Scene {
    fn new(style: &Style, at: Vec3, heading: f32, speed: f32, phase: f32) -> Self {
        let skeleton = walker();
        let wanted = Wanted {
            left_mps: 0.0,
            forward_mps: speed,
            turn_rps: 0.0,
            height_m: None,
        };
        let blend = Blend::new(style, style.cycles(&skeleton), None, &wanted);
        let velocity = yaw(heading) * Vec3::new(0.0, 0.0, speed);
        let mut rotations = Vec::new();
        let roots = std::array::from_fn(|frame| {
            let back = 3.0 - frame as f32;
            let mut pose = vec![Quat::IDENTITY; 6];
            let moment = blend.sample(phase - back * blend.rate, 0, &mut pose);
            pose[0] = yaw(heading) * pose[0];
            rotations.extend(pose);
            let position = at - velocity * (back / FPS);
            GlobalRoot::new(position.with_y(moment.height_m), heading)
        });
        Self {
            skeleton,
            roots,
            rotations,
            velocity,
        }
    }

    fn standing(style: &Style) -> Self {
        Self::new(style, Vec3::ZERO, 0.0, 0.0, 0.0)
    }

    fn at(&self, frame: u64) -> PlanContext<'_> {
        PlanContext {
            frame,
            roots: self.roots,
            rotations: &self.rotations,
            velocity: self.velocity,
            seed: 0,
            skeleton: &self.skeleton,
            fps: FPS,
            frames_per_token: 4,
            plan_frames: None,
        }
    }
}

fn style() -> Arc<Style> {
    Arc::new(walker_style())
}

fn only(names: &[&str]) -> Arc<Style> {
    let mut style = walker_style();
    style.gaits.retain(|gait| names.contains(&gait.name.as_str()));
    Arc::new(style)
}

fn target(plan: &PlanTargets) -> (GlobalRoot, LocalRoot, &[Quat]) {
    let key = plan.targets.last().unwrap();
    (
        key.root.unwrap(),
        key.velocity.unwrap(),
        key.rotations.as_deref().unwrap(),
    )
}

/// Frames of the poses in the gap.
fn poses_at(plan: &PlanTargets) -> Vec<usize> {
    plan.gap_poses.iter().map(|pose| pose.frame).collect()
}

/// Frames for a standing character, and for one that stops or turns a little: late, because its
/// feet must step freely until then.
const STANDS: [usize; 1] = [18];
const STOPS: [usize; 1] = [27];

#[test]
fn a_plan_is_a_second_long_with_one_target_at_its_end() {
    let style = style();
    let scene = Scene::standing(&style);
    let plan = Locomotion::new(0, 0.0, FPS, command(&style, 0.0, 1.2, None)).plan(&scene.at(4));
    assert_eq!((plan.frames, plan.targets.len()), (Some(34), TARGET_KEYS));
    let guide = plan.guide.as_ref().unwrap();
    assert_eq!((guide.path.len(), plan.r_g2.len()), (34, 34));
    assert_eq!(
        (guide.position_ratio, guide.heading_ratio),
        (CHANGE_RATIO, 1.0),
        "it starts"
    );
    assert_eq!(plan.r_g2[..4], scene.roots);
    assert_eq!(guide.path[..3], scene.roots[..3]);
    let poses: Vec<usize> = plan.gap_poses.iter().map(|pose| pose.frame).collect();
    assert_eq!(poses, [18]);
    let (root, _, pose) = target(&plan);
    assert!(
        root.position
            .with_y(0.0)
            .distance(plan.r_g2[LAST].position.with_y(0.0))
            < 1e-6
    );
    assert!(
        (heading_of(pose[0], Vec3::X) - root.heading).abs() < 1e-5,
        "pose and root face one way"
    );
    assert!(wrap_angle(guide.path[LAST].heading - root.heading).abs() < 1e-5);
}

#[test]
fn a_longer_plan_has_its_target_further_ahead_and_poses_as_far_apart() {
    let style = style();
    let scene = Scene::new(&style, Vec3::ZERO, 0.0, 1.2, 0.1);
    let plan = |frames: Option<usize>, x: f32| {
        let mut context = scene.at(40);
        context.plan_frames = frames;
        Locomotion::new(0, 0.0, FPS, command(&style, x, 1.2, Some(0.0))).plan(&context)
    };
    let (usual, same, long) = (plan(None, 0.0), plan(Some(34), 0.0), plan(Some(64), 0.0));
    assert_eq!(usual, same);
    assert_eq!(
        (
            long.frames,
            long.r_g2.len(),
            long.guide.as_ref().unwrap().path.len()
        ),
        (Some(64), 64, 64)
    );
    let frames = |plan: &PlanTargets| plan.gap_poses.iter().map(|pose| pose.frame).collect::<Vec<_>>();
    assert_eq!((frames(&usual), frames(&long)), (vec![18], vec![18, 33, 48]));
    assert_eq!(
        (frames(&plan(Some(34), 1.2)), frames(&plan(Some(40), 1.2))),
        (vec![9, 15, 21, 27], vec![9, 15, 21, 27, 33])
    );
    assert_eq!(frames(&plan(Some(64), 1.2)), [9, 15, 21, 27, 33, 39, 45, 51, 57]);
    // The first second is the same: the pose in the middle and the path.
    assert_eq!(usual.gap_poses[0], long.gap_poses[0]);
    let path = |plan: &PlanTargets| plan.guide.as_ref().unwrap().path.clone();
    for (a, b) in path(&usual).iter().zip(path(&long)) {
        assert!(a.position.distance(b.position) < 0.01, "{a:?} {b:?}");
    }
    // The target is two seconds ahead, at the phase that the gait has then.
    let (root, velocity, pose) = target(&long);
    assert!((root.position.z - 2.4).abs() < 0.02, "{root:?}");
    assert!((velocity.vz - 1.2).abs() < 0.1);
    let phases = (plan(Some(63), 0.0), plan(Some(34), 0.0));
    let apart = |other: &PlanTargets| {
        let (_, _, other) = target(other);
        pose.iter()
            .zip(other)
            .map(|(a, b)| angle_between(*a, *b))
            .fold(0.0, f32::max)
    };
    assert!(
        apart(&phases.0) < apart(&phases.1),
        "a frame later is nearer than a second"
    );
}

#[test]
fn r_g2_is_the_closed_form() {
    let style = style();
    let scene = Scene::new(&style, Vec3::new(3.0, 0.0, -2.0), 0.4, 1.2, 0.3);
    // At the character's own speed: a change would follow the ramp.
    let (x, z) = 0.4f32.sin_cos();
    let command = command(&style, 1.2 * x, 1.2 * z, Some(0.9));
    let velocity = command.velocity;
    let mut locomotion = Locomotion::new(50, 0.4, FPS, command);
    let plan = locomotion.plan(&scene.at(54));
    let r0 = scene.roots[3].position;
    assert!(
        plan.r_g1
            .position
            .with_y(0.0)
            .distance((r0 + velocity).with_y(0.0))
            < 1e-3
    );
    assert!((plan.r_g1.heading - 0.9).abs() < 1e-6);
    for (frame, root) in plan.r_g2.iter().enumerate().skip(4) {
        let t = (frame - 3) as f32 / FPS;
        let (d, v0) = (r0 - plan.r_g1.position, scene.velocity);
        let want = (d + (v0 + d * GAMMA) * t) * (-GAMMA * t).exp() + plan.r_g1.position;
        assert!(root.position.distance(want) < 1e-4, "frame {frame}");
        // The heading spring has moved since the command, four frames before the context's last.
        let mut spring = HeadingSpring::new(50, 0.4);
        spring.turn_to(50, FPS, Some(0.9), MOST_TURN_RPS);
        let want = spring.at(51 + frame as u64, FPS).0;
        assert!((root.heading - want).abs() < 1e-4, "frame {frame}");
    }
}

#[test]
fn the_target_pose_continues_the_step() {
    let style = style();
    for (speed, phase) in [(1.2, 0.1), (1.2, 0.8), (3.0, 0.45), (2.1, 0.6)] {
        let scene = Scene::new(&style, Vec3::ZERO, 0.0, speed, phase);
        let mut locomotion = Locomotion::new(0, 0.0, FPS, command(&style, 0.0, speed, None));
        let plan = locomotion.plan(&scene.at(4));
        let wanted = Wanted {
            left_mps: 0.0,
            forward_mps: speed,
            turn_rps: 0.0,
            height_m: None,
        };
        let blend = Blend::new(&style, style.cycles(&scene.skeleton), None, &wanted);
        let mut want = vec![Quat::IDENTITY; 6];
        blend.sample(phase + 30.0 * blend.rate, 0, &mut want);
        let (_, velocity, pose) = target(&plan);
        for joint in [2, 4] {
            assert!(
                angle_between(pose[joint], want[joint]) < 0.06,
                "{speed} m/s, joint {joint}"
            );
        }
        assert!((velocity.vz - speed).abs() < 0.15 && velocity.vx.abs() < 0.05);
        let (root, sway) = (target(&plan).0, blend.moment(phase + 30.0 * blend.rate, 0).sway);
        assert!(
            (root.heading - sway).abs() < 0.03,
            "the pelvis sways with the step"
        );
    }
}

#[test]
fn a_turn_is_finished_a_second_after_the_command_however_often_it_is_planned() {
    let style = style();
    let mut locomotion = Locomotion::new(0, 0.0, FPS, command(&style, 0.0, 1.2, None));
    locomotion.set_command(60, command(&style, 1.2, 0.0, None));
    for splice in [64, 73, 82, 91] {
        // A character that lags behind does not hold the spring back.
        let scene = Scene::new(&style, Vec3::ZERO, 0.3, 1.2, 0.0);
        let plan = locomotion.plan(&scene.at(splice));
        let at = |frame: u64| (3 + frame - splice) as usize;
        let heading = plan.r_g2[at(90.max(splice + 1))].heading;
        assert!(
            (heading - FRAC_PI_2).abs().to_degrees() < 1.0,
            "planned at {splice}: {heading}"
        );
    }
}

#[test]
fn a_reversal_turns_by_the_short_way_and_not_too_far_at_once() {
    let style = style();
    let scene = Scene::new(&style, Vec3::ZERO, 0.0, 1.2, 0.0);
    for side in [1.0, -1.0] {
        let mut locomotion = Locomotion::new(0, 0.0, FPS, command(&style, 0.0, 1.2, None));
        locomotion.set_command(10, command(&style, side * 0.01, -1.2, None));
        let plan = locomotion.plan(&scene.at(14));
        let end = plan.r_g2[LAST].heading * side;
        assert!(end > 1.5 && end < MAX_TURN + 0.01, "{end}");
        let (root, velocity, _) = target(&plan);
        assert!(
            root.position.z < -0.4 && velocity.vz < -1.0,
            "it goes back already"
        );
        // Nearly there: the next plan ends the turn.
        let scene = Scene::new(&style, Vec3::ZERO, side * 2.0, 1.0, 0.0);
        let end = locomotion.plan(&scene.at(40)).r_g2[LAST].heading;
        assert!(wrap_angle(end - PI).abs() < 0.05, "{end}");
    }
}

#[test]
fn headings_wrap() {
    let style = style();
    let scene = Scene::new(&style, Vec3::ZERO, 3.1, 1.2, 0.0);
    let mut locomotion = Locomotion::new(0, 3.1, FPS, command(&style, 0.0, 1.2, Some(-3.1 + 4.0 * PI)));
    let plan = locomotion.plan(&scene.at(4));
    for root in plan.r_g2.iter().chain(&plan.guide.unwrap().path) {
        assert!(root.heading > -PI && root.heading <= PI);
        assert!(root.heading.abs() > 2.7, "the short way: {}", root.heading);
    }
}

#[test]
fn stopping_comes_to_rest_and_is_held_after_a_second() {
    let style = style();
    let walking = Scene::new(&style, Vec3::new(0.0, 0.0, 5.0), 0.0, 1.2, 0.2);
    let mut locomotion = Locomotion::new(0, 0.0, FPS, command(&style, 0.0, 1.2, None));
    locomotion.set_command(30, command(&style, 0.0, 0.0, None));
    let plan = locomotion.plan(&walking.at(34));
    let (root, velocity, _) = target(&plan);
    assert!(root.position.z > 5.0 && root.position.z < 5.2, "{root:?}");
    assert!(velocity.vx == 0.0 && velocity.vz == 0.0);
    assert_eq!(plan.gaits, [("idle".to_owned(), 1.0)]);
    assert_eq!(poses_at(&plan), STOPS);
    assert!(root.heading.abs() < 1e-3, "its heading is unchanged");

    // An early plan starts from wherever the character is, a later one from where it stood then.
    let stands = |x: f32| Scene::new(&style, Vec3::new(x, 0.0, 5.1), 0.0, 0.0, 0.0);
    let x = |locomotion: &mut Locomotion, at: f32, frame| {
        target(&locomotion.plan(&stands(at).at(frame))).0.position.x
    };
    assert!((x(&mut locomotion, 0.1, 50) - 0.1).abs() < 1e-5);
    assert!((x(&mut locomotion, 0.2, 61) - 0.2).abs() < 1e-5);
    assert!((x(&mut locomotion, 0.3, 70) - 0.2).abs() < 0.01);
    assert!((x(&mut locomotion, 0.5, 900) - 0.2).abs() < 0.01);
    // Until it moves again.
    locomotion.set_command(900, command(&style, 0.0, 1.0, None));
    locomotion.set_command(910, command(&style, 0.0, 0.0, None));
    assert!((x(&mut locomotion, 0.5, 914) - 0.5).abs() < 1e-5);
}

#[test]
fn infeasible_velocities_become_the_nearest_feasible() {
    let style = style();
    let scene = Scene::standing(&style);
    let mut locomotion = Locomotion::new(0, 0.0, FPS, command(&style, 8.0, 0.0, Some(0.0)));
    let plan = locomotion.plan(&scene.at(4));
    let way = plan.r_g1.position - scene.roots[3].position;
    assert!(way.x > 0.4 && way.x < 1.5 && way.z.abs() < 1e-4, "{way}");
    let (root, velocity, pose) = target(&plan);
    assert!(velocity.vx < 1.6 && root.position.is_finite());
    assert!(pose.iter().all(|q| (q.length() - 1.0).abs() < 1e-5));
}

#[test]
fn a_style_change_keeps_the_spring_and_the_step() {
    let brisk = style();
    let mut other = walker_style();
    other.name = "sneak".to_owned();
    for key in other.gaits.iter_mut().flat_map(|gait| &mut gait.keys) {
        key.rotations[1] = Quat::from_rotation_x(0.5);
        key.height_m -= 0.05;
    }
    let other = Arc::new(other);
    let scene = Scene::new(&brisk, Vec3::ZERO, 0.2, 1.2, 0.35);
    let mut stays = Locomotion::new(0, 0.2, FPS, command(&brisk, 1.0, 1.0, None));
    let mut changes = stays.clone();
    stays.set_command(7, command(&brisk, 1.0, 1.0, None));
    changes.set_command(7, command(&other, 1.0, 1.0, None));
    let (a, b) = (stays.plan(&scene.at(11)), changes.plan(&scene.at(11)));
    for (a, b) in a.r_g2.iter().zip(&b.r_g2) {
        assert!(
            (a.heading - b.heading).abs() < 1e-5
                && a.position.with_y(0.0).distance(b.position.with_y(0.0)) < 1e-5
        );
    }
    let ((_, _, a), (_, _, b)) = (target(&a), target(&b));
    assert!(angle_between(a[2], b[2]) < 0.05, "the legs go on in step");
    assert!((angle_between(a[1], b[1]) - 0.5).abs() < 1e-3, "the back bends");
}

#[test]
fn an_unknown_gait_leaves_the_choice_to_the_velocity() {
    let style = style();
    let scene = Scene::new(&style, Vec3::ZERO, 0.0, 3.0, 0.0);
    let plan = |gait: Option<&str>| {
        let gait = gait.map(str::to_owned);
        let command = LocomotionCommand {
            gait,
            ..command(&style, 0.0, 3.0, None)
        };
        Locomotion::new(0, 0.0, FPS, command).plan(&scene.at(4))
    };
    assert_eq!(plan(Some("moonwalk")), plan(None));
    let walk = plan(Some("walk"));
    assert_eq!(walk.gaits, [("walk".to_owned(), 1.0)]);
    assert!(
        walk.r_g1.position.z < 1.8,
        "as fast as that gait goes, once it has slowed down"
    );
}

#[test]
fn token_counts_of_a_style_set_the_length() {
    let scene = Scene::standing(&style());
    let plan = |counts: &[u32]| {
        let mut style = walker_style();
        style.allowed_token_counts = counts.to_vec();
        let style = Arc::new(style);
        Locomotion::new(0, 0.0, FPS, command(&style, 0.0, 1.2, None)).plan(&scene.at(4))
    };
    let short = plan(&[6]);
    assert_eq!((short.frames, short.r_g2.len()), (Some(24), 24));
    // A character takes 0.3 s to reach 1.2 m/s.
    let starts = 1.2 * 0.15;
    assert!((short.r_g1.position.z - (1.2 * 20.0 / FPS - starts)).abs() < 1e-4);
    let free = plan(&[7, 10]);
    assert_eq!((free.frames, free.guide.unwrap().path.len()), (None, 40));
    assert_eq!(free.allowed_token_counts, [7, 10]);
    assert!((free.r_g1.position.z - (1.2 - starts)).abs() < 1e-4);
}

#[test]
fn the_guide_is_a_smooth_way_to_the_target() {
    let style = style();
    let scene = Scene::new(&style, Vec3::ZERO, 0.0, 1.2, 0.0);
    let mut locomotion = Locomotion::new(0, 0.0, FPS, command(&style, 1.2, 0.0, None));
    let plan = locomotion.plan(&scene.at(4));
    let path = plan.guide.unwrap().path;
    assert!(
        path[LAST]
            .position
            .with_y(0.0)
            .distance(plan.r_g2[LAST].position.with_y(0.0))
            < 1e-5
    );
    let step = |frame: usize| (path[frame + 1].position - path[frame].position) * FPS;
    assert!(
        step(3).distance(scene.velocity) < 0.2 && step(LAST - 1).with_y(0.0).distance(Vec3::X * 1.2) < 0.2
    );
    for frame in 3..LAST - 1 {
        assert!(
            (step(frame + 1) - step(frame)).length() < 0.3,
            "no jerk at {frame}"
        );
    }
}

proptest! {
    #[test]
    fn any_command_gives_a_sound_and_repeatable_plan(
        commands in proptest::collection::vec(
            (1u64..20, -9.0f32..9.0, -9.0f32..9.0, proptest::option::of(-7.0f32..7.0), proptest::option::of(0.0f32..2.0)),
            1..6,
        ),
        heading in -PI..PI, speed in 0.0f32..3.0, phase in 0.0f32..1.0,
    ) {
        let style = style();
        let scene = Scene::new(&style, Vec3::new(4.0, 0.0, 1.0), heading, speed, phase);
        let mut a = Locomotion::new(0, heading, FPS, command(&style, 0.0, 0.0, None));
        let mut b = a.clone();
        let mut frame = 0;
        for (wait, x, z, facing, height_m) in commands {
            frame += wait;
            let next = LocomotionCommand { height_m, ..command(&style, x, z, facing) };
            a.set_command(frame, next.clone());
            b.set_command(frame, next);
            let (a, b) = (a.plan(&scene.at(frame + 4)), b.plan(&scene.at(frame + 4)));
            prop_assert_eq!(&a, &b);
            let (root, velocity, pose) = target(&a);
            prop_assert!(root.position.is_finite() && root.position.distance(scene.roots[3].position) < 4.0);
            prop_assert!(velocity.to_array().iter().all(|v| v.is_finite() && v.abs() < 8.0));
            prop_assert!(pose.iter().all(|q| (q.length() - 1.0).abs() < 1e-5));
            let ahead = wrap_angle(a.r_g2[LAST].heading - heading).abs();
            prop_assert!(ahead <= MAX_TURN + 0.02, "{ahead}");
            let sum: f32 = a.gaits.iter().map(|(_, weight)| weight).sum();
            prop_assert!((sum - 1.0).abs() < 1e-4);
            for pose in &a.gap_poses {
                prop_assert!(pose.frame > 3 && pose.frame < LAST);
            }
        }
    }
}

#[path = "locomotion_gap_tests.rs"]
mod gap;
