//! Documents of a pack's skills.

use serde::{Deserialize, Serialize};

use super::{
    AnchorDoc, BoxDoc, Motion, ObjectDoc, Origin, ReleaseDoc, SetDoc, ShapeDoc, TriggerDoc, VariantDoc,
};

/// A whole skill: what a character does on the spot. The origin of each set's keyframes is the
/// place of the character at the start of the set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkillDoc {
    /// Version of the format: 1.
    pub format: u32,
    /// Letters, digits, '-', '_' or '.'.
    pub name: String,
    /// A description for people.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
    /// Ways to do it.
    pub variants: Vec<VariantDoc>,
    /// The phases of all variants.
    pub sets: Vec<SetDoc>,
}

impl From<SkillDoc> for ObjectDoc {
    /// The definition of an object without a place, because no set uses its place. The networks
    /// make all sets that do not say otherwise, also those with low hips.
    fn from(skill: SkillDoc) -> Self {
        let set = |set: SetDoc| SetDoc {
            origin: Origin::Character,
            motion: set.motion.or(Some(Motion::Plan)),
            ..set
        };
        Self {
            format: skill.format,
            name: skill.name,
            description: skill.description,
            solid: false,
            shared: true,
            shape: ShapeDoc::Box(BoxDoc {
                center_m: [0.0; 3],
                half_extents_m: [0.1; 3],
            }),
            trigger: TriggerDoc::default(),
            anchor: AnchorDoc::default(),
            release: ReleaseDoc::default(),
            approaches: Vec::new(),
            sockets: Vec::new(),
            variants: skill.variants,
            sets: skill.sets.into_iter().map(set).collect(),
        }
    }
}
