//! Model packs: a folder with `pack.toml` and one ONNX file a stage. Loading checks the manifest, the files' content
//! hash and (in [`crate::engine`]) every tensor of every stage, so that a wrong pack fails at start and says why.

mod dims;
mod error;
mod manifest;
#[cfg(any(test, feature = "testing"))]
pub mod toy;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest as _, Sha256};
use troupe_motion::ik::{Leg, legs};
use troupe_motion::robot::Hinge;
use troupe_motion::stance::low_hips_m;
use troupe_motion::{Robot, Skeleton};
use troupe_proto::v1;

pub use dims::{Dims, GLOBAL_ROOT, LOCAL_ROOT, POSE_FEATURES, SIX_D, TensorSpec, TensorType};
pub use error::{PackError, PackProblem};
pub use manifest::Manifest;

/// Name of the manifest inside a pack folder.
pub const MANIFEST_FILE: &str = "pack.toml";

/// The three networks of a pack, in the order in which they run (and in which the content hash reads them).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Constraints to token count and root trajectory.
    Root,
    /// Root and poses to the logits of the pose tokens.
    Pose,
    /// Tokens, root and poses to frames.
    Decoder,
}

impl Stage {
    /// All stages, in running order.
    pub const ALL: [Self; 3] = [Self::Root, Self::Pose, Self::Decoder];

    /// The stage's name: a metric label, and the stem of its file.
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
    /// The manifest as written.
    pub manifest: Manifest,
    /// Sizes of every tensor and limit of every request.
    pub dims: Dims,
    /// The skeleton that poses and frames are of.
    pub skeleton: Arc<Skeleton>,
    /// The skeleton's legs, whose feet are held still where they stand.
    pub legs: Arc<[Leg]>,
    /// Hips lower than this over the ground are those of one who sits or crouches, metres.
    pub low_hips_m: f32,
    /// The folder, where the ONNX files are.
    pub folder: PathBuf,
}

impl Pack {
    /// Loads and checks the pack in `folder`: manifest, limits, skeleton, and the hash of the ONNX files.
    ///
    /// # Errors
    /// [`PackError`], which names the folder and what is wrong with it.
    pub fn load(folder: &Path) -> Result<Self, PackError> {
        Self::try_load(folder).map_err(|problem| PackError {
            folder: folder.to_owned(),
            problem,
        })
    }

    fn try_load(folder: &Path) -> Result<Self, PackProblem> {
        let pack = Self::from_manifest(Manifest::parse(&read_text(&folder.join(MANIFEST_FILE))?)?, folder)?;
        let found = content_hash(folder)?;
        let expected = &pack.manifest.content_hash;
        if !expected.eq_ignore_ascii_case(&found) {
            return Err(PackProblem::ContentHash {
                expected: expected.clone(),
                found,
            });
        }
        Ok(pack)
    }

    /// A pack from an already parsed manifest, without looking at its files.
    ///
    /// # Errors
    /// [`PackProblem`] where the manifest contradicts itself.
    pub fn from_manifest(manifest: Manifest, folder: &Path) -> Result<Self, PackProblem> {
        let dims = manifest.check()?;
        let skeleton = manifest.skeleton.clone();
        let skeleton = match &manifest.robot {
            Some(robot) => skeleton.with_robot(robot)?,
            None => skeleton,
        };
        Ok(Self {
            manifest,
            dims,
            low_hips_m: low_hips_m(&skeleton),
            legs: legs(&skeleton).into(),
            skeleton: Arc::new(skeleton),
            folder: folder.to_owned(),
        })
    }

    /// The pack's name.
    pub fn name(&self) -> &str {
        &self.manifest.name
    }

    /// The file of one stage.
    pub fn stage_file(&self, stage: Stage) -> PathBuf {
        self.folder.join(stage.file_name())
    }

    /// The public description of the pack, which `engine` runs.
    pub fn describe(&self, is_default: bool, engine: &str) -> v1::Pack {
        let manifest = &self.manifest;
        let joints = &self.skeleton.joints;
        let contacts = self.skeleton.contacts.as_ref();
        let parent = |parent: Option<usize>| parent.map_or(-1, |index| index as i32);
        v1::Pack {
            name: manifest.name.clone(),
            version: manifest.version.clone(),
            licence: manifest.licence.clone(),
            credits: manifest.credits.clone(),
            fps: manifest.fps,
            joints: joints
                .iter()
                .map(|joint| v1::Joint {
                    name: joint.name.clone(),
                    parent: parent(joint.parent),
                    offset: Some(vector(joint.offset_m)),
                })
                .collect(),
            left_axis: Some(vector(self.skeleton.left_axis)),
            ground_y: self.skeleton.ground_y_m,
            contact_joints: contacts
                .iter()
                .flat_map(|contacts| &contacts.joints)
                .map(|&joint| joints[joint].name.clone())
                .collect(),
            contact_rules: contacts.map(|contacts| v1::ContactRules {
                max_height: contacts.max_height_m.clone(),
                max_speed: contacts.max_speed_mps,
                clearance: contacts.clearance_m.clone(),
            }),
            context_frames: self.dims.context_frames as u32,
            max_targets: self.dims.max_targets as u32,
            min_frames: self.dims.min_frames() as u32,
            max_frames: self.dims.max_frames() as u32,
            frames_per_token: self.dims.frames_per_token as u32,
            heads: self.dims.heads as u32,
            codes: self.dims.codes as u32,
            content_hash: manifest.content_hash.clone(),
            is_default,
            parameters: manifest.parameters,
            figures_json: manifest.figures_json(),
            engine: engine.to_owned(),
            robot: (self.skeleton.robot.as_ref()).map(|robot| describe_robot(robot, &self.skeleton)),
        }
    }
}

fn describe_robot(robot: &Robot, skeleton: &Skeleton) -> v1::Robot {
    let hinge = |hinge: &Hinge| v1::Hinge {
        joint: skeleton.joints[hinge.joint].name.clone(),
        axis: Some(vector(hinge.axis)),
        rest: Some(v1::Quat {
            w: hinge.rest.w,
            x: hinge.rest.x,
            y: hinge.rest.y,
            z: hinge.rest.z,
        }),
        lower: hinge.lower_rad,
        upper: hinge.upper_rad,
        max_speed: hinge.max_speed_rad_per_s,
    };
    v1::Robot {
        name: robot.name().to_owned(),
        hinges: robot.hinges().iter().map(hinge).collect(),
        qpos_size: robot.qpos_len() as u32,
    }
}

fn vector(v: troupe_motion::Vec3) -> v1::Vec3 {
    v1::Vec3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

/// Folders below `root` that hold a manifest, sorted; `root` itself where it is a pack.
///
/// # Errors
/// [`PackError`] where `root` cannot be read, or holds no pack.
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

/// `sha256:<hex>` over the bytes of the stages' files, in the order of [`Stage::ALL`].
///
/// # Errors
/// [`PackProblem::Read`] where a file is missing or unreadable.
pub fn content_hash(folder: &Path) -> Result<String, PackProblem> {
    let mut hasher = Sha256::new();
    for stage in Stage::ALL {
        let path = folder.join(stage.file_name());
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
mod tests;
