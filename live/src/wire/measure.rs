//! Axes and units of a client's values, and the size of its character.

use troupe_motion::conventions::Convention;
use troupe_motion::{GlobalRoot, Vec3};

use crate::skeleton::Worn;

/// The convention of a session, and the size of its character: a character that wears a skeleton of
/// the user's own lives in the size of its pack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measure {
    convention: Convention,
    /// Metres of the user for a metre of the character.
    scale: f32,
}

impl From<Convention> for Measure {
    fn from(convention: Convention) -> Self {
        Self {
            convention,
            scale: 1.0,
        }
    }
}

impl Measure {
    /// The measure of a session.
    pub fn of(convention: Convention, worn: Option<&Worn>) -> Self {
        Self {
            convention,
            scale: worn.map_or(1.0, Worn::scale),
        }
    }

    /// Axes and unit of the client.
    pub fn convention(self) -> Convention {
        self.convention
    }

    /// Metres of the user for a metre of the character.
    pub fn scale(self) -> f32 {
        self.scale
    }

    /// The client's units for a metre of the character.
    pub fn units_per_metre(self) -> f32 {
        self.convention.units_per_metre() * self.scale
    }

    /// A place or velocity of the client for the character, metres.
    pub fn position_to_native(self, position: Vec3) -> Vec3 {
        self.convention.position_to_native(position) / self.scale
    }

    /// A place or velocity of the character for the client.
    pub fn position_from_native(self, position: Vec3) -> Vec3 {
        self.convention.position_from_native(position * self.scale)
    }

    /// A heading of the client, native.
    pub fn heading_to_native(self, heading: f32) -> f32 {
        self.convention.heading_to_native(heading)
    }

    /// A native heading for the client.
    pub fn heading_from_native(self, heading: f32) -> f32 {
        self.convention.heading_from_native(heading)
    }

    /// The place and heading of the character's root in the user's size, native.
    pub fn sized(self, root: GlobalRoot) -> GlobalRoot {
        GlobalRoot::new(self.scale * root.position, root.heading)
    }
}
