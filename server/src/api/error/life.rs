//! Errors of packs that are loaded, unloaded and swapped.

use super::row::{FULL, INTERNAL, NOT_FOUND, NOT_NOW, Row, Tabled, UNIMPLEMENTED};
use troupe_service::LifeError;

impl Tabled for LifeError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::Fixed => UNIMPLEMENTED.because("PACKS_ARE_FIXED"),
            Self::Folder(_) => INTERNAL.because("PACKS_NOT_READ"),
            Self::Unknown { allowed, .. } => NOT_FOUND
                .because("UNKNOWN_PACK")
                .field("name")
                .allowed(allowed.join(", ")),
            Self::Twice { .. } => NOT_NOW.because("PACK_TWICE").field("version"),
            Self::OtherVersion { loaded, .. } => NOT_NOW
                .because("OTHER_VERSION")
                .field("version")
                .allowed(loaded.clone()),
            Self::NotLoaded { loaded, .. } => NOT_NOW
                .because("PACK_NOT_LOADED")
                .field("name")
                .allowed(loaded.join(", ")),
            Self::Default { .. } => NOT_NOW.because("DEFAULT_PACK").field("name"),
            Self::Refused { .. } => NOT_NOW.because("PACK_REFUSED").field("name"),
            Self::Memory { .. } => FULL.because("NO_MEMORY"),
            Self::Busy { most } => FULL
                .because("TOO_MANY_CHANGES")
                .allowed(format!("at most {most}")),
        }
    }
}
