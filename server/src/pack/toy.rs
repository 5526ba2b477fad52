//! Toy packs for tests and fuzz targets: few numbers, no files.

use std::path::Path;

use troupe_motion::{ContactParams, Joint, Skeleton, Vec3};

use super::{Manifest, Pack};

/// Hips, and a foot 0.8 m below them. Left is +X.
///
/// # Panics
/// Never: the skeleton is valid.
pub fn skeleton() -> Skeleton {
    let joint = |name: &str, parent, y| Joint {
        name: name.into(),
        parent,
        offset_m: Vec3::new(0.0, y, 0.0),
    };
    let contacts = ContactParams {
        joints: vec![1],
        max_height_m: vec![0.1],
        max_speed_mps: 0.3,
        clearance_m: vec![0.05],
    };
    let joints = vec![joint("Hips", None, 0.0), joint("Foot", Some(0), -0.8)];
    Skeleton::new(joints, Vec3::X, 0.0, Some(contacts)).expect("a valid skeleton")
}

/// The manifest of a toy pack: 3 to 16 tokens of two heads with five codes.
pub fn manifest(name: &str, skeleton: Skeleton) -> Manifest {
    Manifest {
        format: 1,
        name: name.into(),
        version: "1.2.3".into(),
        licence: "CC0".into(),
        credits: vec!["Nobody".into()],
        fps: 30.0,
        frames_per_token: 4,
        min_tokens: 3,
        max_tokens: 16,
        heads: 2,
        codes: 5,
        context_frames: 4,
        max_targets: 4,
        parameters: 7,
        content_hash: format!("sha256:{}", "0".repeat(64)),
        skeleton,
        robot: None,
        training: toml::Table::new(),
        evaluation: toml::Table::new(),
    }
}

/// A toy pack. Its styles are those in `folder`, where it has any.
///
/// # Panics
/// Where no pack may have this name or skeleton.
pub fn pack(name: &str, skeleton: Skeleton, folder: &Path) -> Pack {
    Pack::from_manifest(manifest(name, skeleton), folder).expect("a valid pack")
}
