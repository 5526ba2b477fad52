//! Folders of documents, such as the styles and objects that users add.

use std::ffi::OsStr;
use std::io::{self, Write as _};
use std::path::{Path as FilePath, PathBuf};

use super::read::unreadable;
use super::{Document, DocumentError, Format, read_file};
use crate::FieldError;

/// Reads every `*.toml` and `*.json` file of `folder`, runs `check` on each, and returns the
/// results sorted by name. A folder that does not exist counts as empty.
///
/// # Errors
/// [`DocumentError`] for the first file that cannot be used, or that has the same name inside as
/// another.
pub fn read_folder<D: Document, T>(
    folder: &FilePath,
    check: impl Fn(D) -> Result<T, FieldError>,
    name_of: impl Fn(&T) -> &str,
) -> Result<Vec<T>, DocumentError> {
    let read = read_each(folder, check, name_of, |_, _| Ok(()), Err)?;
    Ok(read.into_iter().map(|(_, one)| one).collect())
}

/// As [`read_folder`], for a folder that [`keep`] writes, whose files are named after the document
/// inside. A file that cannot be used, or that has another name, is skipped with a warning: a
/// broken upload must not keep the server from starting.
///
/// # Errors
/// [`DocumentError`] if the folder cannot be read.
pub fn read_kept<D: Document, T>(
    folder: &FilePath,
    check: impl Fn(D) -> Result<T, FieldError>,
    name_of: impl Fn(&T) -> &str,
) -> Result<Vec<T>, DocumentError> {
    let left_out = |error: DocumentError| {
        tracing::warn!(%error, "skipped a file that cannot be used");
        Ok(())
    };
    let named_for_it = |file: &FilePath, name: &str| match file.file_stem() == Some(OsStr::new(name)) {
        true => Ok(()),
        false => Err(misnamed::<D>(name).in_file(file)),
    };
    let read = read_each(folder, check, &name_of, named_for_it, left_out)?;
    Ok(read.into_iter().map(|(_, one)| one).collect())
}

fn misnamed<D: Document>(name: &str) -> DocumentError {
    DocumentError {
        field: "name".to_owned(),
        ..DocumentError::whole::<D>(
            format!(
                "is {name:?}, but the name of a file in this folder must be its {}",
                D::WHAT
            ),
            "the file's name",
        )
    }
}

/// The documents of a folder, sorted by name. `fits` checks a file's path against the name inside.
/// `on_bad` decides whether a file that cannot be used is skipped.
fn read_each<D: Document, T>(
    folder: &FilePath,
    check: impl Fn(D) -> Result<T, FieldError>,
    name_of: impl Fn(&T) -> &str,
    fits: impl Fn(&FilePath, &str) -> Result<(), DocumentError>,
    mut on_bad: impl FnMut(DocumentError) -> Result<(), DocumentError>,
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
        let one = match read_file(&file, &check) {
            Ok(one) => one,
            Err(error) => {
                on_bad(error)?;
                continue;
            }
        };
        let name = name_of(&one);
        if let Err(error) = fits(&file, name) {
            on_bad(error)?;
            continue;
        }
        if all.iter().any(|(_, before)| name_of(before) == name) {
            let error = DocumentError {
                field: "name".to_owned(),
                ..DocumentError::whole::<D>(
                    format!("is {name:?}, the same as the {} of another file", D::WHAT),
                    "a different name in each file",
                )
            };
            on_bad(error.in_file(&file))?;
            continue;
        }
        all.push((file, one));
    }
    all.sort_by(|(_, a), (_, b)| name_of(a).cmp(name_of(b)));
    Ok(all)
}

/// Writes a document to `folder` as the file of `name`, and replaces the file that was there.
/// Creates the folder if needed. Readers see the old file or the new one, never a part of one.
///
/// # Errors
/// Those of the file system.
pub fn keep(folder: &FilePath, name: &str, format: Format, text: &str) -> io::Result<()> {
    write_whole(folder, &file_of(folder, name, format), text)?;
    match format {
        Format::Toml => remove(&file_of(folder, name, Format::Json)),
        Format::Json => remove(&file_of(folder, name, Format::Toml)),
    }
}

/// Writes `file` in `folder` completely or not at all, and flushes it to the disk, so that it
/// survives a power cut. Removes what is left of a write that failed.
///
/// # Errors
/// Those of the file system.
pub fn write_whole(folder: &FilePath, file: &FilePath, text: &str) -> io::Result<()> {
    std::fs::create_dir_all(folder)?;
    // With an ending that is not read, so that a leftover does not count as a document.
    let mut unfinished = file.as_os_str().to_owned();
    unfinished.push(".part");
    let unfinished = PathBuf::from(unfinished);
    let written = write_synced(&unfinished, text).and_then(|()| std::fs::rename(&unfinished, file));
    if written.is_err() {
        // The reason of the failed write matters more than a leftover file.
        let _ = std::fs::remove_file(&unfinished);
        return written;
    }
    sync_folder(folder)
}

fn write_synced(file: &FilePath, text: &str) -> io::Result<()> {
    let mut file = std::fs::File::create(file)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()
}

/// Flushes the names in a folder to the disk, on systems that support this.
fn sync_folder(folder: &FilePath) -> io::Result<()> {
    match cfg!(unix) {
        true => std::fs::File::open(folder)?.sync_all(),
        false => Ok(()),
    }
}

/// Whether a write failed because the disk is full.
pub fn is_full(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded
    )
}

/// Removes the file of `name`, if it exists.
///
/// # Errors
/// Those of the file system.
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
    fn a_document_that_was_written_is_read_until_it_is_removed() {
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
    fn a_broken_file_or_one_with_another_name_is_skipped() {
        let folder = TempFolder::new("misnamed-documents");
        keep(folder.path(), "a", Format::Toml, "name = \"b\"").unwrap();
        keep(folder.path(), "b", Format::Toml, "nonsense").unwrap();
        keep(folder.path(), "c", Format::Toml, "name = \"c\"").unwrap();
        assert_eq!(read(&folder).unwrap(), ["c"]);
        let error = misnamed::<Note>("b").to_string();
        let wanted = "name: is \"b\", but the name of a file in this folder must be its note; allowed: the file's name";
        assert!(error.ends_with(wanted), "{error}");
    }

    #[test]
    fn a_failed_write_leaves_no_file() {
        let folder = TempFolder::new("unwritten-documents");
        // A folder takes the place of the file.
        std::fs::create_dir_all(folder.path().join("a.toml/inside")).unwrap();
        assert!(keep(folder.path(), "a", Format::Toml, "name = \"a\"").is_err());
        let names: Vec<_> = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        assert_eq!(names, ["a.toml"]);
    }
}
