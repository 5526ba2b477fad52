//! Files of the disk beside the one that is read.

use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path};

use crate::glb::MAX_BUFFER_BYTES;

/// The bytes of a file in a folder or below it, as [`Source::beside`](super::Source::beside) gives
/// them. A file of motion cannot name any other. Of a file beyond 1 GiB only a part comes back,
/// which is still too large for the reader.
pub fn below(folder: &Path, name: &str) -> Option<Vec<u8>> {
    let name = Path::new(name);
    let is_below = name
        .components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    is_below
        .then(|| part_of(&folder.join(name), MAX_BUFFER_BYTES))
        .flatten()
}

/// The bytes of a mesh that a robot's description names, which may stand in any folder.
/// `package://` is the description's folder.
pub fn mesh(folder: &Path, name: &str) -> Option<Vec<u8>> {
    let name = Path::new(name.strip_prefix("package://").unwrap_or(name));
    let ending = name.extension().and_then(OsStr::to_str);
    let is_mesh = ending.is_some_and(|ending| ending.eq_ignore_ascii_case("stl"));
    is_mesh
        .then(|| part_of(&folder.join(name), MAX_BUFFER_BYTES))
        .flatten()
}

/// A file, or of a larger one the first bytes: one more than `most_bytes`.
fn part_of(path: &Path, most_bytes: usize) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut part = File::open(path).ok()?.take(most_bytes as u64 + 1);
    part.read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_below_the_folder_are_read() {
        let top = std::env::temp_dir().join(format!("troupe-beside-{}", std::process::id()));
        let folder = top.join("motion");
        std::fs::create_dir_all(folder.join("data")).unwrap();
        for file in ["out.bin", "out.STL", "motion/walk.bin", "motion/data/walk.bin"] {
            std::fs::write(top.join(file), "12345").unwrap();
        }
        let whole = top.join("out.bin");
        let whole = whole.to_str().unwrap();
        for (name, is_read) in [
            ("walk.bin", true),
            ("./data/walk.bin", true),
            ("../out.bin", false),
            ("data/../../out.bin", false),
            (whole, false),
            ("lost.bin", false),
        ] {
            assert_eq!(below(&folder, name).is_some(), is_read, "{name}");
        }
        assert!(mesh(&folder, "../out.STL").is_some() && mesh(&top, "package://out.STL").is_some());
        assert!(mesh(&folder, "walk.bin").is_none());
        assert_eq!(part_of(&top.join("out.bin"), 5).unwrap().len(), 5);
        assert_eq!(part_of(&top.join("out.bin"), 3).unwrap().len(), 4);
        std::fs::remove_dir_all(top).unwrap();
    }
}
