//! Checks of a robot's numbers.

use glam::{DQuat, DVec3};

use super::choices::{Advice, Choice, OptionName};
use super::error::ReadErrorKind;
use super::options::{AngleUnit, JointOrder, Options, QuaternionOrder};
use super::report::{Report, Topic};
use super::robot::{Rows, Usual, note_quaternion, to_radians};
use crate::robot::Robot;
use crate::skeleton::Skeleton;

/// Mean cosine of the root's tilt from which a robot is upright.
const UPRIGHT: f64 = 0.8;
/// Cosine of the tilt beyond which a robot lies.
const LEAST_UPRIGHT: f64 = 0.1;
/// Difference of two readings' tilts that leaves no doubt.
const CLEAR: f64 = 0.5;
/// Least way of a root that shows where it walks, metres.
const MIN_WAY_M: f64 = 1.0;
/// An angle that is farther beyond its limits shows that the numbers mean something else, radians.
const FAR_RAD: f64 = 0.5;
/// An angle that is farther beyond its limits is noted, radians.
const NOTED_RAD: f64 = 0.05;
/// No hinge turns farther, radians: larger numbers are degrees.
const FULL_TURN_RAD: f64 = std::f64::consts::TAU;
/// Most hinges that a note lists.
const LISTED: usize = 4;

/// The rotation of a quaternion, in the file's axes.
pub(super) fn turn(q: [f64; 4], order: QuaternionOrder) -> DQuat {
    match order {
        QuaternionOrder::Xyzw => DQuat::from_array(q),
        QuaternionOrder::Wxyz => DQuat::from_xyzw(q[1], q[2], q[3], q[0]),
    }
}

/// How a root moves in one reading of its quaternions.
struct Reading {
    /// Mean cosine of the tilt.
    upright: f64,
    /// Mean cosine between where it faces and where it goes, weighted by the way; none if it stays.
    ahead: Option<f64>,
}

fn reading(rows: &Rows, order: QuaternionOrder) -> Reading {
    let mut upright = 0.0;
    let (mut ahead, mut way_m) = (0.0, 0.0);
    for (frame, &quaternion) in rows.quaternions.iter().enumerate() {
        let turn = turn(quaternion, order);
        upright += (turn * DVec3::Z).z;
        if let Some(next) = rows.places.get(frame + 1) {
            let step = (*next - rows.places[frame]) * DVec3::new(1.0, 1.0, 0.0);
            let facing = ((turn * DVec3::X) * DVec3::new(1.0, 1.0, 0.0)).normalize_or_zero();
            ahead += facing.dot(step);
            way_m += step.length();
        }
    }
    Reading {
        upright: upright / rows.quaternions.len().max(1) as f64,
        ahead: (way_m >= MIN_WAY_M).then(|| ahead / way_m),
    }
}

/// The order of the root's quaternions.
///
/// # Errors
/// [`ReadErrorKind::Open`] if both orders make an upright robot, and only the other one walks
/// ahead.
pub(super) fn quaternion_order(
    rows: &Rows,
    usual: QuaternionOrder,
    is_fixed: bool,
    options: &Options,
    report: &mut Report,
) -> Result<QuaternionOrder, ReadErrorKind> {
    if let Some(order) = options.quaternion {
        return Ok(order);
    }
    let other = match usual {
        QuaternionOrder::Xyzw => QuaternionOrder::Wxyz,
        QuaternionOrder::Wxyz => QuaternionOrder::Xyzw,
    };
    if is_fixed {
        return Ok(usual);
    }
    let [first, second] = [usual, other].map(|order| reading(rows, order));
    let name = |order: QuaternionOrder| match order {
        QuaternionOrder::Xyzw => "xyzw",
        QuaternionOrder::Wxyz => "wxyz",
    };
    let tilts = format!(
        "its mean upright cosine is {:.2} as {} and {:.2} as {}",
        first.upright,
        name(usual),
        second.upright,
        name(other)
    );
    let open = |evidence: String| {
        Err(ReadErrorKind::Open {
            topic: Topic::Quaternion,
            what: "the order of the root's quaternion",
            evidence,
            options: Advice::decides(Choice::new(OptionName::Quaternion, &["xyzw", "wxyz"])),
        })
    };
    if second.upright >= UPRIGHT && second.upright - first.upright >= CLEAR {
        note_quaternion(report, other, &tilts);
        return Ok(other);
    }
    if second.upright >= UPRIGHT && first.upright < UPRIGHT && second.upright > first.upright {
        return open(tilts);
    }
    if let (Some(first), Some(second)) = (first.ahead, second.ahead)
        && first <= -CLEAR
        && second >= CLEAR
    {
        let ways = format!("{tilts}, but it walks backwards as {}", name(usual));
        return open(ways);
    }
    if first.upright >= UPRIGHT && second.upright >= UPRIGHT && first.ahead.is_none() {
        let text = format!(
            "the root's quaternion is read as {}: {tilts}, and it walks too little to show which; \
             --quaternion decides",
            name(usual)
        );
        report.odd(Topic::Quaternion, text);
    }
    Ok(usual)
}

