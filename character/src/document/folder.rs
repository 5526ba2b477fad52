//! Folders of documents.

use std::ffi::OsStr;
use std::io;
use std::path::{Path as FilePath, PathBuf};

use super::read::unreadable;
use super::{Document, DocumentError, Format, read_file};
use crate::FieldError;

/// Reads every `*.toml` and `*.json` of `folder` and makes of each what `check` does; sorted by name. A folder that is not
/// there has none.
///
/// # Errors
/// [`DocumentError`] for the first file that cannot be used, or has the name of another.
pub fn read_folder<D: Document, T>(
    folder: &FilePath,
    check: impl Fn(D) -> Result<T, FieldError>,
    name_of: impl Fn(&T) -> &str,
) -> Result<Vec<T>, DocumentError> {
    let read = read_each(folder, check, name_of)?;
    Ok(read.into_iter().map(|(_, one)| one).collect())
}

/// As [`read_folder`], for a folder of [`keep`]: each file is named for what is in it.
///
/// # Errors
/// [`DocumentError`] for the first file that cannot be used, or is named for something else.
pub fn read_kept<D: Document, T>(
    folder: &FilePath,
    check: impl Fn(D) -> Result<T, FieldError>,
    name_of: impl Fn(&T) -> &str,
) -> Result<Vec<T>, DocumentError> {
    let read = read_each(folder, check, &name_of)?;
    let misnamed = |(file, one): &&(PathBuf, T)| file.file_stem() != Some(OsStr::new(name_of(one)));
    if let Some((file, one)) = read.iter().find(misnamed) {
        let error = DocumentError {
            field: "name".to_owned(),
            ..DocumentError::whole::<D>(
                format!(
                    "is {:?}, but a file in this folder is named for its {}",
                    name_of(one),
                    D::WHAT
                ),
                "the file's name",
            )
        };
        return Err(error.in_file(file));
    }
    Ok(read.into_iter().map(|(_, one)| one).collect())
}

/// What is in the files of a folder, sorted by name.
fn read_each<D: Document, T>(
    folder: &FilePath,
    check: impl Fn(D) -> Result<T, FieldError>,
    name_of: impl Fn(&T) -> &str,
) -> Result<Vec<(PathBuf, T)>, DocumentError> {
    let unreadable = |cause| unreadable::<D>(cause).in_file(folder);
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(cause) if cause.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(cause) => return Err(unreadable(cause)),
    };
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(unreadable)?.path();
        if Format::of_file(&path).is_some() {
            files.push(path);
        }
    }
    files.sort();
    let mut all: Vec<(PathBuf, T)> = Vec::with_capacity(files.len());
    for file in files {
        let one = read_file(&file, &check)?;
        let name = name_of(&one);
        if all.iter().any(|(_, before)| name_of(before) == name) {
            let error = DocumentError {
                field: "name".to_owned(),
                ..DocumentError::whole::<D>(
                    format!("is {name:?}, which another file's {} has", D::WHAT),
                    "a name of its own for each",
                )
            };
            return Err(error.in_file(&file));
        }
        all.push((file, one));
    }
    all.sort_by(|(_, a), (_, b)| name_of(a).cmp(name_of(b)));
    Ok(all)
}

/// Writes a text into `folder`, which is made where it is not there, as the file of what is named `name`, in the place of the
/// one that was there. Readers see the old file or the new one, never a part of one.
///
/// # Errors
/// That of the file system.
pub fn keep(folder: &FilePath, name: &str, format: Format, text: &str) -> io::Result<()> {
    std::fs::create_dir_all(folder)?;
    // Not of an ending that is read, so that a file that is left behind is not taken for one.
    let unfinished = folder.join(format!("{name}.{}.part", format.ending()));
    std::fs::write(&unfinished, text)?;
    std::fs::rename(&unfinished, file_of(folder, name, format))?;
    match format {
        Format::Toml => remove(&file_of(folder, name, Format::Json)),
        Format::Json => remove(&file_of(folder, name, Format::Toml)),
    }
}

/// Removes the file of what is named `name`, where there is one.
///
/// # Errors
/// That of the file system.
pub fn forget(folder: &FilePath, name: &str) -> io::Result<()> {
    remove(&file_of(folder, name, Format::Toml))?;
    remove(&file_of(folder, name, Format::Json))
}

fn file_of(folder: &FilePath, name: &str, format: Format) -> PathBuf {
    folder.join(format!("{name}.{}", format.ending()))
}

fn remove(file: &FilePath) -> io::Result<()> {
    match std::fs::remove_file(file) {
        Err(cause) if cause.kind() != io::ErrorKind::NotFound => Err(cause),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::testing::TempFolder;

    #[derive(serde::Deserialize)]
    struct Note {
        name: String,
    }

    impl Document for Note {
        const WHAT: &'static str = "note";
        const MAX_BYTES: usize = 100;
    }

    fn read(folder: &TempFolder) -> Result<Vec<String>, String> {
        let names = read_kept(folder.path(), |note: Note| Ok(note.name), |name| name);
        names.map_err(|error| error.to_string())
    }

    #[test]
    fn what_is_kept_is_read_again_until_it_is_forgotten() {
        let folder = TempFolder::new("kept-documents");
        let inside = folder.path().join("not/yet/there");
        keep(&inside, "a", Format::Toml, "name = \"a\"").unwrap();
        for (name, format, text) in [
            ("b", Format::Toml, "name = \"b\""),
            ("a", Format::Json, "{\"name\": \"a\"}"),
            ("b", Format::Json, "{\"name\": \"b\"}"),
            ("b", Format::Toml, "name = \"b\" # again"),
        ] {
            keep(folder.path(), name, format, text).unwrap();
        }
        assert_eq!(read(&folder).unwrap(), ["a", "b"], "one file for each");
        assert!(folder.path().join("b.toml").is_file() && folder.path().join("a.json").is_file());
        forget(folder.path(), "a").unwrap();
        forget(folder.path(), "never-was").unwrap();
        assert_eq!(read(&folder).unwrap(), ["b"]);
    }

    #[test]
    fn files_are_named_for_what_is_in_them() {
        let folder = TempFolder::new("misnamed-documents");
        keep(folder.path(), "a", Format::Toml, "name = \"b\"").unwrap();
        let error = read(&folder).unwrap_err();
        let wanted = "a.toml: name: is \"b\", but a file in this folder is named for its note; allowed: the file's name";
        assert!(error.ends_with(wanted), "{error}");
    }
}
