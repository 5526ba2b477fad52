//! The packs that a server has loaded.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use troupe_batch::{Batcher, PackMetrics};
use troupe_character::document::DocumentError;
use troupe_character::skill::Skills;
use troupe_character::style::{StyleError, StyleTable};
use troupe_engine::pack::Pack;
use troupe_motion::model::{Capability, Rig};

/// Most characters of a pack's name that an error echoes.
const MAX_ECHO: usize = 64;

/// A pack and the way to its engine.
#[derive(Debug)]
pub struct LoadedPack {
    /// The pack.
    pub pack: Arc<Pack>,
    /// The way to its engine.
    pub batcher: Batcher,
    /// The engine's name.
    pub engine: &'static str,
    /// Its locomotion styles: of each of its bodies, in their order, or of its one skeleton.
    pub styles: Vec<Arc<StyleTable>>,
    /// What its characters can do where they stand.
    pub skills: Arc<Skills>,
    /// Its metrics.
    pub metrics: PackMetrics,
}

/// A pack that is not loaded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown pack {name:?}; loaded: {}", loaded.join(", "))]
pub struct UnknownPack {
    /// The name that was asked for.
    pub name: String,
    /// The field of the request that named it.
    pub field: String,
    /// The names that there are.
    pub loaded: Vec<String>,
}

/// A pack that cannot do what is asked of it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the pack {pack} cannot do this: it has no capability {wanted}; it has: {}",
    names(can)
)]
pub struct CannotDo {
    /// The pack's name.
    pub pack: String,
    /// What it would need.
    pub wanted: Capability,
    /// The field of the request that named it.
    pub field: String,
    /// What it can do.
    pub can: Vec<Capability>,
}

/// A body that a pack does not have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.text())]
pub struct UnknownBody {
    /// The pack's name.
    pub pack: String,
    /// The name that was asked for.
    pub name: String,
    /// The field of the request that named it.
    pub field: String,
    /// The names that there are; none for a pack of one skeleton.
    pub there_are: Vec<String>,
}

impl UnknownBody {
    fn text(&self) -> String {
        let Self { pack, name, .. } = self;
        match self.there_are.is_empty() {
            true => format!("the pack {pack} has one skeleton, and no body {name:?}"),
            false => format!(
                "the pack {pack} has no body {name:?}; it has {}",
                self.there_are.join(", ")
            ),
        }
    }
}

/// The styles of a pack: of each of its bodies, or of its one skeleton. Added ones are in `folder`,
/// below the pack's name.
///
/// # Errors
/// [`StyleError`].
pub fn load_styles(pack: &Pack, folder: Option<PathBuf>) -> Result<Vec<Arc<StyleTable>>, StyleError> {
    each_styles(pack, folder, |_, rig, folder| {
        StyleTable::load(rig, &pack.folder, folder)
    })
}

/// The skills of a pack; none of a pack of many bodies.
///
/// # Errors
/// [`DocumentError`], boxed: it is long beside the other reasons why a server does not start.
pub fn load_skills(pack: &Pack) -> Result<Arc<Skills>, Box<DocumentError>> {
    match pack.bodies.is_empty() {
        true => Ok(Arc::new(Skills::load(&pack.folder, &pack.rig)?)),
        false => Ok(Arc::default()),
    }
}

/// What `table` gives for each body of the pack (its place, rig and folder), or for the pack's one
/// skeleton.
fn each_styles(
    pack: &Pack,
    folder: Option<PathBuf>,
    table: impl Fn(usize, &Rig, Option<PathBuf>) -> Result<StyleTable, StyleError>,
) -> Result<Vec<Arc<StyleTable>>, StyleError> {
    if pack.bodies.is_empty() {
        return Ok(vec![Arc::new(table(0, &pack.rig, folder)?)]);
    }
    let folder = folder.map(|folder| folder.join(pack.name()));
    let bodies = pack.bodies.iter().enumerate();
    bodies
        .map(|(index, body)| Ok(Arc::new(table(index, &body.rig, folder.clone())?)))
        .collect()
}

fn names(capabilities: &[Capability]) -> String {
    let names: Vec<&str> = capabilities.iter().map(|able| able.name()).collect();
    names.join(", ")
}

