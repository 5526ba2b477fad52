//! Decides which axis of a file points up, and the unit of its lengths, by how a body stands.

use glam::DVec3;

use super::ReadErrorKind;
use super::agreement::Agreement;
use super::choices::{Advice, Choice, OptionName};
use super::options::Options;
use super::report::{Basis, Finding, Topic, Up};
use super::survey::Stance;
use super::units::{self, CENTIMETRE_M, UNITS, Unit};

/// Share of the direction from feet to head that an axis must have at rest.
const MIN_RESTING: f64 = 0.9;
/// As [`MIN_RESTING`], of the mean direction over the motion.
const MIN_MOVING: f64 = 0.8;
/// As [`MIN_MOVING`], if the rest pose stands along the same axis.
const MIN_LEANING: f64 = 0.5;
/// The lowest joint's place along the true up axis varies by less than this share of the body.
const STEADY_FLOOR: f64 = 0.1;
/// If it varies by more along another axis, that axis does not point up.
const UNSTEADY_FLOOR: f64 = 0.2;
/// Height of a body by the length of a leg plus that of the spine: feet, hips and skull come on
/// top.
const HEIGHT_BY_LENGTH: f64 = 1.24;
/// Heights of grown people, metres.
const PEOPLE_M: std::ops::RangeInclusive<f64> = 1.25..=2.15;
/// Heights of other bodies on two legs, metres: children, and figures of games.
const FIGURES_M: std::ops::RangeInclusive<f64> = 0.3..=4.0;

/// From this height on, a figure in the usual unit is as likely as a person in another, metres.
/// Smaller figures are rarer than files in CMU's unit.
const SMALL_M: f64 = 0.45;

/// Heights that are believed where the format says the unit, metres.
const STATED_M: std::ops::RangeInclusive<f64> = 0.05..=20.0;

/// What a format says about axes and units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stated {
    pub(super) up: Option<Up>,
    pub(super) unit_m: Option<f64>,
    /// Units that a file of the format may be in, whatever it says.
    pub(super) units: &'static [Unit],
    /// Whether some programs write files of the format with Y up, whatever it says.
    pub(super) may_be_y_up: bool,
    /// Name of the format, with its article.
    pub(super) by: &'static str,
}

/// The axis that points up. If the bones are `alike` those of the skeleton that is read onto, the
/// rest pose shows nothing, and it takes motion to doubt Y.
///
/// # Errors
/// [`ReadErrorKind::Open`] if rest pose and motion speak for different axes.
pub(super) fn up_of(
    stance: Option<&Stance>,
    stated: Stated,
    alike: bool,
    options: &Options,
) -> Result<Finding<Up>, ReadErrorKind> {
    if let Some(up) = options.up {
        return Ok(Finding::new(up, Basis::Given, "--up"));
    }
    if let Some(up) = stated.up {
        let y_up = stance.filter(|_| stated.may_be_y_up).and_then(y_up_instead(up));
        return Ok(y_up.unwrap_or_else(|| Finding::new(up, Basis::Stated, stated.by)));
    }
    let agreed = options.agreement.as_ref().and_then(Agreement::up);
    let Some(stance) = stance else {
        return Ok(match agreed {
            Some(up) => Finding::new(up, Basis::Found, "as the other files of the folder"),
            None => {
                let why = "no body on two legs is found by its joints' names; --up decides";
                Finding::new(Up::Y, Basis::Assumed, why)
            }
        });
    };
    let mut stance = *stance;
    if alike {
        stance.resting = DVec3::ZERO;
    }
    match up_by(&stance) {
        Sight::Clear(up, evidence) => Ok(Finding::new(up, Basis::Found, evidence)),
        Sight::Split(options, evidence) => match agreed.filter(|up| options.contains(up)) {
            Some(up) => {
                let evidence = format!("as the other files of the folder; {evidence}");
                Ok(Finding::new(up, Basis::Found, evidence))
            }
            None if alike => {
                let why = format!("the bones point as the skeleton's; {evidence}; --up decides");
                Ok(Finding::new(Up::Y, Basis::Assumed, why))
            }
            None => Err(ReadErrorKind::Open {
                topic: Topic::Up,
                what: "which axis points up",
                evidence,
                options: Advice::decides(Choice::new(OptionName::Up, &options)),
            }),
        },
        Sight::Dim(evidence) => Ok(match agreed {
            Some(up) => Finding::new(up, Basis::Found, "as the other files of the folder"),
            None => Finding::new(Up::Y, Basis::Assumed, format!("{evidence}; --up decides")),
        }),
    }
}

