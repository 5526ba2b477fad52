//! Object definitions as messages, and back.

use std::collections::HashMap;
use std::sync::Arc;

use troupe_proto::v1;

use super::WorldError;
use troupe_character::document::{DocumentError, Format, read};
use troupe_character::object::{Definition, Listed, ObjectDoc};
use troupe_character::scene::SceneTable;
use troupe_character::{FieldError, Path};
use troupe_motion::model::Rig;

/// Checks that a request has a document. Returns its text and format.
pub(super) fn document<'a>(
    path: &Path<'_>,
    document: Option<&'a v1::Document>,
) -> Result<(&'a str, Format), FieldError> {
    let Some(document) = document else {
        return Err(path.error("is missing", "a text and its format"));
    };
    Ok((&document.text, format(&path.field("format"), document.format)?))
}

/// Reads the format of a message.
pub(super) fn format(path: &Path<'_>, value: i32) -> Result<Format, FieldError> {
    match v1::DocumentFormat::try_from(value) {
        Ok(v1::DocumentFormat::Toml) => Ok(Format::Toml),
        Ok(v1::DocumentFormat::Json) => Ok(Format::Json),
        Err(_) => Err(path.error(
            format!("is {value}"),
            "DOCUMENT_FORMAT_TOML (0) or DOCUMENT_FORMAT_JSON (1)",
        )),
    }
}

/// Checks that the name in a document is the name in the request, unless the request has none.
pub(super) fn check_name(name: &str, wanted: &str) -> Result<(), FieldError> {
    if wanted.is_empty() || wanted == name {
        return Ok(());
    }
    let wanted: String = wanted
        .chars()
        .take(troupe_character::document::MAX_NAME_CHARS)
        .collect();
    Err(Path::root().field("name").error(
        format!("is {name:?}, but the request names {wanted:?}"),
        "the name in the request",
    ))
}

/// Reads and checks a definition for `pack`.
pub(super) fn read_definition(
    text: &str,
    format: Format,
    wanted: &str,
    pack: &Rig,
) -> Result<Definition, DocumentError> {
    read(text, format, |doc: ObjectDoc| {
        check_name(&doc.name, wanted)?;
        Definition::from_doc(doc, pack)
    })
}

/// The summary of a definition. `objects` is the number of its objects in all scenes.
pub(super) fn write(definition: &Definition, revision: u64, objects: u32) -> v1::ObjectDefinition {
    let names = |names: &mut dyn Iterator<Item = &String>| names.cloned().collect();
    v1::ObjectDefinition {
        name: definition.name.clone(),
        pack: definition.pack.clone(),
        description: definition.description.clone(),
        revision,
        solid: definition.body.solid,
        shared: definition.body.shared,
        variants: variants(definition),
        approaches: names(&mut definition.approaches.iter().map(|approach| &approach.name)),
        sockets: names(&mut definition.sockets.iter().map(|socket| &socket.name)),
        sets: names(&mut definition.sets.iter().map(|set| &set.name)),
        objects,
    }
}

/// The ways to use an object, with their weights.
pub(super) fn variants(definition: &Definition) -> Vec<v1::ObjectVariant> {
    let each = definition.variants.iter().map(|variant| v1::ObjectVariant {
        name: variant.name.clone(),
        weight: variant.weight,
    });
    each.collect()
}

/// The whole definition as text.
pub(super) fn write_document(definition: &Definition, format: Format) -> Result<v1::Document, WorldError> {
    let (text, format) = match format {
        Format::Toml => (
            definition.doc.to_toml().map_err(|error| error.to_string()),
            v1::DocumentFormat::Toml,
        ),
        Format::Json => (
            serde_json::to_string_pretty(&*definition.doc).map_err(|error| error.to_string()),
            v1::DocumentFormat::Json,
        ),
    };
    Ok(v1::Document {
        format: format.into(),
        text: text.map_err(WorldError::Internal)?,
    })
}

/// The number of objects of each definition in all scenes.
pub(super) fn count_objects(scenes: &SceneTable) -> HashMap<Arc<str>, u32> {
    let mut counts = HashMap::new();
    for cell in scenes.all().values() {
        for instance in cell.snapshot().instances() {
            *counts.entry(Arc::clone(&instance.object)).or_default() += 1;
        }
    }
    counts
}

/// The summary of a definition in a list. `counts` has the numbers of objects by definition.
pub(super) fn write_listed(listed: &Listed, counts: &HashMap<Arc<str>, u32>) -> v1::ObjectDefinition {
    let definition = &listed.definition;
    let objects = counts.get(definition.name.as_str()).copied().unwrap_or(0);
    write(definition, listed.revision, objects)
}
