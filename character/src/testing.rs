//! Small rigs and bodies for tests.

use std::sync::Arc;

use troupe_motion::anatomy::PartsDoc;
use troupe_motion::model::{Dims, Rig};
use troupe_motion::retarget::Figure;
use troupe_motion::{ContactParams, Joint, Quat, Skeleton, Vec3};

/// Height of the hips of [`person`], metres.
pub const PERSON_HIPS_M: f32 = 0.93;

/// The person's joints. `{}` stands for either side; offsets are those of the left one.
const PERSON: [(&str, &str, [f32; 3]); 13] = [
    ("hips", "", [0.0, PERSON_HIPS_M, 0.0]),
    ("spine", "hips", [0.0, 0.12, 0.0]),
    ("chest", "spine", [0.0, 0.16, 0.0]),
    ("neck", "chest", [0.0, 0.22, 0.0]),
    ("head", "neck", [0.0, 0.1, 0.0]),
    ("{}_thigh", "hips", [0.09, -0.03, 0.0]),
    ("{}_shin", "{}_thigh", [0.0, -0.41, 0.02]),
    ("{}_foot", "{}_shin", [0.0, -0.4, -0.02]),
    ("{}_toe", "{}_foot", [0.0, -0.07, 0.14]),
    ("{}_shoulder", "chest", [0.03, 0.18, 0.0]),
    ("{}_upperarm", "{}_shoulder", [0.13, 0.0, 0.0]),
    ("{}_forearm", "{}_upperarm", [0.0, -0.28, 0.0]),
    ("{}_hand", "{}_forearm", [0.0, -0.25, 0.0]),
];

/// A joint of a body: its name, its parent's, and its offset, metres.
pub type Row = (String, String, Vec3);

/// The joints of a person that stands with hanging arms. The hips are the first.
pub fn person() -> Vec<Row> {
    let mut rows = Vec::new();
    for (name, parent, [x, y, z]) in PERSON {
        let sides: &[(&str, f32)] = match name.contains("{}") {
            true => &[("left", 1.0), ("right", -1.0)],
            false => &[("", 1.0)],
        };
        for (side, sign) in sides {
            let [name, parent] = [name, parent].map(|name| name.replace("{}", side));
            rows.push((name, parent, Vec3::new(sign * x, y, z)));
        }
    }
    rows
}

/// The joints of rows in a size. A parent comes before its children.
pub fn joints_of(rows: &[Row], size: f32) -> Vec<Joint> {
    let joint = |(name, parent, offset): &Row| Joint {
        name: name.clone(),
        parent: rows.iter().position(|row| row.0 == *parent),
        offset_m: size * *offset,
    };
    rows.iter().map(joint).collect()
}

/// The body of joints that stands with its root at a height, metres.
pub fn figure_of(joints: Vec<Joint>, contacts: Option<ContactParams>, height_m: f32) -> Figure {
    let skeleton = Skeleton::new(joints, Vec3::X, 0.0, contacts).unwrap();
    let still = vec![Quat::IDENTITY; skeleton.joint_count()];
    Figure::new(Arc::new(skeleton), &still, Some(height_m), &PartsDoc::default()).unwrap()
}

/// Sizes of a test rig: segments of 12 to 64 frames, as in the packs that ship.
pub fn dims(skeleton: &Skeleton) -> Dims {
    Dims {
        joints: skeleton.joint_count(),
        contacts: skeleton
            .contacts
            .as_ref()
            .map_or(0, |contacts| contacts.joints.len()),
        heads: 2,
        codes: 5,
        min_tokens: 3,
        max_tokens: 16,
        frames_per_token: 4,
        context_frames: 4,
        max_targets: 4,
        root_choices: 0,
    }
}

/// A rig of this skeleton.
pub fn rig_of(name: &str, skeleton: Skeleton) -> Rig {
    Rig::new(name, 30.0, dims(&skeleton), skeleton)
}

/// Two joints: a pelvis whose left is +X, and a foot below it.
pub fn toy_rig() -> Rig {
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
    let skeleton = Skeleton::new(joints, Vec3::X, 0.0, Some(contacts)).unwrap();
    rig_of("toy", skeleton)
}
