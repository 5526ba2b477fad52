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
use crate::object::{Definition, Hold, MAX_BYTES, ObjectDoc, TooShort};
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
    /// The skills in the folder `skills` of a pack. The folder may be missing. Skills that are too
    /// short for the pack are there, but cannot be done ([`Definition::too_short`]).
    ///
    /// # Errors
    /// [`DocumentError`] for the first file that is not a skill of this pack, or has the same name
    /// as another.
    pub fn load(pack_folder: &FilePath, rig: &Rig) -> Result<Self, DocumentError> {
        let skills = read_folder(
            &pack_folder.join(FOLDER),
            |doc| of_doc(doc, rig, Definition::from_kept),
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

    /// The skill of this name, even if it is too short for the pack.
    pub fn get(&self, name: &str) -> Option<&Arc<Definition>> {
        self.by_name.get(name)
    }

    /// All skills that can be done, sorted by name.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<Definition>> {
        self.by_name.values().filter(|skill| skill.too_short.is_none())
    }

    /// The skills that are too short for the pack, sorted by name.
    pub fn too_short(&self) -> impl Iterator<Item = (&str, &TooShort)> {
        let all = self.by_name.values();
        all.filter_map(|skill| Some((skill.name.as_str(), skill.too_short.as_ref()?)))
    }

    /// Names of the skills that can be done, sorted.
    pub fn names(&self) -> Vec<String> {
        self.iter().map(|skill| skill.name.clone()).collect()
    }
}

impl Definition {
    /// Reads the TOML text of a skill and checks it for `rig`.
    ///
    /// # Errors
    /// [`DocumentError`] for the first error.
    pub fn skill_from_toml(text: &str, rig: &Rig) -> Result<Self, DocumentError> {
        read(text, Format::Toml, |doc| of_doc(doc, rig, Self::from_doc))
    }

    /// Whether one of its sets is held until a command ends it.
    pub fn is_held(&self) -> bool {
        self.sets.iter().any(|set| set.hold == Hold::UntilEnded)
    }
}

/// Checks a skill. `checked` checks what it has in common with an object.
fn of_doc(
    doc: SkillDoc,
    rig: &Rig,
    checked: impl Fn(ObjectDoc, &Rig) -> Result<Definition, FieldError>,
) -> Result<Definition, FieldError> {
    let path = Path::root();
    for (index, set) in doc.sets.iter().enumerate() {
        if !set.events.is_empty() {
            let events = path.element("sets", index);
            let found = format!("has {} of them", set.events.len());
            return Err(events.field("events").error(found, "none: a skill has no object"));
        }
    }
    let skill = checked(doc.into(), rig)?;
    Ok(Definition {
        is_skill: true,
        ..skill
    })
}

#[cfg(test)]
mod tests {
    use troupe_engine::pack::Pack;

    use super::*;

    #[test]
    fn skills_that_are_too_short_for_a_pack_are_known_and_not_offered() {
        let folder = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../models/g1");
        let mut rig = (*Pack::load(&folder).unwrap().rig).clone();
        let all = Skills::load(&folder, &rig).unwrap();
        assert_eq!(all.names(), ["jump", "lie-down", "sit-on-ground"]);
        assert_eq!(all.too_short().count(), 0);
        // The published networks make 24 to 64 frames, of which four are the context.
        rig.dims.min_tokens = 6;
        let some = Skills::load(&folder, &rig).unwrap();
        assert_eq!(some.names(), ["lie-down"]);
        let short: Vec<_> = some
            .too_short()
            .map(|(name, short)| (name, short.least))
            .collect();
        assert_eq!(short, [("jump", 20), ("sit-on-ground", 20)]);
        assert_eq!(some.get("jump").unwrap().too_short.as_ref().unwrap().frames, 10);
    }

    #[test]
    fn a_new_skill_that_is_too_short_is_refused() {
        let folder = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../models/g1");
        let mut rig = (*Pack::load(&folder).unwrap().rig).clone();
        let text = std::fs::read_to_string(folder.join("skills/jump.toml")).unwrap();
        assert!(Definition::skill_from_toml(&text, &rig).is_ok());
        rig.dims.min_tokens = 6;
        let error = Definition::skill_from_toml(&text, &rig).unwrap_err().to_string();
        assert!(
            error.contains("sets[1].frames: is 10; allowed: 20 to 60"),
            "{error}"
        );
    }
}