impl LoadedPack {
    /// Checks that the pack can do what the request asks for; `field` names the pack in the
    /// request.
    ///
    /// # Errors
    /// [`CannotDo`].
    pub fn require(&self, capability: Capability, field: impl ToString) -> Result<(), CannotDo> {
        let capabilities = self.pack.manifest.capabilities;
        match capabilities.has(capability) {
            true => Ok(()),
            false => Err(CannotDo {
                pack: self.pack.name().to_owned(),
                wanted: capability,
                field: field.to_string(),
                can: capabilities.list().collect(),
            }),
        }
    }

    /// The place of a body among the pack's, which is that of its styles too; of the default one
    /// where the name, given in `field`, is empty. 0 for a pack of one skeleton.
    ///
    /// # Errors
    /// [`UnknownBody`].
    pub fn place_of(&self, field: impl ToString, name: &str) -> Result<usize, UnknownBody> {
        let bodies = &self.pack.bodies;
        if bodies.is_empty() && name.is_empty() {
            return Ok(0);
        }
        let found = self.pack.body(name);
        let place = found.and_then(|body| bodies.iter().position(|other| Arc::ptr_eq(other, body)));
        place.ok_or_else(|| UnknownBody {
            pack: self.pack.name().to_owned(),
            name: name.chars().take(MAX_ECHO).collect(),
            field: field.to_string(),
            there_are: bodies.iter().map(|body| body.name.clone()).collect(),
        })
    }

    /// The styles of a body, as [`LoadedPack::place_of`].
    ///
    /// # Errors
    /// [`UnknownBody`].
    pub fn styles_of(&self, field: impl ToString, body: &str) -> Result<&Arc<StyleTable>, UnknownBody> {
        Ok(&self.styles[self.place_of(field, body)?])
    }

    /// The rig of the body at a place, or that of the pack's one skeleton.
    pub fn rig(&self, place: usize) -> &Arc<Rig> {
        self.pack
            .bodies
            .get(place)
            .map_or(&self.pack.rig, |body| &body.rig)
    }

    /// The pack with a tenant's own styles beside those that came with it, kept in `folder`.
    ///
    /// # Errors
    /// [`StyleError`].
    pub fn of_tenant(&self, folder: Option<PathBuf>) -> Result<Self, StyleError> {
        let beside = |place: usize, rig: &Rig, folder| self.styles[place].beside(rig, folder);
        Ok(self.with_styles(each_styles(&self.pack, folder, beside)?))
    }

    fn with_styles(&self, styles: Vec<Arc<StyleTable>>) -> Self {
        Self {
            pack: self.pack.clone(),
            batcher: self.batcher.clone(),
            engine: self.engine,
            styles,
            skills: self.skills.clone(),
            metrics: self.metrics.clone(),
        }
    }
}

/// All packs of a server.
#[derive(Debug, Clone)]
pub struct PackTable {
    packs: BTreeMap<String, Arc<LoadedPack>>,
    default: String,
}

impl PackTable {
    /// A table whose default is `default`, one of the names of `packs`.
    pub fn new(packs: Vec<LoadedPack>, default: String) -> Self {
        let packs = packs
            .into_iter()
            .map(|loaded| (loaded.pack.name().to_owned(), Arc::new(loaded)))
            .collect();
        Self { packs, default }
    }

    /// The pack of that name, which the request gave in `field`; the default where it is empty.
    ///
    /// # Errors
    /// [`UnknownPack`].
    pub fn find(&self, field: impl ToString, name: &str) -> Result<&Arc<LoadedPack>, UnknownPack> {
        let wanted = if name.is_empty() { &self.default } else { name };
        self.packs.get(wanted).ok_or_else(|| UnknownPack {
            name: wanted.chars().take(MAX_ECHO).collect(),
            field: field.to_string(),
            loaded: self.packs.keys().cloned().collect(),
        })
    }

    /// A table of the same packs as [`LoadedPack::of_tenant`] gives them.
    ///
    /// # Errors
    /// [`StyleError`].
    pub fn of_tenant(&self, folder: Option<PathBuf>) -> Result<Self, StyleError> {
        let of = |loaded: &Arc<LoadedPack>| {
            let name = loaded.pack.name().to_owned();
            Ok((name, Arc::new(loaded.of_tenant(folder.clone())?)))
        };
        Ok(Self {
            packs: self.all().map(of).collect::<Result<_, StyleError>>()?,
            default: self.default.clone(),
        })
    }

    /// All of them, by name.
    pub fn all(&self) -> impl Iterator<Item = &Arc<LoadedPack>> {
        self.packs.values()
    }

    /// Whether a request that names no pack gets this one.
    pub fn is_default(&self, loaded: &LoadedPack) -> bool {
        loaded.pack.name() == self.default
    }
}
