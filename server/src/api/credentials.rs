//! What lets callers in. It can be replaced while the server runs.

use arc_swap::ArcSwap;

use super::keys::Keys;

/// What a server accepts.
#[derive(Debug)]
pub struct Credentials {
    keys: ArcSwap<Keys>,
}

impl Credentials {
    /// Keys.
    pub fn new(keys: Keys) -> Self {
        Self {
            keys: ArcSwap::from_pointee(keys),
        }
    }

    /// Accepts these keys and no others, from the next call on.
    pub fn replace_keys(&self, keys: Keys) {
        self.keys.store(keys.into());
    }

    /// The keys as they are now.
    pub(super) fn keys(&self) -> arc_swap::Guard<std::sync::Arc<Keys>> {
        self.keys.load()
    }
}
