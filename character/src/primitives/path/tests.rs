use std::f32::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;

use super::*;
use crate::Path;
use crate::primitives::{Locomotion, PlanContext};
use crate::style::testing::{walker, walker_style};
use crate::style::{PLAIN, Words};
use troupe_motion::{GlobalRoot, Quat};

const FPS: f32 = 30.0;

fn style() -> Arc<Style> {
    Arc::new(walker_style())
}

/// A style of a pack that plans by paths.
fn words() -> Arc<Style> {
    Arc::new(Style {
        name: PLAIN.to_owned(),
        words: Some(Words {
            weights: vec![("walk".to_owned(), 1.0)],
            max_speed_mps: 4.0,
        }),
        ..walker_style()
    })
}

fn point(x: f32, z: f32, time_s: Option<f32>) -> AskedPoint {
    AskedPoint {
        position: Vec3::new(x, 7.0, z),
        heading: None,
        time_s,
    }
}

fn made(points: &[AskedPoint], speed_mps: Option<f32>, is_loop: bool) -> PathCommand {
    PathCommand::new(&Path::root(), points, speed_mps, is_loop, style()).unwrap()
}

fn wrong(points: &[AskedPoint], speed_mps: Option<f32>) -> (String, String) {
    let error = PathCommand::new(&Path::root(), points, speed_mps, false, style()).unwrap_err();
    (error.field, error.allowed)
}

fn corner() -> PathCommand {
    made(
        &[
            point(0.0, 0.0, None),
            point(0.0, 3.0, None),
            point(3.0, 3.0, None),
        ],
        Some(1.0),
        false,
    )
}

#[test]
fn it_passes_its_points_at_their_times() {
    let path = corner();
    let times: Vec<f32> = path.points.iter().map(|point| point.time_s).collect();
    assert_eq!(times, [0.0, 3.0, 6.0]);
    for point in &path.points[..2] {
        assert!(path.at(point.time_s).position.distance(point.position) < 1e-4);
    }
    // It comes to stand at its last point, a little later.
    let end = path.at(path.ends_s().unwrap());
    assert_eq!(
        (end.position, end.velocity),
        (path.points[2].position, Vec3::ZERO)
    );
    assert_eq!(path.ends_s(), Some(6.0 + EASE_S / 2.0));
    // It faces the direction of travel.
    assert!((path.at(1.0).heading - 0.0).abs() < 0.2 && (path.at(5.5).heading - FRAC_PI_2).abs() < 0.2);
    assert!((path.at(3.0).heading - FRAC_PI_2 / 2.0).abs() < 1e-3);
}

#[test]
fn it_has_no_jumps() {
    let loops = made(
        &[
            point(0.0, 0.0, Some(0.5)),
            point(0.0, 2.0, Some(2.0)),
            point(2.0, 2.0, Some(4.0)),
        ],
        None,
        true,
    );
    for path in [corner(), loops] {
        let step = 0.01;
        for frame in 0..2000 {
            let [a, b] = [frame, frame + 1].map(|frame| path.at(frame as f32 * step));
            assert!(a.position.distance(b.position) < 0.04, "at {frame}");
            assert!(a.velocity.distance(b.velocity) < 0.15, "at {frame}: {a:?} {b:?}");
        }
    }
}

#[test]
fn a_loop_begins_again() {
    let path = made(
        &[
            point(0.0, 0.0, None),
            point(0.0, 2.0, None),
            point(2.0, 2.0, None),
        ],
        Some(1.0),
        true,
    );
    let round = path.round_s().unwrap();
    assert!((round - (4.0 + 8f32.sqrt())).abs() < 1e-3, "{round}");
    for t in [0.0, 1.3, 3.9, 5.0, round - 0.01] {
        let (a, b) = (path.at(t), path.at(t + 3.0 * round));
        assert!(a.position.distance(b.position) < 1e-3 && a.velocity.distance(b.velocity) < 1e-2);
    }
    assert_eq!(path.ends_s(), None);
    // A path that is already closed takes no time for the way back.
    let square = [(0.0, 0.0), (0.0, 2.0), (2.0, 2.0), (0.0, 0.0)].map(|(x, z)| point(x, z, None));
    assert!((made(&square, Some(1.0), true).round_s().unwrap() - (4.0 + 8f32.sqrt())) < 0.05);
}

