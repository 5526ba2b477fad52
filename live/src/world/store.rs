//! The scenes and definitions of a server, and the folders in which they are kept.

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
use crate::skeleton::Skeletons;
use crate::uploads::{Journal, Upload};

/// The folders of scenes, definitions and skeletons. The server reads them at its start and writes
/// uploads to them.
#[derive(Debug, Clone, Default)]
pub struct Folders {
    /// Scenes, one file each. `None`: uploads are lost when the server stops.
    pub scenes: Option<PathBuf>,
    /// Definitions: one folder per pack, with the pack's name, and one file per definition. `None`:
    /// uploads are lost when the server stops.
    pub objects: Option<PathBuf>,
    /// Skeletons of users' own, one file each. `None`: uploads are lost when the server stops.
    pub skeletons: Option<PathBuf>,
}

/// The scenes, definitions and skeletons of a server, or of a tenant.
#[derive(Debug)]
pub struct Store {
    scenes: Arc<SceneTable>,
    definitions: Arc<Definitions>,
    skeletons: Arc<Skeletons>,
    folders: Folders,
    memory: Arc<UploadMemory>,
    /// What has changed here. Its lock is taken before that of `kept`.
    journal: Arc<Journal>,
    /// Facts about the scenes' files. The lock also allows only one upload or deletion at a time.
    kept: Mutex<Kept>,
}

/// The scenes that are kept as files or that servers share, by name.
pub(super) type Kept = BTreeMap<String, KeptScene>;

/// Facts about a scene as it was uploaded.
#[derive(Debug)]
pub(super) struct KeptScene {
    /// Names of the definitions of its objects.
    definitions: BTreeSet<String>,
    /// Start of a hash of the content, or a random number if servers share the upload.
    pub(super) content: u64,
}

/// Why the folders cannot be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// A folder or file cannot be read.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// There are more definitions than a server may have.
    #[error(transparent)]
    Definitions(#[from] DefinitionsError),
    /// There are more scenes than a server may have.
    #[error(transparent)]
    Scenes(#[from] TableError),
}

/// Why an upload or a deletion failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// A definition is unknown, cannot be added, or cannot be deleted.
    #[error(transparent)]
    Definitions(#[from] DefinitionsError),
    /// A scene is unknown, cannot be added, or cannot be deleted.
    #[error(transparent)]
    Scenes(#[from] TableError),
    /// The file of a scene would be too long to be read again.
    #[error(
        "the file of scene {name:?} would have {bytes} bytes; allowed: at most {}",
        SceneDoc::MAX_BYTES
    )]
    TooLong {
        /// Name of the scene.
        name: String,
        /// Length of the file.
        bytes: usize,
    },
    /// With this upload, all uploads together would exceed their memory limit.
    #[error("{what} {name:?} {cause}")]
    NoMemory {
        /// `scene` or `object definition`.
        what: &'static str,
        /// Name of the upload.
        name: String,
        /// Size of the upload, size of all others, and the limit.
        cause: NoMemory,
    },
    /// A file could not be written or removed.
    #[error("{what} {name:?} cannot be written to its folder: {cause}")]
    Keep {
        /// `scene` or `object definition`.
        what: &'static str,
        /// Name of the scene or definition.
        name: String,
        /// The system's reason.
        cause: String,
        /// Whether the disk is full.
        full: bool,
    },
}

