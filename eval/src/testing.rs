//! What tests share.

use std::sync::Arc;

use glam::Vec3;
use troupe_motion::skeleton::{Joint, Skeleton};

/// A skeleton of one joint.
pub(crate) fn lone_hips() -> Arc<Skeleton> {
    let joint = Joint {
        name: "Hips".to_owned(),
        parent: None,
        offset_m: Vec3::ZERO,
    };
    Arc::new(Skeleton::new(vec![joint], Vec3::X, 0.0, None).unwrap())
}
