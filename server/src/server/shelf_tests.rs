use std::path::{Path, PathBuf};

use super::super::StartError;
use super::super::folder::FolderPacks;
use super::*;
use crate::server::PackSource;
use troupe_character::testing::toy_rig;
use troupe_engine::pack::testing::pack_of;

/// Nothing to load.
struct Empty;

impl Provider for Empty {
    fn first(&self) -> Result<Vec<PackSource>, StartError> {
        Ok(Vec::new())
    }

    fn stock(&self) -> Result<Stock, String> {
        Ok(Stock::default())
    }

    fn read(&self, offer: &Offer) -> Result<Pack, StartError> {
        Err(StartError::Packs(offer.name.clone()))
    }

    fn source(&self, pack: Pack, _: usize) -> Result<PackSource, StartError> {
        Err(StartError::Packs(pack.name().to_owned()))
    }
}

fn shelf(change: impl FnOnce(&mut Config)) -> ServerShelf {
    let mut config = Config::local(Path::new("unused")).unwrap();
    change(&mut config);
    ServerShelf::new(config, 100, Telemetry::new().unwrap(), Arc::new(Empty))
}

/// A pack with three files of a mebibyte each.
fn pack(folder: &Path) -> Pack {
    let mut pack = pack_of(toy_rig());
    for file in pack.files() {
        std::fs::write(folder.join(file), vec![0; 1 << 20]).unwrap();
    }
    pack.folder = folder.to_owned();
    pack
}

#[test]
fn memory_is_estimated_by_what_like_packs_took() {
    let folder = tempfile::tempdir().unwrap();
    let (shelf, pack) = (shelf(|_| {}), pack(folder.path()));
    let mib = |shelf: &ServerShelf| shelf.estimate(&pack, &[]).unwrap() >> 20;
    assert_eq!(mib(&shelf), 12, "four times its files");
    shelf.measured([&pack], "", (Some(100 << 20), Some(106 << 20)));
    assert_eq!(mib(&shelf), 6, "as at the start");
    shelf.measured([&pack], "vermo", (Some(0), Some(90 << 20)));
    assert_eq!(mib(&shelf), 6, "another family does not count");
    shelf.measured([&pack], "motionbricks", (Some(0), Some(9 << 20)));
    shelf.measured([&pack], "motionbricks", (Some(9 << 20), Some(0)));
    assert_eq!(mib(&shelf), 9, "the most of its family");
}

#[test]
fn a_pack_beyond_the_limit_is_refused_with_the_option() {
    let folder = tempfile::tempdir().unwrap();
    let mut large = pack(folder.path());
    large.manifest.parameters = 1 << 30;
    let shelf = shelf(|config| config.memory_limit_mib = 8192);
    let error = shelf.estimate(&large, &[]).unwrap_err();
    assert!(
        error.starts_with("memory_limit_mib is 8192, but the server may take "),
        "{error}"
    );
    assert!(error.contains("program and weights 16512 MiB (packs)"), "{error}");
}

#[test]
fn a_pack_without_free_memory_is_refused_with_figures() {
    let figures = (3 << 20, 4.0, "as is usual");
    assert_eq!(within(12 << 20, Some(12 << 20), figures), Ok(()));
    assert_eq!(within(12 << 20, None, figures), Ok(()), "the system does not say");
    let error = within(12 << 20, Some(11 << 20), figures).unwrap_err();
    assert_eq!(
        error,
        "it needs about 12 MiB: files of 3 MiB, times 4.0 as is usual; the machine or container has 11 MiB left; \
         allowed: unload a pack first, or give the server more memory"
    );
}

#[test]
fn a_folder_that_is_not_there_is_no_stock() {
    let packs = FolderPacks::new(Config::local(&PathBuf::from("nowhere")).unwrap());
    assert!(packs.stock().unwrap_err().contains("nowhere"));
    assert!(packs.look().unwrap_err().contains("nowhere"));
}