/// Y, if the body stands along it on a steady floor, and not along the axis that a format says.
fn y_up_instead(stated: Up) -> impl Fn(&Stance) -> Option<Finding<Up>> {
    move |stance| {
        let (moving, share) = Up::nearest(stance.moving);
        let varies = |up: Up| stance.floor[up as usize] / stance.length;
        let stands = varies(Up::Y) <= STEADY_FLOOR && varies(stated) >= UNSTEADY_FLOOR;
        let evidence = format!(
            "from feet to head is {:.0} % y over the frames; the lowest joint's place varies by {:.0} % of the body \
             along y, by {:.0} % along {stated}",
            100.0 * share,
            100.0 * varies(Up::Y),
            100.0 * varies(stated),
        );
        (moving == Up::Y && share >= MIN_MOVING && stands)
            .then(|| Finding::new(Up::Y, Basis::Found, evidence))
    }
}

/// Says that the up axis of a format may not be the file's: the body lies in all frames, and its
/// lowest joint rises and falls. That of a body that crawls, or of an animal, stays low.
pub(super) fn lies(stance: &Stance, up: Up, stated: Stated) -> Option<String> {
    let (moving, share) = Up::nearest(stance.moving);
    let is_steady = stance.floor[up as usize] / stance.length <= STEADY_FLOOR;
    let is_odd = share >= MIN_MOVING && moving != up && (stated.may_be_y_up || !is_steady);
    is_odd.then(|| {
        let share = 100.0 * share;
        format!(
            "from feet to head is {share:.0} % {moving} over the frames, and {up} is up: if the body does not lie, \
             --up decides"
        )
    })
}

/// What can be seen of the up axis.
pub(super) enum Sight {
    /// One axis, with the evidence.
    Clear(Up, String),
    /// Two axes have something for them.
    Split([Up; 2], String),
    /// Nothing.
    Dim(String),
}

pub(super) fn up_by(stance: &Stance) -> Sight {
    let (rest, rest_share) = Up::nearest(stance.resting);
    let (moving, share) = Up::nearest(stance.moving);
    let rests = rest_share >= MIN_RESTING;
    let moves = share >= MIN_MOVING;
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let over_frames = format!("from feet to head is {} {moving} over the frames", percent(share));
    let varies = |up: Up| stance.floor[up as usize] / stance.length;
    let floors = |one: Up, other: Up| {
        format!(
            "the lowest joint's place varies by {} of the body along {one}, by {} along {other}",
            percent(varies(one)),
            percent(varies(other)),
        )
    };
    let stands = |up: Up, not: Up| varies(up) <= STEADY_FLOOR && varies(not) >= UNSTEADY_FLOOR;
    match (rests.then_some(rest), moves.then_some(moving)) {
        (None | Some(Up::Y), Some(Up::Y)) => Sight::Clear(Up::Y, over_frames),
        (Some(rest), Some(moving)) if rest == moving => {
            let evidence = format!("{over_frames}, and {} at rest", percent(rest_share));
            Sight::Clear(moving, evidence)
        }
        (Some(rest), None) => {
            let at_rest = format!("from feet to head is {} {rest} at rest", percent(rest_share));
            if rest == Up::Y || (moving == rest && share >= MIN_LEANING) {
                let evidence = format!("{at_rest}; the motion stands along no axis");
                return Sight::Clear(rest, evidence);
            }
            let evidence = format!("{at_rest}; {}", floors(rest, Up::Y));
            match (stands(rest, Up::Y), stands(Up::Y, rest)) {
                (true, _) => Sight::Clear(rest, evidence),
                (_, true) => Sight::Clear(Up::Y, evidence),
                _ => Sight::Split([rest, Up::Y], evidence),
            }
        }
        (rest, Some(moving)) => {
            // A body that lies along an axis, or one that stands along it.
            let other = rest.unwrap_or(Up::Y);
            // Y is what most files have: it takes more to doubt it than to believe it.
            let is_clear = match moving {
                Up::Y => !stands(other, Up::Y),
                _ => stands(moving, other),
            };
            let at_rest = match rest {
                Some(rest) => format!(", and {} {rest} at rest", percent(rest_share)),
                None => String::new(),
            };
            let evidence = format!("{over_frames}{at_rest}; {}", floors(moving, other));
            match is_clear {
                true => Sight::Clear(moving, evidence),
                false => Sight::Split([moving, other], evidence),
            }
        }
        (None, None) => Sight::Dim("neither the rest pose nor the motion stands along an axis".to_owned()),
    }
}

