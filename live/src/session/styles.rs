//! The calls for the styles of a pack.

use troupe_proto::v1;

use super::SessionError;
use super::options::unknown_style;
use crate::packs::LoadedPack;
use crate::world::{UploadMemory, WorldError};
use troupe_character::Path;
use troupe_character::document::is_full;
use troupe_character::style::{MAX_ADDED_STYLES, PutError, Style};

/// `troupe.v1.Sessions/ListStyles`.
///
/// # Errors
/// [`SessionError::UnknownBody`].
pub fn list(pack: &LoadedPack, body: &str) -> Result<v1::ListStylesResponse, SessionError> {
    let place = pack.place_of("body", body)?;
    let styles = &pack.styles[place];
    Ok(v1::ListStylesResponse {
        pack: pack.pack.name().to_owned(),
        body: pack
            .pack
            .bodies
            .get(place)
            .map(|body| body.name.clone())
            .unwrap_or_default(),
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
    memory: &UploadMemory,
) -> Result<v1::Style, SessionError> {
    let root = Path::root();
    let place = pack.place_of(root.field("body"), body)?;
    let path = root.field("style");
    let Some(style) = style else {
        return Err(path.error("is missing", "a style with its keyframes").into());
    };
    let style = Style::from_proto(&path, style, pack.rig(place), false)?;
    let replaced = pack.styles[place]
        .get(&style.name)
        .filter(|style| !style.built_in);
    let replaced_bytes = replaced.map_or(0, |style| style.bytes());
    memory
        .check(style.bytes(), replaced_bytes)
        .map_err(|cause| WorldError::NoMemory {
            what: "style",
            name: style.name.clone(),
            cause,
            field: path.to_string(),
        })?;
    let name = path.field("name");
    match pack.styles[place].put(style) {
        Ok(style) => Ok(style.to_proto()),
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