/// How far the angles are beyond the limits in a reading, radians: the worst, its hinge and its
/// frame.
struct Beyond {
    far_rad: f64,
    hinge: usize,
    frame: usize,
}

fn beyond(angles: &[f64], robot: &Robot, factor: f64, order: &[usize]) -> Beyond {
    let hinges = robot.hinges();
    let mut worst = Beyond {
        far_rad: 0.0,
        hinge: 0,
        frame: 0,
    };
    for (frame, row) in angles.chunks_exact(hinges.len()).enumerate() {
        for (&hinge, angle) in order.iter().zip(row) {
            let of = &hinges[hinge];
            let angle = angle * factor;
            let far_rad = (f64::from(of.lower_rad) - angle).max(angle - f64::from(of.upper_rad));
            if far_rad > worst.far_rad {
                worst = Beyond {
                    far_rad,
                    hinge,
                    frame,
                };
            }
        }
    }
    worst
}

/// Brings the angles into radians and into the robot's order.
///
/// # Errors
/// An angle far beyond its limits in every reading, or more readings than one that fit.
pub(super) fn angles(
    rows: &mut Rows,
    robot: &Robot,
    skeleton: &Skeleton,
    usual: &Usual,
    options: &Options,
    report: &mut Report,
) -> Result<(), ReadErrorKind> {
    let is_order_open = options.joint_order.is_none() && !usual.is_order_fixed;
    let given = options.joint_order.as_ref().unwrap_or(&usual.order);
    let order = order_of(given, robot, skeleton)?;
    let unit = options.angles.unwrap_or(AngleUnit::Radians);
    let now = beyond(&rows.angles, robot, to_radians(unit), &order);
    let largest = most(rows, robot.hinges().len());
    let joint = |hinge: usize| &*skeleton.joints[robot.hinges()[hinge].joint].name;
    let mut reading = (unit, order);
    if now.far_rad > FAR_RAD {
        let of = &robot.hinges()[now.hinge];
        let column = usual.first_column
            + reading
                .1
                .iter()
                .position(|&hinge| hinge == now.hinge)
                .unwrap_or(0);
        let evidence = format!(
            "column {column} ({}) is {:.2} rad beyond its limits, {:.2} to {:.2} rad, in frame {}",
            joint(now.hinge),
            now.far_rad,
            of.lower_rad,
            of.upper_rad,
            now.frame
        );
        match fitting(rows, robot, &reading, largest, options, is_order_open) {
            Some((AngleUnit::Degrees, ..)) if largest <= FULL_TURN_RAD && usual.is_order_fixed => {
                return Err(ReadErrorKind::Open {
                    topic: Topic::Angles,
                    what: "what the angles mean",
                    evidence,
                    options: Advice::new(
                        format!(
                            "{{}} fits, but then most frames turn no hinge farther than {largest:.1}°; else {{}} \
                             gives the robot of the file"
                        ),
                        [OptionName::Degrees, OptionName::Skeleton].map(Choice::any),
                    ),
                });
            }
            Some((AngleUnit::Degrees, order, _)) if largest <= FULL_TURN_RAD => {
                return Err(ReadErrorKind::Open {
                    topic: Topic::Angles,
                    what: "what the angles mean",
                    evidence,
                    options: Advice::new(
                        format!(
                            "{{}} names the hinges of the columns; {{}} fits too, but then most frames turn no \
                             hinge farther than {largest:.1}°"
                        ),
                        [
                            Choice::any(OptionName::JointOrder),
                            match (order == reading.1, order == robot.breadth_first()) {
                                (true, _) => Choice::any(OptionName::Degrees),
                                (false, true) => Choice::new(OptionName::JointOrder, &["isaaclab"]),
                                (false, false) => Choice::new(OptionName::JointOrder, &["tree"]),
                            },
                        ],
                    ),
                });
            }
            Some((unit, order, name)) => {
                let topic = if unit == reading.0 {
                    Topic::JointOrder
                } else {
                    Topic::Angles
                };
                report.repaired(
                    topic,
                    format!("read with {name}, in which all angles are within their limits: {evidence}"),
                );
                reading = (unit, order);
            }
            None if usual.is_order_fixed => {
                let advice = Advice::new(
                    "is this the robot of the file? {} gives another",
                    [Choice::any(OptionName::Skeleton)],
                );
                return Err(ReadErrorKind::Angles { evidence, advice });
            }
            None => {
                let advice = Advice::new(
                    "are the angles in the robot's order ({}), and of this robot?",
                    [Choice::any(OptionName::JointOrder)],
                );
                return Err(ReadErrorKind::Angles { evidence, advice });
            }
        }
    }
    if reading.0 == AngleUnit::Degrees && largest <= FULL_TURN_RAD {
        let text =
            format!("as degrees, most frames turn no hinge farther than {largest:.1}°; is --degrees right?");
        report.odd(Topic::Angles, text);
    }
    apply(rows, &reading.1, to_radians(reading.0));
    note_limits(rows, robot, joint, report);
    Ok(())
}

