//! API keys and their roles. The server's file only has hashes of keys, so it reveals no key.

use std::collections::HashSet;
use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};
use subtle::ConstantTimeEq as _;

use super::clients::{Identity, Quota, Recorded, Role};
use troupe_base::tenant::{TENANT_NAMES, names_a_tenant};

/// Start of every key, so that scanners can find leaked keys.
const PREFIX: &str = "troupe_";
/// Random bytes of a key.
const SECRET_BYTES: usize = 32;
pub(super) const HASH_BYTES: usize = 32;
/// Longest name, bytes.
const MAX_NAME_BYTES: usize = 128;
/// Largest share of a key in the queues.
const MAX_SHARE: u32 = 100;
/// The fields of an entry.
const FIELDS: [&str; 9] = [
    "name",
    "sha256",
    "role",
    "tenant",
    "max_sessions",
    "max_streams",
    "transfer_memory_mib",
    "share",
    "record",
];
/// Characters without a space that messages about a file of keys do not show. Names of options and
/// roles are shorter, keys and their hashes longer.
const MIN_SECRET_CHARS: usize = 24;
/// The name of the key that a server makes for scrapes of its metrics.
const METRICS: &str = "metrics";
/// The name of the key that a server makes for one run.
const ONE_TIME: &str = "one-time";

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
    /// The file of the metrics key can be neither read nor written.
    #[error("metrics_key: cannot use {}: {error}", path.display())]
    MetricsKey {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        error: io::Error,
    },
    /// The file of the metrics key holds something else.
    #[error(
        "metrics_key: {} holds no key; allowed: a new file, or one that the server has written",
        path.display()
    )]
    NoMetricsKey {
        /// The file.
        path: PathBuf,
    },
    /// The file is no valid list of keys.
    #[error("keys: {}: {message}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The field, its value, and the allowed values.
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
    tenant: Option<String>,
    max_sessions: Option<usize>,
    max_streams: Option<usize>,
    transfer_memory_mib: Option<usize>,
    share: Option<u32>,
    record: Option<Recorded>,
}

/// A key that the server accepts, as its hash.
#[derive(Debug, Clone)]
struct Known {
    identity: Identity,
    hash: [u8; HASH_BYTES],
    quota: Quota,
}

impl Entry {
    /// The first invalid field, with the allowed values.
    fn problem(&self) -> Option<String> {
        let Self { name, tenant, .. } = self;
        let fits = |text: &str| (1..=MAX_NAME_BYTES).contains(&text.len());
        if !fits(name) {
            return Some(format!("name is {name:?}; allowed: 1 to {MAX_NAME_BYTES} bytes"));
        }
        if let Some(tenant) = tenant.as_deref().filter(|tenant| !names_a_tenant(tenant)) {
            return Some(format!(
                "tenant of {name:?} is {tenant:?}; allowed: {TENANT_NAMES}"
            ));
        }
        let quotas = [
            ("max_sessions", self.max_sessions),
            ("max_streams", self.max_streams),
            ("transfer_memory_mib", self.transfer_memory_mib),
        ];
        let zero = quotas.iter().find(|(_, quota)| *quota == Some(0));
        if let Some((option, _)) = zero {
            return Some(format!("{option} of {name:?} is 0; allowed: 1 or more"));
        }
        let share = self.share.filter(|share| !(1..=MAX_SHARE).contains(share));
        share.map(|share| format!("share of {name:?} is {share}; allowed: 1 to {MAX_SHARE}"))
    }

    fn known(self) -> Result<Known, String> {
        if let Some(problem) = self.problem() {
            return Err(problem);
        }
        let Some(hash) = unhex(&self.sha256) else {
            let name = &self.name;
            return Err(format!(
                "sha256 of {name:?} is no hash; allowed: 64 hexadecimal digits"
            ));
        };
        Ok(Known {
            identity: Identity {
                name: self.name.into(),
                role: self.role,
                tenant: self.tenant.map(Into::into),
            },
            hash,
            quota: Quota {
                sessions: self.max_sessions,
                streams: self.max_streams,
                bytes: self.transfer_memory_mib.map(|mib| mib.saturating_mul(1 << 20)),
                share: self.share,
                recorded: self.record,
            },
        })
    }
}

/// The keys that a server accepts.
#[derive(Debug, Clone, Default)]
pub struct Keys(Vec<Known>);

impl Keys {
    /// The keys of a file.
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

