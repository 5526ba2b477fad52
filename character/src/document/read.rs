//! Reads documents from texts and files, and checks them.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path as FilePath, PathBuf};

use serde::de::DeserializeOwned;

use super::locate::{in_json, in_toml, line_and_column};
use super::words::{missing, plain};
use crate::FieldError;

/// The syntax of a document.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// TOML: files that end in `.toml`.
    Toml,
    /// JSON: files that end in `.json`.
    Json,
}

impl Format {
    /// The ending of files of this format, without the dot.
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

/// A kind of document, as people write it.
pub trait Document: DeserializeOwned {
    /// What the document describes, for messages: for example `object definition`.
    const WHAT: &'static str;
    /// Size limit of a document, bytes.
    const MAX_BYTES: usize;
}

/// Where a document came from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// A text that was sent. The string says what it describes, for example `object definition`.
    Text(&'static str),
    /// A file, or a folder that cannot be read.
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

/// Why a document cannot be used, and at which place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DocumentError {
    /// The text or file that has the error.
    pub source: Source,
    /// Line and column of the error, from 1. None if the text has no such place.
    pub place: Option<(usize, usize)>,
    /// Path of the field, for example `sets[1].keyframes[0].height_m`. Empty for an error of the
    /// whole document.
    pub field: String,
    /// What is wrong, for example `is 200`.
    pub message: String,
    /// What is allowed instead. Empty if the message already says so.
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

    /// The error of a field of `text`, with its line and column.
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

    /// An error from the parser about the field at `path`.
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

/// Parses a text. Values are not checked.
///
/// # Errors
/// [`DocumentError`] for a text of the wrong form.
pub fn parse<D: Document>(text: &str, format: Format) -> Result<D, DocumentError> {
    if text.len() > D::MAX_BYTES {
        return Err(DocumentError::too_long::<D>(text.len() as u64));
    }
    match format {
        Format::Toml => parse_toml(text),
        Format::Json => parse_json(text),
    }
}

/// Parses a text, and runs `check` on the result.
///
/// # Errors
/// [`DocumentError`] for the first error.
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

/// Reads `file`, which ends in `.toml` or `.json`, and runs `check` on its document.
///
/// # Errors
/// [`DocumentError`] with the file, and with line and field if the error has them.
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
        // Checks the length first, so that a file that is too long is not read.
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
