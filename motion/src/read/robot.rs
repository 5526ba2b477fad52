//! Motion of robots as numbers: the root's place and quaternion, and the hinges' angles. One set of
//! checks for every format: order of the quaternion, unit and order of the angles, limits, upright.

use std::sync::Arc;

use glam::{DQuat, DVec3, Quat, Vec3};

use super::Understood;
use super::choices::OptionName;
use super::error::ReadErrorKind;
use super::joints::finish;
use super::options::{AngleUnit, JointOrder, LeadingPose, Options, QuaternionOrder};
use super::report::{Basis, Finding, Format, Report, RestPose, Topic, Up};
use super::robot_checks as checks;
use crate::clip::{Clip, MAX_ROTATIONS};
use crate::conventions::Convention;
use crate::robot::Robot;
use crate::skeleton::Skeleton;

/// Rate of files without one, Hz.
pub(super) const USUAL_FPS: f32 = 30.0;
/// Largest difference of a quaternion from unit length: some files have three digits.
const UNIT_TOLERANCE: f64 = 0.02;
/// Numbers of the root before the angles.
pub(super) const ROOT: usize = 7;

/// Rows of a file, one a frame: place, quaternion as it stands, angles as they stand.
pub(super) struct Rows {
    pub(super) places: Vec<DVec3>,
    pub(super) quaternions: Vec<[f64; 4]>,
    /// `frames * hinges`.
    pub(super) angles: Vec<f64>,
}

/// What a format says about the numbers.
pub(super) struct Usual {
    pub(super) format: Finding<Format>,
    pub(super) producer: Option<Finding<String>>,
    pub(super) quaternion: QuaternionOrder,
    /// Whether the format or the header leaves no doubt about the quaternion's order.
    pub(super) is_quaternion_fixed: bool,
    /// Whether the format or the header leaves no doubt about the order of the hinges.
    pub(super) is_order_fixed: bool,
    pub(super) order: JointOrder,
    pub(super) fps: Finding<f32>,
    /// As columns are counted in messages: of the first angle, from 1.
    pub(super) first_column: usize,
}

/// The robot of the skeleton to read onto.
pub(super) fn robot_of(options: &Options) -> Result<(&Arc<Skeleton>, &Robot), ReadErrorKind> {
    let skeleton = options.skeleton.as_ref();
    let robot = skeleton.and_then(|skeleton| Some((skeleton, skeleton.robot.as_ref()?)));
    robot.ok_or(ReadErrorKind::NoRobot)
}

/// The rate that an option gives, or the usual one.
pub(super) fn fps_of(options: &Options, stated: Option<Finding<f32>>) -> Finding<f32> {
    match (options.fps, stated) {
        (Some(fps), _) => Finding::new(fps, Basis::Given, "--fps"),
        (None, Some(stated)) => stated,
        (None, None) => {
            let why = "the file has no rate; Unitree's and Kimodo's have 30; --fps decides";
            Finding::new(USUAL_FPS, Basis::Assumed, why)
        }
    }
}

