//! API keys: who may call what. The server knows hashes only, so its file of keys gives nobody away.

use std::collections::HashSet;
use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};
use subtle::ConstantTimeEq as _;

/// What a key begins with, so that one can be found where it does not belong.
const PREFIX: &str = "troupe_";
/// Bytes of a key that nobody can guess.
const SECRET_BYTES: usize = 32;
const HASH_BYTES: usize = 32;
/// The name of the key that a server makes for one run.
const ONE_TIME: &str = "one-time";

/// What the holder of a key may do. Each role may do what those before it may.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Ask for motion, drive sessions, and read all else.
    Drive,
    /// Also write styles, scenes and object definitions.
    Author,
    /// Also read metrics.
    Admin,
}

impl Role {
    /// Its name in files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Drive => "drive",
            Self::Author => "author",
            Self::Admin => "admin",
        }
    }
}

/// Why a file of keys cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KeysError {
    /// The file cannot be read.
    #[error("keys: cannot read {}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        error: io::Error,
    },
    /// The file is not one of keys.
    #[error("keys: {}: {message}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
}

/// A file of keys.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    keys: Vec<Entry>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    sha256: String,
    role: Role,
}

/// One key, as the server knows it.
#[derive(Debug, Clone)]
struct Known {
    name: String,
    hash: [u8; HASH_BYTES],
    role: Role,
}

/// The keys that a server accepts.
#[derive(Debug, Clone)]
pub struct Keys(Vec<Known>);

impl Keys {
    /// Those of a file.
    ///
    /// # Errors
    /// [`KeysError`], which names the file and the entry.
    pub fn load(path: &Path) -> Result<Self, KeysError> {
        let text = std::fs::read_to_string(path).map_err(|error| KeysError::Read {
            path: path.to_owned(),
            error,
        })?;
        Self::read(&text).map_err(|message| KeysError::Invalid {
            path: path.to_owned(),
            message,
        })
    }

    fn read(text: &str) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|error| error.to_string())?;
        if file.keys.is_empty() {
            return Err("keys is empty; allowed: one entry or more".to_owned());
        }
        let mut names = HashSet::new();
        let known = file.keys.into_iter().enumerate().map(|(index, entry)| {
            let Entry { name, sha256, role } = entry;
            let hash = unhex(&sha256).ok_or_else(|| {
                format!("keys[{index}].sha256 of {name:?} is no hash; allowed: 64 hexadecimal digits")
            })?;
            match names.insert(name.clone()) {
                true => Ok(Known { name, hash, role }),
                false => Err(format!(
                    "keys[{index}].name is {name:?} again; allowed: each name once"
                )),
            }
        });
        known.collect::<Result<_, String>>().map(Self)
    }

    /// A new key with all rights, and the key itself.
    pub fn one_time() -> (Self, String) {
        let key = new_key();
        let known = Known {
            name: ONE_TIME.to_owned(),
            hash: hash(&key),
            role: Role::Admin,
        };
        (Self(vec![known]), key)
    }

    /// The name and role of a key. It takes the same time for every key.
    pub(super) fn find(&self, key: &str) -> Option<(&str, Role)> {
        let hash = hash(key);
        let mut found = None;
        for known in &self.0 {
            if bool::from(known.hash.ct_eq(&hash)) {
                found = Some((known.name.as_str(), known.role));
            }
        }
        found
    }
}

/// A key that nobody can guess.
pub fn new_key() -> String {
    let secret: [u8; SECRET_BYTES] = rand::random();
    format!("{PREFIX}{}", hex(&secret))
}

/// What a file of keys has for `key`.
pub fn entry(name: &str, role: Role, key: &str) -> String {
    let name = toml::Value::from(name);
    let (sha256, role) = (hex(&hash(key)), role.name());
    format!("[[keys]]\nname = {name}\nsha256 = \"{sha256}\"\nrole = \"{role}\"\n")
}

fn hash(key: &str) -> [u8; HASH_BYTES] {
    Sha256::digest(key.as_bytes()).into()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn unhex(text: &str) -> Option<[u8; HASH_BYTES]> {
    let digits = text.as_bytes();
    if digits.len() != 2 * HASH_BYTES {
        return None;
    }
    let digit = |at: usize| char::from(digits[at]).to_digit(16);
    let mut bytes = [0; HASH_BYTES];
    for (index, byte) in bytes.iter_mut().enumerate() {
        *byte = (digit(2 * index)? * 16 + digit(2 * index + 1)?) as u8;
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_made_is_read_again() {
        let (drive, admin) = (new_key(), new_key());
        assert!(drive != admin && drive.len() == 71 && drive.starts_with("troupe_"));
        let file = entry("the \"game\"", Role::Drive, &drive) + &entry("ops", Role::Admin, &admin);
        assert!(!file.contains(&drive));
        let keys = Keys::read(&file).unwrap();
        assert_eq!(keys.find(&drive), Some(("the \"game\"", Role::Drive)));
        assert_eq!(keys.find(&admin), Some(("ops", Role::Admin)));
        for wrong in ["", "troupe_", &drive[1..], &format!("{drive} ")] {
            assert_eq!(keys.find(wrong), None, "{wrong}");
        }
        let (keys, key) = Keys::one_time();
        assert_eq!(keys.find(&key), Some((ONE_TIME, Role::Admin)));
    }

    #[test]
    fn mistakes_name_the_entry() {
        let good = entry("a", Role::Author, "secret");
        let error = |text: &str| Keys::read(text).unwrap_err();
        assert!(error("keys = []").contains("one entry or more"));
        assert!(error(&good.replace("author", "boss")).contains("boss"));
        assert!(error(&good.replace("sha256 = \"", "sha256 = \"0")).contains("keys[0].sha256 of \"a\""));
        assert!(error(&good.replace("name", "label")).contains("label"));
        assert!(error(&(good.clone() + &good)).contains("keys[1].name is \"a\" again"));
        let missing = Keys::load(Path::new("/nowhere/keys.toml"))
            .unwrap_err()
            .to_string();
        assert!(
            missing.starts_with("keys: cannot read /nowhere/keys.toml"),
            "{missing}"
        );
    }
}
