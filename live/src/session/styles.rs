//! The calls for the styles of a pack, and styles as servers share them.

use prost::Message as _;
use troupe_proto::v1;

use super::SessionError;
use super::options::unknown_style;
use crate::packs::{LoadedPack, PackTable};
use crate::uploads::{Record, Upload};
use crate::world::{NoMemory, Store, UploadMemory, WorldError};
use troupe_character::Path;
use troupe_character::document::is_full;
use troupe_character::style::{MAX_ADDED_STYLES, PutError, Style, StyleTable};

/// `troupe.v1.Sessions/ListStyles`.
///
/// # Errors
/// [`SessionError::UnknownBody`].
pub fn list(pack: &LoadedPack, body: &str) -> Result<v1::ListStylesResponse, SessionError> {
    let place = pack.place_of("body", body)?;
    let styles = &pack.styles[place];
    Ok(v1::ListStylesResponse {
        pack: pack.pack.name().to_owned(),
        body: body_name(pack, place).to_owned(),
        styles: styles
            .list()
            .iter()
            .map(|style| style.to_proto_summary())
            .collect(),
        default_style: styles
            .default_style()
            .map(|style| style.name.clone())
            .unwrap_or_default(),
    })
}

/// `troupe.v1.Sessions/GetStyle`.
///
/// # Errors
/// [`SessionError::UnknownBody`] or [`SessionError::UnknownStyle`].
pub fn get(pack: &LoadedPack, body: &str, name: &str) -> Result<v1::Style, SessionError> {
    let styles = pack.styles_of("body", body)?;
    match styles.get(name) {
        Some(style) => Ok(style.to_proto()),
        None => Err(unknown_style(&Path::root().field("style"), name, styles)),
    }
}

/// `troupe.v1.Sessions/PutStyle`. Blocks if added styles are kept in a folder.
///
/// # Errors
/// [`SessionError`] for the first value that is not accepted, or if the style cannot be written.
pub fn put(
    pack: &LoadedPack,
    body: &str,
    style: Option<&v1::Style>,
    store: &Store,
) -> Result<v1::Style, SessionError> {
    let root = Path::root();
    let place = pack.place_of(root.field("body"), body)?;
    let path = root.field("style");
    let Some(style) = style else {
        return Err(path.error("is missing", "a style with its keyframes").into());
    };
    let style = Style::from_proto(&path, style, pack.rig(place), false)?;
    let mut changed = store.journal().change();
    room(&pack.styles[place], &style, store.memory()).map_err(|cause| WorldError::NoMemory {
        what: "style",
        name: style.name.clone(),
        cause,
        field: path.to_string(),
    })?;
    let name = path.field("name");
    match pack.styles[place].put(style) {
        Ok(style) => {
            changed.note(Upload::Style {
                pack: pack.pack.name().to_owned(),
                body: body_name(pack, place).to_owned(),
                name: style.name.clone(),
            });
            Ok(style.to_proto())
        }
        Err(PutError::BuiltIn(style)) => Err(SessionError::StyleIsBuiltIn {
            name: style,
            field: name.to_string(),
        }),
        Err(PutError::TooMany) => Err(name
            .error(
                "is new, but the pack has no room for another style",
                format!("at most {MAX_ADDED_STYLES} added styles"),
            )
            .into()),
        Err(PutError::Keep { name, cause }) => {
            let is_full = is_full(&cause);
            let error = PutError::Keep { name, cause };
            Err(WorldError::not_kept(&error, is_full).into())
        }
    }
}

/// The name of a body. Empty for a pack with one skeleton.
fn body_name(pack: &LoadedPack, place: usize) -> &str {
    let body = pack.pack.bodies.get(place);
    body.map_or("", |body| &body.name)
}

/// Checks that a style fits, in the place of the one with its name.
fn room(table: &StyleTable, style: &Style, memory: &UploadMemory) -> Result<(), NoMemory> {
    let replaced = table.get(&style.name).filter(|style| !style.built_in);
    memory.check(style.bytes(), replaced.map_or(0, |style| style.bytes()))
}

/// The styles of a body, if its pack is loaded.
fn table_of<'a>(table: &'a PackTable, pack: &str, body: &str) -> Option<(&'a LoadedPack, usize)> {
    let loaded = table.get(pack)?;
    let place = loaded.place_of("body", body).ok()?;
    (body_name(loaded, place) == body).then_some((loaded, place))
}

/// The record of an added style. `None`: there is no such style now, because its pack is not
/// loaded, or has a style of its own of this name.
///
/// # Errors
/// The reason why it cannot be written.
pub(super) fn write_shared(
    table: &PackTable,
    (pack, body, name): (&str, &str, &str),
) -> Result<Option<Vec<u8>>, String> {
    let found = table_of(table, pack, body).and_then(|(pack, place)| pack.styles[place].get(name));
    let Some(style) = found.filter(|style| !style.built_in) else {
        return Ok(None);
    };
    Record::new(&style.to_proto().encode_to_vec()).write().map(Some)
}

/// Takes in a style of another server.
///
/// # Errors
/// The reason why the style is left out. Then nothing has changed.
pub(super) fn take_shared(
    table: &PackTable,
    (pack, body, name): (&str, &str, &str),
    record: &[u8],
    memory: &UploadMemory,
) -> Result<(), String> {
    let (pack, place) = table_of(table, pack, body)
        .ok_or_else(|| format!("its pack {pack:?} with body {body:?} is not loaded"))?;
    let record = Record::read(record)?;
    let message = v1::Style::decode(record.body).map_err(|error| error.to_string())?;
    if message.name != name {
        return Err(format!(
            "the record has the name {:?}; allowed: {name:?}",
            message.name
        ));
    }
    let style = Style::from_proto(&Path::root(), &message, pack.rig(place), false);
    let style = style.map_err(|error| error.to_string())?;
    let styles = &pack.styles[place];
    room(styles, &style, memory).map_err(|error| error.to_string())?;
    styles.take(style).map(drop).map_err(|error| error.to_string())
}