/// Turns rows into a clip, or says what does not fit the robot.
pub(super) fn understand(
    file: &str,
    mut rows: Rows,
    usual: Usual,
    options: &Options,
) -> Result<Understood, ReadErrorKind> {
    refuse_unused(options)?;
    let (skeleton, robot) = robot_of(options)?;
    let (frames, joints) = (rows.places.len(), skeleton.joint_count());
    if frames > MAX_ROTATIONS / joints {
        return Err(ReadErrorKind::Robot(format!("{frames} frames are too many")));
    }
    let text = |text: &str| text.to_owned();
    let name = format!("robot {}", robot.name());
    let mut report = Report {
        file: file.to_owned(),
        format: usual.format.clone(),
        producer: usual.producer.clone(),
        skeleton: Finding::new(name, Basis::Given, format!("{} hinges", robot.hinges().len())),
        up: Finding::new(Up::Z, Basis::Stated, "robots' files are Z up, X ahead"),
        unit_m: Finding::new(1.0, Basis::Stated, "robots' files are in metres"),
        fps: usual.fps.clone(),
        rest_pose: Finding::new(RestPose::None, Basis::Stated, "hinges at angle 0"),
        frames,
        joints,
        nodes: Vec::new(),
        contacts: Finding::new(Vec::new(), Basis::Stated, ""),
        repairs: Vec::new(),
        oddities: Vec::new(),
    };
    for (frame, quaternion) in rows.quaternions.iter_mut().enumerate() {
        let length = quaternion.iter().map(|n| n * n).sum::<f64>().sqrt();
        if length.is_nan() || (length - 1.0).abs() > UNIT_TOLERANCE {
            return Err(ReadErrorKind::Range {
                field: format!("frame {frame}: the length of the root's quaternion"),
                found: format!("{length:.3}"),
                allowed: text("0.98 to 1.02"),
                option: None,
            });
        }
        quaternion.iter_mut().for_each(|n| *n /= length);
    }
    let order = checks::quaternion_order(
        &rows,
        usual.quaternion,
        usual.is_quaternion_fixed,
        options,
        &mut report,
    )?;
    checks::angles(&mut rows, robot, skeleton, &usual, options, &mut report)?;
    let turns: Vec<DQuat> = rows.quaternions.iter().map(|&q| checks::turn(q, order)).collect();
    checks::upright(&turns, &mut report);
    let mut roots = Vec::with_capacity(frames);
    let mut rotations = vec![Quat::IDENTITY; frames * joints];
    let hinges = robot.hinges().len();
    let mut angles = vec![0.0; hinges];
    for (frame, pose) in rotations.chunks_exact_mut(joints).enumerate() {
        let place: Vec3 = rows.places[frame].as_vec3();
        roots.push(Convention::Ros.position_to_native(place));
        for (to, from) in angles.iter_mut().zip(&rows.angles[frame * hinges..]) {
            *to = *from as f32;
        }
        robot.pose(
            Convention::Ros.rotation_to_native(turns[frame].as_quat()),
            &angles,
            pose,
        );
    }
    let clip = Clip::new(Arc::clone(skeleton), report.fps.value, roots, rotations)?;
    finish(clip, None, report, options)
}

/// Numbers of rows `[frames, 7 + hinges]`: place, quaternion, angles.
pub(super) fn rows_of(numbers: &[f64], columns: usize) -> Rows {
    let mut rows = Rows {
        places: Vec::new(),
        quaternions: Vec::new(),
        angles: Vec::new(),
    };
    for row in numbers.chunks_exact(columns) {
        rows.places.push(DVec3::new(row[0], row[1], row[2]));
        rows.quaternions.push([row[3], row[4], row[5], row[6]]);
        rows.angles.extend(&row[ROOT..]);
    }
    rows
}

/// Refuses options that a robot's file leaves no room for.
fn refuse_unused(options: &Options) -> Result<(), ReadErrorKind> {
    let given = [
        (OptionName::Up, options.up.is_some()),
        (OptionName::Unit, options.unit_m.is_some()),
        (OptionName::Root, options.root.is_some()),
        (OptionName::RestPose, options.rest_pose.is_some()),
        (OptionName::MaxSlide, options.max_slide_m.is_some()),
        (
            OptionName::LeadingPose,
            options.leading_pose != LeadingPose::default(),
        ),
    ];
    match given.into_iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => Err(ReadErrorKind::Unused(option)),
        None => Ok(()),
    }
}

/// That a file has another number of columns than the robot.
pub(super) fn columns_error(found: usize, robot: &Robot, skeleton: &Skeleton) -> ReadErrorKind {
    let hinges = robot.hinges().len();
    let followers: Vec<&str> = (robot.mimics().iter())
        .map(|mimic| &*skeleton.joints[mimic.joint].name)
        .collect();
    let left_out = match followers.is_empty() {
        true => String::new(),
        false => format!(
            "; joints that follow others have no column: {}",
            followers.join(", ")
        ),
    };
    ReadErrorKind::Robot(format!(
        "{found} columns; robot {} has {}: 7 of the root and {hinges} angles{left_out}",
        robot.name(),
        ROOT + hinges
    ))
}

/// The unit of angles as a factor to radians.
pub(super) fn to_radians(unit: AngleUnit) -> f64 {
    match unit {
        AngleUnit::Radians => 1.0,
        AngleUnit::Degrees => std::f64::consts::PI / 180.0,
    }
}

/// Notes that the quaternion was read in another order than usual.
pub(super) fn note_quaternion(report: &mut Report, order: QuaternionOrder, evidence: &str) {
    let order = match order {
        QuaternionOrder::Xyzw => "x y z w",
        QuaternionOrder::Wxyz => "w x y z",
    };
    report.repaired(
        Topic::Quaternion,
        format!("the root's quaternion is {order}: {evidence}"),
    );
}
