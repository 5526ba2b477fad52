//! How takes of one walk differ from each other, by which the characters of a crowd differ.
//!
//! A pack's folder may have a file `takes.json`. For each take it has the mean turn of the joints
//! above the legs relative to the mean of the style's takes, and the cadence of its steps for its
//! speed.

use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;
use troupe_motion::{Quat, Skeleton, Vec3};

use super::{StyleError, StyleProblem};
use crate::{FieldError, Path as FieldPath};

/// The file in a pack's folder.
const FILE: &str = "takes.json";
/// Largest turn of a joint in the file, radians.
const MAX_TURN: f32 = 1.0;
/// Factor by which characters exceed the takes: one performer made them all, one after another.
const SPREAD: f32 = 2.6;
/// Largest turn of a joint after that, radians.
const MAX_SPREAD: f32 = 0.35;
/// Allowed cadences relative to the style's.
const CADENCES: std::ops::RangeInclusive<f32> = 0.8..=1.25;

/// How a take of a walk differs from the mean of its style's takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Take {
    /// Cadence of its steps for its speed; 1 is the mean.
    pub cadence: f32,
    /// Joints with their turns, in the frame of reference of the joint's parent.
    pub turns: Vec<(usize, Quat)>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    joints: Vec<String>,
    takes: Vec<Row>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    #[serde(rename = "clip")]
    _clip: String,
    #[serde(rename = "style")]
    _style: String,
    cadence: f32,
    /// Axes times angles, radians, one for each joint of the document.
    turns: Vec<[f32; 3]>,
}

/// The takes in a pack's folder. Empty if it has no such file.
pub(super) fn load(folder: &Path, skeleton: &Skeleton) -> Result<Arc<[Take]>, StyleError> {
    let path = folder.join(FILE);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => return Ok(Arc::default()),
        Err(cause) => {
            let problem = StyleProblem::Read(cause);
            return Err(StyleError { path, problem });
        }
    };
    parse(&text, skeleton).map_err(|problem| StyleError { path, problem })
}

fn parse(text: &str, skeleton: &Skeleton) -> Result<Arc<[Take]>, StyleProblem> {
    let parse = |cause| StyleProblem::Parse {
        field: ".".to_owned(),
        cause,
    };
    let document: Document = serde_json::from_str(text).map_err(parse)?;
    let root = FieldPath::root();
    let joints: Vec<usize> = (document.joints.iter().enumerate())
        .map(|(index, name)| {
            let found = skeleton.joints.iter().position(|joint| joint.name == *name);
            let missing = || {
                root.element("joints", index)
                    .error(format!("is {name:?}"), "a joint of the pack")
            };
            found.ok_or_else(missing)
        })
        .collect::<Result<_, _>>()?;
    let rows = document.takes.into_iter().enumerate();
    let takes = rows.map(|(index, row)| row.take(&root.element("takes", index), &joints));
    Ok(takes.collect::<Result<_, _>>()?)
}

impl Row {
    fn take(self, path: &FieldPath<'_>, joints: &[usize]) -> Result<Take, FieldError> {
        if !CADENCES.contains(&self.cadence) {
            let allowed = format!("{} to {}", CADENCES.start(), CADENCES.end());
            return Err(path
                .field("cadence")
                .error(format!("is {}", self.cadence), allowed));
        }
        if self.turns.len() != joints.len() {
            let allowed = format!("{}, one for each of the joints", joints.len());
            return Err(path
                .field("turns")
                .error(format!("has {} entries", self.turns.len()), allowed));
        }
        let turned = self
            .turns
            .iter()
            .enumerate()
            .zip(joints)
            .map(|((index, turn), &joint)| {
                let turn = Vec3::from_array(*turn);
                // Rejects NaN too.
                if turn.length() <= MAX_TURN {
                    let spread = (turn * SPREAD).clamp_length_max(MAX_SPREAD);
                    return Ok((joint, Quat::from_scaled_axis(spread)));
                }
                let path = path.element("turns", index);
                Err(path.error(
                    format!("is a turn of {} radians", turn.length()),
                    format!("0 to {MAX_TURN}"),
                ))
            });
        Ok(Take {
            turns: turned.collect::<Result<_, _>>()?,
            cadence: self.cadence,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::testing::{TempFolder, walker};

    fn document(turn: f32, cadence: f32, joint: &str) -> String {
        format!(
            "{{\"joints\": [\"{joint}\"], \"takes\": [{{\"clip\": \"walk_1\", \"style\": \"calm\", \
             \"cadence\": {cadence}, \"turns\": [[0, {turn}, 0]]}}]}}"
        )
    }

    #[test]
    fn takes_are_read_by_joint_names() {
        let folder = TempFolder::new("takes");
        let skeleton = walker();
        assert!(
            load(folder.path(), &skeleton).unwrap().is_empty(),
            "a pack may have none"
        );
        let joint = &skeleton.joints[1].name;
        std::fs::write(folder.path().join(FILE), document(0.1, 1.05, joint)).unwrap();
        let takes = load(folder.path(), &skeleton).unwrap();
        let wanted = Take {
            cadence: 1.05,
            // Beyond the take, but within what a body bends.
            turns: vec![(1, Quat::from_rotation_y(0.1 * SPREAD))],
        };
        assert_eq!(takes[..], [wanted]);
    }

    #[test]
    fn errors_name_the_value() {
        let skeleton = walker();
        let joint = &skeleton.joints[1].name;
        for (text, wanted) in [
            (
                document(1.2, 1.0, joint),
                "takes[0].turns[0]: is a turn of 1.2 radians; allowed: 0 to 1",
            ),
            (
                document(0.2, 2.0, joint),
                "takes[0].cadence: is 2; allowed: 0.8 to 1.25",
            ),
            (
                document(0.2, 1.0, "tail"),
                "joints[0]: is \"tail\"; allowed: a joint of the pack",
            ),
            ("{}".to_owned(), "missing field `joints`"),
        ] {
            let error = parse(&text, &skeleton).unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}\nwant {wanted}");
        }
    }
}
