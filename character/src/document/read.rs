//! From a text, a file or a folder to what a document means.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path as FilePath, PathBuf};

use serde::de::DeserializeOwned;

use super::locate::{in_json, in_toml, line_and_column};
use super::words::{missing, plain};
use crate::FieldError;

/// How a document is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// TOML, files that end in `.toml`.
    Toml,
    /// JSON, files that end in `.json`.
    Json,
}

impl Format {
    /// What files of this format end in.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Toml => "toml",
            Self::Json => "json",
        }
    }

    /// The format of files with this ending.
    pub fn of_file(file: &FilePath) -> Option<Self> {
        match file.extension().and_then(OsStr::to_str) {
            Some("toml") => Some(Self::Toml),
            Some("json") => Some(Self::Json),
            _ => None,
        }
    }
}

/// A kind of document, as it is written.
pub trait Document: DeserializeOwned {
    /// What it is, for messages.
    const WHAT: &'static str;
    /// Most bytes of one.
    const MAX_BYTES: usize;
}

/// Where a document came from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// A text; of what, for example `object definition`.
    Text(&'static str),
    /// A file or folder.
    File(PathBuf),
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text(what) => f.write_str(what),
            Self::File(file) => write!(f, "{}", file.display()),
        }
    }
}

/// A document that cannot be used, and where it is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DocumentError {
    /// Where it came from.
    pub source: Source,
    /// Line and column of what is wrong, from 1, where the text has such a place.
    pub place: Option<(usize, usize)>,
    /// Path of the field, for example `sets[1].keyframes[0].height_m`; empty for the document
    /// itself.
    pub field: String,
    /// What is wrong.
    pub message: String,
    /// What is allowed instead; empty where the message says it.
    pub allowed: String,
}

impl DocumentError {
    pub(super) fn whole<D: Document>(message: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self {
            source: Source::Text(D::WHAT),
            place: None,
            field: String::new(),
            message: message.into(),
            allowed: allowed.into(),
        }
    }

    fn too_long<D: Document>(bytes: u64) -> Self {
        Self::whole::<D>(
            format!("is {bytes} bytes long"),
            format!("at most {} bytes", D::MAX_BYTES),
        )
    }

    /// The error of a field of `text`.
    fn of_field<D: Document>(error: FieldError, text: &str, format: Format) -> Self {
        let offset = match format {
            Format::Toml => in_toml(text, &error.field),
            Format::Json => in_json(text, &error.field),
        };
        Self {
            place: offset.map(|offset| line_and_column(text, offset)),
            field: error.field,
            ..Self::whole::<D>(error.message, error.allowed)
        }
    }

    /// What a parser says of the field at `path`.
    fn of_parser<D: Document>(path: &str, message: &str) -> Self {
        let Some(name) = missing(message) else {
            return Self {
                field: path.to_owned(),
                ..Self::whole::<D>(plain(message), "")
            };
        };
        let dot = if path.is_empty() { "" } else { "." };
        Self {
            field: format!("{path}{dot}{name}"),
            ..Self::whole::<D>("is missing", "")
        }
    }

    pub(super) fn in_file(mut self, file: &FilePath) -> Self {
        self.source = Source::File(file.to_owned());
        self
    }
}

impl fmt::Display for DocumentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.source)?;
        if let Some((line, column)) = self.place {
            write!(f, "line {line}, column {column}: ")?;
        }
        if !self.field.is_empty() {
            write!(f, "{}: ", self.field)?;
        }
        f.write_str(&self.message)?;
        if !self.allowed.is_empty() {
            write!(f, "; allowed: {}", self.allowed)?;
        }
        Ok(())
    }
}

impl std::error::Error for DocumentError {}

/// Reads a text; only its form is checked.
///
/// # Errors
/// [`DocumentError`].
pub fn parse<D: Document>(text: &str, format: Format) -> Result<D, DocumentError> {
    if text.len() > D::MAX_BYTES {
        return Err(DocumentError::too_long::<D>(text.len() as u64));
    }
    match format {
        Format::Toml => parse_toml(text),
        Format::Json => parse_json(text),
    }
}

/// Reads a text, and makes of it what `check` does.
///
/// # Errors
/// [`DocumentError`] for the first thing that is wrong.
pub fn read<D: Document, T>(
    text: &str,
    format: Format,
    check: impl FnOnce(D) -> Result<T, FieldError>,
) -> Result<T, DocumentError> {
    check(parse(text, format)?).map_err(|error| DocumentError::of_field::<D>(error, text, format))
}

fn parse_toml<D: Document>(text: &str) -> Result<D, DocumentError> {
    let wrong = |field: String, error: &toml::de::Error| DocumentError {
        place: error.span().map(|span| line_and_column(text, span.start)),
        ..DocumentError::of_parser::<D>(&field, error.message())
    };
    let reader = toml::Deserializer::parse(text).map_err(|error| wrong(String::new(), &error))?;
    serde_path_to_error::deserialize(reader).map_err(|error| wrong(field_of(error.path()), error.inner()))
}

fn parse_json<D: Document>(text: &str) -> Result<D, DocumentError> {
    let wrong = |field: String, error: &serde_json::Error| {
        let place = (error.line() > 0).then(|| (error.line(), error.column()));
        let message = error.to_string();
        let end = place.map_or(String::new(), |(line, column)| {
            format!(" at line {line} column {column}")
        });
        DocumentError {
            place,
            ..DocumentError::of_parser::<D>(&field, message.strip_suffix(&end).unwrap_or(&message))
        }
    };
    let mut reader = serde_json::Deserializer::from_str(text);
    let document = serde_path_to_error::deserialize(&mut reader)
        .map_err(|error| wrong(field_of(error.path()), error.inner()))?;
    reader.end().map_err(|error| wrong(String::new(), &error))?;
    Ok(document)
}

fn field_of(path: &serde_path_to_error::Path) -> String {
    let field = path.to_string();
    if field == "." { String::new() } else { field }
}

/// Reads `file`, which ends in `.toml` or `.json`, and makes of it what `check` does.
///
/// # Errors
/// [`DocumentError`], which names the file, and line and field where there are such.
pub fn read_file<D: Document, T>(
    file: &FilePath,
    check: impl FnOnce(D) -> Result<T, FieldError>,
) -> Result<T, DocumentError> {
    let work = || {
        let Some(format) = Format::of_file(file) else {
            return Err(DocumentError::whole::<D>(
                format!("is no {}", D::WHAT),
                "files that end in .toml or .json",
            ));
        };
        // Its length first: a text that is too long is not worth reading.
        let length = std::fs::metadata(file).map_err(unreadable::<D>)?.len();
        if length > D::MAX_BYTES as u64 {
            return Err(DocumentError::too_long::<D>(length));
        }
        let text = std::fs::read_to_string(file).map_err(unreadable::<D>)?;
        read(&text, format, check)
    };
    work().map_err(|error| error.in_file(file))
}

pub(super) fn unreadable<D: Document>(cause: std::io::Error) -> DocumentError {
    DocumentError::whole::<D>(format!("cannot be read: {cause}"), "")
}
