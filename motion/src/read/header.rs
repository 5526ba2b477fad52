//! Names of the columns of a robot's CSV.

use super::choices::{Advice, Choice, OptionName};
use super::error::ReadErrorKind;
use super::options::{Options, QuaternionOrder};
use super::robot::ROOT;
use super::robot_checks::hinge_named;
use crate::robot::Robot;
use crate::skeleton::Skeleton;

/// Words that may stand before what a column of the root holds.
const OF_ROOT: [&str; 8] = [
    "root", "floating", "base", "pelvis", "body", "link", "joint", "world",
];
/// Words for a place, without separators.
const PLACE: [&str; 9] = [
    "",
    "p",
    "t",
    "pos",
    "position",
    "trans",
    "translate",
    "translation",
    "location",
];
/// Words for a rotation, without separators.
const ROTATION: [&str; 8] = [
    "q",
    "quat",
    "quaternion",
    "r",
    "rot",
    "rotation",
    "orientation",
    "orn",
];
/// Words for a rotation about one axis.
const ANGLE: [&str; 4] = ["rotate", "euler", "eulerangle", "angle"];

/// What a column of the root holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// Of the place: axis 0 to 2.
    Place(usize),
    /// Of the quaternion: 0 to 3 for x y z w.
    Quaternion(usize),
    /// An angle about one axis.
    Angle,
}

/// What a header says.
#[derive(Debug, Default)]
pub(super) struct Named {
    /// For each of x y z and x y z w, its column. None if the header does not name them.
    pub(super) root: Option<[usize; ROOT]>,
    /// Names of the hinges' columns. None if they are only numbered, or an option has the order.
    pub(super) hinges: Option<Vec<String>>,
}

/// Reads a header of as many columns as the robot has. The file has `dropped` columns before them.
///
/// # Errors
/// [`ReadErrorKind::Range`] with the first name that is not known, or stands twice.
pub(super) fn read(
    header: &[String],
    dropped: usize,
    robot: &Robot,
    skeleton: &Skeleton,
    options: &Options,
) -> Result<Named, ReadErrorKind> {
    let mut named = Named::default();
    let unknown = |column: usize, allowed: String, option: Advice| ReadErrorKind::Range {
        field: format!("the name of column {}", column + dropped + 1),
        found: format!("{:?}", header[column]),
        allowed,
        option: Some(option),
    };
    match root(&header[..ROOT]) {
        Ok(columns) => named.root = Some(columns),
        Err(_) if options.quaternion.is_some() => (),
        Err(column) => {
            let allowed = "x y z, qx qy qz qw of the root, once each, in any order";
            let advice = Advice::new(
                "{} reads the root's columns in the order x y z and quaternion, whatever their names",
                [Choice::new(OptionName::Quaternion, &["xyzw", "wxyz"])],
            );
            return Err(unknown(column, allowed.to_owned(), advice));
        }
    }
    let names = &header[ROOT..];
    if options.joint_order.is_some() || are_numbers(names) {
        return Ok(named);
    }
    let mut is_seen = vec![false; robot.hinges().len()];
    for (nth, name) in names.iter().enumerate() {
        let hinge = hinge_named(name, robot, skeleton);
        let seen = hinge.and_then(|hinge| is_seen.get_mut(hinge));
        if seen.is_none_or(|seen| std::mem::replace(seen, true)) {
            let allowed = format!("the joints of robot {}'s hinges, once each", robot.name());
            let advice = Advice::new(
                "{} says which hinges the columns are, whatever their names",
                [Choice::any(OptionName::JointOrder)],
            );
            return Err(unknown(ROOT + nth, allowed, advice));
        }
    }
    named.hinges = Some(names.to_vec());
    Ok(named)
}

/// Refuses a header whose root turns by three angles instead of a quaternion.
///
/// # Errors
/// [`ReadErrorKind::Robot`].
pub(super) fn refuse_angles(
    header: &[String],
    robot: &Robot,
    skeleton: &Skeleton,
) -> Result<(), ReadErrorKind> {
    let of_root = |name: &String| match hinge_named(name, robot, skeleton) {
        Some(_) => None,
        None => part(name),
    };
    let parts: Vec<Option<Part>> = header.iter().map(of_root).collect();
    let has_w = parts.contains(&Some(Part::Quaternion(3)));
    // `rot_x` is of a quaternion if there is a `rot_w`, and `qx` always.
    let is_angle = |(name, part): &(&String, &Option<Part>)| match part {
        Some(Part::Quaternion(_)) => !has_w && !name.contains(['q', 'Q']),
        part => matches!(part, Some(Part::Angle)),
    };
    let columns = header.iter().zip(&parts).filter(is_angle);
    let angles: Vec<&str> = columns.map(|(name, _)| &**name).collect();
    match angles[..] {
        [_, _, _] => Err(ReadErrorKind::Robot(format!(
            "columns {} are the root's rotation as three angles, which are not read (BONES-SEED has them, with \
             centimetres and degrees). A row must have the root's x y z in metres, its quaternion, and the hinges' \
             angles; write the rotation as qx qy qz qw and the place in metres",
            angles.join(", ")
        ))),
        _ => Ok(()),
    }
}

