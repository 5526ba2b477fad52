//! The packs that a server has loaded.

mod fit;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use troupe_batch::{Batcher, PackMetrics};
use troupe_character::document::DocumentError;
use troupe_character::skill::Skills;
use troupe_character::style::{StyleError, StyleTable};
use troupe_engine::pack::Pack;
use troupe_motion::model::{Capability, Rig};

pub use fit::Shape;

/// Maximum number of characters of a requested name that an error repeats.
const MAX_ECHO: usize = 64;

/// A pack together with the batcher in front of its engine.
#[derive(Debug)]
pub struct LoadedPack {
    /// Manifest, rig and bodies, as read from the pack's folder.
    pub pack: Arc<Pack>,
    /// Groups requests into batches for the engine.
    pub batcher: Batcher,
    /// Name of the engine that runs the networks.
    pub engine: &'static str,
    /// Locomotion styles, one table per body in the order of the bodies. A pack without bodies has
    /// one table, for its only skeleton.
    pub styles: Vec<Arc<StyleTable>>,
    /// Skills that the characters can use on the spot.
    pub skills: Arc<Skills>,
    /// Times and counts of this pack's batches, labelled with its name and version.
    pub metrics: PackMetrics,
}

/// The requested pack is not loaded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown pack {name:?}; loaded: {}", loaded.join(", "))]
pub struct UnknownPack {
    /// The requested name, cut to 64 characters.
    pub name: String,
    /// The field of the request that has the name.
    pub field: String,
    /// Names of all loaded packs.
    pub loaded: Vec<String>,
}

/// The pack lacks the capability that the request needs.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the pack {pack} cannot do this: it has no capability {wanted}; it has: {}",
    names(can)
)]
pub struct CannotDo {
    /// The pack's name.
    pub pack: String,
    /// The missing capability.
    pub wanted: Capability,
    /// The field of the request that names the pack.
    pub field: String,
    /// The capabilities of the pack.
    pub can: Vec<Capability>,
}

/// The pack has no body of the requested name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.text())]
pub struct UnknownBody {
    /// The pack's name.
    pub pack: String,
    /// The requested name, cut to 64 characters.
    pub name: String,
    /// The field of the request that has the name.
    pub field: String,
    /// Names of the pack's bodies. Empty for a pack with one skeleton.
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

/// Loads the styles of a pack: one table per body, or one for its only skeleton. Added styles are
/// read from the subfolder of `folder` that has the pack's name.
///
/// # Errors
/// [`StyleError`] if a file of styles cannot be used.
pub fn load_styles(pack: &Pack, folder: Option<PathBuf>) -> Result<Vec<Arc<StyleTable>>, StyleError> {
    each_styles(pack, folder, |_, rig, folder| {
        StyleTable::load(rig, &pack.folder, folder)
    })
}

/// Loads the skills of a pack. A pack with bodies has none. Skills that are too short for the pack
/// are logged, and refused when they are asked for.
///
/// # Errors
/// [`DocumentError`], boxed because it is much larger than the other errors of a server's start.
pub fn load_skills(pack: &Pack) -> Result<Arc<Skills>, Box<DocumentError>> {
    match pack.bodies.is_empty() {
        true => {
            let skills = Skills::load(&pack.folder, &pack.rig)?;
            for (skill, short) in skills.too_short() {
                tracing::warn!(
                    pack = pack.name(),
                    skill,
                    set = short.set,
                    "the skill is not offered: the set has {} frames, and the pack makes at least {} at a time; allowed: \
                     more frames, or another pack",
                    short.frames,
                    short.least
                );
            }
            Ok(Arc::new(skills))
        }
        false => Ok(Arc::default()),
    }
}

/// Calls `table` with the index, rig and folder of each body, or once for the pack's only skeleton.
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
    /// Checks that the pack has `capability`. `field` is the field of the request that names the
    /// pack.
    ///
    /// # Errors
    /// [`CannotDo`] if the pack lacks it.
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

    /// The index of a body in the pack's bodies and in [`LoadedPack::styles`]. An empty name means
    /// the default body. The index is 0 for a pack with one skeleton. `field` is the field of the
    /// request that has the name.
    ///
    /// # Errors
    /// [`UnknownBody`] if the pack has no such body.
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

