//! Documents of scenes, and the shapes of scenes and objects.

use serde::{Deserialize, Serialize};

use super::is_default;

/// A whole scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneDoc {
    /// Version of the format: 1.
    pub format: u32,
    /// Letters, digits, '-', '_' or '.'.
    pub name: String,
    /// Height of the ground plane, metres. Default 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub ground_m: f32,
    /// Static bodies that characters stand on, or that are in the way to objects. They do not stop
    /// locomotion.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub colliders: Vec<ColliderDoc>,
    /// Objects that characters may use.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub objects: Vec<InstanceDoc>,
}

impl SceneDoc {
    /// The TOML text.
    ///
    /// # Errors
    /// If a value cannot be written, which no checked scene has.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }
}

/// A static collider. At most one of `heading_deg` and `rotation` is given. Default: no rotation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColliderDoc {
    /// Unique among the scene's colliders.
    pub id: String,
    /// Position of the origin, metres. Default: the scene's origin.
    #[serde(default, skip_serializing_if = "is_default")]
    pub position_m: [f32; 3],
    /// Heading of its +Z, degrees about +Y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading_deg: Option<f32>,
    /// Rotation: w, x, y, z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f32; 4]>,
    /// Shape in the collider's frame, metres.
    pub shape: ColliderShapeDoc,
}

/// An object of a scene. At most one of `heading_deg` and `rotation` is given. Default: no
/// rotation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InstanceDoc {
    /// Unique among the scene's objects.
    pub id: String,
    /// Name of the object's definition.
    pub definition: String,
    /// Position of the origin, metres.
    pub position_m: [f32; 3],
    /// Heading of its +Z, degrees about +Y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading_deg: Option<f32>,
    /// Rotation: w, x, y, z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f32; 4]>,
}

/// A convex shape in its owner's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeDoc {
    /// A box along the axes.
    Box(BoxDoc),
    /// The hull of points.
    Convex(ConvexDoc),
}

/// The shape of a static collider.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ColliderShapeDoc {
    /// A box along the axes.
    Box(BoxDoc),
    /// The hull of points.
    Convex(ConvexDoc),
    /// Uneven ground. It may only be turned about +Y.
    Heightfield(HeightfieldDoc),
}

/// A box along the axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxDoc {
    /// Middle of the box, metres. Default: the origin.
    #[serde(default, skip_serializing_if = "is_default")]
    pub center_m: [f32; 3],
    /// Half the size along each axis, metres.
    pub half_extents_m: [f32; 3],
}

/// The hull of points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConvexDoc {
    /// 4 to 64 points, metres.
    pub points_m: Vec<[f32; 3]>,
}

/// Heights over a grid in the x-z plane, centred on the origin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeightfieldDoc {
    /// Samples along z, 2 to 512.
    pub rows: usize,
    /// Samples along x, 2 to 512.
    pub columns: usize,
    /// Size along x and z, metres.
    pub size_m: [f32; 2],
    /// `rows * columns` heights in metres, row by row: the first row is at the least z, its first
    /// sample at the least x.
    pub heights_m: Vec<f32>,
}

impl ShapeDoc {
    /// The word for this shape in a document.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Box(_) => "box",
            Self::Convex(_) => "convex",
        }
    }
}
