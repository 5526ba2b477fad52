//! Keeps the results of accuracy checks in files, for the next start.
//!
//! A check takes seconds and depends only on the pack's files, the libraries, the CPU and this
//! version of the server. These make the file's name. If the folder cannot be read or written, the
//! check is made again, and nothing else happens.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use super::EngineKind;
use super::machine::Machine;
use super::select::Check;
use crate::pack::{MANIFEST_FILE, Pack};

/// Rises with every change to how networks are made or compared.
const REVISION: u32 = 2;

/// The folder of the results; none keeps nothing.
#[derive(Debug, Clone, Default)]
pub struct CheckCache {
    folder: Option<PathBuf>,
}

impl CheckCache {
    /// A cache in this folder, which need not exist.
    pub fn new(folder: Option<PathBuf>) -> Self {
        Self { folder }
    }

    /// The file of a check's result. None without a folder, or if the pack cannot be read.
    pub(super) fn file(
        &self,
        pack: &Pack,
        engine: EngineKind,
        threads: usize,
        machine: &Machine,
        library: &Path,
    ) -> Option<PathBuf> {
        let folder = self.folder.as_ref()?;
        let mut hash = Sha256::new();
        let mut add = |part: &[u8]| {
            hash.update((part.len() as u64).to_le_bytes());
            hash.update(part);
        };
        let version = env!("CARGO_PKG_VERSION");
        add(format!("{REVISION} {version} {engine} {threads}").as_bytes());
        add(format!("{} {:?} {:?}", machine.cpu, machine.features, machine.gpus).as_bytes());
        // File names contain the libraries' versions.
        let mut libraries: Vec<String> = std::fs::read_dir(library.parent()?)
            .ok()?
            .filter_map(Result::ok)
            .filter_map(|file| Some(format!("{:?} {}", file.file_name(), file.metadata().ok()?.len())))
            .collect();
        libraries.sort();
        add(libraries.join("\n").as_bytes());
        // The manifest has a hash of the networks, which was compared when the pack was loaded.
        add(&std::fs::read(pack.folder.join(MANIFEST_FILE)).ok()?);
        for body in &pack.bodies {
            add(&std::fs::read(pack.body_file(&body.name)).ok()?);
        }
        let mut name = format!("accuracy-{}-", pack.name());
        for byte in &hash.finalize()[..16] {
            let _ = write!(name, "{byte:02x}");
        }
        Some(folder.join(name + ".json"))
    }
}

/// Reads a stored result.
pub(super) fn read(file: &Path) -> Option<Check> {
    let text = std::fs::read_to_string(file).ok()?;
    let check: Check = serde_json::from_str(&text)
        .inspect_err(
            |error| tracing::debug!(file = %file.display(), %error, "a stored accuracy check is not used"),
        )
        .ok()?;
    // Limits may have changed, and the file may contain anything.
    (check.passed == check.accuracy.passes()).then_some(check)
}

/// Stores a result.
pub(super) fn write(file: &Path, check: &Check) {
    let kept = || -> std::io::Result<()> {
        let folder = file.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder)?;
        // Complete or not at all, even with several writers.
        let part = file.with_extension(format!("{}.part", std::process::id()));
        std::fs::write(&part, serde_json::to_vec_pretty(check)?)?;
        std::fs::rename(&part, file)
    };
    if let Err(error) = kept() {
        tracing::debug!(file = %file.display(), %error, "the accuracy check cannot be stored");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::Accuracy;
    use std::time::Duration;

    fn check(passed: bool) -> Check {
        let accuracy = Accuracy {
            joint_mean_m: if passed { 0.0003 } else { 0.3 },
            ..Accuracy::default()
        };
        Check {
            engine: EngineKind::OpenvinoBf16,
            accuracy,
            passed,
            took: Duration::from_millis(1234),
        }
    }

    #[test]
    fn a_result_is_unchanged_by_writing_and_reading() {
        let folder = std::env::temp_dir().join(format!("troupe-checks-{}", std::process::id()));
        let file = folder.join("deep/accuracy.json");
        assert_eq!(read(&file), None);
        for passed in [true, false] {
            write(&file, &check(passed));
            assert_eq!(read(&file), Some(check(passed)));
        }
        write(
            &file,
            &Check {
                passed: true,
                ..check(false)
            },
        );
        assert_eq!(read(&file), None, "its figures do not pass");
        std::fs::write(&file, "{").unwrap();
        assert_eq!(read(&file), None);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_folder_that_cannot_be_created_is_not_an_error() {
        write(Path::new("/proc/nowhere/accuracy.json"), &check(true));
    }

    #[test]
    fn another_pack_machine_or_library_is_another_file() {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models");
        let [human, g1] = ["human", "g1"].map(|name| Pack::load(&models.join(name)).unwrap());
        let machine = Machine::detect();
        let other = Machine {
            cpu: "another".to_owned(),
            ..machine.clone()
        };
        let cache = CheckCache::new(Some(PathBuf::from("cache")));
        let library = models.join("human/root.onnx");
        let engine = EngineKind::OpenvinoBf16;
        let first = cache.file(&human, engine, 1, &machine, &library).unwrap();
        assert_eq!(
            cache.file(&human, engine, 1, &machine, &library),
            Some(first.clone())
        );
        let others = [
            cache.file(&g1, engine, 1, &machine, &library),
            cache.file(&human, EngineKind::Cuda, 1, &machine, &library),
            cache.file(&human, engine, 2, &machine, &library),
            cache.file(&human, engine, 1, &other, &library),
            cache.file(&human, engine, 1, &machine, &models.join("g1/root.onnx")),
        ];
        for other in others {
            assert_ne!(other.unwrap(), first);
        }
        let nowhere = CheckCache::default();
        assert_eq!(nowhere.file(&human, engine, 1, &machine, &library), None);
    }
}
