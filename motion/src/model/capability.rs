//! What a pack can do.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Something that a model may be able to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Capability {
    /// Fill the gap between keyframes.
    Inbetween,
    /// Drive live characters.
    Live,
    /// Follow a path over the ground.
    Path,
    /// Make motion of a text.
    Text,
    /// Describe a motion in words.
    Describe,
    /// Move several characters in one job.
    Agents,
}

impl Capability {
    /// Every capability once.
    pub const ALL: [Self; 6] = [
        Self::Inbetween,
        Self::Live,
        Self::Path,
        Self::Text,
        Self::Describe,
        Self::Agents,
    ];

    /// The capability's name in a manifest and in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Inbetween => "inbetween",
            Self::Live => "live",
            Self::Path => "path",
            Self::Text => "text",
            Self::Describe => "describe",
            Self::Agents => "agents",
        }
    }
}

impl fmt::Display for Capability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What a pack can do: the table `[capabilities]` of its manifest. Missing entries are false.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Capabilities {
    /// See [`Capability::Inbetween`].
    pub inbetween: bool,
    /// See [`Capability::Live`].
    pub live: bool,
    /// See [`Capability::Path`].
    pub path: bool,
    /// See [`Capability::Text`].
    pub text: bool,
    /// See [`Capability::Describe`].
    pub describe: bool,
    /// See [`Capability::Agents`].
    pub agents: bool,
}

impl Capabilities {
    /// Whether the pack has a capability.
    pub fn has(&self, capability: Capability) -> bool {
        match capability {
            Capability::Inbetween => self.inbetween,
            Capability::Live => self.live,
            Capability::Path => self.path,
            Capability::Text => self.text,
            Capability::Describe => self.describe,
            Capability::Agents => self.agents,
        }
    }

    /// All capabilities that the pack has.
    pub fn list(&self) -> impl Iterator<Item = Capability> {
        Capability::ALL
            .into_iter()
            .filter(|&capability| self.has(capability))
    }
}
