//! The skeletons of a tenant, and the folder that keeps them.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard, Weak};

use troupe_character::document::{Document as _, DocumentError, Format, forget, is_full, keep, read_kept};
use troupe_character::{FieldError, Path};
use troupe_motion::retarget::{Figure, RetargetError};

use super::carrier::Ways;
use super::doc::{BodyDoc, SkeletonDoc};
use super::dress::Dress;
use super::error::SkeletonError;
use super::guest::Guests;
use super::worn::Worn;
use crate::packs::{LoadedPack, PackTable};
use crate::session::LivePack;
use crate::uploads::{Journal, Upload};
use crate::world::{MemoryHolder, NoMemory, UploadMemory};

/// Maximum number of skeletons of a tenant.
pub const MAX_SKELETONS: usize = 256;
/// Lengths of a skeleton's legs by those of a pack's.
const SCALES: RangeInclusive<f32> = 0.05..=20.0;
/// Most names that an error lists.
const LISTED: usize = 32;
/// Most characters of a name that an error repeats.
const MAX_ECHO: usize = 64;
/// Estimated memory of a joint: itself, and what is worn of it on a few packs, bytes.
const BYTES_PER_JOINT: usize = 2048;

type ByName = BTreeMap<Arc<str>, Arc<Own>>;

/// The skeletons of a tenant.
#[derive(Debug)]
pub struct Skeletons {
    all: RwLock<ByName>,
    /// Keeps them. `None`: they are lost when the server stops.
    folder: Option<PathBuf>,
    /// What has changed here. Held by the one writer.
    journal: Arc<Journal>,
    pub(super) guests: Guests,
    pub(super) ways: Ways,
}

/// A skeleton and the packs that it is worn on.
#[derive(Debug)]
pub(super) struct Own {
    pub(super) doc: SkeletonDoc,
    pub(super) figure: Figure,
    fits: Mutex<Vec<Fit>>,
}

/// A skeleton on a body of a pack.
#[derive(Debug)]
struct Fit {
    pack: String,
    place: usize,
    worn: Arc<Worn>,
    /// The pack as its newest sessions have it. It ends with them.
    live: Weak<LivePack>,
}

impl Own {
    pub(super) fn new(doc: SkeletonDoc) -> Result<Self, String> {
        Ok(Self {
            figure: doc.body.figure()?,
            doc,
            fits: Mutex::default(),
        })
    }

    fn fits(&self) -> MutexGuard<'_, Vec<Fit>> {
        self.fits.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The skeleton on a body of a pack. The first call for a body takes some milliseconds.
    fn on(
        &self,
        of: (&LoadedPack, usize),
        table: &PackTable,
        field: &str,
    ) -> Result<Arc<Worn>, SkeletonError> {
        let (loaded, place) = of;
        let is_it = |fit: &&Fit| fit.pack == loaded.pack.name() && fit.place == place;
        if let Some(fit) = self.fits().iter().find(is_it) {
            return Ok(fit.worn.clone());
        }
        let unfit = |(found, allowed): (String, String)| SkeletonError::Unfit {
            name: self.doc.name.clone(),
            pack: body_of(loaded, place).into(),
            faults: vec![format!("{found}; allowed: {allowed}")],
            field: field.to_owned(),
            allowed: allowed.into(),
            may_force: false,
        };
        let worn = Worn::new(&self.doc.name, &self.figure, of, table);
        let worn = worn.map_err(|error| unfit(apart(&error, self.figure.parts().on_fours)))?;
        let worn = Arc::new(worn);
        out_of_scale(worn.scale()).map_or(Ok(()), |fault| Err(unfit(fault)))?;
        let mut fits = self.fits();
        // Another call may have been faster.
        if let Some(fit) = fits.iter().find(is_it) {
            return Ok(fit.worn.clone());
        }
        fits.push(Fit {
            pack: loaded.pack.name().to_owned(),
            place,
            worn: worn.clone(),
            live: Weak::new(),
        });
        Ok(worn)
    }

