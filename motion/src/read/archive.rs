//! NumPy archives: which layout one has, Troupe's own, BeyondMimic's, and SONIC's folder of CSV
//! files.

use glam::{DQuat, DVec3};

use super::adapted::Arrays;
use super::choices::{Advice, Choice, OptionName};
use super::error::ReadErrorKind;
use super::joints::{self, Parsed};
use super::options::{JointOrder, Options, QuaternionOrder};
use super::report::{Basis, Finding, Format, Topic, Up};
use super::robot::{ROOT, Rows, Usual, columns_error, fps_of, robot_of, understand};
use super::robot_checks::bare;
use super::stance::Stated;
use super::table::Table;
use super::units::UNITS;
use super::{Source, Understood, kimodo, smpl, text};
use crate::clip::{MAX_FRAMES, MAX_ROTATIONS};
use crate::files::NumpyError;
use crate::files::npz::Unpacked;
use crate::fk::WorldMotion;
use crate::robot::{Robot, TRACKER_FPS};
use crate::skeleton::Skeleton;

/// Most bodies of a robot.
const MAX_BODIES: usize = 1024;
/// Farthest that a body of a file may be from the robot's own, metres, on average.
const MAX_BODY_ERROR_M: f32 = 0.02;

pub(super) fn read(file: &str, bytes: &[u8], options: &Options) -> Result<Understood, ReadErrorKind> {
    let mut archive = Unpacked::open(bytes)?;
    if archive.has("joint_pos") && archive.has("body_quat_w") {
        return beyond_mimic(file, &mut archive, options);
    }
    let parsed = parse(&mut archive, options)?;
    joints::understand(file, parsed, options)
}

/// An archive of joints.
fn parse(archive: &mut Unpacked<'_>, options: &Options) -> Result<Parsed<'static>, ReadErrorKind> {
    if archive.has("quaternions") && archive.has("joint_names") {
        own(archive, options)
    } else if kimodo::is_kimodo(archive) {
        kimodo::parse(archive, options)
    } else if smpl::is_amass(archive) {
        smpl::parse(archive, options)
    } else {
        let mut names = archive.names();
        names.truncate(16);
        let reason = "no motion that is read: Troupe's has quaternions and joint_names, AMASS's trans and poses, \
                      Kimodo's posed_joints and global_rot_mats, BeyondMimic's joint_pos and body_quat_w";
        Err(NumpyError::array(&names.join(", "), reason).into())
    }
}

/// Troupe's own archive.
fn own(archive: &mut Unpacked<'_>, options: &Options) -> Result<Parsed<'static>, ReadErrorKind> {
    let names = archive.texts("joint_names")?;
    let count = names.len();
    let (frames, roots) = archive.rows("root", &[3])?;
    if count == 0 || frames > MAX_FRAMES.min(MAX_ROTATIONS / count) {
        let reason = format!("{frames} frames of {count} joints");
        return Err(NumpyError::array("root", reason).into());
    }
    let (rows, quaternions) = archive.rows("quaternions", &[count, 4])?;
    if rows != frames {
        return Err(NumpyError::array("quaternions", format!("{rows} frames, but root has {frames}")).into());
    }
    let fps = own_fps(archive, options)?;
    let (joints, parents) = archive.rows("parents", &[])?;
    let (with_offset, offsets) = archive.rows("offsets", &[3])?;
    let parent = |(joint, &parent): (usize, &f32)| match parent {
        parent if parent < 0.0 && joint == 0 => Ok(None),
        parent if parent >= 0.0 && (parent as usize) < joint => Ok(Some(parent as usize)),
        parent => {
            let reason = format!("that of joint {joint} is {parent}; parents come before their children");
            Err(NumpyError::array("parents", reason))
        }
    };
    let parents = parents
        .iter()
        .enumerate()
        .map(parent)
        .collect::<Result<Vec<_>, _>>()?;
    if joints != count || with_offset != count {
        let reason = format!("{joints} joints, but joint_names has {count}");
        return Err(NumpyError::array("parents", reason).into());
    }
    let vectors = |numbers: &[f32]| -> Vec<DVec3> {
        let vectors = numbers.chunks_exact(3);
        vectors
            .map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into()))
            .collect()
    };
    let turn = |(at, q): (usize, &[f32])| {
        let turn = DQuat::from_xyzw(q[1].into(), q[2].into(), q[3].into(), q[0].into());
        match (turn.length() - 1.0).abs() <= 1e-3 {
            true => Ok(turn.normalize()),
            false => {
                let reason = format!(
                    "frame {}, joint {:?}: no unit length",
                    at / count,
                    names[at % count]
                );
                Err(NumpyError::array("quaternions", reason))
            }
        }
    };
    let rotations = quaternions
        .chunks_exact(4)
        .enumerate()
        .map(turn)
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Parsed {
        source: Box::new(Arrays {
            names,
            parents,
            offsets: vectors(&offsets),
            roots: vectors(&roots),
            rotations,
            fps: fps.value,
        }),
        format: Finding::new(
            Format::Npz,
            Basis::Found,
            "it has the arrays quaternions and joint_names",
        ),
        producer: Some(Finding::new(
            "Troupe".to_owned(),
            Basis::Found,
            "the names of its arrays",
        )),
        skeleton: None,
        stated: Stated {
            up: Some(Up::Y),
            unit_m: Some(1.0),
            units: &UNITS,
            may_be_y_up: false,
            by: "Troupe is Y up and in metres",
        },
        fps,
        repairs: Vec::new(),
        oddities: Vec::new(),
    })
}

