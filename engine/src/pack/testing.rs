//! Packs without files, for tests.

use std::path::PathBuf;
use std::sync::Arc;

use troupe_motion::model::{Capabilities, Rig};

use super::{Family, Manifest, Pack, VerMoDoc};

/// A pack with that rig, with a manifest and without networks.
pub fn pack_of(rig: Rig) -> Pack {
    let dims = rig.dims;
    let manifest = Manifest {
        format: 2,
        family: Family::MotionBricks.name().to_owned(),
        capabilities: Capabilities {
            inbetween: true,
            live: true,
            ..Capabilities::default()
        },
        name: rig.name.clone(),
        version: "1.2.3".into(),
        licence: "CC0".into(),
        credits: vec!["Somebody".into()],
        fps: rig.fps,
        frames_per_token: dims.frames_per_token,
        min_tokens: dims.min_tokens,
        max_tokens: dims.max_tokens,
        heads: dims.heads,
        codes: dims.codes,
        context_frames: dims.context_frames,
        max_targets: dims.max_targets,
        root_choices: (dims.root_choices > 0).then_some(dims.root_choices),
        parameters: 7,
        content_hash: format!("sha256:{}", "0".repeat(64)),
        skeleton: (*rig.skeleton).clone(),
        robot: None,
        limits: None,
        unimogen: None,
        vermo: None,
        sonic_planner: None,
        training: toml::Table::new(),
        evaluation: toml::Table::new(),
    };
    Pack {
        folder: PathBuf::from(&manifest.name),
        manifest,
        rig: Arc::new(rig),
        bodies: Vec::new(),
        words: Vec::new(),
        lexicon: None,
    }
}

/// The manifest's table of the pack's language model, for tests that change it; none for a pack
/// without one.
pub fn language_table(pack: &mut Pack) -> &mut Option<VerMoDoc> {
    &mut pack.manifest.vermo
}