/// For each part of the root, its column; else the first column that is none or stands twice.
fn root(names: &[String]) -> Result<[usize; ROOT], usize> {
    let mut columns = [usize::MAX; ROOT];
    for (column, name) in names.iter().enumerate() {
        let at = match part(name) {
            Some(Part::Place(axis)) => axis,
            Some(Part::Quaternion(nth)) => 3 + nth,
            _ => return Err(column),
        };
        if columns[at] != usize::MAX {
            return Err(column);
        }
        columns[at] = column;
    }
    Ok(columns)
}

/// The part of the root that a name stands for: `x`, `qx`, `root_pos_x` or `Base Quat W`.
fn part(name: &str) -> Option<Part> {
    let name: String = name
        .to_lowercase()
        .chars()
        .filter(|c| c.is_alphanumeric())
        .collect();
    let mut words = &*name;
    while let Some(rest) = OF_ROOT.iter().find_map(|word| words.strip_prefix(word)) {
        words = rest;
    }
    // Angles about axes, and only of the root.
    if words.len() < name.len() && ["roll", "pitch", "yaw"].contains(&words) {
        return Some(Part::Angle);
    }
    let axis = words.chars().next_back().and_then(|axis| "xyzw".find(axis))?;
    let word = &words[..words.len() - 1];
    match axis {
        0..3 if PLACE.contains(&word) => Some(Part::Place(axis)),
        0..3 if ANGLE.contains(&word) => Some(Part::Angle),
        _ if ROTATION.contains(&word) => Some(Part::Quaternion(axis)),
        _ => None,
    }
}

/// Whether names are one word with numbers that rise by one: they name no hinge.
fn are_numbers(names: &[String]) -> bool {
    let number = |name: &str| {
        let word = name.trim_end_matches(|c: char| c.is_ascii_digit());
        let number = name[word.len()..].parse::<usize>().ok()?;
        Some((word.to_owned(), number))
    };
    let Some((word, first)) = names.first().and_then(|name| number(name)) else {
        return false;
    };
    let expected = (first..).map(|nth| Some((word.clone(), nth)));
    names
        .iter()
        .map(|name| number(name))
        .zip(expected)
        .all(|(found, expected)| found == expected)
}

/// The columns of x y z and the quaternion. An option has the quaternion's order in the columns as
/// they stand; else it is x y z w.
pub(super) fn in_order(mut columns: [usize; ROOT], given: Option<QuaternionOrder>) -> [usize; ROOT] {
    if given.is_some() {
        columns[3..].sort_unstable();
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_the_root_have_names_of_many_programs() {
        for (names, wanted) in [
            (["x", "root_x", "Root_Pos_X", "base.position.x"], Part::Place(0)),
            (["pz", "tz", "root_translateZ", "pelvis z"], Part::Place(2)),
            (["qw", "root_rot_w", "rot_w", "base_quat_w"], Part::Quaternion(3)),
            (["qy", "orientation_y", "root_qy", "Quat Y"], Part::Quaternion(1)),
            (["root_rotateX", "euler_z", "root_yaw", "base_roll"], Part::Angle),
        ] {
            for name in names {
                assert_eq!(part(name), Some(wanted), "{name}");
            }
        }
        for name in [
            "",
            "w",
            "foo",
            "waist_yaw",
            "yaw",
            "left_hip_pitch",
            "frame",
            "é",
            "base",
        ] {
            assert_eq!(part(name), None, "{name}");
        }
    }

    #[test]
    fn numbers_name_no_hinge() {
        let names = |text: &str| -> Vec<String> { text.split(' ').map(str::to_owned).collect() };
        assert!(are_numbers(&names("j0 j1 j2")) && are_numbers(&names("dof_07 dof_08 dof_09")));
        assert!(
            !are_numbers(&names("j0 j2 j1")) && !are_numbers(&names("j0 k1")) && !are_numbers(&names("a b"))
        );
    }
}