impl Store {
    /// Reads all files of `folders`. A definition is checked against the pack whose folder has it.
    /// A file that cannot be used is skipped with a warning. `max_bytes` limits the memory of all
    /// uploads that [`Store::memory`] counts.
    ///
    /// # Errors
    /// [`LoadError`] if a folder cannot be read, or has more entries than a server may have.
    pub fn load<'a>(
        folders: Folders,
        max_bytes: usize,
        packs: impl IntoIterator<Item = &'a Rig>,
    ) -> Result<Self, LoadError> {
        Self::load_within(folders, Arc::new(UploadMemory::new(max_bytes)), packs)
    }

    /// Reads the files of a tenant's `folders`. They share the memory limit with this store.
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
        let journal = Arc::<Journal>::default();
        let skeletons = Skeletons::load(folders.skeletons.clone())?;
        let skeletons = Arc::new(skeletons.noting(journal.clone()));
        memory.count(&scenes);
        memory.count(&definitions);
        memory.count(&skeletons);
        Ok(Self {
            scenes,
            definitions,
            skeletons,
            folders,
            memory,
            journal,
            kept: Mutex::new(kept),
        })
    }

    /// Reads the definitions of a pack that is loaded while the server runs. Those that are there
    /// stay.
    ///
    /// # Errors
    /// [`LoadError`] if the folder cannot be read, or there are too many definitions.
    pub(crate) fn read_definitions_of(&self, pack: &Rig) -> Result<(), LoadError> {
        let Some(folder) = &self.folders.objects else {
            return Ok(());
        };
        // No upload or deletion comes between.
        let _one = self.kept();
        let listed = self.definitions.snapshot();
        let mut all: Vec<Definition> = Vec::new();
        read_definitions(&folder.join(pack.name()), pack, &mut all)?;
        for definition in all {
            if listed.get(&definition.name).is_err() {
                self.definitions.upload(definition, &self.scenes)?;
            }
        }
        Ok(())
    }

    /// All scenes by name, with the sessions in them.
    pub fn scenes(&self) -> &SceneTable {
        &self.scenes
    }

    /// All object definitions by name.
    pub fn definitions(&self) -> &Arc<Definitions> {
        &self.definitions
    }

    /// The skeletons of users' own characters.
    pub fn skeletons(&self) -> &Arc<Skeletons> {
        &self.skeletons
    }

    /// The memory limit of all uploads of the server.
    pub fn memory(&self) -> &Arc<UploadMemory> {
        &self.memory
    }

    /// What has changed here, if servers share uploads.
    pub(crate) fn journal(&self) -> &Arc<Journal> {
        &self.journal
    }

    pub(super) fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a scene, or replaces the scene with its name. Sessions in the old scene are then in the
    /// new one. Returns the scene's name.
    ///
    /// `make` makes the scene. The definitions that it gets do not change until this returns.
    /// `text` is the scene's text, if it was uploaded as one. If there is a folder of scenes, this
    /// writes the scene to it, which blocks.
    ///
    /// # Errors
    /// The error of `make`, or [`StoreError`]. Then nothing has changed.
    pub fn put_scene<E: From<StoreError>>(
        &self,
        text: Option<(&str, Format)>,
        make: impl FnOnce(&DefinitionList) -> Result<NamedScene, E>,
    ) -> Result<String, E> {
        let mut changed = self.journal.change();
        let mut kept = self.kept();
        let name = self.definitions.while_unchanged(|definitions| {
            let NamedScene { name, scene } = make(definitions)?;
            self.room_for_scene(&name, &scene)?;
            if let Some(folder) = &self.folders.scenes {
                keep_scene(folder, &name, &scene, text)?;
                kept.insert(name.clone(), KeptScene::of(&name, &scene));
            }
            if changed.is_shared() {
                // Places of objects in the store are those of the upload before.
                kept.insert(name.clone(), KeptScene::with(rand::random(), &scene));
            }
            self.show_scene(&name, scene)?;
            Ok::<_, E>(name)
        })?;
        changed.note(Upload::Scene(name.clone()));
        Ok(name)
    }

    /// Checks that a scene fits, in the place of the one with its name.
    pub(super) fn room_for_scene(&self, name: &str, scene: &Scene) -> Result<(), StoreError> {
        self.scenes.room_for(name)?;
        let replaced = self.scenes.get(name).map_or(0, |cell| cell.snapshot().bytes());
        self.room("scene", name, scene.bytes(), replaced)
    }

    /// Has a scene found under its name. Sessions in the scene before are then in this one.
    pub(super) fn show_scene(&self, name: &str, scene: Scene) -> Result<(), StoreError> {
        match self.scenes.get(name) {
            Ok(cell) => {
                let Ok(()) = cell.update(|before| -> Result<(), Infallible> {
                    before.become_scene(scene);
                    Ok(())
                });
            }
            Err(_) => drop(self.scenes.add(name, scene)?),
        }
        Ok(())
    }

    /// Checks that there is room for an upload of `bytes`, which replaces one of `replaced` bytes.
    fn room(&self, what: &'static str, name: &str, bytes: usize, replaced: usize) -> Result<(), StoreError> {
        self.memory
            .check(bytes, replaced)
            .map_err(|cause| StoreError::NoMemory {
                what,
                name: name.to_owned(),
                cause,
            })
    }

    /// Removes a scene without sessions, and its file. This blocks.
    ///
    /// # Errors
    /// [`StoreError::Scenes`] if the scene is unknown or has sessions. Then nothing has changed.
    /// [`StoreError::Keep`] if its file cannot be removed. Then the scene is back after a restart.
    pub fn delete_scene(&self, name: &str) -> Result<(), StoreError> {
        let mut changed = self.journal.change();
        let mut kept = self.kept();
        self.scenes.remove(name)?;
        changed.note(Upload::Scene(name.to_owned()));
        if let Some(folder) = &self.folders.scenes {
            forget(folder, name).map_err(|cause| not_kept("scene", name, &cause))?;
        }
        kept.remove(name);
        Ok(())
    }

    /// Adds a definition, or replaces the definition with its name. `text` is its text. If there is
    /// a folder of definitions, this writes the text to it, which blocks.
    ///
    /// # Errors
    /// [`StoreError`]. Then nothing has changed.
    pub fn put_definition(
        &self,
        definition: Definition,
        text: &str,
        format: Format,
    ) -> Result<Uploaded, StoreError> {
        let mut changed = self.journal.change();
        let _one = self.kept();
        let before = self.definitions.snapshot();
        let replaced = before.get(&definition.name).ok();
        self.room_for_definition(&definition)?;
        if let Some(folder) = &self.folders.objects {
            let name = &definition.name;
            let not_kept = |cause: std::io::Error| not_kept("object definition", name, &cause);
            keep(&folder.join(&definition.pack), name, format, text).map_err(not_kept)?;
            if let Some(other) = replaced.filter(|other| other.definition.pack != definition.pack) {
                forget(&folder.join(&other.definition.pack), name).map_err(not_kept)?;
            }
        }
        changed.note(Upload::Definition(definition.name.clone()));
        Ok(self.definitions.upload(definition, &self.scenes)?)
    }

    /// Checks that a definition fits, in the place of the one with its name.
    pub(super) fn room_for_definition(&self, definition: &Definition) -> Result<(), StoreError> {
        let before = self.definitions.snapshot();
        let replaced = before.get(&definition.name).ok();
        if replaced.is_none() && before.iter().len() >= MAX_DEFINITIONS {
            return Err(DefinitionsError::Full.into());
        }
        let replaced = replaced.map_or(0, |other| other.definition.bytes());
        self.room(
            "object definition",
            &definition.name,
            definition.bytes(),
            replaced,
        )
    }

    /// Removes a definition and its file. No scene may have an object of it, neither in memory nor
    /// in its file. This blocks.
    ///
    /// # Errors
    /// [`StoreError::Definitions`] if the definition is unknown or in use. Then nothing has
    /// changed. [`StoreError::Keep`] if its file cannot be removed. Then the definition is back
    /// after a restart.
    pub fn delete_definition(&self, name: &str) -> Result<(), StoreError> {
        let mut changed = self.journal.change();
        let removed = self.remove_definition(&self.kept(), name)?;
        changed.note(Upload::Definition(name.to_owned()));
        if let Some(folder) = &self.folders.objects {
            forget(&folder.join(&removed.pack), name)
                .map_err(|cause| not_kept("object definition", name, &cause))?;
        }
        Ok(())
    }

    /// Removes a definition from memory, if no scene may have an object of it.
    pub(super) fn remove_definition(&self, kept: &Kept, name: &str) -> Result<Arc<Definition>, StoreError> {
        let names =
            |(scene, file): (&String, &KeptScene)| file.definitions.contains(name).then(|| scene.clone());
        let scenes: Vec<String> = kept.iter().filter_map(names).collect();
        if !scenes.is_empty() {
            let name = name.to_owned();
            return Err(DefinitionsError::InUse { name, scenes }.into());
        }
        Ok(self.definitions.remove(name, &self.scenes)?)
    }
}