#[test]
fn it_waits_where_points_stay() {
    let stays = [(0.0, 0.0), (2.0, 2.0), (2.0, 7.0), (5.0, 9.0)].map(|(z, time)| point(0.0, z, Some(time)));
    let path = made(&stays, None, false);
    for t in [2.0, 3.0, 5.0, 7.0] {
        assert!((path.at(t).position.z - 2.0).abs() < 1e-4, "at {t}");
        assert_eq!(path.at(t).heading, 0.0);
    }
}

#[test]
fn headings_turn_the_short_way() {
    let facing = |x, heading| AskedPoint {
        heading: Some(heading),
        ..point(x, 0.0, None)
    };
    let path = made(&[facing(0.0, 3.0), facing(1.0, -3.0)], Some(1.0), false);
    let middle = wrap_angle(path.at(0.5).heading - PI);
    assert!(middle.abs() < 0.01, "{middle}");
}

#[test]
fn errors_name_the_field() {
    let two = [point(0.0, 0.0, None), point(0.0, 1.0, None)];
    assert_eq!(wrong(&two[..1], None), ("points".into(), "2 to 1024".into()));
    assert_eq!(wrong(&[two[0]; 1025], None).0, "points");
    for speed in [0.0, f32::NAN, 16.0] {
        assert_eq!(
            wrong(&two, Some(speed)),
            ("speed".into(), "0.05 to 15 m/s".into())
        );
    }
    let timed = |times: [Option<f32>; 2]| [point(0.0, 0.0, times[0]), point(0.0, 30.0, times[1])];
    for (times, field, allowed) in [
        (
            [Some(0.0), None],
            "points[1].time",
            "a time for all points, or for none",
        ),
        ([Some(1.0), Some(1.0)], "points[1].time", "times that increase"),
        ([Some(0.0), Some(1.0)], "points[1].time", "at most 15 m/s"),
        ([Some(-1.0), Some(9.0)], "points[0].time", "0 to 600 s"),
        ([Some(0.0), Some(f32::NAN)], "points[1].time", "0 to 600 s"),
        ([Some(0.0), Some(601.0)], "points[1].time", "0 to 600 s"),
    ] {
        assert_eq!(wrong(&timed(times), None), (field.into(), allowed.into()));
    }
    assert_eq!(wrong(&timed([Some(0.0), Some(9.0)]), Some(1.0)).0, "speed");
    let far = [point(0.0, 0.0, None), point(0.0, 700.0, None)];
    assert_eq!(wrong(&far, Some(1.0)), ("points".into(), "at most 600 s".into()));
    let mut still = walker_style();
    still.gaits.truncate(1);
    let error = PathCommand::new(&Path::root(), &two, None, false, Arc::new(still)).unwrap_err();
    assert_eq!(error.field, "style");
}

/// A body that follows its plans exactly, and plans at a fixed interval.
struct Follower {
    locomotion: Locomotion,
    roots: [GlobalRoot; 4],
    frame: u64,
    /// Distance from the path's clock in each frame from a second after the command on, metres.
    off_m: Vec<f32>,
}

impl Follower {
    fn new(at: Vec3, path: PathCommand) -> Self {
        let standing = crate::primitives::LocomotionCommand::standing(&path.style);
        let mut locomotion = Locomotion::new(0, 0.0, FPS, standing);
        locomotion.set_path(0, path);
        Self {
            locomotion,
            roots: [GlobalRoot::new(at.with_y(0.9), 0.0); 4],
            frame: 0,
            off_m: Vec::new(),
        }
    }

