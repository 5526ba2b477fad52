//! Packs without a server: what their folders say of them.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Deserialize;
use troupe_client::Pack;
use troupe_motion::Skeleton;
use troupe_motion::robot::RobotDoc;
use troupe_proto::v1;

use crate::context::Context;
use crate::failure::Failure;

/// Which pack, of a server or in a folder.
#[derive(Debug, Args)]
pub(super) struct PackFrom {
    /// Model pack of the server; without it the server's default.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME", help_heading = PACK)]
    pub(super) pack: String,

    /// Folder of the model pack, such as models/human: no server is needed then.
    #[arg(long, value_name = "DIR", conflicts_with = "pack", help_heading = PACK)]
    pub(super) pack_folder: Option<PathBuf>,
}

const PACK: &str = "Pack";

impl PackFrom {
    /// The pack, from its folder or from the server.
    pub(super) async fn get(&self, context: &Context) -> Result<Pack, Failure> {
        match &self.pack_folder {
            Some(folder) => read(folder),
            None => Ok(context.connect_to_pack(&self.pack).await?.1),
        }
    }
}

/// What `pack.toml` says that clips and keyframes need.
#[derive(Deserialize)]
struct Manifest {
    name: String,
    version: String,
    fps: f32,
    frames_per_token: u32,
    min_tokens: u32,
    max_tokens: u32,
    context_frames: u32,
    max_targets: u32,
    skeleton: Skeleton,
    robot: Option<RobotDoc>,
}

/// Reads the `pack.toml` of a folder; the networks beside it are not looked at.
pub(super) fn read(folder: &Path) -> Result<Pack, Failure> {
    let file = folder.join("pack.toml");
    let text = std::fs::read_to_string(&file).map_err(|e| Failure::file(&file, e))?;
    let manifest: Manifest = toml::from_str(&text).map_err(|e| Failure::file(&file, e))?;
    if !(manifest.fps.is_finite() && manifest.fps > 0.0) {
        return Err(Failure::file(&file, format_args!("fps is {}", manifest.fps)));
    }
    let frames = |tokens: u32| tokens.saturating_mul(manifest.frames_per_token);
    let message = v1::Pack {
        name: manifest.name,
        version: manifest.version,
        fps: manifest.fps,
        context_frames: manifest.context_frames,
        min_frames: frames(manifest.min_tokens),
        max_frames: frames(manifest.max_tokens),
        max_targets: manifest.max_targets,
        ..v1::Pack::default()
    };
    let skeleton = match &manifest.robot {
        Some(robot) => (manifest.skeleton.with_robot(robot)).map_err(|e| Failure::file(&file, e))?,
        None => manifest.skeleton,
    };
    Ok(Pack::with_skeleton(message, skeleton))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_pack_is_read_from_its_folder() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/human");
        let pack = read(&folder).unwrap();
        assert_eq!(
            (pack.name(), pack.fps(), pack.context_frames()),
            ("human", 30.0, 4)
        );
        assert_eq!(pack.segment_frames(), 12..=64);
        assert!(pack.skeleton().joint_index("Hand_R").is_some());
    }

    #[test]
    fn a_folder_that_is_no_pack_is_reported() {
        let failure = read(Path::new("no/such")).err().unwrap().to_string();
        assert!(failure.contains("no/such/pack.toml"), "{failure}");
    }
}
