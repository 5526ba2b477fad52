//! Errors of scenes, objects and definitions.

use super::row::{EXISTS, FULL, INTERNAL, INVALID, NOT_FOUND, NOT_NOW, Row, Tabled};
use troupe_character::document::DocumentError;
use troupe_character::document::check::listed;
use troupe_character::object::{DefinitionsError, MAX_DEFINITIONS};
use troupe_character::scene::{MAX_ID_BYTES, MAX_SCENES, SceneError, TableError};
use troupe_live::world::WorldError;

impl Tabled for WorldError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::Field(error) => error.row(),
            Self::Document(error) => error.row(),
            Self::Scene { error, field } => error.row().field(field),
            Self::Object { error, field } => error.row().field(field),
            Self::Definition { error, field } => error.row().field(field),
            Self::NoMemory { cause, field, .. } => {
                FULL.because("TOO_MUCH_UPLOADED").field(field).allowed(format!(
                    "at most {} bytes in all scenes, object definitions, styles and skeletons",
                    cause.most
                ))
            }
            Self::NotKept {
                is_disk_full: true, ..
            } => FULL.because("DISK_FULL"),
            Self::NotKept { .. } | Self::Internal(_) => INTERNAL.because("INTERNAL"),
        }
    }
}

impl Tabled for DocumentError {
    fn row(&self) -> Row<'_> {
        let field = match self.field.as_str() {
            "" => "document",
            field => field,
        };
        Row {
            allowed: Some(self.allowed.clone()).filter(|allowed| !allowed.is_empty()),
            place: self.place,
            ..INVALID.because("INVALID_DOCUMENT").field(field)
        }
    }
}

impl Tabled for TableError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::Unknown { known, .. } => NOT_FOUND.because("UNKNOWN_SCENE").allowed(names(known)),
            Self::Exists(_) => EXISTS.because("SCENE_EXISTS"),
            Self::InUse { .. } => NOT_NOW
                .because("SCENE_IN_USE")
                .allowed("a scene without sessions"),
            Self::Full => FULL
                .because("TOO_MANY_SCENES")
                .allowed(format!("at most {MAX_SCENES}")),
            Self::Name(_) => INVALID
                .because("INVALID_FIELD")
                .allowed(format!("1 to {MAX_ID_BYTES} bytes")),
        }
    }
}

impl Tabled for SceneError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::Unknown { .. } => NOT_FOUND.because("UNKNOWN_OBJECT"),
            Self::Exists { .. } => EXISTS.because("OBJECT_EXISTS"),
            Self::Taken { .. } | Self::NotHeld { .. } | Self::MoveHeld { .. } => {
                NOT_NOW.because("OBJECT_TAKEN")
            }
            Self::Full { limit, .. } => FULL
                .because("TOO_MANY_OBJECTS")
                .allowed(format!("at most {limit}")),
            Self::Value { allowed, .. } => INVALID.because("INVALID_FIELD").allowed(allowed.as_str()),
            Self::Shape { .. } => INVALID.because("INVALID_FIELD"),
        }
    }
}

impl Tabled for DefinitionsError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::Unknown { known, .. } => NOT_FOUND
                .because("UNKNOWN_OBJECT_DEFINITION")
                .allowed(names(known)),
            Self::InUse { .. } => NOT_NOW
                .because("OBJECT_DEFINITION_IN_USE")
                .allowed("one of which no scene has an object"),
            Self::Full => FULL
                .because("TOO_MANY_OBJECT_DEFINITIONS")
                .allowed(format!("at most {MAX_DEFINITIONS}")),
        }
    }
}

/// Names as a list in an error text.
fn names(names: &[String]) -> String {
    listed(names.iter().map(String::as_str))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::ApiError;
    use troupe_base::echo::MAX_PATH;
    use troupe_character::document::Source;

    #[test]
    fn documents_name_their_place_and_echo_little() {
        let error = WorldError::from(DocumentError {
            source: Source::Text("scene"),
            place: Some((7, 3)),
            field: "x".repeat(1000),
            message: "y".repeat(1000),
            allowed: "0 to 1".to_owned(),
        });
        let detail = ApiError::from(error).body().error;
        assert_eq!((detail.line, detail.column), (Some(7), Some(3)));
        assert_eq!(
            (detail.code.as_str(), detail.reason.as_str()),
            ("INVALID_ARGUMENT", "INVALID_DOCUMENT")
        );
        assert!(
            detail.message.starts_with("scene: line 7, column 3: xxx"),
            "{}",
            detail.message
        );
        assert!(detail.message.len() < 1000 && detail.field.unwrap().chars().count() == MAX_PATH + 1);
        assert_eq!(detail.allowed.as_deref(), Some("0 to 1"));
    }
}
