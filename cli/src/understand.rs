//! Reading files of motion and of characters, and saying what was understood.

use std::path::{Path, PathBuf};

use troupe_motion::read::{self, Basis, Options, ReadErrorKind, Report, Source, Understood};

use crate::term::{Term, plain};

/// The file of a SONIC motion that stands for the other CSV files of its folder.
pub(super) const SONIC_FILE: &str = "joint_pos.csv";
/// Why a file of motion was not understood.
#[derive(Debug, thiserror::Error)]
pub(super) enum Misread {
    /// The file system's error.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// What is wrong with the file.
    #[error("{}", plain(&.0.to_string()))]
    Kind(#[from] ReadErrorKind),
}

impl Misread {
    /// Whether another choice of options may read the file.
    pub(super) fn has_options(&self) -> bool {
        matches!(self, Self::Kind(kind) if !kind.options().is_empty())
    }

    /// Whether the file has no animation, but may have a skeleton at rest.
    pub(super) fn lacks_animation(&self) -> bool {
        matches!(self, Self::Kind(kind) if kind.lacks_animation())
    }
}

/// Reads a file of motion, and says what was understood of it. Names and rates as for
/// [`read_clip_on`](crate::read_clip_on).
///
/// # Errors
/// [`Misread`], without the path.
pub(super) fn understand(
    path: &Path,
    mut options: Options,
    gltf_fps: Option<f32>,
) -> Result<Understood, Misread> {
    let (path, animation) = split_animation(path);
    // SONIC's motion is a folder of files.
    let sonic = path.join(SONIC_FILE);
    let path = if sonic.is_file() { sonic } else { path };
    let bytes = std::fs::read(&path)?;
    options.animation = animation.or(options.animation);
    if is_gltf(&path, &bytes) {
        options.fps = options.fps.or(gltf_fps);
    }
    let read = with_source(&path, &bytes, |source| read::read(source, &options));
    Ok(read.map_err(|error| error.kind)?)
}

/// Reads the file of a character: its skeleton at rest. It needs no animation.
///
/// # Errors
/// [`Misread`], without the path.
pub(super) fn understand_character(path: &Path, options: Options) -> Result<Understood, Misread> {
    let (file, animation) = split_animation(path);
    let bytes = std::fs::read(&file)?;
    let options = Options {
        animation: animation.or(options.animation),
        ..options
    };
    let read = with_source(&file, &bytes, |source| read::character(source, &options));
    Ok(read.map_err(|error| error.kind)?)
}

/// Does something with a file as a source of the reader, which also finds the files beside it.
pub(super) fn with_source<T>(path: &Path, bytes: &[u8], does: impl FnOnce(&Source<'_>) -> T) -> T {
    let folder = path.parent().unwrap_or(Path::new(""));
    let beside = |name: &str| read::beside::below(folder, name);
    does(&Source {
        name: &path.to_string_lossy(),
        bytes,
        beside: &beside,
    })
}

/// Whether a file is glTF, binary or text.
fn is_gltf(path: &Path, bytes: &[u8]) -> bool {
    bytes.starts_with(b"glTF")
        || bytes.trim_ascii_start().starts_with(b"{")
        || ending(path).as_deref() == Some("gltf")
}

/// A file's ending, in lower case and without the dot.
pub(super) fn ending(path: &Path) -> Option<String> {
    path.extension().map(|e| e.to_string_lossy().to_lowercase())
}

/// Notes what a user must know of a file that was read: repairs, oddities, and an assumed rate.
pub(super) fn note(path: &Path, report: &Report, term: &Term) {
    note_as(path, report, term, &str::to_owned);
}

/// As [`note`], in the words of other options.
pub(super) fn note_as(path: &Path, report: &Report, term: &Term, words: &dyn Fn(&str) -> String) {
    let path = path.display();
    for repair in &report.repairs {
        term.note(format_args!("{path}: {}", plain(&words(&repair.text))));
    }
    for oddity in &report.oddities {
        term.note(format_args!("{path}: odd: {}", plain(&words(&oddity.text))));
    }
    if report.fps.basis == Basis::Assumed {
        term.note(format_args!(
            "{path}: read at {} frames per second: {}",
            report.fps.value, report.fps.evidence
        ));
    }
}

/// The animation that a path names behind `#`, or an option.
pub(super) fn animation_of(path: &Path, options: &Options) -> Option<String> {
    split_animation(path).1.or_else(|| options.animation.clone())
}

/// Splits `horse.glb#Walk` into a file and the name of an animation in it, unless a file of the
/// whole name exists.
fn split_animation(path: &Path) -> (PathBuf, Option<String>) {
    let whole = path.to_string_lossy();
    match whole.rsplit_once('#') {
        Some((file, animation)) if !path.exists() => (file.into(), Some(animation.to_owned())),
        _ => (path.to_owned(), None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_may_name_an_animation() {
        let split = |path: &str| {
            let (path, animation) = split_animation(Path::new(path));
            (path.to_str().unwrap().to_owned(), animation)
        };
        assert_eq!(
            split("a/horse.glb#Walk"),
            ("a/horse.glb".into(), Some("Walk".into()))
        );
        assert_eq!(split("a/horse.glb"), ("a/horse.glb".into(), None));
        let odd = std::env::temp_dir().join(format!("troupe-{}#1.bvh", std::process::id()));
        std::fs::write(&odd, "").unwrap();
        assert_eq!(
            split_animation(&odd),
            (odd.clone(), None),
            "a file of that name is there"
        );
        std::fs::remove_file(odd).unwrap();
    }

    #[test]
    fn control_characters_of_names_do_not_reach_a_terminal() {
        let kind = ReadErrorKind::NoAnimations("a\u{1b}[31m".to_owned());
        assert!(!Misread::from(kind).to_string().contains('\u{1b}'));
        let kind = ReadErrorKind::UnknownAnimation {
            wanted: "Walk".to_owned(),
            names: vec!["a\u{1b}[31m\nb".to_owned()],
        };
        let text = Misread::from(kind).to_string();
        assert!(text.ends_with("the file has a\\u{1b}[31m\\nb"), "{text}");
    }

    #[test]
    fn the_animation_of_a_path_comes_before_that_of_an_option() {
        let options = Options {
            animation: Some("Trot".to_owned()),
            ..Options::default()
        };
        let of = |path: &str, options: &Options| animation_of(Path::new(path), options);
        assert_eq!(of("no/fox.glb#Walk", &options).as_deref(), Some("Walk"));
        assert_eq!(of("no/fox.glb", &options).as_deref(), Some("Trot"));
        assert_eq!(of("no/fox.glb", &Options::default()), None);
    }
}
