//! Styles as files: the JSON form of the message `Style`, in a file with the style's name.

use std::ffi::OsStr;
use std::path::{Path as FilePath, PathBuf};

use troupe_proto::v1;

use super::Style;
use crate::document::write_whole;
use crate::{FieldError, Path};
use troupe_motion::model::Rig;

/// Ending of style files.
const EXTENSION: &str = "json";

/// A style file or folder that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("style {}: {problem}", path.display())]
pub struct StyleError {
    /// The file or folder at fault.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: StyleProblem,
}

/// What is wrong with a style file.
#[derive(Debug, thiserror::Error)]
pub enum StyleProblem {
    /// The file system's error.
    #[error("cannot be read: {0}")]
    Read(std::io::Error),
    /// It is not JSON, or not a style. The cause names line and column.
    #[error("{}{cause}", place(field))]
    Parse {
        /// The value's place in the file; `.` for the whole document.
        field: String,
        /// The parser's error.
        cause: serde_json::Error,
    },
    /// A value that is not accepted.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The style's name differs from the file's.
    #[error("name is {0:?}, but the file has another name")]
    Name(String),
    /// An added style has the name of one of the pack's own.
    #[error("the pack has a style of this name; choose another name")]
    BuiltIn,
    /// More added styles than a pack may have.
    #[error("more than {0} added styles")]
    TooMany(usize),
}

fn place(field: &str) -> String {
    if field == "." {
        String::new()
    } else {
        format!("{field}: ")
    }
}

/// Loads every `*.json` file of `folder`, sorted by name. A folder that does not exist counts as
/// empty. A style that a user added and that cannot be used is skipped with a warning: it must not
/// keep the server from starting.
///
/// # Errors
/// [`StyleError`] for the first file that is not a style of the pack, with the file and the line or
/// field.
pub fn load_folder(folder: &FilePath, rig: &Rig, built_in: bool) -> Result<Vec<Style>, StyleError> {
    let unreadable = |cause| StyleError {
        path: folder.to_owned(),
        problem: StyleProblem::Read(cause),
    };
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(cause) => return Err(unreadable(cause)),
    };
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(unreadable)?.path();
        if path.extension() == Some(OsStr::new(EXTENSION)) {
            files.push(path);
        }
    }
    let mut styles = Vec::with_capacity(files.len());
    for path in files {
        match load_file(&path, rig, built_in).map_err(|problem| StyleError { path, problem }) {
            Ok(style) => styles.push(style),
            Err(error) if built_in => return Err(error),
            Err(error) => tracing::warn!(%error, "skipped a style that cannot be used"),
        }
    }
    styles.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(styles)
}

fn load_file(file: &FilePath, rig: &Rig, built_in: bool) -> Result<Style, StyleProblem> {
    let text = std::fs::read_to_string(file).map_err(StyleProblem::Read)?;
    let style = parse(&text, rig, built_in)?;
    if file.file_stem() == Some(OsStr::new(&style.name)) {
        Ok(style)
    } else {
        Err(StyleProblem::Name(style.name))
    }
}

/// Reads a style from its JSON form.
fn parse(text: &str, rig: &Rig, built_in: bool) -> Result<Style, StyleProblem> {
    let mut reader = serde_json::Deserializer::from_str(text);
    let parse = |field: String, cause| StyleProblem::Parse { field, cause };
    let style: v1::Style = serde_path_to_error::deserialize(&mut reader)
        .map_err(|error| parse(error.path().to_string(), error.into_inner()))?;
    reader.end().map_err(|cause| parse(".".to_owned(), cause))?;
    Ok(Style::from_proto(&Path::root(), &style, rig, built_in)?)
}

