//! The object definitions of a server, by name.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use arc_swap::ArcSwap;

use super::{Definition, MAX_DEFINITIONS};
use crate::document::MAX_NAME_CHARS;
use crate::document::check::listed;
use crate::scene::{Bodies, Body, Scene, SceneTable};

/// An entry of the table.
#[derive(Debug, Clone)]
pub struct Listed {
    /// The checked definition.
    pub definition: Arc<Definition>,
    /// Grows with every upload to the table, so no two uploads have the same.
    pub revision: u64,
}

/// All definitions at one moment.
#[derive(Debug, Clone, Default)]
pub struct DefinitionList {
    by_name: BTreeMap<String, Listed>,
    /// Revision of the newest upload.
    revision: u64,
}

impl DefinitionList {
    /// The definition of this name.
    ///
    /// # Errors
    /// [`DefinitionsError::Unknown`] if there is none.
    pub fn get(&self, name: &str) -> Result<&Listed, DefinitionsError> {
        self.by_name.get(name).ok_or_else(|| DefinitionsError::Unknown {
            name: name.chars().take(MAX_NAME_CHARS).collect(),
            known: self.by_name.keys().cloned().collect(),
        })
    }

    /// All definitions, sorted by name.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Listed> {
        self.by_name.values()
    }

    fn put(&mut self, definition: Arc<Definition>) -> Result<Option<Listed>, DefinitionsError> {
        if self.by_name.len() >= MAX_DEFINITIONS && !self.by_name.contains_key(&definition.name) {
            return Err(DefinitionsError::Full);
        }
        self.revision += 1;
        let revision = self.revision;
        let name = definition.name.clone();
        Ok(self.by_name.insert(name, Listed { definition, revision }))
    }
}

impl Bodies for DefinitionList {
    fn body(&self, definition: &str) -> Option<Arc<Body>> {
        let listed = self.by_name.get(definition)?;
        Some(Arc::clone(&listed.definition.body))
    }

    fn names(&self) -> Vec<&str> {
        self.by_name.keys().map(String::as_str).collect()
    }
}

/// Why the table was not changed, or has no such entry.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DefinitionsError {
    /// No definition has this name.
    #[error(
        "there is no object definition {name:?}; there are: {}",
        listed(known.iter().map(String::as_str))
    )]
    Unknown {
        /// The unknown name.
        name: String,
        /// The names that exist.
        known: Vec<String>,
    },
    /// The table holds [`MAX_DEFINITIONS`] definitions.
    #[error("there are {MAX_DEFINITIONS} object definitions, the most that there may be")]
    Full,
    /// Some scenes have objects of this definition.
    #[error(
        "object definition {name:?} is used in {}; allowed: a definition without objects in scenes",
        listed(scenes.iter().map(String::as_str))
    )]
    InUse {
        /// Name of the definition.
        name: String,
        /// Names of the scenes.
        scenes: Vec<String>,
    },
}

/// Result of an upload.
#[derive(Debug, Clone)]
pub struct Uploaded {
    /// The definition as it is in the table now.
    pub definition: Arc<Definition>,
    /// The new revision.
    pub revision: u64,
    /// The definition that it replaced.
    pub replaced: Option<Arc<Definition>>,
    /// Number of objects in scenes that have its body now.
    pub rebound: usize,
}

/// The definitions of a server. Reading takes no lock, and never sees half of a change.
///
/// An interaction keeps the `Arc` of the definition that it began with, and ends with that, even if
/// the name is replaced or removed.
#[derive(Debug, Default)]
pub struct Definitions {
    list: ArcSwap<DefinitionList>,
    /// Held by the one writer.
    writing: Mutex<()>,
}

impl Definitions {
    /// A table of these definitions. Of two with the same name the later counts.
    ///
    /// # Errors
    /// [`DefinitionsError::Full`] for more than [`MAX_DEFINITIONS`].
    pub fn new(definitions: impl IntoIterator<Item = Definition>) -> Result<Self, DefinitionsError> {
        let mut list = DefinitionList::default();
        for definition in definitions {
            list.put(Arc::new(definition))?;
        }
        Ok(Self {
            list: ArcSwap::from_pointee(list),
            writing: Mutex::new(()),
        })
    }

    /// All definitions as they are now. The list does not change afterwards.
    pub fn snapshot(&self) -> Arc<DefinitionList> {
        self.list.load_full()
    }

    /// The definition of this name.
    ///
    /// # Errors
    /// [`DefinitionsError::Unknown`] if there is none.
    pub fn get(&self, name: &str) -> Result<Listed, DefinitionsError> {
        self.list.load().get(name).cloned()
    }

    /// Runs `work` while no definition is replaced or removed. Everything that puts objects into a
    /// scene of the scene table, or a scene with objects into that table, must run here. Otherwise
    /// an object could get the body of a definition that was just replaced or removed. `work` must
    /// not upload or remove.
    pub fn while_unchanged<T>(&self, work: impl FnOnce(&DefinitionList) -> T) -> T {
        let _no_writer = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        work(&self.list.load())
    }

    /// Adds a definition, or replaces the one of its name. All objects of that one in `scenes` get
    /// the new body ([`Scene::rebind`]).
    ///
    /// # Errors
    /// [`DefinitionsError::Full`]; then nothing has changed.
    pub fn upload(&self, definition: Definition, scenes: &SceneTable) -> Result<Uploaded, DefinitionsError> {
        let _one = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let mut list = DefinitionList::clone(&self.list.load());
        let definition = Arc::new(definition);
        let replaced = list.put(Arc::clone(&definition))?;
        let revision = list.revision;
        self.list.store(Arc::new(list));
        let rebound = match replaced {
            Some(_) => rebind_all(&definition, scenes),
            None => 0,
        };
        Ok(Uploaded {
            definition,
            revision,
            replaced: replaced.map(|listed| listed.definition),
            rebound,
        })
    }

    /// Removes a definition without objects in `scenes`.
    ///
    /// # Errors
    /// [`DefinitionsError::Unknown`], or [`DefinitionsError::InUse`] with the names of the scenes.
    pub fn remove(&self, name: &str, scenes: &SceneTable) -> Result<Arc<Definition>, DefinitionsError> {
        let _one = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let mut list = DefinitionList::clone(&self.list.load());
        let removed = Arc::clone(&list.get(name)?.definition);
        let used_in: Vec<String> = (scenes.all().iter())
            .filter(|(_, cell)| cell.snapshot().uses(name))
            .map(|(scene, _)| scene.clone())
            .collect();
        if !used_in.is_empty() {
            return Err(DefinitionsError::InUse {
                name: name.to_owned(),
                scenes: used_in,
            });
        }
        list.by_name.remove(name);
        self.list.store(Arc::new(list));
        Ok(removed)
    }
}

/// Gives the objects of all scenes their new body. Returns their number.
fn rebind_all(definition: &Definition, scenes: &SceneTable) -> usize {
    let cells = scenes.all();
    let rebind = |cell: &crate::scene::SceneCell| {
        // A scene without such objects is not published again.
        let changed = cell.update(|scene| match scene.rebind(definition) {
            0 => Err(()),
            objects => Ok(objects),
        });
        changed.unwrap_or(0)
    };
    cells.values().map(|cell| rebind(cell)).sum()
}

impl Scene {
    /// Gives every object of this definition its new body after the definition was replaced.
    /// Reservations and holders stay. Returns the number of objects.
    pub fn rebind(&mut self, definition: &Definition) -> usize {
        self.replace_body(&definition.name, &definition.body)
    }
}
