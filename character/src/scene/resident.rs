//! Who lives in a scene.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::SceneCell;

/// The count of a scene that nobody can enter any more.
const CLOSED: usize = usize::MAX;

/// Counts those who live in a scene.
#[derive(Debug, Default)]
pub(super) struct Residents(AtomicUsize);

impl Residents {
    /// How many there are.
    pub(super) fn count(&self) -> usize {
        match self.0.load(Ordering::Acquire) {
            CLOSED => 0,
            count => count,
        }
    }

    /// One more; `false` where nobody can enter any more.
    fn enter(&self) -> bool {
        let more = |count| (count != CLOSED).then(|| count + 1);
        self.0
            .fetch_update(Ordering::AcqRel, Ordering::Acquire, more)
            .is_ok()
    }

    fn leave(&self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }

    /// Lets nobody enter from now on, where nobody is in it. Else how many are.
    pub(super) fn close(&self) -> Result<(), usize> {
        self.0
            .compare_exchange(0, CLOSED, Ordering::AcqRel, Ordering::Acquire)
            .map(|_| ())
    }
}

/// A session's place in a scene, which is not deleted while there are such. Dropping it leaves.
#[derive(Debug)]
pub struct Resident {
    name: Arc<str>,
    cell: Arc<SceneCell>,
}

impl Resident {
    /// A place in the scene of this name; `None` where it is being deleted.
    pub(super) fn enter(name: &str, cell: &Arc<SceneCell>) -> Option<Self> {
        cell.residents.enter().then(|| Self {
            name: Arc::from(name),
            cell: Arc::clone(cell),
        })
    }

    /// The scene's name.
    pub fn name(&self) -> &Arc<str> {
        &self.name
    }

    /// The scene.
    pub fn cell(&self) -> &Arc<SceneCell> {
        &self.cell
    }
}

impl Drop for Resident {
    fn drop(&mut self) {
        self.cell.residents.leave();
    }
}
