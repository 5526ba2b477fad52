//! The clips to measure on, in any format that `troupe` reads.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;
use troupe_cli::{Failure, Reading, Term, clip_in, read_clip, read_clip_on};
use troupe_client::Pack;
use troupe_motion::Skeleton;
use troupe_motion::clip::Clip;
use troupe_motion::files::Format;

/// A clip by its file's stem.
pub(crate) struct NamedClip {
    pub(crate) name: String,
    pub(crate) clip: Clip,
}

/// A clip that could not be used.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Skipped {
    pub(crate) clip: String,
    pub(crate) reason: String,
}

/// Formats of the clips of a folder. A lone `.npy` is often something else.
const FORMATS: [Format; 4] = [Format::Bvh, Format::Csv, Format::Glb, Format::Npz];

/// Endings of the files that can be read, for messages.
pub(crate) fn endings() -> String {
    FORMATS.map(|format| format!(".{}", format.ending())).join(" or ")
}

/// A file's name without its ending, if that is the ending of a clip.
fn stem(name: &str) -> Option<&str> {
    let strip = |format: &Format| name.strip_suffix(format.ending())?.strip_suffix('.');
    FORMATS.iter().find_map(strip)
}

/// Reads the clip of a name from a folder, in whatever format it is there.
pub(crate) fn read_named(data: &Path, name: &str, pack: &Pack, reading: &Reading) -> Result<Clip, Failure> {
    read_clip(&clip_in(data, name, pack), pack, reading, &Term::new(true))
}

/// Names of the clips to use, sorted: those of the split file, or every clip of the folder.
pub(crate) fn clip_names(data: &Path, split: Option<&Path>) -> Result<Vec<String>, Failure> {
    let names: BTreeSet<String> = match split {
        Some(split) => std::fs::read_to_string(split)
            .map_err(|e| Failure::file(split, e))?
            .lines()
            .map(|line| line.split('#').next().unwrap_or_default().trim())
            .filter(|line| !line.is_empty())
            .map(|line| stem(line).unwrap_or(line).to_owned())
            .collect(),
        None => std::fs::read_dir(data)
            .map_err(|e| Failure::file(data, e))?
            .filter_map(|entry| Some(stem(entry.ok()?.file_name().to_str()?)?.to_owned()))
            .collect(),
    };
    Ok(names.into_iter().collect())
}

/// Reads clips by name onto the pack's skeleton. A clip that cannot be used comes back with the
/// reason.
pub(crate) fn read_clips(
    data: &Path,
    names: &[String],
    pack: &Pack,
    reading: &Reading,
    term: &Term,
) -> (Vec<NamedClip>, Vec<Skipped>) {
    let bar = term.bar(names.len(), "reading clips");
    let (mut clips, mut skipped) = (Vec::new(), Vec::new());
    for name in names {
        match read_named(data, name, pack, reading) {
            Ok(clip) => clips.push(NamedClip {
                name: name.clone(),
                clip,
            }),
            Err(why) => {
                let why = why.to_string();
                // The message begins with the path, which has the name again.
                let reason = why
                    .strip_prefix(&data.join(name).display().to_string())
                    .and_then(|rest| rest.split_once(": "))
                    .map_or(&*why, |(_, reason)| reason)
                    .to_owned();
                skipped.push(Skipped {
                    clip: name.clone(),
                    reason,
                });
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    (clips, skipped)
}

/// Takes out the clips that have fewer frames than the shortest window.
pub(crate) fn drop_short(clips: &mut Vec<NamedClip>, least_frames: usize) -> Vec<Skipped> {
    let short = clips.extract_if(.., |named| named.clip.frames() < least_frames);
    short
        .map(|named| Skipped {
            reason: format!(
                "{} frames, fewer than the {least_frames} of the shortest window",
                named.clip.frames()
            ),
            clip: named.name,
        })
        .collect()
}

/// BVH files of a folder, read one by one onto a skeleton and at their own rate.
pub(crate) struct BvhFolder {
    folder: PathBuf,
    names: Vec<String>,
    skeleton: Arc<Skeleton>,
}

impl BvhFolder {
    /// Those that the split names, or all.
    ///
    /// # Errors
    /// [`Failure::Input`] if the split or the folder cannot be read, or has no clips.
    pub(crate) fn list(
        folder: &Path,
        split: Option<&Path>,
        skeleton: Arc<Skeleton>,
    ) -> Result<Self, Failure> {
        let names = clip_names(folder, split)?;
        if names.is_empty() {
            return Err(Failure::file(folder, "it has no clips"));
        }
        Ok(Self {
            folder: folder.to_owned(),
            names,
            skeleton,
        })
    }

    /// Reads those whose name `takes`. A name without a BVH file is left out.
    pub(crate) fn read(
        &self,
        takes: impl Fn(&str) -> bool,
    ) -> impl Iterator<Item = Result<(&str, Clip), Failure>> {
        let wanted: Vec<&String> = self.names.iter().filter(|name| takes(name)).collect();
        wanted.into_iter().filter_map(|name| {
            let path = self.folder.join(format!("{name}.bvh"));
            path.exists().then(|| Ok((name.as_str(), self.read_one(&path)?)))
        })
    }

    fn read_one(&self, path: &Path) -> Result<Clip, Failure> {
        read_clip_on(path, &self.skeleton, &Reading::default(), None).map_err(|why| Failure::file(path, why))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_split_file_may_have_comments_endings_and_repeats() {
        let folder = std::env::temp_dir().join(format!("troupe-split-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let split = folder.join("split.txt");
        std::fs::write(&split, "# held out\nwalk_2.bvh\r\n\nwalk_1  # good\nwalk_2\n").unwrap();
        let names = clip_names(&folder, Some(&split)).unwrap();
        std::fs::write(folder.join("b.bvh"), "").unwrap();
        std::fs::write(folder.join("a.glb"), "").unwrap();
        let all = clip_names(&folder, None).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(names, ["walk_1", "walk_2"]);
        assert_eq!(all, ["a", "b"], "the split is no clip");
        assert!(matches!(clip_names(&folder, None), Err(Failure::Input(_))));
    }
}
