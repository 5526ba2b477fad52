//! The parts of a body as a document, with joints by name.

#[cfg(feature = "files")]
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::parts::{Limb, Parts};
use crate::ik::is_below;
use crate::skeleton::Skeleton;

/// Parts of a body by the names of their joints. As a correction, what is left out stays as it was
/// found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartsDoc {
    /// From the pelvis to the joint that the arms hang on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trunk: Option<Vec<String>>,
    /// From above the trunk to the head.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub neck: Option<Vec<String>>,
    /// From the first joint of the tail to its tip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tail: Option<Vec<String>>,
    /// Whether the body stands on four legs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on_fours: Option<bool>,
    /// The left leg; the left hind leg of a body on four.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_leg: Option<LimbDoc>,
    /// The right one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub right_leg: Option<LimbDoc>,
    /// The left arm, or fore leg.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_arm: Option<LimbDoc>,
    /// The right one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub right_arm: Option<LimbDoc>,
}

/// A limb by the names of its joints. As a correction, what is left out stays as it was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimbDoc {
    /// Joints between the trunk and the limb: clavicles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub girdle: Option<Vec<String>>,
    /// Shoulder or hip, and twists along the upper bone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upper: Option<Vec<String>>,
    /// Elbow or knee, and twists along the lower bone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lower: Option<Vec<String>>,
    /// Wrist or ankle; `""` for an arm that the body lacks, which then has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<String>,
    /// The joint that the toes turn about; `""` for a foot without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub toe: Option<String>,
}

#[cfg(feature = "files")]
impl LimbDoc {
    /// This limb, and of another one what it leaves out.
    fn or(self, other: Self) -> Self {
        Self {
            girdle: self.girdle.or(other.girdle),
            upper: self.upper.or(other.upper),
            lower: self.lower.or(other.lower),
            end: self.end.or(other.end),
            toe: self.toe.or(other.toe),
        }
    }
}

impl PartsDoc {
    /// The document of parts.
    pub fn of(parts: &Parts, skeleton: &Skeleton) -> Self {
        let name = |joint: usize| skeleton.joints[joint].name.clone();
        let names = |joints: &[usize]| -> Vec<String> { joints.iter().map(|&joint| name(joint)).collect() };
        let limb = |limb: &Limb| LimbDoc {
            girdle: Some(names(&limb.girdle)),
            upper: Some(names(&limb.upper)),
            lower: Some(names(&limb.lower)),
            end: Some(name(limb.end)),
            toe: limb.toe.map(name),
        };
        let leg = |leg: &Limb| LimbDoc {
            toe: Some(leg.toe.map(name).unwrap_or_default()),
            ..limb(leg)
        };
        let none = || LimbDoc {
            end: Some(String::new()),
            ..LimbDoc::default()
        };
        let arm = |side: usize| Some(parts.arms.as_ref().map_or_else(none, |arms| limb(&arms[side])));
        Self {
            trunk: Some(names(&parts.trunk)),
            neck: Some(names(&parts.neck)),
            tail: Some(names(&parts.tail)),
            on_fours: Some(parts.on_fours),
            left_leg: Some(leg(&parts.legs[0])),
            right_leg: Some(leg(&parts.legs[1])),
            left_arm: arm(0),
            right_arm: arm(1),
        }
    }

    /// The document of a body whose bones are named as in VRM, such as `leftUpperLeg`, by the names
    /// of its joints. Bones that the skeleton lacks are left out; none without hips, legs and head.
    #[cfg(feature = "files")]
    pub(crate) fn of_bones(bones: &BTreeMap<String, String>, skeleton: &Skeleton) -> Option<Self> {
        let name = |bone: &str| {
            let name = bones.get(bone)?;
            skeleton.joint_index(name).map(|_| name.clone())
        };
        let names = |bones: &[&str]| -> Vec<String> { bones.iter().filter_map(|bone| name(bone)).collect() };
        let limb = |[girdle, upper, lower, end, toe]: [&str; 5], side: &str| {
            let name = |bone: &str| name(&format!("{side}{bone}"));
            Some(LimbDoc {
                girdle: Some(name(girdle).into_iter().collect()),
                upper: Some(vec![name(upper)?]),
                lower: Some(vec![name(lower)?]),
                end: Some(name(end)?),
                toe: Some(name(toe).unwrap_or_default()),
            })
        };
        let leg = |side| limb(["", "UpperLeg", "LowerLeg", "Foot", "Toes"], side);
        let arm = |side| limb(["Shoulder", "UpperArm", "LowerArm", "Hand", ""], side);
        name("hips").zip(name("head"))?;
        Some(Self {
            trunk: Some(names(&["hips", "spine", "chest", "upperChest"])),
            neck: Some(names(&["neck", "head"])),
            on_fours: Some(false),
            left_leg: Some(leg("left")?),
            right_leg: Some(leg("right")?),
            left_arm: arm("left"),
            right_arm: arm("right"),
            ..Self::default()
        })
    }

    /// This document, and of another one what it leaves out.
    #[cfg(feature = "files")]
    pub(crate) fn or(self, other: Self) -> Self {
        let limb = |own: Option<LimbDoc>, other: Option<LimbDoc>| match (own, other) {
            (Some(own), Some(other)) => Some(own.or(other)),
            (own, other) => own.or(other),
        };
        Self {
            trunk: self.trunk.or(other.trunk),
            neck: self.neck.or(other.neck),
            tail: self.tail.or(other.tail),
            on_fours: self.on_fours.or(other.on_fours),
            left_leg: limb(self.left_leg, other.left_leg),
            right_leg: limb(self.right_leg, other.right_leg),
            left_arm: limb(self.left_arm, other.left_arm),
            right_arm: limb(self.right_arm, other.right_arm),
        }
    }