/// The rate that an option gives, or the array `fps`.
fn own_fps(archive: &mut Unpacked<'_>, options: &Options) -> Result<Finding<f32>, ReadErrorKind> {
    smpl::stated_rate(archive, options)?.ok_or_else(|| ReadErrorKind::Range {
        field: "array \"fps\"".to_owned(),
        found: "missing".to_owned(),
        allowed: "one number from 1 to 1000".to_owned(),
        option: Some(Advice::decides(Choice::any(OptionName::Fps))),
    })
}

fn beyond_mimic(
    file: &str,
    archive: &mut Unpacked<'_>,
    options: &Options,
) -> Result<Understood, ReadErrorKind> {
    let (skeleton, robot) = robot_of(options)?;
    let hinges = robot.hinges().len();
    let (shape, _) = archive.floats("joint_pos")?;
    if let [_, columns] = shape[..]
        && columns as usize != hinges
    {
        return Err(columns_error(columns as usize + ROOT, robot, skeleton));
    }
    let (frames, angles) = archive.rows("joint_pos", &[hinges])?;
    let (shape, _) = archive.floats("body_pos_w")?;
    let bodies = shape.get(1).map_or(0, |&bodies| bodies as usize);
    let (placed, places) = archive.rows("body_pos_w", &[bodies, 3])?;
    let (turned, turns) = archive.rows("body_quat_w", &[bodies, 4])?;
    if placed != frames || turned != frames || frames == 0 || !(1..=MAX_BODIES).contains(&bodies) {
        let reason = format!("{placed} frames of {bodies} bodies; joint_pos has {frames} frames");
        return Err(NumpyError::array("body_pos_w", reason).into());
    }
    let fps = own_fps(archive, options)?;
    let mut texts = |name: &str| archive.has(name).then(|| archive.texts(name)).transpose();
    let named = texts("joint_names")?;
    let names = texts("body_names")?;
    if let Some(names) = names.as_ref().filter(|names| names.len() != bodies) {
        let reason = format!("{} names, but body_pos_w has {bodies} bodies", names.len());
        return Err(NumpyError::array("body_names", reason).into());
    }
    let joints = joints_of_bodies(names.as_deref(), bodies, skeleton, robot);
    let root = joints.iter().position(|joint| *joint == Some(0));
    let body = root.unwrap_or(0);
    let wide: Vec<f64> = places.iter().map(|&n| n.into()).collect();
    let turns: Vec<f64> = turns.iter().map(|&n| n.into()).collect();
    let rows = Rows {
        places: wide
            .chunks_exact(3 * bodies)
            .map(|places| DVec3::from_slice(&places[3 * body..]))
            .collect(),
        quaternions: turns
            .chunks_exact(4 * bodies)
            .map(|turns| &turns[4 * body..])
            .map(|q| [q[0], q[1], q[2], q[3]])
            .collect(),
        angles: angles.into_iter().map(f64::from).collect(),
    };
    let usual = Usual {
        format: Finding::new(
            Format::BeyondMimic,
            Basis::Found,
            "it has the arrays joint_pos and body_quat_w",
        ),
        producer: Some(Finding::new(
            "BeyondMimic".to_owned(),
            Basis::Found,
            "the names of its arrays",
        )),
        quaternion: QuaternionOrder::Wxyz,
        is_quaternion_fixed: false,
        is_order_fixed: true,
        order: named.map_or(JointOrder::BreadthFirst, JointOrder::Named),
        fps,
        first_column: 1,
    };
    let mut understood = understand(file, rows, usual, options)?;
    if let (None, Some(names)) = (root, names) {
        let text = format!(
            "body_names has no {:?}: its first body, {:?}, is read as the root",
            skeleton.joints[0].name, names[0]
        );
        understood.report.odd(Topic::JointOrder, text);
    }
    compare_bodies(&mut understood, &places, &joints);
    Ok(understood)
}

