//! The scenes and definitions of a server, and the folders that they are kept in.

use std::collections::{BTreeMap, BTreeSet};
use std::convert::Infallible;
use std::path::{Path as FilePath, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use sha2::{Digest as _, Sha256};
use troupe_character::document::{Document as _, DocumentError, Format, forget, is_full, keep, read_kept};
use troupe_character::object::{
    Definition, DefinitionList, Definitions, DefinitionsError, MAX_DEFINITIONS, Uploaded,
};
use troupe_character::scene::{NamedScene, Scene, SceneDoc, SceneTable, TableError};
use troupe_motion::model::Rig;

use super::memory::{NoMemory, UploadMemory};

/// Where scenes and definitions are read from as the server starts, and kept when they are
/// uploaded.
#[derive(Debug, Clone, Default)]
pub struct Folders {
    /// Scenes, a file each. `None`: uploaded ones last until the server stops.
    pub scenes: Option<PathBuf>,
    /// Definitions: a folder for each pack, named as the pack, with a file each. `None`: uploaded
    /// ones last until the server stops.
    pub objects: Option<PathBuf>,
}

/// The scenes and definitions of a server, or of a tenant.
#[derive(Debug)]
pub struct Store {
    scenes: Arc<SceneTable>,
    definitions: Arc<Definitions>,
    folders: Folders,
    memory: Arc<UploadMemory>,
    /// The definitions that the kept files of scenes name. One upload or deletion at a time has it.
    kept: Mutex<Kept>,
}

/// The scenes that are kept as files, by name.
type Kept = BTreeMap<String, KeptScene>;

/// A scene as its file has it.
#[derive(Debug)]
pub(super) struct KeptScene {
    /// The definitions that it names.
    definitions: BTreeSet<String>,
    /// Tells it from a file of other content.
    pub(super) content: u64,
}

/// A file as the server starts that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// It is not what it should be.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// More definitions than a server may have.
    #[error(transparent)]
    Definitions(#[from] DefinitionsError),
    /// More scenes than a server may have.
    #[error(transparent)]
    Scenes(#[from] TableError),
}

/// Why nothing was uploaded or deleted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// A definition that is not there, cannot be there, or cannot go.
    #[error(transparent)]
    Definitions(#[from] DefinitionsError),
    /// A scene that is not there, cannot be there, or cannot go.
    #[error(transparent)]
    Scenes(#[from] TableError),
    /// A scene that takes more room as a file than can be read again.
    #[error(
        "scene {name:?} takes {bytes} bytes as a file, of at most {}",
        SceneDoc::MAX_BYTES
    )]
    TooLong {
        /// The scene.
        name: String,
        /// How long it is.
        bytes: usize,
    },
    /// Uploads would take more memory than they may.
    #[error("{what} {name:?} {cause}")]
    NoMemory {
        /// What it is.
        what: &'static str,
        /// Its name.
        name: String,
        /// What takes how much.
        cause: NoMemory,
    },
    /// It could not be written to its folder, or removed from there.
    #[error("{what} {name:?} cannot be written to its folder: {cause}")]
    Keep {
        /// What it is.
        what: &'static str,
        /// Its name.
        name: String,
        /// Why.
        cause: String,
        /// Whether the disk is full.
        full: bool,
    },
}

impl Store {
    /// Reads all files of `folders`. Definitions are checked for that of `packs` whose folder they
    /// are in. A file that cannot be used is left out with a warning. Scenes, definitions and
    /// whatever else [`Store::memory`] counts may take `max_bytes` in all.
    ///
    /// # Errors
    /// [`LoadError`] where a folder cannot be read, or holds more than a server may have.
    pub fn load<'a>(
        folders: Folders,
        max_bytes: usize,
        packs: impl IntoIterator<Item = &'a Rig>,
    ) -> Result<Self, LoadError> {
        Self::load_within(folders, Arc::new(UploadMemory::new(max_bytes)), packs)
    }

    /// Reads the files of a tenant's `folders`. They share the memory with those of this store.
    ///
    /// # Errors
    /// [`LoadError`], as [`Store::load`].
    pub fn beside<'a>(
        &self,
        folders: Folders,
        packs: impl IntoIterator<Item = &'a Rig>,
    ) -> Result<Self, LoadError> {
        Self::load_within(folders, self.memory.clone(), packs)
    }

    fn load_within<'a>(
        folders: Folders,
        memory: Arc<UploadMemory>,
        packs: impl IntoIterator<Item = &'a Rig>,
    ) -> Result<Self, LoadError> {
        let mut definitions: Vec<Definition> = Vec::new();
        if let Some(folder) = &folders.objects {
            for pack in packs {
                read_definitions(&folder.join(pack.name()), pack, &mut definitions)?;
            }
        }
        let definitions = Arc::new(Definitions::new(definitions)?);
        let (scenes, mut kept) = (SceneTable::default(), Kept::new());
        if let Some(folder) = &folders.scenes {
            let bodies = definitions.snapshot();
            let check = |doc| NamedScene::from_doc(doc, &*bodies);
            for NamedScene { name, scene } in read_kept(folder, check, |named| &named.name)? {
                kept.insert(name.clone(), KeptScene::of(&name, &scene));
                scenes.add(&name, scene)?;
            }
        }
        let scenes = Arc::new(scenes);
        memory.count(&scenes);
        memory.count(&definitions);
        Ok(Self {
            scenes,
            definitions,
            folders,
            memory,
            kept: Mutex::new(kept),
        })
    }

    /// The scenes.
    pub fn scenes(&self) -> &SceneTable {
        &self.scenes
    }

    /// The definitions.
    pub fn definitions(&self) -> &Arc<Definitions> {
        &self.definitions
    }

    /// What all uploads of the server may take.
    pub fn memory(&self) -> &Arc<UploadMemory> {
        &self.memory
    }

    pub(super) fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a scene, or replaces the one of its name: those who are in it are in the new one at
    /// once. `make` makes it, of the definitions as they are and will be until this is done; `text`
    /// is what it was made from, where it was from a text. Writes it to the folder of scenes, where
    /// there is one: this blocks. Gives the scene's name.
    ///
    /// # Errors
    /// That of `make`, or [`StoreError`]; then nothing has changed.
    pub fn put_scene<E: From<StoreError>>(
        &self,
        text: Option<(&str, Format)>,
        make: impl FnOnce(&DefinitionList) -> Result<NamedScene, E>,
    ) -> Result<String, E> {
        let mut kept = self.kept();
        self.definitions.while_unchanged(|definitions| {
            let NamedScene { name, scene } = make(definitions)?;
            self.scenes.room_for(&name).map_err(StoreError::from)?;
            let replaced = self.scenes.get(&name).map_or(0, |cell| cell.snapshot().bytes());
            self.room("scene", &name, scene.bytes(), replaced)?;
            if let Some(folder) = &self.folders.scenes {
                keep_scene(folder, &name, &scene, text)?;
                kept.insert(name.clone(), KeptScene::of(&name, &scene));
            }
            match self.scenes.get(&name) {
                Ok(cell) => {
                    let Ok(()) = cell.update(|before| -> Result<(), Infallible> {
                        before.become_scene(scene);
                        Ok(())
                    });
                }
                Err(_) => {
                    self.scenes.add(&name, scene).map_err(StoreError::from)?;
                }
            }
            Ok(name)
        })
    }

    /// Whether what is uploaded may take so much memory, where it takes the place of something that
    /// takes `replaced`.
    fn room(&self, what: &'static str, name: &str, bytes: usize, replaced: usize) -> Result<(), StoreError> {
        self.memory
            .check(bytes, replaced)
            .map_err(|cause| StoreError::NoMemory {
                what,
                name: name.to_owned(),
                cause,
            })
    }

    /// Takes out a scene in which there are no sessions, and its file. This blocks.
    ///
    /// # Errors
    /// [`StoreError::Scenes`]; then nothing has changed. [`StoreError::Keep`] where its file could
    /// not be removed: then it comes back when the server starts again.
    pub fn delete_scene(&self, name: &str) -> Result<(), StoreError> {
        let mut kept = self.kept();
        self.scenes.remove(name)?;
        if let Some(folder) = &self.folders.scenes {
            forget(folder, name).map_err(|cause| not_kept("scene", name, &cause))?;
        }
        kept.remove(name);
        Ok(())
    }

    /// Adds a definition that was read from `text`, or replaces the one of its name. Writes it to
    /// the folder of definitions, where there is one: this blocks.
    ///
    /// # Errors
    /// [`StoreError`]; then nothing has changed.
    pub fn put_definition(
        &self,
        definition: Definition,
        text: &str,
        format: Format,
    ) -> Result<Uploaded, StoreError> {
        let _one = self.kept();
        let before = self.definitions.snapshot();
        let replaced = before.get(&definition.name).ok();
        if replaced.is_none() && before.iter().len() >= MAX_DEFINITIONS {
            return Err(DefinitionsError::Full.into());
        }
        let replaced_bytes = replaced.map_or(0, |other| other.definition.bytes());
        self.room(
            "object definition",
            &definition.name,
            definition.bytes(),
            replaced_bytes,
        )?;
        if let Some(folder) = &self.folders.objects {
            let name = &definition.name;
            let not_kept = |cause: std::io::Error| not_kept("object definition", name, &cause);
            keep(&folder.join(&definition.pack), name, format, text).map_err(not_kept)?;
            if let Some(other) = replaced.filter(|other| other.definition.pack != definition.pack) {
                forget(&folder.join(&other.definition.pack), name).map_err(not_kept)?;
            }
        }
        Ok(self.definitions.upload(definition, &self.scenes)?)
    }

    /// Takes out a definition of which no scene has an object, as it is or as it is kept, and its
    /// file. This blocks.
    ///
    /// # Errors
    /// [`StoreError::Definitions`]; then nothing has changed. [`StoreError::Keep`] where its file
    /// could not be removed: then it comes back when the server starts again.
    pub fn delete_definition(&self, name: &str) -> Result<(), StoreError> {
        let kept = self.kept();
        let names =
            |(scene, file): (&String, &KeptScene)| file.definitions.contains(name).then(|| scene.clone());
        let scenes: Vec<String> = kept.iter().filter_map(names).collect();
        if !scenes.is_empty() {
            let name = name.to_owned();
            return Err(DefinitionsError::InUse { name, scenes }.into());
        }
        let removed = self.definitions.remove(name, &self.scenes)?;
        if let Some(folder) = &self.folders.objects {
            forget(&folder.join(&removed.pack), name)
                .map_err(|cause| not_kept("object definition", name, &cause))?;
        }
        Ok(())
    }
}

