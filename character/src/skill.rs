//! Skills: what the characters of a pack can do on the spot, such as lying down, getting up and
//! jumping.
//!
//! A skill is written like the sets of a smart object ([`crate::object`]), but without an object:
//! the keyframes of each set are relative to where the character is when the set begins. A pack has
//! its skills in the folder `skills`, one TOML or JSON file each.

use std::collections::BTreeMap;
use std::path::Path as FilePath;
use std::sync::Arc;

use troupe_motion::model::Rig;
use troupe_proto::docs::SkillDoc;

use crate::document::{Document, DocumentError, Format, read, read_folder};
use crate::object::{Definition, Hold, MAX_BYTES};
use crate::{FieldError, Path};

/// Folder of a pack's skills inside the pack's folder.
const FOLDER: &str = "skills";

impl Document for SkillDoc {
    const WHAT: &'static str = "skill";
    const MAX_BYTES: usize = MAX_BYTES;
}

/// The skills of one pack, by name.
#[derive(Debug, Default)]
pub struct Skills {
    by_name: BTreeMap<String, Arc<Definition>>,
}

impl Skills {
    /// The skills in the folder `skills` of a pack. The folder may be missing.
    ///
    /// # Errors
    /// [`DocumentError`] for the first file that is not a skill of this pack, or has the same name
    /// as another.
    pub fn load(pack_folder: &FilePath, rig: &Rig) -> Result<Self, DocumentError> {
        let skills = read_folder(
            &pack_folder.join(FOLDER),
            |doc| of_doc(doc, rig),
            |skill| &skill.name,
        )?;
        Ok(Self::new(skills))
    }

    /// A table of these skills, whose names must differ.
    pub fn new(skills: impl IntoIterator<Item = Definition>) -> Self {
        let by_name = (skills.into_iter()).map(|skill| (skill.name.clone(), Arc::new(skill)));
        Self {
            by_name: by_name.collect(),
        }
    }

    /// The skill of this name.
    pub fn get(&self, name: &str) -> Option<&Arc<Definition>> {
        self.by_name.get(name)
    }

    /// All skills, sorted by name.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Arc<Definition>> {
        self.by_name.values()
    }

    /// Their names, sorted.
    pub fn names(&self) -> Vec<String> {
        self.by_name.keys().cloned().collect()
    }
}

impl Definition {
    /// Reads the TOML text of a skill and checks it for `rig`.
    ///
    /// # Errors
    /// [`DocumentError`] for the first error.
    pub fn skill_from_toml(text: &str, rig: &Rig) -> Result<Self, DocumentError> {
        read(text, Format::Toml, |doc| of_doc(doc, rig))
    }

    /// Whether one of its sets is held until a command ends it.
    pub fn is_held(&self) -> bool {
        self.sets.iter().any(|set| set.hold == Hold::UntilEnded)
    }
}

fn of_doc(doc: SkillDoc, rig: &Rig) -> Result<Definition, FieldError> {
    let path = Path::root();
    for (index, set) in doc.sets.iter().enumerate() {
        if !set.events.is_empty() {
            let events = path.element("sets", index);
            let found = format!("has {} of them", set.events.len());
            return Err(events.field("events").error(found, "none: a skill has no object"));
        }
    }
    let skill = Definition::from_doc(doc.into(), rig)?;
    Ok(Definition {
        is_skill: true,
        ..skill
    })
}
