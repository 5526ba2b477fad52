//! NumPy archives: which layout one has, Troupe's own, BeyondMimic's, and SONIC's folder of CSV
//! files.

use glam::{DQuat, DVec3};

use super::adapted::Arrays;
use super::error::ReadErrorKind;
use super::joints::{self, Parsed};
use super::options::{JointOrder, Options, QuaternionOrder};
use super::report::{Basis, Finding, Format, Topic, Up};
use super::robot::{ROOT, Rows, Usual, columns_error, fps_of, robot_of, understand};
use super::stance::Stated;
use super::table::Table;
use super::{Source, Understood, kimodo, smpl, text};
use crate::clip::{MAX_FRAMES, MAX_ROTATIONS};
use crate::files::NumpyError;
use crate::files::npz::Unpacked;
use crate::fk::WorldMotion;
use crate::robot::TRACKER_FPS;

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

/// An archive of joints, for a survey too.
pub(super) fn parse(archive: &mut Unpacked<'_>, options: &Options) -> Result<Parsed<'static>, ReadErrorKind> {
    if archive.has("quaternions") && archive.has("joint_names") {
        own(archive)
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
fn own(archive: &mut Unpacked<'_>) -> Result<Parsed<'static>, ReadErrorKind> {
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
    let (_, fps) = archive.floats("fps")?;
    let [fps] = fps[..] else {
        return Err(NumpyError::array("fps", "it must be one number").into());
    };
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
            fps,
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
            may_be_y_up: false,
            by: "Troupe is Y up and in metres",
        },
        fps: Finding::new(fps, Basis::Stated, "fps"),
        repairs: Vec::new(),
        oddities: Vec::new(),
    })
}

fn beyond_mimic(
    file: &str,
    archive: &mut Unpacked<'_>,
    options: &Options,
) -> Result<Understood, ReadErrorKind> {
    let (_, robot) = robot_of(options)?;
    let hinges = robot.hinges().len();
    let (shape, _) = archive.floats("joint_pos")?;
    if let [_, columns] = shape[..]
        && columns as usize != hinges
    {
        return Err(columns_error(columns as usize + ROOT, robot));
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
    let (_, fps) = archive.floats("fps")?;
    let [fps] = fps[..] else {
        return Err(NumpyError::array("fps", "it must be one number").into());
    };
    let named = archive
        .has("joint_names")
        .then(|| archive.texts("joint_names"))
        .transpose()?;
    let wide: Vec<f64> = places.iter().map(|&n| n.into()).collect();
    let turns: Vec<f64> = turns.iter().map(|&n| n.into()).collect();
    let rows = Rows {
        places: wide.chunks_exact(3 * bodies).map(DVec3::from_slice).collect(),
        quaternions: turns
            .chunks_exact(4 * bodies)
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
        is_fixed: true,
        order: named.map_or(JointOrder::BreadthFirst, JointOrder::Named),
        fps: fps_of(options, Some(Finding::new(fps, Basis::Stated, "fps"))),
        first_column: 1,
    };
    let mut understood = understand(file, rows, usual, options)?;
    compare_bodies(&mut understood, &places, bodies);
    Ok(understood)
}

/// Compares the places of the bodies with those that the robot's own links have, if they are as
/// many.
fn compare_bodies(understood: &mut Understood, places: &[f32], bodies: usize) {
    let Understood { clip, report, .. } = understood;
    let Some(robot) = &clip.skeleton.robot else {
        return;
    };
    let same_frames = places.len() == 3 * bodies * clip.frames();
    if bodies != 1 + robot.hinges().len() || !same_frames {
        return;
    }
    let world = WorldMotion::from_clip(clip);
    let order = robot.breadth_first();
    let joints: Vec<usize> = std::iter::once(0)
        .chain(order.iter().map(|&hinge| robot.hinges()[hinge].joint))
        .collect();
    let mut sum_m = 0.0;
    for (frame, places) in places.chunks_exact(3 * bodies).enumerate() {
        for (&joint, place) in joints.iter().zip(places.chunks_exact(3)) {
            let place = glam::Vec3::from_slice(place);
            let place = crate::conventions::Convention::Ros.position_to_native(place);
            sum_m += world.positions_at(frame)[joint].distance(place);
        }
    }
    let mean_m = sum_m / (places.len() / 3).max(1) as f32;
    if mean_m > MAX_BODY_ERROR_M {
        let text = format!(
            "the bodies stand {mean_m:.3} m from the robot's links on average: are the robot and --joint-order right?"
        );
        report.odd(Topic::JointOrder, text);
    }
}

/// SONIC's folder, by its `joint_pos.csv`; the other files are beside it.
pub(super) fn sonic(source: &Source<'_>, options: &Options) -> Result<Understood, ReadErrorKind> {
    let (_, robot) = robot_of(options)?;
    let hinges = robot.hinges().len();
    let angles = Table::parse(&text::decode(source.bytes).text)?;
    if angles.columns != hinges {
        return Err(columns_error(angles.columns + ROOT, robot));
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
        is_fixed: true,
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