/// Reads the definitions of one pack.
fn read_definitions(folder: &FilePath, pack: &Rig, all: &mut Vec<Definition>) -> Result<(), LoadError> {
    let check = |doc| Definition::from_doc(doc, pack);
    for definition in read_kept(folder, check, |definition| &definition.name)? {
        if all.iter().any(|before| before.name == definition.name) {
            let (folder, name) = (folder.display(), definition.name);
            tracing::warn!(
                "a file is left out: {folder}: object definition {name:?} is that of another pack too; allowed: a name of its \
                 own for each"
            );
            continue;
        }
        all.push(definition);
    }
    Ok(())
}

impl KeptScene {
    /// What is kept of `scene`.
    fn of(name: &str, scene: &Scene) -> Self {
        let instances = scene.instances();
        // A scene that cannot be written as text is not kept, so the empty one stands for none.
        let text = scene.to_doc(name).to_toml().unwrap_or_default();
        let hash: [u8; 32] = Sha256::digest(text.as_bytes()).into();
        Self {
            definitions: instances.map(|instance| instance.object.to_string()).collect(),
            content: hash.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes)),
        }
    }
}

fn keep_scene(
    folder: &FilePath,
    name: &str,
    scene: &Scene,
    text: Option<(&str, Format)>,
) -> Result<(), StoreError> {
    let kept = match text {
        Some((text, format)) => keep(folder, name, format, text),
        None => {
            let text = scene.to_doc(name).to_toml().map_err(|cause| StoreError::Keep {
                what: "scene",
                name: name.to_owned(),
                cause: cause.to_string(),
                full: false,
            })?;
            if text.len() > SceneDoc::MAX_BYTES {
                return Err(StoreError::TooLong {
                    name: name.to_owned(),
                    bytes: text.len(),
                });
            }
            keep(folder, name, Format::Toml, &text)
        }
    };
    kept.map_err(|cause| not_kept("scene", name, &cause))
}

fn not_kept(what: &'static str, name: &str, cause: &std::io::Error) -> StoreError {
    StoreError::Keep {
        what,
        name: name.to_owned(),
        cause: cause.to_string(),
        full: is_full(cause),
    }
}
