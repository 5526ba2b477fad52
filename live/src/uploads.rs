//! Uploads that servers share: their names, what has changed here, and the form in which the store
//! has them. `session/uploads` writes and reads them, and docs/decisions/uploads.md says why.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use serde::{Deserialize, Serialize};
use troupe_base::tenant::{Tenant, names_a_tenant};

/// Version of the form of records. Records of other versions are left out.
const FORMAT: u32 = 1;

/// Kind and name of an upload. Uploads are taken in by their order: a scene needs its definitions.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Upload {
    /// By its name.
    Definition(String),
    /// An added style.
    Style {
        /// Name of the pack.
        pack: String,
        /// Name of the body. Empty for a pack with one skeleton.
        body: String,
        /// Name of the style.
        name: String,
    },
    /// By its name.
    Skeleton(String),
    /// By its name.
    Scene(String),
}

impl Upload {
    /// What the store calls the upload of a tenant.
    pub(crate) fn field(&self, tenant: &Tenant) -> String {
        let tenant = tenant.as_deref().unwrap_or_default();
        match self {
            Self::Definition(name) => format!("definition/{tenant}/{name}"),
            Self::Style { pack, body, name } => format!("style/{tenant}/{pack}/{body}/{name}"),
            Self::Skeleton(name) => format!("skeleton/{tenant}/{name}"),
            Self::Scene(name) => format!("scene/{tenant}/{name}"),
        }
    }

    /// The tenant and the upload that the store calls `field`. `None`: this version of the server
    /// does not know such uploads.
    pub(crate) fn of_field(field: &str) -> Option<(Tenant, Self)> {
        let (kind, rest) = field.split_once('/')?;
        let (tenant, name) = rest.split_once('/')?;
        if !tenant.is_empty() && !names_a_tenant(tenant) {
            return None;
        }
        let upload = match kind {
            "definition" => Self::Definition(name.to_owned()),
            "skeleton" => Self::Skeleton(name.to_owned()),
            "scene" => Self::Scene(name.to_owned()),
            "style" => {
                let (of, name) = name.rsplit_once('/')?;
                let (pack, body) = of.rsplit_once('/')?;
                let [pack, body, name] = [pack, body, name].map(str::to_owned);
                Self::Style { pack, body, name }
            }
            _ => return None,
        };
        Some(((!tenant.is_empty()).then(|| Arc::from(tenant)), upload))
    }
}

/// The uploads of a tenant that the shared store does not have as they are here. Whoever changes
/// uploads holds its lock, so what comes from the store never replaces a newer upload.
#[derive(Debug, Default)]
pub(crate) struct Journal(Mutex<Changed>);

/// The uploads that have changed.
#[derive(Debug, Default)]
pub(crate) struct Changed {
    is_shared: bool,
    uploads: BTreeSet<Upload>,
}

impl Journal {
    /// Waits until no other call changes uploads.
    pub(crate) fn change(&self) -> MutexGuard<'_, Changed> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// As [`Journal::change`]. `None`: a call changes uploads now, and may wait for its disk.
    pub(crate) fn try_change(&self) -> Option<MutexGuard<'_, Changed>> {
        match self.0.try_lock() {
            Ok(changed) => Some(changed),
            Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    /// From now on, changes are noted.
    pub(crate) fn share(&self) {
        self.change().is_shared = true;
    }

    /// Whether the store has everything as it is here.
    pub(crate) fn is_empty(&self) -> bool {
        self.try_change()
            .is_some_and(|changed| changed.uploads.is_empty())
    }

    /// Takes out what has changed. None, while a call changes uploads.
    pub(crate) fn take(&self) -> BTreeSet<Upload> {
        let changed = self.try_change();
        changed.map_or_else(BTreeSet::new, |mut changed| std::mem::take(&mut changed.uploads))
    }
}

impl Changed {
    /// Whether uploads are shared.
    pub(crate) fn is_shared(&self) -> bool {
        self.is_shared
    }

    /// Notes an upload that was added, replaced or removed.
    pub(crate) fn note(&mut self, upload: Upload) {
        if self.is_shared {
            self.uploads.insert(upload);
        }
    }

    /// Whether the store lacks the newest change of an upload.
    pub(crate) fn has(&self, upload: &Upload) -> bool {
        self.uploads.contains(upload)
    }
}

/// An upload as the store has it.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record<'a> {
    pub(crate) format: u32,
    /// Differs for every upload of a scene. 0 for other uploads.
    pub(crate) content: u64,
    /// The pack that an object definition is for. Empty for other uploads.
    pub(crate) pack: &'a str,
    /// A style's message, or the JSON of another upload.
    pub(crate) body: &'a [u8],
}

impl<'a> Record<'a> {
    pub(crate) fn new(body: &'a [u8]) -> Self {
        Self {
            format: FORMAT,
            content: 0,
            pack: "",
            body,
        }
    }

    pub(crate) fn write(&self) -> Result<Vec<u8>, String> {
        postcard::to_allocvec(self).map_err(|error| error.to_string())
    }

    /// # Errors
    /// The reason why the record cannot be used.
    pub(crate) fn read(bytes: &'a [u8]) -> Result<Self, String> {
        let record: Self = postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        match record.format {
            FORMAT => Ok(record),
            other => Err(format!("the record has format {other}; allowed: {FORMAT}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_names_tenant_kind_and_name() {
        let style = Upload::Style {
            pack: "a/b".to_owned(),
            body: String::new(),
            name: "brisk".to_owned(),
        };
        for (tenant, upload, field) in [
            (None, Upload::Scene("yard".to_owned()), "scene//yard"),
            (
                Some("studio"),
                Upload::Definition("cup".to_owned()),
                "definition/studio/cup",
            ),
            (
                Some("studio"),
                Upload::Skeleton("hero".to_owned()),
                "skeleton/studio/hero",
            ),
            (None, style, "style//a/b//brisk"),
        ] {
            let tenant: Tenant = tenant.map(Arc::from);
            assert_eq!(upload.field(&tenant), field);
            assert_eq!(Upload::of_field(field), Some((tenant, upload)));
        }
        for unknown in [
            "",
            "scene",
            "scene/yard",
            "scene/../yard",
            "rug//yard",
            "style//a/b",
        ] {
            assert_eq!(Upload::of_field(unknown), None, "{unknown:?}");
        }
    }

    #[test]
    fn a_journal_notes_changes_once_uploads_are_shared() {
        let (journal, yard) = (Journal::default(), Upload::Scene("yard".to_owned()));
        journal.change().note(yard.clone());
        assert!(journal.is_empty());
        journal.share();
        let mut changed = journal.change();
        changed.note(yard.clone());
        assert!(changed.has(&yard));
        assert!(
            !journal.is_empty() && journal.take().is_empty(),
            "a call changes uploads"
        );
        drop(changed);
        assert_eq!(journal.take(), BTreeSet::from([yard]));
        assert!(journal.is_empty());
    }

    #[test]
    fn a_record_of_another_form_says_so() {
        let bytes = Record::new(b"{}").write().unwrap();
        assert_eq!(Record::read(&bytes).unwrap(), Record::new(b"{}"));
        let later = Record {
            format: 2,
            ..Record::new(b"{}")
        };
        let error = Record::read(&later.write().unwrap()).unwrap_err();
        assert_eq!(error, "the record has format 2; allowed: 1");
        assert!(Record::read(&bytes[..3]).is_err());
    }
}