    /// Whether it corrects nothing.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Corrects the parts that were found. Without any, the document needs a trunk and both legs.
    ///
    /// # Errors
    /// A sentence with the field and what is allowed.
    pub(super) fn corrected(&self, found: Option<Parts>, skeleton: &Skeleton) -> Result<Parts, String> {
        let joint = |field: &str, name: &str| {
            let found = skeleton.joint_index(name);
            found.ok_or_else(|| format!("{field} names {name:?}; allowed: a joint of the skeleton"))
        };
        let joints = |field: &str, names: &[String], least: usize| {
            if names.len() < least {
                return Err(format!("{field} is empty; allowed: at least {least} joint"));
            }
            names
                .iter()
                .map(|name| joint(field, name))
                .collect::<Result<Vec<_>, _>>()
        };
        let limb = |field: &str, doc: &Option<LimbDoc>, found: Option<&Limb>| -> Result<_, String> {
            let Some(doc) = doc else {
                return Ok(found.cloned());
            };
            let list = |part: &str, names: &Option<Vec<String>>, found: Option<&Vec<usize>>, least: usize| {
                let field = format!("{field}.{part}");
                match (names, found) {
                    (Some(names), _) => joints(&field, names, least),
                    (None, Some(found)) => Ok(found.clone()),
                    (None, None) => joints(&field, &[], least),
                }
            };
            let upper = list("upper", &doc.upper, found.map(|found| &found.upper), 1)?;
            let lower = list("lower", &doc.lower, found.map(|found| &found.lower), 1)?;
            let girdle = list("girdle", &doc.girdle, found.map(|found| &found.girdle), 0)?;
            let end = match (&doc.end, found) {
                (Some(end), _) => joint(&format!("{field}.end"), end)?,
                (None, Some(found)) => found.end,
                (None, None) => {
                    return Err(format!(
                        "{field}.end is missing; allowed: a joint of the skeleton"
                    ));
                }
            };
            let toe = match &doc.toe {
                Some(toe) if toe.is_empty() => None,
                Some(toe) => Some(joint(&format!("{field}.toe"), toe)?),
                None => found.and_then(|found| found.toe),
            };
            let made = Limb {
                girdle,
                // A robot's hip or shoulder begins above its last hinge.
                top: found
                    .filter(|found| found.upper[0] == upper[0])
                    .map_or(upper[0], |found| found.top),
                upper,
                lower,
                end,
                toe,
            };
            descend(field, &made, skeleton)?;
            Ok(Some(made))
        };
        let found = found.as_ref();
        let list =
            |field: &str, names: &Option<Vec<String>>, own: Option<&Vec<usize>>, least: usize| match names {
                Some(names) => joints(field, names, least),
                None => Ok(own.cloned().unwrap_or_default()),
            };
        let legs = [
            limb("left_leg", &self.left_leg, found.map(|parts| &parts.legs[0]))?,
            limb("right_leg", &self.right_leg, found.map(|parts| &parts.legs[1]))?,
        ];
        let own = found.and_then(|parts| parts.arms.as_ref());
        let arm = |field: &str, doc: &Option<LimbDoc>, found: Option<&Limb>| match doc {
            Some(doc) if doc.end.as_deref() == Some("") => Ok(None),
            doc => limb(field, doc, found),
        };
        let arms = [
            arm("left_arm", &self.left_arm, own.map(|arms| &arms[0]))?,
            arm("right_arm", &self.right_arm, own.map(|arms| &arms[1]))?,
        ];
        let trunk = list("trunk", &self.trunk, found.map(|parts| &parts.trunk), 1)?;
        let ([Some(left), Some(right)], false) = (legs, trunk.is_empty()) else {
            return Err("no body is found; trunk, left_leg and right_leg are needed".to_owned());
        };
        Ok(Parts {
            trunk,
            neck: list("neck", &self.neck, found.map(|parts| &parts.neck), 0)?,
            tail: list("tail", &self.tail, found.map(|parts| &parts.tail), 0)?,
            legs: [left, right],
            arms: match arms {
                [Some(left), Some(right)] => Some([left, right]),
                _ => None,
            },
            on_fours: self.on_fours.unwrap_or(found.is_some_and(|parts| parts.on_fours)),
        })
    }
}

/// Refuses a limb whose bones do not hang on each other.
fn descend(field: &str, limb: &Limb, skeleton: &Skeleton) -> Result<(), String> {
    let [top, middle, end] = limb.chain();
    let mut bones = vec![("lower", middle, limb.upper[0]), ("end", end, middle)];
    bones.extend(limb.toe.map(|toe| ("toe", toe, end)));
    if limb.upper[0] != top {
        bones.push(("upper", limb.upper[0], top));
    }
    for (part, below, above) in bones {
        if !is_below(skeleton, below, above) {
            let [below, above] = [below, above].map(|joint| &*skeleton.joints[joint].name);
            return Err(format!(
                "{field}.{part} names {below:?}, which does not hang on {above:?}; allowed: a joint below that one"
            ));
        }
    }
    Ok(())
}