    /// [`Own::on`], if its certificate passes or the skeleton was forced.
    pub(super) fn fit(
        &self,
        of: (&LoadedPack, usize),
        table: &PackTable,
        field: &str,
    ) -> Result<Arc<Worn>, SkeletonError> {
        let worn = self.on(of, table, field)?;
        let faults = worn.certificate().faults();
        match faults.is_empty() || self.doc.forced {
            true => Ok(worn),
            false => Err(SkeletonError::Unfit {
                name: self.doc.name.clone(),
                pack: body_of(of.0, of.1).into(),
                faults,
                field: field.to_owned(),
                allowed: "figures within the bar".into(),
                may_force: true,
            }),
        }
    }

    /// Checks that no session wears it.
    pub(super) fn check_unused(&self) -> Result<(), SkeletonError> {
        match self.sessions() {
            0 => Ok(()),
            sessions => Err(SkeletonError::InUse {
                name: self.doc.name.clone(),
                sessions,
            }),
        }
    }

    /// Number of sessions that wear it.
    pub(super) fn sessions(&self) -> usize {
        let fits = self.fits();
        fits.iter().map(|fit| fit.worn.wearers()).sum()
    }
}

/// Why motion of a pack cannot be carried over to a body on four legs or on two, and what is
/// allowed.
fn apart(error: &RetargetError, on_fours: bool) -> (String, String) {
    let [own, pack] = match on_fours {
        true => ["four", "two"],
        false => ["two", "four"],
    };
    match error {
        RetargetError::Legs { .. } => (
            format!("it stands on {own} legs, and the pack's body on {pack}"),
            format!("a body on {pack} legs"),
        ),
        other => (
            other.to_string(),
            "another pack, whose motion can be carried over".to_owned(),
        ),
    }
}

/// What is wrong with a scale, and what is allowed.
fn out_of_scale(scale: f32) -> Option<(String, String)> {
    let (low, high) = (SCALES.start(), SCALES.end());
    (!SCALES.contains(&scale)).then(|| {
        (
            format!("its legs are {} times as long as the pack's", three_digits(scale)),
            format!("{low} to {high} times, in metres"),
        )
    })
}

/// A number with its first three digits.
fn three_digits(value: f32) -> f32 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// The name of a pack, with that of its body.
fn body_of(loaded: &LoadedPack, place: usize) -> String {
    let name = loaded.pack.name();
    match loaded.pack.bodies.get(place) {
        Some(body) => format!("{name}/{}", body.name),
        None => name.to_owned(),
    }
}

impl MemoryHolder for Skeletons {
    fn bytes(&self) -> usize {
        let all = self.all();
        all.values().map(|own| bytes(own)).sum()
    }
}

fn bytes(own: &Own) -> usize {
    let text = match &own.doc.body {
        BodyDoc::Robot(robot) => robot.description.len(),
        BodyDoc::Joints(_) => 0,
    };
    text + own.figure.skeleton().joint_count() * BYTES_PER_JOINT
}

impl Skeletons {
    /// The skeletons that `folder` keeps. A file that cannot be used is skipped with a warning.
    ///
    /// # Errors
    /// [`DocumentError`] if the folder cannot be read.
    pub fn load(folder: Option<PathBuf>) -> Result<Self, DocumentError> {
        let check = |doc: SkeletonDoc| {
            let root = Path::root();
            Own::new(doc).map_err(|why| root.field("body").error(why, "a body"))
        };
        let kept = match &folder {
            Some(folder) => read_kept(folder, check, |own| &own.doc.name)?,
            None => Vec::new(),
        };
        let kept = kept.into_iter().take(MAX_SKELETONS);
        let all = kept.map(|own| (Arc::from(own.doc.name.as_str()), Arc::new(own)));
        Ok(Self {
            all: RwLock::new(all.collect()),
            folder,
            journal: Arc::default(),
            guests: Guests::default(),
            ways: Ways::default(),
        })
    }

