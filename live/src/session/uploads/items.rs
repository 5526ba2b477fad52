//! What a server knows of a tenant's uploads in the shared store.

use std::collections::BTreeMap;
use std::sync::{Arc, Weak};

use super::Version;
use crate::session::Space;
use crate::uploads::Upload;

/// The uploads of a tenant.
#[derive(Debug, Default)]
pub(super) struct Items {
    /// The space that has those that were taken in.
    space: Weak<Space>,
    all: BTreeMap<Upload, Item>,
}

/// An upload.
#[derive(Debug)]
struct Item {
    at: Version,
    /// Size of its record. `None`: it was removed.
    bytes: Option<usize>,
    state: State,
    /// Why it was left out when it was last tried.
    reason: Option<String>,
}

/// Whether an upload is here as the store has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    /// Not yet.
    Pending,
    /// It is, or a call here has changed it since.
    Taken,
    /// It is not, because it does not fit or cannot be read.
    LeftOut,
}

impl Items {
    /// From now on, these are the uploads of this space. If it is another one than before, nothing
    /// was taken in.
    pub(super) fn belong_to(&mut self, space: &Arc<Space>) {
        if !self.are_of(space) {
            self.space = Arc::downgrade(space);
            self.all.values_mut().for_each(|item| item.state = State::Pending);
        }
    }

    /// Whether the space has what was taken in.
    pub(super) fn are_of(&self, space: &Arc<Space>) -> bool {
        std::ptr::eq(self.space.as_ptr(), Arc::as_ptr(space))
    }

    /// The rank of an upload. 0: none is known.
    pub(super) fn rank(&self, upload: &Upload) -> u64 {
        self.all.get(upload).map_or(0, |item| item.at.rank)
    }

    /// Notes a version of an upload.
    pub(super) fn set(&mut self, upload: Upload, at: Version, bytes: Option<usize>, state: State) {
        let item = Item {
            at,
            bytes,
            state,
            reason: None,
        };
        self.all.insert(upload, item);
    }

    /// Notes a change in the store. This server may have made it.
    pub(super) fn changed(&mut self, upload: Upload, at: Version, bytes: Option<usize>) {
        match self.all.get_mut(&upload).filter(|item| item.at.rank == at.rank) {
            Some(item) => item.at = at,
            None => self.set(upload, at, bytes, State::Pending),
        }
    }

    /// Notes that an upload is here as the store has it.
    pub(super) fn took(&mut self, upload: &Upload) {
        if let Some(item) = self.all.get_mut(upload) {
            (item.state, item.reason) = (State::Taken, None);
        }
    }

    /// Notes that an upload is left out. Answers whether the reason is another one than before.
    pub(super) fn leave_out(&mut self, upload: &Upload, reason: &str) -> bool {
        let Some(item) = self.all.get_mut(upload) else {
            return true;
        };
        item.state = State::LeftOut;
        let before = item.reason.replace(reason.to_owned());
        before.as_deref() != Some(reason)
    }

    /// Why an upload is left out.
    #[cfg(test)]
    pub(super) fn reason(&self, upload: &Upload) -> Option<&str> {
        self.all.get(upload)?.reason.as_deref()
    }

    /// The uploads that are to be taken in, with the sizes of their records, or those that are to
    /// be removed. With a definition, scenes that were left out are tried again.
    pub(super) fn pending(&mut self, are_there: bool) -> Vec<(Upload, usize)> {
        let of_definition = |(upload, item): (&Upload, &Item)| {
            matches!(upload, Upload::Definition(_)) && item.state == State::Pending
        };
        if are_there && self.all.iter().any(of_definition) {
            self.retry_each(|upload| matches!(upload, Upload::Scene(_)));
        }
        let is_due = |item: &Item| item.state == State::Pending && item.bytes.is_some() == are_there;
        let due = self.all.iter().filter(|(_, item)| is_due(item));
        due.map(|(upload, item)| (upload.clone(), item.bytes.unwrap_or(0)))
            .collect()
    }

    /// The uploads that are here as in the store, with their ranks and whether they were not
    /// removed.
    pub(super) fn taken(&self) -> impl Iterator<Item = (&Upload, u64, bool)> {
        let taken = self.all.iter().filter(|(_, item)| item.state == State::Taken);
        taken.map(|(upload, item)| (upload, item.at.rank, item.bytes.is_some()))
    }

    /// Forgets what was not taken in, after the store has lost uploads.
    pub(super) fn only_taken(&mut self) {
        self.all.retain(|_, item| item.state == State::Taken);
    }

    /// Has uploads that were left out tried again.
    pub(super) fn retry(&mut self) {
        self.retry_each(|_| true);
    }

    fn retry_each(&mut self, is_due: impl Fn(&Upload) -> bool) {
        for (upload, item) in &mut self.all {
            if item.state == State::LeftOut && is_due(upload) {
                item.state = State::Pending;
            }
        }
    }

    /// A pack was loaded, or took the place of another version. It needs its styles, and what was
    /// left out may fit now.
    pub(super) fn pack_came(&mut self, name: &str) {
        self.retry();
        for (upload, item) in &mut self.all {
            if matches!(upload, Upload::Style { pack, .. } if pack == name) {
                item.state = State::Pending;
            }
        }
    }

    /// Has uploads removed that the store does not list. It has forgotten removals up to `floor`.
    pub(super) fn keep(&mut self, floor: u64, is_listed: impl Fn(&Upload) -> bool) {
        for (upload, item) in &mut self.all {
            if item.bytes.is_some() && !is_listed(upload) {
                item.at = Version {
                    rank: floor.max(item.at.rank),
                    position: floor + 1,
                };
                (item.bytes, item.state) = (None, State::Pending);
            }
        }
    }

    /// Forgets removals up to a position, unless they are yet to be done here.
    pub(super) fn forget(&mut self, floor: u64) {
        let is_served = self.space.strong_count() > 0;
        self.all.retain(|_, item| {
            let is_due = is_served && item.state == State::Pending;
            item.bytes.is_some() || item.at.position > floor || is_due
        });
    }
}
