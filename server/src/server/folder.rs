//! The packs of a folder: those that a server starts with, and those that it loads later.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};

use super::{PackSource, StartError};
use crate::config::Config;
use troupe_engine::Selector;
use troupe_engine::pack::{MANIFEST_FILE, Manifest, Pack, PackError, PackProblem, find_packs};
use troupe_service::{Offer, Stock, by_age};

/// Where the packs of a server come from.
pub trait Provider: Send + Sync + 'static {
    /// The packs that the server starts with. This blocks.
    ///
    /// # Errors
    /// [`StartError`] if one of them cannot be used.
    fn first(&self) -> Result<Vec<PackSource>, StartError>;

    /// The packs that could be loaded now. This blocks.
    ///
    /// # Errors
    /// Why they cannot be listed.
    fn stock(&self) -> Result<Stock, String>;

    /// Reads and checks a pack, without its networks. This blocks.
    ///
    /// # Errors
    /// [`StartError`], with what is wrong with the pack.
    fn read(&self, offer: &Offer) -> Result<Pack, StartError>;

    /// Chooses what runs a pack, beside `there` others. This blocks.
    ///
    /// # Errors
    /// [`StartError`] if no engine can run it.
    fn source(&self, pack: Pack, there: usize) -> Result<PackSource, StartError>;

    /// Frees what is kept of a pack whose workers have ended.
    fn forget(&self, _pack: &Pack) {}

    /// The folders as they are now, for a server that watches them. This blocks.
    ///
    /// # Errors
    /// Why they cannot be looked at.
    fn look(&self) -> Result<BTreeMap<PathBuf, Seen>, String> {
        Err("there is no folder to watch".to_owned())
    }
}

/// A folder with a manifest.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seen {
    /// Differs if a file was written, added or removed.
    pub print: Vec<FilePrint>,
    /// The pack. None if its manifest cannot be read.
    pub offer: Option<Offer>,
}

/// What a look sees of a file: name, size in bytes, time of its last change.
pub type FilePrint = (PathBuf, u64, Option<Duration>);

/// The packs of the folder that the configuration names.
pub(super) struct FolderPacks {
    config: Config,
    /// Made with the first packs, so that all share one pool of networks.
    selector: Mutex<Option<Selector>>,
}

impl FolderPacks {
    pub(super) fn new(config: Config) -> Self {
        Self {
            config,
            selector: Mutex::default(),
        }
    }

    /// The selector for `packs` packs.
    fn selector(&self, packs: usize) -> Result<Selector, StartError> {
        let mut kept = self.selector.lock().unwrap_or_else(PoisonError::into_inner);
        let selector = match kept.take() {
            Some(selector) => Selector { packs, ..selector },
            None => self.config.selector(packs).map_err(StartError::Library)?,
        };
        Ok(kept.insert(selector).clone())
    }
}

/// A pack with the engine that a selector chose.
fn source_of(pack: Pack, selector: &Selector, decision: troupe_engine::Decision) -> PackSource {
    let (selector, engine) = (selector.clone(), decision.engine);
    PackSource {
        pack,
        workers: decision.workers.count,
        generator: Box::new(move |pack, max_batch| selector.generator(pack, engine, max_batch)),
        decision: Some(decision),
    }
}

fn in_engine(pack: &Pack) -> impl FnOnce(troupe_engine::EngineError) -> StartError {
    let pack = pack.name().to_owned();
    |error| StartError::Engine { pack, error }
}

impl Provider for FolderPacks {
    fn first(&self) -> Result<Vec<PackSource>, StartError> {
        let packs = load_packs(&self.config)?;
        let selector = self.selector(packs.len())?;
        let decisions = selector.choose_all(&packs);
        let pairs = packs.into_iter().zip(decisions);
        pairs
            .map(|(pack, decision)| {
                let decision = decision.map_err(in_engine(&pack))?;
                Ok(source_of(pack, &selector, decision))
            })
            .collect()
    }

    fn stock(&self) -> Result<Stock, String> {
        let mut stock = Stock::default();
        for folder in find_packs(&self.config.packs).map_err(|error| error.to_string())? {
            match offer_of(&folder) {
                Ok(offer) => stock.offers.push(offer),
                Err(error) => stock.unusable.push(error.to_string()),
            }
        }
        Ok(stock)
    }