/// Metres a unit. `fit_m` is the unit with which the bones have the given skeleton's lengths.
///
/// # Errors
/// [`ReadErrorKind::Open`] if the body has a person's height in several units, or in none.
pub(super) fn unit_of(
    stance: Option<&Stance>,
    stated: Stated,
    fit_m: Option<f64>,
    options: &Options,
) -> Result<Finding<f64>, ReadErrorKind> {
    if let Some(unit_m) = options.unit_m {
        return Ok(Finding::new(unit_m, Basis::Given, "--unit"));
    }
    if let Some(unit) = fit_m.and_then(near) {
        let evidence = format!("the bones have the skeleton's lengths in {}", unit.name);
        return Ok(Finding::new(unit.metres, Basis::Found, evidence));
    }
    let Some(stance) = stance else {
        return Ok(match (stated.unit_m, agreed_unit(options)) {
            (Some(unit_m), _) => Finding::new(unit_m, Basis::Stated, stated.by),
            (None, Some(unit_m)) => Finding::new(unit_m, Basis::Found, "as the other files of the folder"),
            (None, None) => {
                let why = "no body on two legs is found by its joints' names; --unit decides";
                Finding::new(CENTIMETRE_M, Basis::Assumed, why)
            }
        });
    };
    let height = HEIGHT_BY_LENGTH * stance.length;
    let tall = |unit_m: f64| height * unit_m;
    let people = stated.units.iter();
    let people: Vec<&Unit> = people
        .filter(|unit| PEOPLE_M.contains(&tall(unit.metres)))
        .collect();
    let usual = stated.unit_m.unwrap_or(CENTIMETRE_M);
    let by = |unit_m: f64| {
        format!(
            "the body is {:.2} m tall in {}",
            tall(unit_m),
            units::name_of(unit_m)
        )
    };
    let stated_basis = match stated.unit_m {
        Some(_) => Basis::Stated,
        None => Basis::Assumed,
    };
    match people[..] {
        // What the format says holds as long as it makes a body of any kind.
        _ if stated.unit_m.is_some() && STATED_M.contains(&tall(usual)) => {
            let evidence = format!("{}; {}", stated.by, by(usual));
            Ok(Finding::new(usual, Basis::Stated, evidence))
        }
        [unit] => Ok(Finding::new(unit.metres, Basis::Found, by(unit.metres))),
        _ if FIGURES_M.contains(&tall(usual)) => {
            let evidence = format!("{}, as most files are; --unit decides", by(usual));
            Ok(Finding::new(usual, stated_basis, evidence))
        }
        _ => match agreed_unit(options) {
            Some(unit_m) => {
                let evidence = format!("as the other files of the folder; {}", by(unit_m));
                Ok(Finding::new(unit_m, Basis::Found, evidence))
            }
            None => {
                let near = nearest_two(height, stated.units);
                let names: Vec<&str> = near.iter().map(|unit| unit.name).collect();
                let heights: Vec<String> = near.iter().map(|unit| by(unit.metres)).collect();
                Err(ReadErrorKind::Open {
                    topic: Topic::Unit,
                    what: "the unit of length",
                    evidence: heights.join(" or ").replace(" or the body is ", " or "),
                    options: Advice::decides(Choice::new(OptionName::Unit, &names)),
                })
            }
        },
    }
}

