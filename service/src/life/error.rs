//! Why a pack was not loaded, unloaded or swapped.

/// Why the packs of the server stay as they are.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LifeError {
    /// The server's packs come from its start alone.
    #[error("the packs of this server cannot change; allowed: a server that reads its packs from a folder")]
    Fixed,
    /// The folder of packs cannot be read.
    #[error("the folder of packs cannot be read: {0}")]
    Folder(String),
    /// Neither a loaded pack nor one in the folder has this name and version.
    #[error(
        "unknown pack {wanted:?}; allowed: {}{}", allowed.join(", "), in_words(unusable)
    )]
    Unknown {
        /// The name, with the version if one was given.
        wanted: String,
        /// Names and versions of the packs in the folder and of those that are loaded.
        allowed: Vec<String>,
        /// Folders that are no packs, with the reasons.
        unusable: Vec<String>,
    },
    /// Several folders have this name and version.
    #[error("the pack {wanted} is in {}; allowed: one folder for a version", folders.join(" and in "))]
    Twice {
        /// Name and version.
        wanted: String,
        /// Sorted by path.
        folders: Vec<String>,
    },
    /// Another version of the pack is loaded.
    #[error("the version {loaded} of the pack {name} is loaded; allowed: that version, none, or a swap")]
    OtherVersion {
        /// The pack's name.
        name: String,
        /// The version that is loaded.
        loaded: String,
    },
    /// Only a pack that is loaded can be swapped.
    #[error("the pack {name} is not loaded; allowed: load it, or swap one of {}", loaded.join(", "))]
    NotLoaded {
        /// The pack's name.
        name: String,
        /// Names of the packs that are loaded.
        loaded: Vec<String>,
    },
    /// Requests that name no pack would fail.
    #[error("{name} is the default pack; allowed: swap it, or restart with another default_pack")]
    Default {
        /// The pack's name.
        name: String,
    },
    /// A file is missing, a hash is wrong, the shape is another, or an engine cannot run it.
    #[error("the pack {wanted} is refused: {reason}")]
    Refused {
        /// Name and version.
        wanted: String,
        /// What is wrong with it.
        reason: String,
    },
    /// There is no room for the networks.
    #[error("there is no memory for the pack {wanted}: {reason}")]
    Memory {
        /// Name and version.
        wanted: String,
        /// The figures, and the way on.
        reason: String,
    },
    /// Too many changes wait for their turns.
    #[error("too many changes of packs wait; allowed: at most {most}, one after another")]
    Busy {
        /// Maximum number of changes that wait or are under way.
        most: usize,
    },
}

/// Folders that cannot be used, if there are any.
fn in_words(unusable: &[String]) -> String {
    match unusable.is_empty() {
        true => String::new(),
        false => format!("; not usable: {}", unusable.join("; ")),
    }
}
