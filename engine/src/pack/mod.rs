//! Model packs: a folder with `pack.toml` and an ONNX file for each network.
//!
//! Loading checks the manifest and the files' content hash; [`crate::onnx`] checks every tensor of
//! every stage. So a wrong pack fails when the server starts, with an error that names the cause.

mod bodies;
mod error;
mod facts;
mod family;
mod lexicon;
mod manifest;
pub(crate) mod sonic_planner;
#[cfg(feature = "testing")]
pub mod testing;
mod unimogen;
pub(crate) mod vermo;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest as _, Sha256};
use troupe_motion::feasibility::Limits;
use troupe_motion::model::{Body, Rig};

pub use error::{PackError, PackProblem};
pub use facts::{Language, SamplerSteps, TaskRefusal};
pub(crate) use family::Family;
pub use lexicon::Lexicon;
pub use manifest::Manifest;
pub use sonic_planner::PLANNER_FILE;
pub(crate) use unimogen::UniMoGenDoc;
pub use unimogen::{DENOISER_FILE, RATE};
pub use vermo::{
    DECODER_FILE, ENCODER_FILE, FLOW_FILE, LANGUAGE_FILE, MAX_FLOW_STEPS, MAX_REPETITION, MAX_TEMPERATURE,
    MessageTask,
};
pub(crate) use vermo::{FRAMES_PER_TOKEN, VerMoDoc};

/// Name of the manifest inside a pack folder.
pub const MANIFEST_FILE: &str = "pack.toml";

/// The three networks of a MotionBricks pack, in the order in which they run. The content hash
/// reads their files in the same order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// From constraints to the token count and the root trajectory.
    Root,
    /// From root and poses to the logits of the pose tokens.
    Pose,
    /// From tokens, root and poses to frames.
    Decoder,
}

impl Stage {
    /// All stages, in running order.
    pub const ALL: [Self; 3] = [Self::Root, Self::Pose, Self::Decoder];

    /// The stage's name in metrics, and the stem of its file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Root => "root",
            Self::Pose => "pose",
            Self::Decoder => "decoder",
        }
    }

    /// The stage's file inside a pack folder.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::Root => "root.onnx",
            Self::Pose => "pose.onnx",
            Self::Decoder => "decoder.onnx",
        }
    }
}

/// A checked pack, without its networks.
#[derive(Debug, Clone)]
pub struct Pack {
    /// The manifest as its author wrote it.
    pub manifest: Manifest,
    /// The skeleton of its motion; for a pack with several bodies, the default body's.
    pub rig: Arc<Rig>,
    /// The bodies that the networks move; empty for a family with one skeleton.
    pub bodies: Vec<Arc<Body>>,
    /// The words that the network knows, in the order of its inputs; empty for a family without
    /// words.
    pub words: Vec<String>,
    /// The text that the pack understands; none for a pack that takes no text.
    pub(crate) lexicon: Option<Arc<Lexicon>>,
    /// The folder of the ONNX files.
    pub folder: PathBuf,
}

impl Pack {
    /// Loads and checks the pack in `folder`: manifest, limits, skeleton, and the hash of the ONNX
    /// files.
    ///
    /// # Errors
    /// [`PackError`], which names the folder and the problem.
    pub fn load(folder: &Path) -> Result<Self, PackError> {
        Self::try_load(folder).map_err(|problem| PackError {
            folder: folder.to_owned(),
            problem,
        })
    }

    fn try_load(folder: &Path) -> Result<Self, PackProblem> {
        let mut pack =
            Self::from_manifest(Manifest::parse(&read_text(&folder.join(MANIFEST_FILE))?)?, folder)?;
        let found = content_hash(folder, &pack.files())?;
        let expected = &pack.manifest.content_hash;
        if !expected.eq_ignore_ascii_case(&found) {
            return Err(PackProblem::ContentHash {
                expected: expected.clone(),
                found,
            });
        }
        if let Some(table) = &pack.manifest.unimogen {
            let bodies = table.read_bodies(folder, pack.manifest.fps, &pack.rig.dims)?;
            pack.bodies = bodies.into_iter().map(Arc::new).collect();
        }
        if let Some(table) = &pack.manifest.sonic_planner {
            let body = table.read_body(folder, pack.manifest.fps, &pack.rig.dims)?;
            pack.bodies = vec![Arc::new(body)];
        }
        if let Some(table) = &pack.manifest.vermo {
            pack.lexicon = Some(Arc::new(Lexicon::load(folder, table)?));
        }
        Ok(pack)
    }