type Fit = (AngleUnit, Vec<usize>, &'static str);

/// Another reading in which all angles are within their limits, with the option that asks for it.
fn fitting(
    rows: &Rows,
    robot: &Robot,
    now: &(AngleUnit, Vec<usize>),
    largest: f64,
    options: &Options,
    may_order: bool,
) -> Option<Fit> {
    let (unit, order) = now;
    let breadth = robot.breadth_first();
    let (other, name, both) = match *order == breadth {
        true => {
            let tree = (0..robot.hinges().len()).collect();
            (tree, "--joint-order tree", "--degrees --joint-order tree")
        }
        false => (
            breadth,
            "--joint-order isaaclab",
            "--degrees --joint-order isaaclab",
        ),
    };
    let fits = |fit: &Fit| beyond(&rows.angles, robot, to_radians(fit.0), &fit.1).far_rad <= NOTED_RAD;
    let is_large = largest > FULL_TURN_RAD;
    let may_turn = options.angles.is_none();
    let degrees = (AngleUnit::Degrees, order.clone(), "--degrees");
    let ordered = (*unit, other.clone(), name);
    let both = (AngleUnit::Degrees, other, both);
    // Numbers beyond a full turn are degrees. Small numbers are within all limits as degrees, so
    // that this alone shows nothing.
    let tried = match is_large && may_turn {
        true => [(degrees, true), (both, may_order)],
        false => [(ordered, may_order), (degrees, may_turn)],
    };
    let mut found = tried.into_iter().filter(|(fit, may)| *may && fits(fit));
    found.next().map(|(fit, _)| fit)
}

/// The largest number of a frame, either way: the middle of all frames, so that no single frame
/// decides what the numbers are.
fn most(rows: &Rows, hinges: usize) -> f64 {
    let of_row = |row: &[f64]| row.iter().fold(0.0_f64, |most, angle| most.max(angle.abs()));
    let mut most: Vec<f64> = rows.angles.chunks_exact(hinges).map(of_row).collect();
    most.sort_by(f64::total_cmp);
    most.get(most.len() / 2).copied().unwrap_or_default()
}

/// For each column, the hinge that it is of.
fn order_of(order: &JointOrder, robot: &Robot, skeleton: &Skeleton) -> Result<Vec<usize>, ReadErrorKind> {
    let hinges = robot.hinges();
    let names = match order {
        JointOrder::Tree => return Ok((0..hinges.len()).collect()),
        JointOrder::BreadthFirst => return Ok(robot.breadth_first()),
        JointOrder::Named(names) => names,
    };
    let found: Option<Vec<usize>> = names
        .iter()
        .map(|name| hinge_named(name, robot, skeleton))
        .collect();
    let mut sorted = found.clone().unwrap_or_default();
    sorted.sort_unstable();
    sorted.dedup();
    match found {
        Some(order) if sorted.len() == hinges.len() && order.len() == hinges.len() => Ok(order),
        _ => Err(ReadErrorKind::Range {
            field: "--joint-order".to_owned(),
            found: names.join(", "),
            allowed: format!(
                "tree, isaaclab, or each of the robot's {} hinges once",
                hinges.len()
            ),
            option: None,
        }),
    }
}

/// The hinge of a joint's name, as a pack, a URDF or a CSV has it: `left_knee`, `left_knee_joint`,
/// `dof_left_knee` or `joint:left_knee`, in any case.
pub(super) fn hinge_named(name: &str, robot: &Robot, skeleton: &Skeleton) -> Option<usize> {
    let joint = |hinge: &crate::robot::Hinge| &*skeleton.joints[hinge.joint].name;
    let mut hinges = robot.hinges().iter();
    let exact = hinges.position(|hinge| joint(hinge).eq_ignore_ascii_case(name.trim()));
    let wanted = bare(name);
    exact.or_else(|| {
        robot
            .hinges()
            .iter()
            .position(|hinge| bare(joint(hinge)) == wanted)
    })
}

/// A joint's name in small letters, without what programs put before and after it.
pub(super) fn bare(name: &str) -> String {
    let name = name.trim().to_lowercase();
    let mut bare = &*name;
    loop {
        let before = ["dof_", "dof:", "joint_", "joint:"];
        let after = ["_joint", "_dof", "_link"];
        let shorter = before.iter().find_map(|word| bare.strip_prefix(word));
        let shorter = shorter.or_else(|| after.iter().find_map(|word| bare.strip_suffix(word)));
        match shorter {
            Some(shorter) if !shorter.is_empty() => bare = shorter,
            _ => return bare.to_owned(),
        }
    }
}

fn apply(rows: &mut Rows, order: &[usize], factor: f64) {
    let mut row = vec![0.0; order.len()];
    for angles in rows.angles.chunks_exact_mut(order.len()) {
        for (&hinge, angle) in order.iter().zip(&*angles) {
            row[hinge] = angle * factor;
        }
        angles.copy_from_slice(&row);
    }
}

fn note_limits<'a>(rows: &Rows, robot: &Robot, joint: impl Fn(usize) -> &'a str, report: &mut Report) {
    let hinges = robot.hinges();
    let mut far = vec![0.0_f64; hinges.len()];
    for row in rows.angles.chunks_exact(hinges.len()) {
        for ((far, of), angle) in far.iter_mut().zip(hinges).zip(row) {
            *far = far.max((f64::from(of.lower_rad) - angle).max(angle - f64::from(of.upper_rad)));
        }
    }
    let mut noted: Vec<usize> = (0..hinges.len())
        .filter(|&hinge| far[hinge] > NOTED_RAD)
        .collect();
    noted.sort_by(|&a, &b| far[b].total_cmp(&far[a]));
    if noted.is_empty() {
        return;
    }
    let listed: Vec<String> = noted
        .iter()
        .take(LISTED)
        .map(|&hinge| format!("{} by {:.2} rad", joint(hinge), far[hinge]))
        .collect();
    let more = match noted.len() > LISTED {
        true => format!(" and {} more", noted.len() - LISTED),
        false => String::new(),
    };
    report.odd(
        Topic::Limits,
        format!("beyond their limits: {}{more}", listed.join(", ")),
    );
}

/// Notes a robot that is seldom upright.
pub(super) fn upright(turns: &[DQuat], report: &mut Report) {
    let upright = turns
        .iter()
        .filter(|turn| (**turn * DVec3::Z).z > LEAST_UPRIGHT)
        .count();
    let share = upright as f64 / turns.len().max(1) as f64;
    if share < 0.5 {
        let text = format!(
            "the root is upright in {:.0} % of the frames; is --quaternion right?",
            100.0 * share
        );
        report.odd(Topic::Upright, text);
    }
}
