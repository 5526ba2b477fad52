//! Documents that people write: definitions of smart objects, skills, and scenes. The same plain
//! types serve TOML and JSON. Lengths are in metres, angles in degrees about +Y, rotations are w,
//! x, y, z; right-handed with Y up.
//!
//! This module checks only the form, and refuses unknown fields. The server checks values.

mod object;
mod scene;
mod skill;

pub use object::{
    Align, AnchorDoc, ApproachDoc, EventDoc, KeyframeDoc, Moment, Motion, ObjectDoc, Origin, PointDoc,
    ReleaseDoc, SetDoc, SocketDoc, TriggerDoc, VariantDoc,
};
pub use scene::{
    BoxDoc, ColliderDoc, ColliderShapeDoc, ConvexDoc, HeightfieldDoc, InstanceDoc, SceneDoc, ShapeDoc,
};
pub use skill::SkillDoc;

/// For serde: a field with its default is left out.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn yes() -> bool {
    true
}

fn is_true(value: &bool) -> bool {
    *value
}

fn is_false(value: &bool) -> bool {
    !*value
}