    /// A pack from an already parsed manifest. It does not look at the pack's files, so it has
    /// neither bodies nor a lexicon.
    ///
    /// # Errors
    /// [`PackProblem`] if the manifest contradicts itself.
    pub fn from_manifest(manifest: Manifest, folder: &Path) -> Result<Self, PackProblem> {
        let dims = manifest.check()?;
        let skeleton = manifest.skeleton.clone();
        let skeleton = match &manifest.robot {
            Some(robot) => skeleton.with_robot(robot)?,
            None => skeleton,
        };
        let mut rig = Rig::new(&manifest.name, manifest.fps, dims, skeleton);
        if let Some(limits) = &manifest.limits {
            rig.limits = Some(Arc::new(Limits::new(limits, &rig.skeleton)?));
        }
        Ok(Self {
            bodies: Vec::new(),
            lexicon: None,
            words: manifest.words().to_vec(),
            manifest,
            rig: Arc::new(rig),
            folder: folder.to_owned(),
        })
    }

    /// The files of the pack's networks, in the order in which the content hash reads them. Empty
    /// for a family that the engine does not run.
    pub fn files(&self) -> Vec<&'static str> {
        let manifest = &self.manifest;
        match manifest.family() {
            Some(Family::MotionBricks) => Stage::ALL.map(Stage::file_name).to_vec(),
            Some(Family::UniMoGen) => manifest
                .unimogen
                .as_ref()
                .map_or_else(Vec::new, UniMoGenDoc::files),
            Some(Family::SonicPlanner) => vec![PLANNER_FILE],
            Some(Family::VerMo) => {
                (manifest.vermo.as_ref()).map_or_else(Vec::new, |table| table.files().to_vec())
            }
            None => Vec::new(),
        }
    }

    /// The pack's name in requests.
    pub fn name(&self) -> &str {
        &self.manifest.name
    }

    /// The body of that name; of the empty name, the default one. None for an unknown name.
    pub fn body(&self, name: &str) -> Option<&Arc<Body>> {
        let default = self
            .manifest
            .unimogen
            .as_ref()
            .map(|table| table.default_body.as_str());
        let wanted = match name {
            "" => default,
            name => Some(name),
        };
        match wanted {
            Some(wanted) => self.bodies.iter().find(|body| body.name == wanted),
            None => self.bodies.first(),
        }
    }

    /// Path of one body's file.
    pub fn body_file(&self, name: &str) -> PathBuf {
        bodies::body_file(&self.folder, name)
    }

    /// Path of one stage's file.
    pub fn stage_file(&self, stage: Stage) -> PathBuf {
        self.folder.join(stage.file_name())
    }
}

/// Folders below `root` that hold a manifest, sorted; `root` itself if it is a pack.
///
/// # Errors
/// [`PackError`] if `root` cannot be read, or holds no pack.
pub fn find_packs(root: &Path) -> Result<Vec<PathBuf>, PackError> {
    let fail = |problem| PackError {
        folder: root.to_owned(),
        problem,
    };
    if root.join(MANIFEST_FILE).is_file() {
        return Ok(vec![root.to_owned()]);
    }
    let read = |cause| {
        fail(PackProblem::Read {
            path: root.to_owned(),
            cause,
        })
    };
    let mut folders = Vec::new();
    for entry in std::fs::read_dir(root).map_err(read)? {
        let path = entry.map_err(read)?.path();
        if path.join(MANIFEST_FILE).is_file() {
            folders.push(path);
        }
    }
    folders.sort();
    if folders.is_empty() {
        Err(fail(PackProblem::NoPacks))
    } else {
        Ok(folders)
    }
}

/// `sha256:<hex>` over the bytes of these files of the folder, one after another.
///
/// # Errors
/// [`PackProblem::Read`] if a file is missing or unreadable.
pub fn content_hash(folder: &Path, files: &[&str]) -> Result<String, PackProblem> {
    let mut hasher = Sha256::new();
    for file in files {
        let path = folder.join(file);
        let mut file = std::fs::File::open(&path).map_err(|cause| PackProblem::Read {
            path: path.clone(),
            cause,
        })?;
        std::io::copy(&mut file, &mut HashWriter(&mut hasher))
            .map_err(|cause| PackProblem::Read { path, cause })?;
    }
    let hex: String = hasher
        .finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    Ok(format!("sha256:{hex}"))
}

struct HashWriter<'a>(&'a mut Sha256);

impl std::io::Write for HashWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn read_text(path: &Path) -> Result<String, PackProblem> {
    std::fs::read_to_string(path).map_err(|cause| PackProblem::Read {
        path: path.to_owned(),
        cause,
    })
}

#[cfg(test)]
mod sonic_planner_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod vermo_tests;