    pub(super) fn read(text: &str) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|error| {
            let place = place_of(text, error.span().map_or(0, |span| span.start));
            format!("{place}: {}", without_secrets(error.message()))
        })?;
        if file.keys.is_empty() {
            return Err("keys is empty; allowed: one entry or more".to_owned());
        }
        let mut names = HashSet::new();
        let known = file.keys.into_iter().enumerate().map(|(index, entry)| {
            let known = entry
                .known()
                .map_err(|problem| format!("keys[{index}].{problem}"))?;
            let name = known.identity.name.clone();
            match names.insert(name.clone()) {
                true => Ok(known),
                false => Err(format!(
                    "keys[{index}].name is {name:?} again; allowed: each name once"
                )),
            }
        });
        let known = known.collect::<Result<_, String>>().map(Self);
        known.map_err(|message| without_secrets(&message))
    }

    /// A new key with the role admin, as it is checked and as text.
    pub fn one_time() -> (Self, String) {
        let key = new_key();
        (Self::one(ONE_TIME, Role::Admin, &key), key)
    }

    /// The key of the server's own scraper, from a file. If the file does not exist, makes a key
    /// and writes it there.
    ///
    /// # Errors
    /// [`KeysError`], which names the file.
    pub fn of_metrics(path: &Path) -> Result<Self, KeysError> {
        let key = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                let key = new_key();
                write_secret(path, &key).map_err(|error| KeysError::MetricsKey {
                    path: path.to_owned(),
                    error,
                })?;
                key
            }
            Err(error) => {
                return Err(KeysError::MetricsKey {
                    path: path.to_owned(),
                    error,
                });
            }
        };
        let key = key.trim();
        match key.starts_with(PREFIX) && key.len() == PREFIX.len() + 2 * SECRET_BYTES {
            true => Ok(Self::one(METRICS, Role::Metrics, key)),
            false => Err(KeysError::NoMetricsKey {
                path: path.to_owned(),
            }),
        }
    }

    fn one(name: &str, role: Role, key: &str) -> Self {
        Self(vec![Known {
            identity: Identity {
                name: name.into(),
                role,
                tenant: None,
            },
            hash: hash(key),
            quota: Quota::default(),
        }])
    }

    /// These keys and `others`.
    #[must_use]
    pub fn and(mut self, others: Self) -> Self {
        self.0.extend(others.0);
        self
    }

    /// The identity and quota of the key with this hash. The search takes the same time for all
    /// keys.
    pub(super) fn find(&self, hash: &[u8; HASH_BYTES]) -> Option<(&Identity, Quota)> {
        let mut found = None;
        for known in &self.0 {
            if bool::from(known.hash.ct_eq(hash)) {
                found = Some((&known.identity, known.quota));
            }
        }
        found
    }
}

/// The line, from 1, of the byte at `offset`, and the field that is set there.
fn place_of(text: &str, offset: usize) -> String {
    let before = text.as_bytes().iter().take(offset);
    let index = before.filter(|&&byte| byte == b'\n').count();
    let set = text.lines().nth(index).and_then(|line| line.split_once('='));
    let field = set.map_or("", |(name, _)| name.trim());
    match FIELDS.contains(&field) {
        true => format!("line {}: {field}", index + 1),
        false => format!("line {}", index + 1),
    }
}

/// A message about a file of keys for the log. Whoever mistakes a line may have put a key into it,
/// so everything that is as long as a key is left out.
fn without_secrets(message: &str) -> String {
    let is_part = |c: char| c.is_ascii_alphanumeric() || "_-+/=.".contains(c);
    let (mut shown, mut word) = (String::new(), String::new());
    for c in message.chars().map(Some).chain([None]) {
        if let Some(c) = c.filter(|&c| is_part(c)) {
            word.push(c);
            continue;
        }
        let is_secret = word.len() >= MIN_SECRET_CHARS;
        shown.push_str(if is_secret { "[left out]" } else { &word });
        word.clear();
        shown.extend(c);
    }
    shown
}

/// Writes a new file that its owner and group may read. After an error there is no file.
fn write_secret(path: &Path, text: &str) -> io::Result<()> {
    use std::io::Write as _;
    let mut options = std::fs::OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o640);
    let written = options
        .open(path)
        .and_then(|mut file| file.write_all(text.as_bytes()).and_then(|()| file.sync_all()));
    if written.is_err() {
        let _ = std::fs::remove_file(path);
    }
    written
}

/// A new random key.
pub fn new_key() -> String {
    secret(PREFIX)
}

/// A random secret of 256 bits, as hexadecimal digits after a prefix.
pub(super) fn secret(prefix: &str) -> String {
    let secret: [u8; SECRET_BYTES] = rand::random();
    format!("{prefix}{}", hex(&secret))
}

/// The entry for `key` in a file of keys.
pub fn entry(name: &str, role: Role, key: &str) -> String {
    let name = toml::Value::from(name);
    let (sha256, role) = (hex(&hash(key)), role.name());
    format!("[[keys]]\nname = {name}\nsha256 = \"{sha256}\"\nrole = \"{role}\"\n")
}

/// The line that gives an entry a tenant.
///
/// # Errors
/// A sentence with the allowed names of tenants.
pub fn tenant_line(tenant: &str) -> Result<String, String> {
    match names_a_tenant(tenant) {
        true => Ok(format!("tenant = \"{tenant}\"\n")),
        false => Err(format!("tenant is {tenant:?}; allowed: {TENANT_NAMES}")),
    }
}