/// Whether the bones have the given skeleton's lengths in one of the units.
pub(super) fn is_of_skeleton(fit_m: Option<f64>) -> bool {
    fit_m.and_then(near).is_some()
}

/// Says that a body that is read as a person may be a small figure in the usual unit.
pub(super) fn may_be_small(stance: &Stance, stated: Stated, unit_m: &Finding<f64>) -> Option<String> {
    let usual = stated.unit_m.unwrap_or(CENTIMETRE_M);
    let small_m = height_m(stance, usual);
    let is_read_as_person = unit_m.basis == Basis::Found && unit_m.value > usual;
    let may_be = is_read_as_person && (SMALL_M..*PEOPLE_M.start()).contains(&small_m);
    may_be.then(|| {
        let usual = units::name_of(usual);
        format!("in {usual} the body is {small_m:.2} m tall: if it is so small, --unit {usual} decides")
    })
}

/// The unit that a file shows by itself, for [`Agreement`].
pub(super) fn unit_by(stance: &Stance) -> Option<f64> {
    let tall = |unit: &Unit| HEIGHT_BY_LENGTH * stance.length * unit.metres;
    let mut people = UNITS.into_iter().filter(|unit| PEOPLE_M.contains(&tall(unit)));
    match (people.next(), people.next()) {
        (Some(unit), None) => Some(unit.metres),
        _ => None,
    }
}

/// Height of a body in metres.
pub(super) fn height_m(stance: &Stance, unit_m: f64) -> f64 {
    HEIGHT_BY_LENGTH * stance.length * unit_m
}

fn agreed_unit(options: &Options) -> Option<f64> {
    options.agreement.as_ref().and_then(Agreement::unit_m)
}

/// A unit within 15 % of a length in metres.
fn near(metres: f64) -> Option<Unit> {
    UNITS
        .into_iter()
        .find(|unit| (metres / unit.metres - 1.0).abs() < 0.15)
}

/// The two of some units in which a height is nearest to a person's.
fn nearest_two(height: f64, units: &[Unit]) -> Vec<Unit> {
    const PERSON_M: f64 = 1.7;
    let mut sorted = units.to_vec();
    let away = |unit: &Unit| (height * unit.metres / PERSON_M).ln().abs();
    sorted.sort_by(|a, b| away(a).total_cmp(&away(b)));
    sorted.truncate(2);
    sorted
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// A body of 1 m whose lowest joint's place varies by these shares along x, y, z, -x, -y, -z.
    fn seen(resting: DVec3, moving: DVec3, floor: [f64; 6]) -> Sight {
        up_by(&Stance {
            length: 1.0,
            moving,
            resting,
            floor,
        })
    }

    #[test]
    fn a_rest_pose_alone_is_believed_only_along_y_or_with_the_floor() {
        let clear = |sight: Sight| match sight {
            Sight::Clear(up, _) => Some(up),
            _ => None,
        };
        let steady = [0.4, 0.05, 0.3, 0.4, 0.05, 0.05];
        // A cartwheel: the body is upside down for a while.
        let cartwheel = |resting| seen(resting, 0.6 * DVec3::Y, [0.4, 0.05, 0.3, 0.4, 0.3, 0.4]);
        assert_eq!(clear(cartwheel(DVec3::Y)), Some(Up::Y));
        assert_eq!(clear(cartwheel(DVec3::NEG_Y)), Some(Up::Y));
        // Which way is up is unclear, because nothing moves.
        let split = seen(DVec3::NEG_Y, 0.6 * DVec3::X, steady);
        assert!(matches!(split, Sight::Split([Up::MinusY, Up::Y], _)));
        // Z up: bent over, and on all fours.
        let bent = seen(DVec3::Z, DVec3::new(0.0, 0.5, 0.6), [0.0; 6]);
        assert_eq!(clear(bent), Some(Up::Z));
        let crawling = seen(DVec3::Z, 0.7 * DVec3::X, [0.4, 0.4, 0.02, 0.4, 0.4, 0.1]);
        assert_eq!(clear(crawling), Some(Up::Z));
    }
}
