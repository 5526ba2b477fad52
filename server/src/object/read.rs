//! Definitions as TOML or JSON texts and files.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path as FilePath, PathBuf};

use super::locate::{in_json, in_toml, line_and_column};
use super::{Definition, MAX_BYTES, ObjectDoc};
use crate::inbetween::FieldError;
use crate::pack::Pack;

/// How a definition is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// TOML, files that end in `.toml`.
    Toml,
    /// JSON, files that end in `.json`.
    Json,
}

impl Format {
    /// The format of files with this ending.
    pub fn of_file(file: &FilePath) -> Option<Self> {
        match file.extension().and_then(OsStr::to_str) {
            Some("toml") => Some(Self::Toml),
            Some("json") => Some(Self::Json),
            _ => None,
        }
    }
}

/// A definition that cannot be used, and where it is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DefinitionError {
    /// The file or folder, where it came from one.
    pub file: Option<PathBuf>,
    /// Line and column of what is wrong, from 1, where the text has such a place.
    pub place: Option<(usize, usize)>,
    /// Path of the field, for example `sets[1].keyframes[0].height_m`; empty for the definition itself.
    pub field: String,
    /// What is wrong.
    pub message: String,
    /// What is allowed instead; empty where the message says it.
    pub allowed: String,
}

impl DefinitionError {
    fn whole(message: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self {
            file: None,
            place: None,
            field: String::new(),
            message: message.into(),
            allowed: allowed.into(),
        }
    }

    fn in_file(mut self, file: &FilePath) -> Self {
        self.file = Some(file.to_owned());
        self
    }
}

impl fmt::Display for DefinitionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.file {
            Some(file) => write!(f, "{}: ", file.display())?,
            None => f.write_str("object definition: ")?,
        }
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

impl std::error::Error for DefinitionError {}

impl Definition {
    /// Reads and checks a TOML text for `pack`.
    ///
    /// # Errors
    /// [`DefinitionError`] for the first thing that is wrong.
    pub fn from_toml(text: &str, pack: &Pack) -> Result<Self, DefinitionError> {
        Self::read(text, Format::Toml, pack)
    }

    /// Reads and checks a JSON text for `pack`.
    ///
    /// # Errors
    /// [`DefinitionError`] for the first thing that is wrong.
    pub fn from_json(text: &str, pack: &Pack) -> Result<Self, DefinitionError> {
        Self::read(text, Format::Json, pack)
    }

    /// Reads and checks a text for `pack`.
    ///
    /// # Errors
    /// [`DefinitionError`] for the first thing that is wrong.
    pub fn read(text: &str, format: Format, pack: &Pack) -> Result<Self, DefinitionError> {
        let doc = ObjectDoc::read(text, format)?;
        Self::from_doc(doc, pack).map_err(|error| {
            let FieldError {
                field,
                message,
                allowed,
            } = error;
            let offset = match format {
                Format::Toml => in_toml(text, &field),
                Format::Json => in_json(text, &field),
            };
            DefinitionError {
                file: None,
                place: offset.map(|offset| line_and_column(text, offset)),
                field,
                message,
                allowed,
            }
        })
    }
}

impl ObjectDoc {
    /// Reads a text; only its form is checked.
    ///
    /// # Errors
    /// [`DefinitionError`].
    pub fn read(text: &str, format: Format) -> Result<Self, DefinitionError> {
        if text.len() > MAX_BYTES {
            let found = format!("is {} bytes long", text.len());
            return Err(DefinitionError::whole(
                found,
                format!("at most {MAX_BYTES} bytes"),
            ));
        }
        match format {
            Format::Toml => read_toml(text),
            Format::Json => read_json(text),
        }
    }

    /// The TOML text.
    ///
    /// # Errors
    /// A message where a value cannot be written, which no checked definition has.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }
}

fn read_toml(text: &str) -> Result<ObjectDoc, DefinitionError> {
    let wrong = |field: String, error: &toml::de::Error| DefinitionError {
        file: None,
        place: error.span().map(|span| line_and_column(text, span.start)),
        field,
        message: error.message().to_owned(),
        allowed: String::new(),
    };
    let reader = toml::Deserializer::parse(text).map_err(|error| wrong(String::new(), &error))?;
    serde_path_to_error::deserialize(reader).map_err(|error| wrong(field_of(error.path()), error.inner()))
}

fn read_json(text: &str) -> Result<ObjectDoc, DefinitionError> {
    let wrong = |field: String, error: &serde_json::Error| {
        let place = (error.line() > 0).then(|| (error.line(), error.column()));
        let message = error.to_string();
        let end = place.map_or(String::new(), |(line, column)| {
            format!(" at line {line} column {column}")
        });
        DefinitionError {
            file: None,
            place,
            field,
            message: message.strip_suffix(&end).unwrap_or(&message).to_owned(),
            allowed: String::new(),
        }
    };
    let mut reader = serde_json::Deserializer::from_str(text);
    let doc = serde_path_to_error::deserialize(&mut reader)
        .map_err(|error| wrong(field_of(error.path()), error.inner()))?;
    reader.end().map_err(|error| wrong(String::new(), &error))?;
    Ok(doc)
}

fn field_of(path: &serde_path_to_error::Path) -> String {
    let field = path.to_string();
    if field == "." { String::new() } else { field }
}

/// Reads and checks the definition in `file`, which ends in `.toml` or `.json`.
///
/// # Errors
/// [`DefinitionError`], which names the file, and line and field where there are such.
pub fn load_file(file: &FilePath, pack: &Pack) -> Result<Definition, DefinitionError> {
    let whole = |message: String, allowed: &str| DefinitionError::whole(message, allowed).in_file(file);
    let Some(format) = Format::of_file(file) else {
        return Err(whole(
            "is no definition".to_owned(),
            "files that end in .toml or .json",
        ));
    };
    let unreadable = |cause: std::io::Error| whole(format!("cannot be read: {cause}"), "");
    // Its length first: a text that is too long is not worth reading.
    let length = std::fs::metadata(file).map_err(unreadable)?.len();
    if length > MAX_BYTES as u64 {
        return Err(whole(
            format!("is {length} bytes long"),
            &format!("at most {MAX_BYTES} bytes"),
        ));
    }
    let text = std::fs::read_to_string(file).map_err(unreadable)?;
    Definition::read(&text, format, pack).map_err(|error| error.in_file(file))
}

/// Reads and checks every `*.toml` and `*.json` of `folder`, sorted by name. A folder that is not there has none.
///
/// # Errors
/// [`DefinitionError`] for the first file that is not a definition, or has the name of another.
pub fn load_folder(folder: &FilePath, pack: &Pack) -> Result<Vec<Definition>, DefinitionError> {
    let unreadable = |cause: std::io::Error| {
        DefinitionError::whole(format!("cannot be read: {cause}"), "").in_file(folder)
    };
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(cause) => return Err(unreadable(cause)),
    };
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(unreadable)?.path();
        if Format::of_file(&path).is_some() {
            files.push(path);
        }
    }
    files.sort();
    let mut definitions: Vec<Definition> = Vec::with_capacity(files.len());
    for file in &files {
        let definition = load_file(file, pack)?;
        if definitions.iter().any(|before| before.name == definition.name) {
            let error = DefinitionError {
                field: "name".to_owned(),
                ..DefinitionError::whole(
                    format!("is {:?}, which another file's object has", definition.name),
                    "a name of its own for each object",
                )
            };
            return Err(error.in_file(file));
        }
        definitions.push(definition);
    }
    definitions.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(definitions)
}
