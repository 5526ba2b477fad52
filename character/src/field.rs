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

/// The size of a caller's body. Values are checked in the size of another body, and errors say
/// lengths and speeds as the caller does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Metres of the caller for a metre of the values.
    scale: f32,
    /// Height of the caller's root joint while the other body's is at height 0, metres.
    root_m: f32,
}

impl Default for Size {
    /// The size of the values.
    fn default() -> Self {
        Self::new(1.0, 0.0)
    }
}

impl Size {
    /// A caller with `scale` metres for a metre of the values, above 0, whose root joint is
    /// `root_m` higher than the scaled height of the other body's.
    pub fn new(scale: f32, root_m: f32) -> Self {
        Self { scale, root_m }
    }
}

/// The place of a value in a request: a chain of steps on the stack. Naming a value costs nothing
/// until there is an error.
#[derive(Debug, Clone, Copy, Default)]
pub struct Path<'a> {
    parent: Option<&'a Path<'a>>,
    name: &'static str,
    index: Option<usize>,
    size: Size,
}

impl<'a> Path<'a> {
    /// The whole request, or the whole document.
    pub fn root() -> Self {
        Self::default()
    }

    /// This place for a caller of another size, and all that is below it.
    pub fn sized(self, size: Size) -> Self {
        Self { size, ..self }
    }

    /// The size of the caller.
    pub fn size(&self) -> Size {
        self.size
    }

    /// A length or speed here as its caller says it, metres or m/s.
    pub fn metres(&self, value: f32) -> f32 {
        self.rounded(value, value * self.size.scale)
    }

    /// A height of the root joint here as its caller says it, metres.
    pub fn height(&self, value: f32) -> f32 {
        self.rounded(value, value * self.size.scale + self.size.root_m)
    }

    /// What the caller gave was divided, and has no more digits than these.
    fn rounded(&self, value: f32, own: f32) -> f32 {
        match self.size == Size::default() {
            true => value,
            false => format!("{own:.5e}").parse().unwrap_or(own),
        }
    }

    /// A field of this message.
    pub fn field(&'a self, name: &'static str) -> Path<'a> {
        Path {
            parent: Some(self),
            name,
            index: None,
            size: self.size,
        }
    }

    /// An element of a repeated field of this message; indices count from 0.
    pub fn element(&'a self, name: &'static str, index: usize) -> Path<'a> {
        Path {
            parent: Some(self),
            name,
            index: Some(index),
            size: self.size,
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

    #[test]
    fn lengths_are_said_in_the_size_of_the_caller() {
        let root = Path::root().sized(Size::new(1.2, -0.5));
        let point = root.element("points", 2);
        let place = point.field("position");
        assert_eq!((place.metres(15.0), place.metres(30.0 / 1.2)), (18.0, 30.0));
        assert_eq!((place.height(1.0), place.height((2.5 + 0.5) / 1.2)), (0.7, 2.5));
        let same = Path::root();
        assert_eq!((same.metres(0.1 + 0.2), same.height(1.0)), (0.1 + 0.2, 1.0));
    }
}
