//! Where the packs come from that a running server loads.

use std::cmp::Ordering;
use std::fmt::Debug;
use std::path::PathBuf;
use std::pin::Pin;
use std::sync::Arc;

use troupe_engine::pack::Pack;
use troupe_live::packs::LoadedPack;

use super::LifeError;

/// A pack that could be loaded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Offer {
    /// The name in its manifest.
    pub name: String,
    /// The version in its manifest.
    pub version: String,
    /// Where its manifest is.
    pub folder: PathBuf,
}

/// All packs that could be loaded.
#[derive(Debug, Clone, Default)]
pub struct Stock {
    /// Packs whose manifests can be read.
    pub offers: Vec<Offer>,
    /// Folders whose manifests cannot be read, with the reasons.
    pub unusable: Vec<String>,
}

/// A pack that is being loaded, or the reason why it cannot be.
pub type Loading<'a> = Pin<Box<dyn Future<Output = Result<LoadedPack, String>> + Send + 'a>>;

/// Finds and loads packs. Errors are texts for operators.
pub trait Shelf: Debug + Send + Sync {
    /// The packs that are there now. This blocks.
    ///
    /// # Errors
    /// Why the folder cannot be read.
    fn stock(&self) -> Result<Stock, String>;

    /// Reads and checks a pack, without its networks. This blocks.
    ///
    /// # Errors
    /// What is wrong with the pack.
    fn read(&self, offer: &Offer) -> Result<Pack, String>;

    /// The estimated memory of a pack's networks, bytes. `there` are the packs in memory.
    ///
    /// # Errors
    /// The figures, if there is no room for it.
    fn estimate(&self, pack: &Pack, there: &[Arc<Pack>]) -> Result<u64, String>;

    /// Chooses the engine of a pack, beside `there` others, and starts its workers.
    fn load(&self, pack: Pack, there: usize) -> Loading<'_>;

    /// Frees what is kept of a pack whose workers have ended.
    fn forget(&self, pack: &Pack);
}

impl Stock {
    /// The pack of this name and version. Without a version it is the newest.
    pub(super) fn find(&self, name: &str, version: &str) -> Option<Result<&Offer, LifeError>> {
        let named = self.offers.iter().filter(|offer| offer.name == name);
        let mut fitting = named.filter(|offer| version.is_empty() || offer.version == version);
        let first = fitting.next()?;
        let best = fitting.fold(first, |best, offer| match by_age(&best.version, &offer.version) {
            Ordering::Less => offer,
            Ordering::Equal | Ordering::Greater => best,
        });
        let same = |offer: &&Offer| (&offer.name, &offer.version) == (&best.name, &best.version);
        let folders: Vec<_> = self.offers.iter().filter(same).collect();
        Some(match folders.len() {
            1 => Ok(best),
            _ => Err(LifeError::Twice {
                wanted: format!("{} {}", best.name, best.version),
                folders: (folders.iter())
                    .map(|offer| offer.folder.display().to_string())
                    .collect(),
            }),
        })
    }
}

/// Compares versions, older ones first: numbers by their size, everything else by its letters.
pub fn by_age(one: &str, other: &str) -> Ordering {
    let parts = |version: &str| -> Vec<(u64, String)> {
        let parts = version.split(['.', '-', '+']);
        // Words come before numbers: 2.0-beta is older than 2.0.1.
        parts
            .map(|part| match part.parse::<u64>() {
                Ok(number) => (number.saturating_add(1), String::new()),
                Err(_) => (0, part.to_owned()),
            })
            .collect()
    };
    parts(one).cmp(&parts(other))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stock(packs: &[(&str, &str)]) -> Stock {
        let offers = packs.iter().enumerate().map(|(index, (name, version))| Offer {
            name: (*name).to_owned(),
            version: (*version).to_owned(),
            folder: index.to_string().into(),
        });
        Stock {
            offers: offers.collect(),
            unusable: Vec::new(),
        }
    }

    #[test]
    fn the_newest_version_is_found_by_its_numbers() {
        let stock = stock(&[("a", "1.9.0"), ("a", "1.10.0"), ("b", "7"), ("a", "1.2.0")]);
        let found = |name, version| {
            stock
                .find(name, version)
                .map(|found| found.unwrap().version.clone())
        };
        assert_eq!(found("a", "").as_deref(), Some("1.10.0"));
        assert_eq!(found("a", "1.2.0").as_deref(), Some("1.2.0"));
        assert_eq!(found("a", "2"), None);
        assert_eq!(found("c", ""), None);
    }

    #[test]
    fn a_version_in_two_folders_is_refused() {
        let stock = stock(&[("a", "2"), ("a", "1"), ("a", "2")]);
        let error = stock.find("a", "").unwrap().unwrap_err();
        assert_eq!(
            error.to_string(),
            "the pack a 2 is in 0 and in 2; allowed: one folder for a version"
        );
        assert!(stock.find("a", "1").unwrap().is_ok());
    }

    #[test]
    fn versions_compare_part_by_part() {
        assert_eq!(by_age("1.2", "1.2"), Ordering::Equal);
        assert_eq!(by_age("1.2", "1.2.1"), Ordering::Less);
        assert_eq!(by_age("2.0.0-beta", "2.0.0.1"), Ordering::Less);
        assert_eq!(by_age("10", "9"), Ordering::Greater);
    }
}
