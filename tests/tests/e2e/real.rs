//! A few clips of captured motion, if the archive is in `../shared/data` beside the checkout.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Parts of the names of clips: the tests use the first clip of the test split with each.
const KINDS: [&str; 4] = ["_walk_", "_run_", "_walk-turn-left_", "_wave-both-hands_"];

/// BVH files of a few clips of the test split. Without the archive the list is empty, and a note is
/// printed once.
///
/// # Panics
/// If the archive exists but cannot be unpacked.
pub fn clips() -> &'static [PathBuf] {
    static CLIPS: OnceLock<Vec<PathBuf>> = OnceLock::new();
    CLIPS.get_or_init(|| {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let archive = root.join("../shared/data/bandai-namco-train.tar.xz");
        if !archive.is_file() {
            eprintln!(
                "note: real clips are not tested, because {} is missing",
                archive.display()
            );
            return Vec::new();
        }
        let split = std::fs::read_to_string(root.join("training/splits/bandai-namco-test.txt"))
            .expect("the test split is in the repository");
        let names = KINDS
            .iter()
            .filter_map(|kind| split.lines().find(|name| name.contains(kind)));
        unpack(
            &archive,
            &names
                .map(|name| format!("{}.bvh", name.trim_end_matches(".bvh")))
                .collect::<Vec<_>>(),
        )
    })
}

/// Unpacks members of the archive into the build folder, unless an earlier run did.
fn unpack(archive: &Path, names: &[String]) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("real-clips");
    let paths = names
        .iter()
        .map(|name| folder.join("bandai-namco").join(name))
        .collect::<Vec<_>>();
    if paths.iter().all(|path| path.is_file()) {
        return paths;
    }
    // Into a new folder first: a run that is stopped must not leave half of a clip.
    let fresh = folder.with_extension(std::process::id().to_string());
    std::fs::create_dir_all(&fresh).expect("the build folder can be written");
    let members = names.iter().map(|name| format!("bandai-namco/{name}"));
    let tar = Command::new("tar")
        .arg("-xJf")
        .arg(archive)
        .arg("-C")
        .arg(&fresh)
        .args(members)
        .status();
    assert!(
        tar.expect("tar is installed").success(),
        "{} cannot be unpacked",
        archive.display()
    );
    if folder.exists() {
        std::fs::remove_dir_all(&folder).expect("the build folder can be written");
    }
    std::fs::rename(&fresh, &folder).expect("the build folder can be written");
    paths
}