    /// Goes on until the path ends, for at most `frames` frames.
    fn run(&mut self, frames: u64) -> Option<run::PathEnd> {
        let skeleton = walker();
        let rotations = vec![Quat::IDENTITY; 4 * skeleton.joint_count()];
        let until = self.frame + frames;
        while self.frame < until {
            let plan = self.locomotion.plan(&PlanContext {
                frame: self.frame,
                roots: self.roots,
                rotations: &rotations,
                velocity: (self.roots[3].position - self.roots[2].position).with_y(0.0) * FPS,
                seed: 0,
                skeleton: &skeleton,
                fps: FPS,
                frames_per_token: 4,
                plan_frames: None,
            });
            for next in &plan.r_g2[4..13] {
                self.frame += 1;
                self.roots.rotate_left(1);
                let step = (next.position - self.roots[2].position).with_y(0.0).length();
                assert!(
                    next.position.is_finite() && next.heading.is_finite() && step < 1.0,
                    "{step} m"
                );
                self.roots[3] = *next;
                if let Some(end) = self.locomotion.end_path(self.frame, next.position) {
                    return Some(end);
                }
                let path = self.locomotion.path().unwrap();
                let near = path.at(self.frame as f32 / FPS).position;
                self.off_m.push(near.distance(next.position.with_y(0.0)));
            }
        }
        None
    }
}

#[test]
fn it_is_followed_from_the_character_to_its_end() {
    for style in [style(), words()] {
        let path = PathCommand { style, ..corner() };
        let mut follower = Follower::new(Vec3::new(0.2, 0.0, -0.1), path);
        let end = follower.run(600).unwrap();
        assert!(end.late_s < 0.3 && end.off_m < 0.02, "{end:?}");
        let late = follower.off_m.iter().skip(30).fold(0.0, |a: f32, &b| a.max(b));
        assert!(late < 0.3, "{late} m off");
        let stands = follower.locomotion.command();
        assert_eq!(stands.velocity, Vec3::ZERO);
        assert!((stands.facing.unwrap() - FRAC_PI_2).abs() < 0.1);
    }
}

#[test]
fn a_character_far_away_goes_there_first() {
    let mut follower = Follower::new(Vec3::new(-4.0, 0.0, 0.0), corner());
    let end = follower.run(900).unwrap();
    assert!((2.0..6.0).contains(&end.late_s) && end.off_m < 0.05, "{end:?}");
}

#[test]
fn a_path_that_is_too_fast_is_followed_late() {
    let fast = made(
        &[point(0.0, 0.0, Some(0.0)), point(0.0, 60.0, Some(6.0))],
        None,
        false,
    );
    let end = Follower::new(Vec3::ZERO, fast).run(900).unwrap();
    // The walker is no faster than its run.
    assert!(end.late_s > 2.0 && end.off_m < 0.2, "{end:?}");
}

#[test]
fn a_loop_goes_on() {
    let round = made(
        &[
            point(0.0, 0.0, None),
            point(0.0, 2.0, None),
            point(2.0, 2.0, None),
        ],
        Some(1.0),
        true,
    );
    let mut follower = Follower::new(Vec3::ZERO, round);
    assert_eq!(follower.run(3000), None);
    let late = follower.off_m.iter().skip(30).fold(0.0, |a: f32, &b| a.max(b));
    assert!(late < 0.1, "{late} m off");
}

prop_compose! {
    fn any_points()(steps in prop::collection::vec((-9.0f32..9.0, -9.0f32..9.0, 0.034f32..3.0, prop::option::of(-7.0f32..7.0)), 2..40)) -> Vec<AskedPoint> {
        let mut time_s = 0.0;
        let first = steps[0];
        steps.iter().map(|&(x, z, step_s, heading)| {
            time_s += step_s;
            AskedPoint {
                position: Vec3::new(x - first.0, 0.0, z - first.1),
                heading,
                time_s: Some(time_s),
            }
        }).collect()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_path_gives_finite_plans(points in any_points(), is_loop: bool, timed: bool, by_words: bool) {
        let style = if by_words { words() } else { style() };
        let points: Vec<AskedPoint> = points.iter().map(|point| AskedPoint {
            time_s: point.time_s.filter(|_| timed),
            ..*point
        }).collect();
        let speed = (!timed).then_some(2.0);
        if let Ok(path) = PathCommand::new(&Path::root(), &points, speed, is_loop, style) {
            for step in 0..400 {
                let moment = path.at(step as f32 * 0.37);
                prop_assert!(moment.position.is_finite() && moment.velocity.is_finite() && moment.heading.is_finite());
                prop_assert!(moment.position.length() < 80.0);
            }
            Follower::new(Vec3::new(1.0, 0.0, 1.0), path).run(120);
        }
    }
}
