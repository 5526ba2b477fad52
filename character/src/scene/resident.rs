//! Counts the sessions in a scene.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::SceneCell;

/// The count of a scene that no session can enter any more.
const CLOSED: usize = usize::MAX;

/// Counts the sessions in a scene.
#[derive(Debug, Default)]
pub(super) struct Residents(AtomicUsize);

impl Residents {
    /// Number of sessions in the scene; 0 once it is closed.
    pub(super) fn count(&self) -> usize {
        match self.0.load(Ordering::Acquire) {
            CLOSED => 0,
            count => count,
        }
    }

    /// Counts one more. `false` if the scene is closed.
    fn enter(&self) -> bool {
        let more = |count| (count != CLOSED).then(|| count + 1);
        self.0
            .fetch_update(Ordering::AcqRel, Ordering::Acquire, more)
            .is_ok()
    }

    fn leave(&self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }

    /// Closes the scene, if no session is in it. Otherwise returns their number.
    pub(super) fn close(&self) -> Result<(), usize> {
        self.0
            .compare_exchange(0, CLOSED, Ordering::AcqRel, Ordering::Acquire)
            .map(|_| ())
    }
}

/// A session's place in a scene, which cannot be removed while it exists. Dropping it leaves the
/// scene.
#[derive(Debug)]
pub struct Resident {
    name: Arc<str>,
    cell: Arc<SceneCell>,
}

impl Resident {
    /// A place in the scene of this name. `None` if the scene is being removed.
    pub(super) fn enter(name: &str, cell: &Arc<SceneCell>) -> Option<Self> {
        cell.residents.enter().then(|| Self {
            name: Arc::from(name),
            cell: Arc::clone(cell),
        })
    }

    /// Name of the scene when it was entered.
    pub fn name(&self) -> &Arc<str> {
        &self.name
    }

    /// The scene, also after it was removed from its table.
    pub fn cell(&self) -> &Arc<SceneCell> {
        &self.cell
    }
}

impl Drop for Resident {
    fn drop(&mut self) {
        self.cell.residents.leave();
    }
}
