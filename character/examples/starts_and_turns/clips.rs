//! The clips that live characters are compared with.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, ensure};
use troupe_motion::Skeleton;
use troupe_motion::bvh::{self, BvhOptions};
use troupe_motion::clip::Clip;

/// The BVH files of a folder, by file name without its ending.
pub struct Clips {
    folder: PathBuf,
    names: Vec<String>,
    skeleton: Arc<Skeleton>,
}

impl Clips {
    /// The names in `lists`, one a line. Without lists: every clip of the folder.
    pub fn list(folder: &Path, lists: &[PathBuf], skeleton: Arc<Skeleton>) -> anyhow::Result<Self> {
        let mut names = BTreeSet::new();
        for list in lists {
            let text = std::fs::read_to_string(list).with_context(|| list.display().to_string())?;
            let lines = text
                .lines()
                .map(|line| line.split('#').next().unwrap_or_default().trim());
            names.extend(
                lines
                    .filter(|line| !line.is_empty())
                    .map(|line| line.trim_end_matches(".bvh").to_owned()),
            );
        }
        if lists.is_empty() {
            for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
                let name = entry?.file_name().to_string_lossy().into_owned();
                names.extend(name.strip_suffix(".bvh").map(str::to_owned));
            }
        }
        ensure!(!names.is_empty(), "{} has no clips", folder.display());
        Ok(Self {
            folder: folder.to_owned(),
            names: names.into_iter().collect(),
            skeleton,
        })
    }

    /// Reads the clips whose name `takes`; a listed clip without a file is skipped.
    pub fn read(
        &self,
        takes: impl Fn(&str) -> bool,
    ) -> impl Iterator<Item = anyhow::Result<(&str, Clip)>> + '_ {
        let wanted: Vec<&String> = self.names.iter().filter(|name| takes(name)).collect();
        wanted.into_iter().filter_map(|name| {
            let path = self.folder.join(name).with_extension("bvh");
            path.exists().then(|| {
                Ok((
                    name.as_str(),
                    self.read_one(&path).with_context(|| path.display().to_string())?,
                ))
            })
        })
    }

    fn read_one(&self, path: &Path) -> anyhow::Result<Clip> {
        let file = bvh::parse_bytes(&std::fs::read(path)?)?;
        Ok(file.to_clip_on(&self.skeleton, &BvhOptions::default())?)
    }
}