    /// The styles of a body. The arguments are those of [`LoadedPack::place_of`].
    ///
    /// # Errors
    /// [`UnknownBody`] if the pack has no such body.
    pub(crate) fn styles_of(
        &self,
        field: impl ToString,
        body: &str,
    ) -> Result<&Arc<StyleTable>, UnknownBody> {
        Ok(&self.styles[self.place_of(field, body)?])
    }

    /// The rig of the body with index `place`, or the rig of the pack's only skeleton.
    pub fn rig(&self, place: usize) -> &Arc<Rig> {
        self.pack
            .bodies
            .get(place)
            .map_or(&self.pack.rig, |body| &body.rig)
    }

    /// Whether the body with index `place` can walk in a style from one keyframe to the next.
    pub fn walks(&self, place: usize) -> bool {
        self.pack.manifest.capabilities.has(Capability::Inbetween)
            && self.rig(place).by_path.is_none()
            && self.styles[place].default_style().is_some()
    }

    /// The pack for one tenant: the built-in styles and the tenant's own, which `folder` keeps.
    ///
    /// # Errors
    /// [`StyleError`] if a file of the tenant's styles cannot be used.
    pub(crate) fn of_tenant(&self, folder: Option<PathBuf>) -> Result<Self, StyleError> {
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

/// All packs of a server, by name.
#[derive(Debug, Clone, Default)]
pub struct PackTable {
    packs: BTreeMap<String, Arc<LoadedPack>>,
    default: String,
}

impl PackTable {
    /// Makes a table. `default` must be the name of one of `packs`.
    pub fn new(packs: Vec<LoadedPack>, default: String) -> Self {
        let packs = packs
            .into_iter()
            .map(|loaded| (loaded.pack.name().to_owned(), Arc::new(loaded)))
            .collect();
        Self { packs, default }
    }

    /// The pack called `name`. An empty name means the default pack. `field` is the field of the
    /// request that has the name.
    ///
    /// # Errors
    /// [`UnknownPack`] if no such pack is loaded.
    pub fn find(&self, field: impl ToString, name: &str) -> Result<&Arc<LoadedPack>, UnknownPack> {
        let wanted = if name.is_empty() { &self.default } else { name };
        self.packs.get(wanted).ok_or_else(|| UnknownPack {
            name: wanted.chars().take(MAX_ECHO).collect(),
            field: field.to_string(),
            loaded: self.packs.keys().cloned().collect(),
        })
    }

    /// The same packs for one tenant, see [`LoadedPack::of_tenant`].
    ///
    /// # Errors
    /// [`StyleError`] if a file of the tenant's styles cannot be used.
    pub(crate) fn of_tenant(&self, folder: Option<PathBuf>) -> Result<Self, StyleError> {
        let of = |loaded: &Arc<LoadedPack>| {
            let name = loaded.pack.name().to_owned();
            Ok((name, Arc::new(loaded.of_tenant(folder.clone())?)))
        };
        Ok(Self {
            packs: self.all().map(of).collect::<Result<_, StyleError>>()?,
            default: self.default.clone(),
        })
    }

    /// The pack called `name`. `None`: it is not loaded.
    pub fn get(&self, name: &str) -> Option<&Arc<LoadedPack>> {
        self.packs.get(name)
    }

    /// A table with `loaded` too, which takes the place of a pack of its name.
    pub(crate) fn with(&self, loaded: Arc<LoadedPack>) -> Self {
        let mut table = self.clone();
        table.packs.insert(loaded.pack.name().to_owned(), loaded);
        table
    }

    /// A table without the pack called `name`.
    pub(crate) fn without(&self, name: &str) -> Self {
        let mut table = self.clone();
        table.packs.remove(name);
        table
    }

    /// All packs, sorted by name.
    pub fn all(&self) -> impl Iterator<Item = &Arc<LoadedPack>> {
        self.packs.values()
    }

    /// Whether a request without a pack's name gets this pack.
    pub fn is_default(&self, loaded: &LoadedPack) -> bool {
        loaded.pack.name() == self.default
    }
}
