//! Errors of skeletons.

use super::row::{FULL, INTERNAL, INVALID, NOT_FOUND, NOT_NOW, Row, Tabled};
use troupe_character::document::check::listed;
use troupe_live::skeleton::SkeletonError;

impl Tabled for SkeletonError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::Field(error) => error.row(),
            Self::UnknownPack(error) => error.row(),
            Self::UnknownBody(error) => error.row(),
            Self::Unknown { field, known, .. } => NOT_FOUND
                .because("UNKNOWN_SKELETON")
                .field(field)
                .allowed(listed(known.iter().map(String::as_str))),
            Self::Unfit {
                field,
                allowed,
                may_force,
                ..
            } => {
                let force = match may_force {
                    true => "; `force` takes the skeleton all the same",
                    false => "",
                };
                INVALID
                    .because("UNFIT_SKELETON")
                    .field(field)
                    .allowed(format!("{allowed}{force}"))
            }
            Self::InUse { .. } => NOT_NOW
                .because("SKELETON_IN_USE")
                .field("name")
                .allowed("a skeleton that no session wears"),
            Self::Full { most } => FULL
                .because("TOO_MANY_SKELETONS")
                .allowed(format!("at most {most}")),
            Self::NoMemory { cause, .. } => {
                FULL.because("TOO_MUCH_UPLOADED").field("source").allowed(format!(
                    "at most {} bytes in all scenes, object definitions, styles and skeletons",
                    cause.most
                ))
            }
            Self::NotKept {
                is_disk_full: true, ..
            } => FULL.because("DISK_FULL"),
            Self::NotKept { .. } => INTERNAL.because("INTERNAL"),
        }
    }
}
