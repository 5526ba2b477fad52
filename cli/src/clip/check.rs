//! `troupe clip check`.

use std::path::{Path, PathBuf};

use clap::Args;
use comfy_table::Table;
use serde::Serialize;
use troupe_motion::read::{self, Agreement, Options, ReadErrorKind, Report, Understood};

use super::onto::Onto;
use crate::context::Context;
use crate::failure::Failure;
use crate::output::{print, table, to_json};
use crate::term::plain;
use crate::understand::{Misread, SONIC_FILE, understand, with_source};

/// Rows of a report that have a column of the table.
const COLUMNS: [&str; 6] = ["format", "up axis", "unit", "rate", "rest pose", "frames"];

/// Check all files of motion in a folder and in those below it.
///
/// A file that leaves its up axis or unit open takes what the other files show. Each animation of a
/// file is checked, and formats that are not read are refused. A file is fine, repaired, odd or
/// refused. The exit code is 0 if all are fine or repaired, and 1 if any is odd or refused. Files
/// are read onto their own skeletons; a robot's files need --pack, --pack-folder or --urdf.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe clip check data/mocap
  troupe clip check data/g1 --pack-folder models/g1 --fps 50
  troupe clip check data/mocap --json > checked.json")]
pub(super) struct Check {
    /// Folder to check.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,

    /// Print JSON.
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    onto: Onto,
}

/// What came of a file. The last two fail the check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Verdict {
    Fine,
    Repaired,
    Odd,
    Refused,
}

impl Verdict {
    fn of(report: &Report) -> Self {
        match (report.oddities.is_empty(), report.repairs.is_empty()) {
            (false, _) => Self::Odd,
            (true, false) => Self::Repaired,
            (true, true) => Self::Fine,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Fine => "fine",
            Self::Repaired => "repaired",
            Self::Odd => "odd",
            Self::Refused => "refused",
        }
    }

    fn fails(self) -> bool {
        matches!(self, Self::Odd | Self::Refused)
    }
}

/// A file with its verdict, and either a report or an error.
#[derive(Debug, Serialize)]
struct Checked {
    /// Path within the folder, with # and the animation if the file has several.
    file: String,
    verdict: Verdict,
    #[serde(skip_serializing_if = "Option::is_none")]
    report: Option<Report>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

impl Checked {
    fn of(file: String, understood: Result<Understood, Misread>) -> Self {
        let (verdict, report, error) = match understood {
            Ok(understood) => (Verdict::of(&understood.report), Some(understood.report), None),
            Err(why) => (Verdict::Refused, None, Some(why.to_string())),
        };
        Self {
            file,
            verdict,
            report,
            error,
        }
    }
}

pub(super) async fn run(context: &Context, command: &Check) -> Result<(), Failure> {
    let files = files_in(&command.folder)?;
    if files.is_empty() {
        let mut endings: Vec<&str> = read::ENDINGS.into_iter().chain(read::ROBOT_ENDINGS).collect();
        endings.sort_unstable();
        endings.dedup();
        let endings = endings.join(", .");
        return Err(Failure::file(
            &command.folder,
            format_args!("no file of motion is in it: .{endings}"),
        ));
    }
    let mut options = command.onto.options(context).await?;
    options.agreement = Some(agreement(&files, &options));
    let bar = context.term.bar(files.len(), "reading files");
    let mut checked = Vec::with_capacity(files.len());
    for file in &files {
        checked.extend(check(&command.folder, file, &options));
        bar.inc(1);
    }
    bar.finish_and_clear();
    match command.json {
        true => print(&to_json(&checked)?)?,
        false => print(&table_of(&checked).to_string())?,
    }
    match checked.iter().filter(|checked| checked.verdict.fails()).count() {
        0 => Ok(()),
        failed => Err(Failure::Other(format!(
            "{}: odd or refused: {failed} of {}",
            command.folder.display(),
            checked.len()
        ))),
    }
}

/// What the files show together. Those that cannot be read show nothing.
fn agreement(files: &[PathBuf], options: &Options) -> Agreement {
    let mut agreement = Agreement::default();
    for file in files {
        if let Ok(bytes) = std::fs::read(file) {
            // Reading the file later gives the same error.
            let _ = with_source(file, &bytes, |source| {
                read::survey(source, options, &mut agreement)
            });
        }
    }
    agreement
}

/// Checks a file, or each of its animations if it has several.
fn check(folder: &Path, file: &Path, options: &Options) -> Vec<Checked> {
    let name = file.strip_prefix(folder).unwrap_or(file).display().to_string();
    match understand(file, options.clone(), None) {
        Err(Misread::Kind(ReadErrorKind::SeveralAnimations(animations))) => {
            let one = |animation: String| {
                let name = format!("{name}#{animation}");
                let options = Options {
                    animation: Some(animation),
                    ..options.clone()
                };
                Checked::of(name, understand(file, options, None))
            };
            animations.into_iter().map(one).collect()
        }
        understood => vec![Checked::of(name, understood)],
    }
}

/// The files that may hold motion, sorted. Links to folders are not followed.
fn files_in(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        let failed = |e| Failure::file(&folder, e);
        let mut here = Vec::new();
        for entry in std::fs::read_dir(&folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            match entry.file_type().map_err(failed)?.is_dir() {
                true => folders.push(entry.path()),
                false => here.push(entry.path()),
            }
        }
        let is_sonic = here.iter().any(|path| path.ends_with(SONIC_FILE));
        here.retain(|path| match ending(path) {
            Some("csv") if is_sonic => path.ends_with(SONIC_FILE),
            ending => ending.is_some(),
        });
        files.append(&mut here);
    }
    files.sort();
    Ok(files)
}

