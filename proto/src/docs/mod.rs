//! Documents that people write: definitions of smart objects, skills, and scenes. Plain types for
//! TOML and JSON, the same fields in both; lengths in metres, angles in degrees about +Y, rotations
//! as w, x, y, z, right-handed with Y up.
//!
//! Only the form is checked here: unknown fields are refused, values are not looked at. The server
//! checks these.

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

/// For serde: a field that is left out where it says what it says anyway.
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
