//! Loads packs while the server runs, if there is memory for them.

use std::fmt::{self, Debug, Formatter};
use std::sync::{Arc, Mutex, PoisonError};

use tokio::task::spawn_blocking;

use super::folder::{Provider, file_bytes};
use super::load;
use crate::config::Config;
use troupe_base::telemetry::Telemetry;
use troupe_engine::machine::{free_memory_bytes, resident_bytes};
use troupe_engine::pack::Pack;
use troupe_service::{Loading, Offer, Shelf, Stock};

/// Memory of a pack's networks by the size of its files, where no pack was measured.
const USUAL_RATIO: f64 = 4.0;
/// Measurements that are kept.
const MAX_MEASURED: usize = 64;

/// The packs of a provider, as a running server loads them.
pub(super) struct ServerShelf {
    config: Config,
    max_connections: usize,
    telemetry: Telemetry,
    provider: Arc<dyn Provider>,
    measured: Mutex<Vec<Measured>>,
}

/// How much memory loading took.
#[derive(Debug, Clone, PartialEq)]
struct Measured {
    /// Family of the pack. Empty: packs of all families, at the server's start.
    family: String,
    /// Size of the files, bytes.
    files: u64,
    /// Growth of the process, bytes.
    taken: u64,
}

impl Debug for ServerShelf {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.debug_struct("ServerShelf").finish_non_exhaustive()
    }
}

impl ServerShelf {
    pub(super) fn new(
        config: Config,
        max_connections: usize,
        telemetry: Telemetry,
        provider: Arc<dyn Provider>,
    ) -> Self {
        Self {
            config,
            max_connections,
            telemetry,
            provider,
            measured: Mutex::default(),
        }
    }

    /// Notes by how much the process has grown from `before` to `after` with these packs.
    pub(super) fn measured<'a>(
        &self,
        packs: impl IntoIterator<Item = &'a Pack>,
        family: &str,
        (before, after): (Option<u64>, Option<u64>),
    ) {
        let files = packs.into_iter().map(file_bytes).sum();
        let (Some(before), Some(after)) = (before, after) else {
            return;
        };
        let mut all = self.measured.lock().unwrap_or_else(PoisonError::into_inner);
        if all.len() == MAX_MEASURED {
            all.remove(0);
        }
        all.push(Measured {
            family: family.to_owned(),
            files,
            taken: after.saturating_sub(before),
        });
    }

    /// Memory by size of files: the most that was measured for the family, or else at the start.
    fn ratio(&self, family: &str) -> (f64, &'static str) {
        let all = self.measured.lock().unwrap_or_else(PoisonError::into_inner);
        let of = |family: &str| {
            let like = all.iter().filter(|one| one.family == family && one.files > 0);
            let ratios = like.map(|one| one.taken as f64 / one.files as f64);
            // Other work may have freed memory since.
            ratios.map(|ratio| ratio.max(1.0)).reduce(f64::max)
        };
        match (of(family), of("")) {
            (Some(ratio), _) => (ratio, "as measured for packs of its family"),
            (None, Some(ratio)) => (ratio, "as measured at the start"),
            (None, None) => (USUAL_RATIO, "as is usual"),
        }
    }
}

impl Shelf for ServerShelf {
    fn stock(&self) -> Result<Stock, String> {
        self.provider.stock()
    }

    fn read(&self, offer: &Offer) -> Result<Pack, String> {
        self.provider.read(offer).map_err(|error| error.to_string())
    }

    fn estimate(&self, pack: &Pack, there: &[Arc<Pack>]) -> Result<u64, String> {
        let all = there.iter().map(|pack| &**pack).chain([pack]);
        let worst = self.config.worst_case(all, self.max_connections);
        worst.within(self.config.memory_limit_bytes())?;
        let files = file_bytes(pack);
        let (ratio, why) = self.ratio(&pack.manifest.family);
        let need = (files as f64 * ratio) as u64;
        within(need, free_memory_bytes(), (files, ratio, why))?;
        Ok(need)
    }

    fn load(&self, pack: Pack, there: usize) -> Loading<'_> {
        Box::pin(async move {
            let (provider, family) = (self.provider.clone(), pack.manifest.family.clone());
            let before = resident_bytes();
            let source = spawn_blocking(move || provider.source(pack, there)).await;
            let source = source.map_err(|_| "the task that chooses its engine has stopped".to_owned())?;
            let source = source.map_err(|error| error.to_string())?;
            let loaded = load(&self.config, &self.telemetry, source).await;
            let loaded = loaded.map_err(|error| error.to_string())?;
            self.measured([&*loaded.pack], &family, (before, resident_bytes()));
            Ok(loaded)
        })
    }

    fn forget(&self, pack: &Pack) {
        self.provider.forget(pack);
    }
}

/// Checks that `need` bytes are `free`. `files` have that size, and take `ratio` times as much.
fn within(need: u64, free: Option<u64>, (files, ratio, why): (u64, f64, &str)) -> Result<(), String> {
    match free {
        Some(free) if need > free => Err(format!(
            "it needs about {} MiB: files of {} MiB, times {ratio:.1} {why}; the machine or container has {} MiB \
             left; allowed: unload a pack first, or give the server more memory",
            need.div_ceil(1 << 20),
            files.div_ceil(1 << 20),
            free >> 20
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
#[path = "shelf_tests.rs"]
mod tests;
