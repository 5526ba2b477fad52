//! Writes scenes as documents.

use troupe_motion::Quat;
use troupe_motion::rotation::to_wxyz;

use super::{
    BoxDoc, Collider, ColliderDoc, ColliderShape, ColliderShapeDoc, ConvexDoc, FORMAT, HeightfieldDoc,
    Instance, InstanceDoc, Scene, SceneDoc, Shape,
};

impl Scene {
    /// The document of the scene as it is now, under this name. Reservations and holders are not
    /// written.
    pub fn to_doc(&self, name: &str) -> SceneDoc {
        let mut objects: Vec<InstanceDoc> = self.instances().map(|instance| instance.to_doc()).collect();
        objects.sort_by(|a, b| a.id.cmp(&b.id));
        SceneDoc {
            format: FORMAT,
            name: name.to_owned(),
            ground_m: self.ground_y_m(),
            colliders: self.colliders().map(|collider| collider.to_doc()).collect(),
            objects,
        }
    }
}

impl Instance {
    fn to_doc(&self) -> InstanceDoc {
        InstanceDoc {
            id: self.id.to_string(),
            definition: self.object.to_string(),
            position_m: self.transform.position.into(),
            heading_deg: None,
            rotation: rotation(self.transform.rotation),
        }
    }
}

impl Collider {
    fn to_doc(&self) -> ColliderDoc {
        ColliderDoc {
            id: self.id.clone(),
            position_m: self.transform.position.into(),
            heading_deg: None,
            rotation: rotation(self.transform.rotation),
            shape: self.shape.to_doc(),
        }
    }
}

impl ColliderShape {
    fn to_doc(&self) -> ColliderShapeDoc {
        match self {
            Self::Solid(Shape::Box {
                center_m,
                half_extents_m,
            }) => ColliderShapeDoc::Box(BoxDoc {
                center_m: (*center_m).into(),
                half_extents_m: (*half_extents_m).into(),
            }),
            Self::Solid(Shape::Convex { points_m }) => ColliderShapeDoc::Convex(ConvexDoc {
                points_m: points_m.iter().copied().map(Into::into).collect(),
            }),
            Self::Heightfield(field) => ColliderShapeDoc::Heightfield(HeightfieldDoc {
                rows: field.rows,
                columns: field.columns,
                size_m: field.size_m,
                heights_m: field.heights_m.clone(),
            }),
        }
    }
}

fn rotation(rotation: Quat) -> Option<[f32; 4]> {
    (rotation != Quat::IDENTITY).then(|| to_wxyz(rotation))
}