/// For each body, the joint that it hangs on, by name. Without names it is known if the bodies are
/// the root and the links of all hinges.
fn joints_of_bodies(
    names: Option<&[String]>,
    bodies: usize,
    skeleton: &Skeleton,
    robot: &Robot,
) -> Vec<Option<usize>> {
    let joint = |name: &String| {
        let mut joints = skeleton.joints.iter();
        joints.position(|joint| bare(&joint.name) == bare(name))
    };
    match names {
        Some(names) => names.iter().map(joint).collect(),
        None if bodies == 1 + robot.hinges().len() => {
            let order = robot.breadth_first().into_iter();
            let joints = order.map(|hinge| Some(robot.hinges()[hinge].joint));
            std::iter::once(Some(0)).chain(joints).collect()
        }
        None => Vec::new(),
    }
}

/// Compares the places of the bodies with those of the robot's own links, if it is known which
/// bodies they are.
fn compare_bodies(understood: &mut Understood, places: &[f32], joints: &[Option<usize>]) {
    let Understood { clip, report, .. } = understood;
    if joints.is_empty() || places.len() != 3 * joints.len() * clip.frames() {
        return;
    }
    let world = WorldMotion::from_clip(clip);
    let (mut sum_m, mut count) = (0.0, 0);
    for (frame, places) in places.chunks_exact(3 * joints.len()).enumerate() {
        for (joint, place) in joints.iter().zip(places.chunks_exact(3)) {
            let Some(joint) = *joint else {
                continue;
            };
            let place = glam::Vec3::from_slice(place);
            let place = crate::conventions::Convention::Ros.position_to_native(place);
            sum_m += world.positions_at(frame)[joint].distance(place);
            count += 1;
        }
    }
    let mean_m = sum_m / count.max(1) as f32;
    if mean_m > MAX_BODY_ERROR_M {
        let text = format!(
            "the bodies stand {mean_m:.3} m from the robot's links on average: are the robot, --joint-order and \
             --quaternion right?"
        );
        report.odd(Topic::JointOrder, text);
    }
}

/// SONIC's folder, by its `joint_pos.csv`; the other files are beside it.
pub(super) fn sonic(source: &Source<'_>, options: &Options) -> Result<Understood, ReadErrorKind> {
    let (skeleton, robot) = robot_of(options)?;
    let hinges = robot.hinges().len();
    let angles = Table::parse(&text::decode(source.bytes).text)?;
    if angles.columns != hinges {
        return Err(columns_error(angles.columns + ROOT, robot, skeleton));
    }
    let beside = |name: &str, width: usize| -> Result<Table, ReadErrorKind> {
        let bytes = (source.beside)(name).ok_or_else(|| {
            ReadErrorKind::Robot(format!(
                "{name} is missing beside it; the root is in body_pos.csv and body_quat.csv"
            ))
        })?;
        let table = Table::parse(&text::decode(&bytes).text)?;
        match table.rows() == angles.rows() && table.columns.is_multiple_of(width) {
            true => Ok(table),
            false => Err(ReadErrorKind::Robot(format!(
                "{name} has {} rows of {} columns; it must have {} rows, and {width} columns a body",
                table.rows(),
                table.columns,
                angles.rows()
            ))),
        }
    };
    let places = beside("body_pos.csv", 3)?;
    let turns = beside("body_quat.csv", 4)?;
    let rows = Rows {
        places: places
            .numbers
            .chunks_exact(places.columns)
            .map(DVec3::from_slice)
            .collect(),
        quaternions: turns
            .numbers
            .chunks_exact(turns.columns)
            .map(|q| [q[0], q[1], q[2], q[3]])
            .collect(),
        angles: angles.numbers,
    };
    let evidence = "joint_pos.csv with body_pos.csv and body_quat.csv beside it";
    let usual = Usual {
        format: Finding::new(Format::Sonic, Basis::Found, evidence),
        producer: Some(Finding::new("SONIC".to_owned(), Basis::Found, evidence)),
        quaternion: QuaternionOrder::Wxyz,
        is_quaternion_fixed: true,
        is_order_fixed: true,
        order: JointOrder::BreadthFirst,
        fps: fps_of(
            options,
            Some(Finding::new(
                TRACKER_FPS,
                Basis::Stated,
                "SONIC's motions have 50 Hz",
            )),
        ),
        first_column: 1,
    };
    let mut understood = understand(source.name, rows, usual, options)?;
    if places.numbers.iter().all(|&number| number == 0.0) {
        let text = "body_pos.csv is all zero: the root does not move";
        understood.report.odd(Topic::Ground, text);
    }
    Ok(understood)
}