pub(super) fn hash(key: &str) -> [u8; HASH_BYTES] {
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
    fn new_keys_can_be_read_again() {
        let (drive, admin) = (new_key(), new_key());
        assert!(drive != admin && drive.len() == 71 && drive.starts_with("troupe_"));
        let file = entry("the \"game\"", Role::Drive, &drive) + &entry("ops", Role::Admin, &admin);
        assert!(!file.contains(&drive));
        let keys = Keys::read(&file).unwrap();
        let find = |keys: &Keys, key: &str| {
            let (identity, _) = keys.find(&hash(key))?;
            Some((identity.name.to_string(), identity.role))
        };
        assert_eq!(
            find(&keys, &drive),
            Some(("the \"game\"".to_owned(), Role::Drive))
        );
        assert_eq!(find(&keys, &admin), Some(("ops".to_owned(), Role::Admin)));
        for wrong in ["", "troupe_", &drive[1..], &format!("{drive} ")] {
            assert_eq!(keys.find(&hash(wrong)), None, "{wrong}");
        }
        let (keys, key) = Keys::one_time();
        assert_eq!(find(&keys, &key), Some((ONE_TIME.to_owned(), Role::Admin)));
    }

    #[test]
    fn an_entry_may_have_a_tenant_and_quotas() {
        let rest = "tenant = \"a\"\nmax_sessions = 3\nmax_streams = 2\ntransfer_memory_mib = 5\n";
        let keys = Keys::read(&(entry("game", Role::Drive, "secret") + rest)).unwrap();
        let (identity, quota) = keys.find(&hash("secret")).unwrap();
        assert_eq!(identity.tenant.as_deref(), Some("a"));
        assert_eq!(
            (quota.sessions, quota.streams, quota.bytes),
            (Some(3), Some(2), Some(5 << 20))
        );
        let plain = Keys::read(&entry("game", Role::Drive, "secret")).unwrap();
        assert_eq!(plain.find(&hash("secret")).unwrap().1, Quota::default());
    }

    #[test]
    fn an_entry_says_which_sessions_are_recorded() {
        let recorded = |keys: Keys| keys.find(&hash("secret")).unwrap().1.recorded;
        let of = |line: &str| Keys::read(&(entry("game", Role::Drive, "secret") + line)).map(recorded);
        assert_eq!(of(""), Ok(None));
        assert_eq!(of("record = \"asked\"\n"), Ok(Some(Recorded::Asked)));
        assert_eq!(of("record = \"always\"\n"), Ok(Some(Recorded::Always)));
        assert!(of("record = true\n").unwrap_err().starts_with("line 5: record"));
    }

    #[test]
    fn the_key_for_metrics_is_written_once_and_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.key");
        Keys::of_metrics(&path).unwrap();
        let key = std::fs::read_to_string(&path).unwrap();
        let again = Keys::of_metrics(&path).unwrap();
        assert_eq!(again.find(&hash(&key)).unwrap().0.role, Role::Metrics);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            let mode = std::fs::metadata(&path).unwrap().permissions().mode();
            assert_eq!(mode & 0o007, 0, "{mode:o}");
        }
        std::fs::write(&path, "short").unwrap();
        let error = Keys::of_metrics(&path).unwrap_err().to_string();
        assert!(error.contains("metrics.key holds no key"), "{error}");
        let error = Keys::of_metrics(Path::new("/nowhere/key"))
            .unwrap_err()
            .to_string();
        assert!(
            error.starts_with("metrics_key: cannot use /nowhere/key"),
            "{error}"
        );
    }

    #[test]
    fn mistakes_name_the_entry() {
        let good = entry("a", Role::Author, "secret");
        let error = |text: &str| Keys::read(text).unwrap_err();
        assert!(error("keys = []").contains("one entry or more"));
        for (broken, line) in [
            ("name = \"a\n", 2),
            ("max_streams = \"troupe_0123456789abcdef0123456789abcdef\"\n", 5),
            ("troupe_0123456789abcdef0123456789abcdef = 1\n", 5),
            ("troupe_0123456789abcdef0123456789abcdef\n", 5),
            ("tenant = \"troupe 0123456789abcdef0123456789abcdef\"\n", 0),
        ] {
            let text = match line {
                2 => format!("[[keys]]\n{broken}"),
                _ => format!("{good}{broken}"),
            };
            let shown = error(&text);
            assert!(!shown.contains("0123456789abcdef"), "{shown}");
            assert!(
                line == 0 || shown.starts_with(&format!("line {line}: ")),
                "{shown}"
            );
        }
        assert!(error(&good.replace("author", "boss")).contains("boss"));
        assert!(error(&good.replace("sha256 = \"", "sha256 = \"0")).contains("keys[0].sha256 of \"a\""));
        assert!(error(&good.replace("name", "label")).contains("label"));
        assert!(error(&good.replace("\"a\"", "\"\"")).starts_with("keys[0].name is \"\""));
        let with = |line: &str| error(&format!("{good}{line}\n"));
        assert_eq!(
            with("max_streams = 0"),
            "keys[0].max_streams of \"a\" is 0; allowed: 1 or more"
        );
        assert_eq!(
            with("share = 101"),
            "keys[0].share of \"a\" is 101; allowed: 1 to 100"
        );
        assert!(with("tenant = \"\"").starts_with("keys[0].tenant of \"a\" is"));
        assert!(with("max_sessions = -1").contains("max_sessions"));
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