/// Writes a style into `folder`, which is created if needed. Readers see the old file or the new
/// one, never a part of one.
pub(super) fn write_file(folder: &FilePath, style: &Style) -> std::io::Result<()> {
    let text = serde_json::to_string(&style.to_proto())?;
    write_whole(folder, &folder.join(format!("{}.{EXTENSION}", style.name)), &text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::testing::{TempFolder, walker_rig, walker_style};

    #[test]
    fn a_style_is_unchanged_by_writing_and_loading() {
        let folder = TempFolder::new("style-files");
        let styles = folder.path().join("not/yet/there");
        let mut brisk = walker_style();
        brisk.name = "brisk".to_owned();
        brisk.built_in = true;
        write_file(&styles, &brisk).unwrap();
        let mut style = walker_style();
        style.built_in = true;
        write_file(&styles, &style).unwrap();
        std::fs::write(styles.join("notes.txt"), "no style").unwrap();

        let loaded = load_folder(&styles, &walker_rig(), true).unwrap();
        let names: Vec<_> = loaded.iter().map(|style| style.name.as_str()).collect();
        assert_eq!(names, ["brisk", "walker"], "sorted, and only the styles");
        for (a, b) in loaded[1].gaits.iter().zip(&style.gaits) {
            assert_eq!(
                (&a.name, a.forward_mps, a.keys.len()),
                (&b.name, b.forward_mps, b.keys.len())
            );
            for (a, b) in a.keys.iter().zip(&b.keys) {
                assert!(
                    a.rotations
                        .iter()
                        .zip(&b.rotations)
                        .all(|(a, b)| a.abs_diff_eq(*b, 1e-6))
                );
            }
        }
    }

    #[test]
    fn every_style_of_the_default_pack_loads() {
        let folder = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../models/human");
        let rig = troupe_engine::pack::Pack::load(&folder).unwrap().rig;
        let styles = load_folder(&folder.join("styles"), &rig, true).unwrap();
        let names: Vec<_> = styles.iter().map(|style| style.name.as_str()).collect();
        for name in ["idle", "normal", "run", "walk"] {
            assert!(names.contains(&name), "{name} is not among {names:?}");
        }
        for style in &styles {
            assert!(style.is_static || style.default_speed_mps > 0.2, "{}", style.name);
            let cycles = style.cycles(&rig.skeleton);
            for (gait, cycle) in style.gaits.iter().zip(&cycles.gaits) {
                let sway = cycle.moment(gait, 0.3).sway;
                assert!(sway.abs() < 0.5, "{} {}: {sway}", style.name, gait.name);
            }
            assert!(
                style.is_static || cycles.steps.is_some(),
                "{} lifts no foot",
                style.name
            );
        }
    }

    #[test]
    fn a_missing_folder_has_no_styles() {
        let none = load_folder(FilePath::new("no/such/folder"), &walker_rig(), true).unwrap();
        assert!(none.is_empty());
    }

    #[test]
    fn errors_name_file_and_place() {
        let folder = TempFolder::new("style-errors");
        let good = serde_json::to_string_pretty(&walker_style().to_proto()).unwrap();
        for (file, text, want) in [
            ("walker.json", "{\n  oops\n}".to_owned(), "line 2 column 3"),
            ("walker.json", format!("{good} {{}}"), "trailing characters"),
            (
                "walker.json",
                good.replacen("\"forward\": 1.2", "\"forward\": \"fast\"", 1),
                "gaits[1].forward: invalid value: string \"fast\", expected a number at line",
            ),
            (
                "walker.json",
                good.replacen("\"forward\": 1.2", "\"forwards\": 1.2", 1),
                "gaits[1].forwards: unknown field `forwards`",
            ),
            (
                "walker.json",
                good.replacen("\"forward\": 1.2", "\"forward\": 12.0", 1),
                "gaits[1].forward: is 12; allowed: -10 to 10",
            ),
            (
                "stroller.json",
                good.clone(),
                "name is \"walker\", but the file has another name",
            ),
        ] {
            let path = folder.path().join(file);
            std::fs::write(&path, text).unwrap();
            let error = load_folder(folder.path(), &walker_rig(), true)
                .unwrap_err()
                .to_string();
            std::fs::remove_file(&path).unwrap();
            assert!(
                error.contains(file) && error.contains(want),
                "{error}\nwant {want}"
            );
        }
    }
}
