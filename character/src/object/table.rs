//! The definitions of a server, by name.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use arc_swap::ArcSwap;

use super::{Definition, MAX_DEFINITIONS};
use crate::document::MAX_NAME_CHARS;
use crate::document::check::listed;
use crate::scene::{Bodies, Body, Scene, SceneTable};

/// A definition of the table.
#[derive(Debug, Clone)]
pub struct Listed {
    /// The definition.
    pub definition: Arc<Definition>,
    /// Grows with every upload to the table, so that no two uploads have the same.
    pub revision: u64,
}

/// All definitions as they were at one moment.
#[derive(Debug, Clone, Default)]
pub struct DefinitionList {
    by_name: BTreeMap<String, Listed>,
    /// That of the latest upload.
    revision: u64,
}

impl DefinitionList {
    /// The definition of this name.
    ///
    /// # Errors
    /// [`DefinitionsError::Unknown`].
    pub fn get(&self, name: &str) -> Result<&Listed, DefinitionsError> {
        self.by_name.get(name).ok_or_else(|| DefinitionsError::Unknown {
            name: name.chars().take(MAX_NAME_CHARS).collect(),
            known: self.by_name.keys().cloned().collect(),
        })
    }

    /// All of them, sorted by name.
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

/// Why the table was not changed, or has no answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DefinitionsError {
    /// A name that is no definition's.
    #[error("there is no object definition {name:?}; there are: {}", listed(known.iter().map(String::as_str)))]
    Unknown {
        /// The name.
        name: String,
        /// The definitions that there are.
        known: Vec<String>,
    },
    /// As many definitions as there may be.
    #[error("there are {MAX_DEFINITIONS} object definitions, the most that there may be")]
    Full,
    /// Objects of this definition are in scenes.
    #[error("object definition {name:?} is used in {}; allowed: one of which no scene has an object", listed(scenes.iter().map(String::as_str)))]
    InUse {
        /// The definition.
        name: String,
        /// The scenes.
        scenes: Vec<String>,
    },
}

/// What an upload did.
#[derive(Debug, Clone)]
pub struct Uploaded {
    /// The definition as it is in the table.
    pub definition: Arc<Definition>,
    /// Its revision.
    pub revision: u64,
    /// The definition that it took the place of.
    pub replaced: Option<Arc<Definition>>,
    /// Objects in scenes that have its body now.
    pub rebound: usize,
}

/// The definitions of a server. Reading takes no lock and sees a definition wholly or not at all.
///
/// Who began something with a definition keeps its `Arc` and ends with that, whatever becomes of
/// the name.
#[derive(Debug, Default)]
pub struct Definitions {
    list: ArcSwap<DefinitionList>,
    /// One writer at a time.
    writing: Mutex<()>,
}

impl Definitions {
    /// A table of these; of one name the last counts.
    ///
    /// # Errors
    /// [`DefinitionsError::Full`].
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

    /// All definitions as they are now; the list does not change under its reader.
    pub fn snapshot(&self) -> Arc<DefinitionList> {
        self.list.load_full()
    }

    /// The definition of this name.
    ///
    /// # Errors
    /// [`DefinitionsError::Unknown`].
    pub fn get(&self, name: &str) -> Result<Listed, DefinitionsError> {
        self.list.load().get(name).cloned()
    }

    /// Does `work` while no definition is replaced or removed. Whatever puts objects into a scene
    /// of the scene table, or a scene with objects into that table, is done here: else an object
    /// could come to have the body of a definition that has just been replaced, or that is no more.
    /// `work` must not upload or remove.
    pub fn while_unchanged<T>(&self, work: impl FnOnce(&DefinitionList) -> T) -> T {
        let _no_writer = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        work(&self.list.load())
    }

    /// Adds a definition, or replaces the one of its name: then all its objects in `scenes` get the
    /// new body ([`Scene::rebind`]).
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

    /// Takes a definition out, of which there are no objects in `scenes`.
    ///
    /// # Errors
    /// [`DefinitionsError::Unknown`], or [`DefinitionsError::InUse`], which names the scenes.
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

/// Rebinds the objects of all scenes. How many there were.
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
    /// Gives every object of this definition the body that it has now: the definition was replaced.
    /// Who has reserved or holds one goes on having it. How many objects there are.
    pub fn rebind(&mut self, definition: &Definition) -> usize {
        self.replace_body(&definition.name, &definition.body)
    }
}