    fn read(&self, offer: &Offer) -> Result<Pack, StartError> {
        Ok(Pack::load(&offer.folder)?)
    }

    fn source(&self, pack: Pack, there: usize) -> Result<PackSource, StartError> {
        let selector = self.selector(there + 1)?;
        let decision = selector.choose(&pack).map_err(in_engine(&pack))?;
        Ok(source_of(pack, &selector, decision))
    }

    fn forget(&self, pack: &Pack) {
        let kept = self
            .selector
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        if let Some(selector) = kept {
            selector.pool.forget(pack);
        }
    }

    fn look(&self) -> Result<BTreeMap<PathBuf, Seen>, String> {
        let folders = find_packs(&self.config.packs).map_err(|error| error.to_string())?;
        let seen = |folder: PathBuf| {
            let print = print_of(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
            let offer = offer_of(&folder).ok();
            Ok((folder, Seen { print, offer }))
        };
        folders.into_iter().map(seen).collect()
    }
}

/// What the manifest in a folder says of its pack.
fn offer_of(folder: &Path) -> Result<Offer, PackError> {
    let path = folder.join(MANIFEST_FILE);
    let text = std::fs::read_to_string(&path).map_err(|cause| PackProblem::Read { path, cause });
    let manifest = text.and_then(|text| Manifest::parse(&text));
    let manifest = manifest.map_err(|problem| PackError {
        folder: folder.to_owned(),
        problem,
    })?;
    Ok(Offer {
        name: manifest.name,
        version: manifest.version,
        folder: folder.to_owned(),
    })
}

/// Folders of folders in a pack that a look goes into, such as that of its styles.
const DEPTH: usize = 2;

/// The files of a folder and of those inside, by name.
fn print_of(folder: &Path) -> std::io::Result<Vec<FilePrint>> {
    let mut print = Vec::new();
    add_files(folder, Path::new(""), DEPTH, &mut print)?;
    print.sort_unstable();
    Ok(print)
}

fn add_files(folder: &Path, within: &Path, depth: usize, print: &mut Vec<FilePrint>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = within.join(entry.file_name());
        // Behind links too: some tools replace the target.
        let about = std::fs::metadata(entry.path())?;
        if about.is_dir() {
            if depth > 0 {
                add_files(&entry.path(), &name, depth - 1, print)?;
            }
            continue;
        }
        let changed = about.modified().ok();
        let changed = changed.and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok());
        print.push((name, about.len(), changed));
    }
    Ok(())
}

/// The packs that `config` names, checked but without their networks. If folders have several
/// versions of a pack, it is the newest.
///
/// # Errors
/// [`StartError`] if a pack cannot be used, or if two folders have the same version of a pack.
pub fn load_packs(config: &Config) -> Result<Vec<Pack>, StartError> {
    let mut packs: Vec<Pack> = Vec::new();
    for folder in find_packs(&config.packs)? {
        let pack = Pack::load(&folder)?;
        let Some(other) = packs.iter_mut().find(|other| other.name() == pack.name()) else {
            packs.push(pack);
            continue;
        };
        let (version, before) = (pack.manifest.version.clone(), other.manifest.version.clone());
        match by_age(&before, &version) {
            std::cmp::Ordering::Equal => {
                let problem = PackProblem::DuplicateName(pack.name().to_owned());
                return Err(PackError { folder, problem }.into());
            }
            std::cmp::Ordering::Less => *other = pack,
            std::cmp::Ordering::Greater => {}
        }
        let (name, served) = (other.name(), &other.manifest.version);
        tracing::info!(
            pack = name,
            served,
            "the folder has several versions of the pack; the newest serves"
        );
    }
    Ok(packs)
}

/// The packs that `config` names, each with its best engine.
///
/// # Errors
/// [`StartError`] if a pack or the requested engine cannot be used.
pub fn packs_of(config: &Config) -> Result<Vec<PackSource>, StartError> {
    FolderPacks::new(config.clone()).first()
}

/// Size of the files of a pack's networks, bytes.
pub(super) fn file_bytes(pack: &Pack) -> u64 {
    let size = |file: &&str| std::fs::metadata(pack.folder.join(file)).map_or(0, |about| about.len());
    let files = pack.files();
    files.iter().map(size).sum()
}

#[cfg(test)]
#[path = "folder_tests.rs"]
mod tests;