    /// The same skeletons, whose changes `journal` has.
    pub(crate) fn noting(self, journal: Arc<Journal>) -> Self {
        Self { journal, ..self }
    }

    pub(super) fn all(&self) -> RwLockReadGuard<'_, ByName> {
        self.all.read().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn changing(&self) -> RwLockWriteGuard<'_, ByName> {
        self.all.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Number of skeletons.
    pub fn count(&self) -> usize {
        self.all().len()
    }

    /// All skeletons, sorted by name.
    pub(super) fn list(&self) -> Vec<Arc<Own>> {
        self.all().values().cloned().collect()
    }

    /// The skeleton of this name. `field` is the field of the request that has the name.
    pub(super) fn get(&self, field: &str, name: &str) -> Result<Arc<Own>, SkeletonError> {
        let all = self.all();
        all.get(name).cloned().ok_or_else(|| SkeletonError::Unknown {
            name: name.chars().take(MAX_ECHO).collect(),
            field: field.to_owned(),
            known: all.keys().take(LISTED).map(ToString::to_string).collect(),
        })
    }

    /// Adds a skeleton, or replaces one that no session wears. Its motion on the body `of` must
    /// pass, unless it is forced. This may write a file, which blocks.
    ///
    /// # Errors
    /// [`SkeletonError`]. Then nothing has changed.
    pub(super) fn put(
        &self,
        doc: SkeletonDoc,
        of: (&LoadedPack, usize),
        table: &PackTable,
        memory: &UploadMemory,
    ) -> Result<Arc<Own>, SkeletonError> {
        let mut changed = self.journal.change();
        let before = self.all().get(doc.name.as_str()).cloned();
        if let Some(same) = before.as_ref().filter(|before| before.doc == doc) {
            same.fit(of, table, "source")?;
            return Ok(same.clone());
        }
        let text = serde_json::to_string(&doc).unwrap_or_default();
        if text.len() > SkeletonDoc::MAX_BYTES {
            let message = format!("takes {} bytes as a skeleton", text.len());
            let allowed = format!("at most {}", SkeletonDoc::MAX_BYTES);
            return Err(Path::root().field("source").error(message, allowed).into());
        }
        let no_body = |why: String| FieldError {
            field: "source".to_owned(),
            message: why,
            allowed: "a body on two legs or four".to_owned(),
        };
        let own = Arc::new(Own::new(doc).map_err(no_body)?);
        own.fit(of, table, "source")?;
        self.room(&own, before.as_deref(), memory)?;
        self.take_in(&own, before.as_deref(), &text)?;
        changed.note(Upload::Skeleton(own.doc.name.clone()));
        Ok(own)
    }

    /// Checks that a skeleton fits, in the place of the one `before`.
    pub(super) fn room(
        &self,
        own: &Own,
        before: Option<&Own>,
        memory: &UploadMemory,
    ) -> Result<(), SkeletonError> {
        if before.is_none() && self.count() >= MAX_SKELETONS {
            return Err(SkeletonError::Full { most: MAX_SKELETONS });
        }
        let no_room = |cause: NoMemory| SkeletonError::NoMemory {
            name: own.doc.name.clone(),
            cause,
        };
        memory.check(bytes(own), before.map_or(0, bytes)).map_err(no_room)
    }

    /// Writes the file of a skeleton, `text`, and then has it found instead of the one `before`: no
    /// session can wear a skeleton whose file cannot be written.
    fn take_in(&self, own: &Arc<Own>, before: Option<&Own>, text: &str) -> Result<(), SkeletonError> {
        let name = own.doc.name.as_str();
        before.map_or(Ok(()), Own::check_unused)?;
        self.write(name, text)?;
        let mut all = self.changing();
        // A session may have begun to wear the one before while the file was written.
        if let Some(before) = before
            && let Err(error) = before.check_unused()
        {
            drop(all);
            self.write(name, &serde_json::to_string(&before.doc).unwrap_or_default())?;
            return Err(error);
        }
        all.insert(Arc::from(name), own.clone());
        Ok(())
    }