/// The ending of a file of motion, read or not, in small letters.
fn ending(path: &Path) -> Option<&'static str> {
    let ending = path.extension()?.to_str()?;
    let known = read::ENDINGS.into_iter().chain(read::ROBOT_ENDINGS);
    let mut known = known.chain(read::UNREAD_ENDINGS);
    known.find(|known| known.eq_ignore_ascii_case(ending))
}

fn table_of(checked: &[Checked]) -> Table {
    let mut table = table();
    let header = ["file", "verdict"].into_iter().chain(COLUMNS).chain(["notes"]);
    table.set_header(header);
    for Checked {
        file,
        verdict,
        report,
        error,
    } in checked
    {
        let mut row = vec![file.clone(), verdict.name().to_owned()];
        let rows = report.as_ref().map(Report::rows).unwrap_or_default();
        let value = |what: &str| {
            let found = rows.iter().find(|row| row[0] == what);
            found.map_or_else(String::new, |row| row[1].clone())
        };
        row.extend(COLUMNS.map(value));
        let notes = report.iter().flat_map(|report| &report.oddities);
        let notes = notes.chain(report.iter().flat_map(|report| &report.repairs));
        let notes = notes.map(|note| &*note.text).chain(error.as_deref());
        let notes: Vec<String> = notes.map(plain).collect();
        row.push(notes.join("\n"));
        table.add_row(row);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sonic_motion_is_one_file() {
        let folder = std::env::temp_dir().join(format!("troupe-check-{}", std::process::id()));
        for (path, name) in [
            ("walk", "joint_pos.csv"),
            ("walk", "body_pos.csv"),
            ("", "dance.CSV"),
            ("", "wave.bvh"),
            ("", "notes.txt"),
            ("", "marks.c3d"),
        ] {
            std::fs::create_dir_all(folder.join(path)).unwrap();
            std::fs::write(folder.join(path).join(name), "").unwrap();
        }
        let files = files_in(&folder).unwrap();
        let names: Vec<_> = files
            .iter()
            .map(|file| file.strip_prefix(&folder).unwrap())
            .collect();
        assert_eq!(
            names,
            ["dance.CSV", "marks.c3d", "walk/joint_pos.csv", "wave.bvh"].map(Path::new)
        );
        std::fs::remove_dir_all(folder).unwrap();
    }
}
