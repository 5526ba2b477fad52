//! Names of fields for errors. Building one costs nothing until there is an error.

use std::fmt;

/// A value that the server does not accept: which field, what is wrong, and what is allowed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldError {
    /// Path of the field, for example `characters[0].context[2].pose.rotations[8]`.
    pub field: String,
    /// What is wrong, for example `is 200`.
    pub message: String,
    /// What is allowed, for example `0 to 100`.
    pub allowed: String,
}

impl fmt::Display for FieldError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; allowed: {}", self.field, self.message, self.allowed)
    }
}

impl std::error::Error for FieldError {}

/// The place of a value in a request: a chain of steps on the stack. Naming a value costs nothing
/// until there is an error.
#[derive(Debug, Clone, Copy, Default)]
pub struct Path<'a> {
    parent: Option<&'a Path<'a>>,
    name: &'static str,
    index: Option<usize>,
}

impl<'a> Path<'a> {
    /// The whole request, or the whole document.
    pub fn root() -> Self {
        Self::default()
    }

    /// A field of this message.
    pub fn field(&'a self, name: &'static str) -> Path<'a> {
        Path {
            parent: Some(self),
            name,
            index: None,
        }
    }

    /// An element of a repeated field of this message; indices count from 0.
    pub fn element(&'a self, name: &'static str, index: usize) -> Path<'a> {
        Path {
            parent: Some(self),
            name,
            index: Some(index),
        }
    }

    /// An error of the value at this place.
    pub fn error(&self, message: impl Into<String>, allowed: impl Into<String>) -> FieldError {
        FieldError {
            field: self.to_string(),
            message: message.into(),
            allowed: allowed.into(),
        }
    }
}

impl fmt::Display for Path<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(parent) = self.parent {
            if parent.parent.is_some() {
                write!(f, "{parent}.")?;
            }
            f.write_str(self.name)?;
        }
        match self.index {
            Some(index) => write!(f, "[{index}]"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_written_as_in_the_request() {
        let root = Path::root();
        let character = root.element("characters", 3);
        let pose = character.field("pose");
        assert_eq!(
            pose.element("rotations", 8).to_string(),
            "characters[3].pose.rotations[8]"
        );
        assert_eq!(root.field("pack").to_string(), "pack");
        let error = character.field("seed").error("is odd", "even");
        assert_eq!(error.to_string(), "characters[3].seed: is odd; allowed: even");
    }
}