/// Reads the definitions of one pack.
fn read_definitions(folder: &FilePath, pack: &Rig, all: &mut Vec<Definition>) -> Result<(), LoadError> {
    let check = |doc| Definition::from_kept(doc, pack);
    for definition in read_kept(folder, check, |definition| &definition.name)? {
        if all.iter().any(|before| before.name == definition.name) {
            let (folder, name) = (folder.display(), definition.name);
            tracing::warn!(
                "a file is skipped: {folder}: another pack has an object definition {name:?} too; \
                 allowed: a name that no other pack uses"
            );
            continue;
        }
        if let Some(short) = &definition.too_short {
            tracing::warn!(
                pack = pack.name(),
                definition = definition.name,
                set = short.set,
                "characters cannot use the object: the set has {} frames, and the pack makes at least {} at a time; \
                 allowed: more frames, or another pack",
                short.frames,
                short.least
            );
        }
        all.push(definition);
    }
    Ok(())
}

impl KeptScene {
    /// The facts about the file of `scene`.
    fn of(name: &str, scene: &Scene) -> Self {
        // A scene that cannot be written as text has no file, so its hash does not matter.
        let text = scene.to_doc(name).to_toml().unwrap_or_default();
        let hash: [u8; 32] = Sha256::digest(text.as_bytes()).into();
        let content = hash.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
        Self::with(content, scene)
    }

    /// The facts about a scene with this content.
    pub(super) fn with(content: u64, scene: &Scene) -> Self {
        let instances = scene.instances();
        Self {
            definitions: instances.map(|instance| instance.object.to_string()).collect(),
            content,
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