    fn write(&self, name: &str, text: &str) -> Result<(), SkeletonError> {
        match &self.folder {
            Some(folder) => keep(folder, name, Format::Json, text).map_err(|cause| not_kept(name, &cause)),
            None => Ok(()),
        }
    }

    /// Removes a skeleton that no session wears, and its file. This blocks.
    ///
    /// # Errors
    /// [`SkeletonError`] if there is no such skeleton, or sessions wear it. Then nothing has
    /// changed. [`SkeletonError::NotKept`] if its file cannot be removed. Then it is back after a
    /// restart.
    pub(super) fn delete(&self, name: &str) -> Result<(), SkeletonError> {
        let mut changed = self.journal.change();
        let own = self.get("name", name)?;
        let mut all = self.changing();
        own.check_unused()?;
        all.remove(name);
        drop(all);
        changed.note(Upload::Skeleton(name.to_owned()));
        match &self.folder {
            Some(folder) => forget(folder, name).map_err(|cause| not_kept(name, &cause)),
            None => Ok(()),
        }
    }

    /// The skeleton called `name` on the body with index `place` of a pack. `field` is the field of
    /// the request that has the name. The first call for a body takes some milliseconds.
    ///
    /// # Errors
    /// [`SkeletonError::Unknown`], or [`SkeletonError::Unfit`] if it does not fit the pack.
    pub fn worn(
        &self,
        field: &str,
        name: &str,
        of: (&LoadedPack, usize),
        table: &PackTable,
    ) -> Result<Arc<Worn>, SkeletonError> {
        self.get(field, name)?.fit(of, table, field)
    }

    /// As [`Skeletons::worn`], without regard to its certificate.
    pub(super) fn tried(
        own: &Own,
        of: (&LoadedPack, usize),
        table: &PackTable,
    ) -> Result<Arc<Worn>, SkeletonError> {
        own.on(of, table, "pack")
    }

    /// A pack whose characters wear the skeleton called `name`, which all sessions of both share;
    /// and what one of them wears.
    ///
    /// # Errors
    /// As [`Skeletons::worn`].
    pub fn wear(
        &self,
        field: &str,
        name: &str,
        pack: &Arc<LivePack>,
        table: &PackTable,
    ) -> Result<(Arc<LivePack>, Dress), SkeletonError> {
        loop {
            let own = self.get(field, name)?;
            let worn = own.fit((&pack.loaded(), pack.place()), table, field)?;
            // While this lock is held, the skeleton is neither replaced nor deleted.
            let all = self.all();
            if !all.get(name).is_some_and(|now| Arc::ptr_eq(now, &own)) {
                continue;
            }
            let dress = worn.dress_for_session();
            let mut fits = own.fits();
            let fit = fits.iter_mut().find(|fit| Arc::ptr_eq(&fit.worn, &worn));
            let live = || Arc::new(pack.wearing(worn.clone()));
            let known = fit.as_ref().and_then(|fit| fit.live.upgrade());
            let live = known
                .filter(|known| known.is_version_of(pack))
                .unwrap_or_else(live);
            if let Some(fit) = fit {
                fit.live = Arc::downgrade(&live);
            }
            return Ok((live, dress));
        }
    }
}

fn not_kept(name: &str, cause: &std::io::Error) -> SkeletonError {
    let is_disk_full = is_full(cause);
    if !is_disk_full {
        tracing::error!(skeleton = name, %cause, "the file of an upload cannot be written or removed");
    }
    SkeletonError::NotKept {
        message: format!("skeleton {name:?} cannot be written to its folder: {cause}"),
        is_disk_full,
    }
}

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;
