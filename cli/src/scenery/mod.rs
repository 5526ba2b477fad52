//! The things of a scene: its colliders, and its objects at every frame of a take.

mod solid;

use glam::{Quat, Vec3};
use serde::Deserialize;
use troupe_client::Client;
use troupe_proto::v1;
use troupe_proto::v1::session_event::Kind;

use crate::failure::Failure;
use crate::graphics::canvas::Ink;
use crate::take::{Event, Moved};

pub(crate) use self::solid::{Paint, Solid};

/// Most that feet may be below the top of a collider that they stand on, metres.
const SINK_M: f32 = 0.15;

const COLLIDER: Paint = Paint {
    fill: Ink::hex(0xe6_ea_ef),
    line: Ink::hex(0xb4_be_ca),
};
const OBJECT: Paint = Paint {
    fill: Ink::hex(0xfd_f4_e2),
    line: Ink::hex(0xd9_b8_7c),
};
/// Paint of an object that the character uses.
const USED: Paint = Paint {
    fill: Ink::hex(0xfc_d9_94),
    line: Ink::hex(0xb8_77_0c),
};

/// A scene, metres, native convention.
#[derive(Debug)]
pub(crate) struct Scenery {
    pub(crate) ground_m: f32,
    colliders: Vec<Solid>,
    objects: Vec<Object>,
}

/// An object and its places.
#[derive(Debug)]
struct Object {
    id: String,
    shape: Solid,
    at_first: (Vec3, Quat),
    /// Later places, in order of time.
    moved: Vec<Moved>,
    /// Whether the character uses it at some time.
    is_used: bool,
}

/// Something to draw.
#[derive(Debug)]
pub(crate) struct Thing<'a> {
    pub(crate) solid: Solid,
    pub(crate) paint: Paint,
    /// Id of an object; None of a collider.
    pub(crate) id: Option<&'a str>,
    /// Whether it is in the character's hand.
    pub(crate) in_hand: bool,
    /// Whether the character uses it at some time.
    pub(crate) is_used: bool,
}

/// The fields of a definition's document that give its shape.
#[derive(Deserialize)]
struct Definition {
    shape: Shape,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Shape {
    Box {
        #[serde(default)]
        center_m: [f32; 3],
        half_extents_m: [f32; 3],
    },
    Convex {
        points_m: Vec<[f32; 3]>,
    },
}

impl Scenery {
    /// A scene as it was at first, with the events of the take. The shapes of objects come from the
    /// server.
    pub(crate) async fn of(
        client: &Client,
        scene: &v1::Scene,
        events: &[Event],
        moved: &[Moved],
    ) -> Result<Self, Failure> {
        let mut shapes = std::collections::BTreeMap::new();
        for object in &scene.objects {
            if !shapes.contains_key(&object.definition) {
                let answer = client
                    .object(&object.definition, v1::DocumentFormat::Json)
                    .await?;
                let text = answer.document.unwrap_or_default().text;
                shapes.insert(object.definition.clone(), shape_of(&text)?);
            }
        }
        let shape_of = |definition: &str| shapes.get(definition).cloned().unwrap_or_default();
        Ok(Self::new(scene, events, moved, shape_of))
    }

    /// A scene with objects of these shapes.
    pub(crate) fn new(
        scene: &v1::Scene,
        events: &[Event],
        moved: &[Moved],
        shape_of: impl Fn(&str) -> Solid,
    ) -> Self {
        let colliders = scene.colliders.iter().map(|collider| {
            let (position, rotation) = place_of(collider.position, collider.rotation);
            let solid = collider.shape.as_ref().map(Solid::of_shape).unwrap_or_default();
            solid.placed(position, rotation)
        });
        let objects = scene.objects.iter().map(|object| Object {
            id: object.id.clone(),
            shape: shape_of(&object.definition),
            at_first: place_of(object.position, object.rotation),
            moved: (moved.iter().filter(|m| m.instance == object.id))
                .cloned()
                .collect(),
            is_used: events.iter().any(|event| starts(event, &object.id)),
        });
        Self {
            ground_m: scene.ground,
            colliders: colliders.collect(),
            objects: objects.collect(),
        }
    }

    /// All things at a frame.
    pub(crate) fn things(&self, frame: usize) -> impl Iterator<Item = Thing<'_>> {
        let colliders = self.colliders.iter().map(|solid| Thing {
            solid: solid.clone(),
            paint: COLLIDER,
            id: None,
            in_hand: false,
            is_used: false,
        });
        let objects = self.objects.iter().map(move |object| {
            let after = object.moved.partition_point(|moved| moved.frame <= frame);
            let last = after.checked_sub(1).map(|at| &object.moved[at]);
            let (position, rotation) = last.map_or(object.at_first, |moved| (moved.position, moved.rotation));
            Thing {
                solid: object.shape.placed(position, rotation),
                paint: if object.is_used { USED } else { OBJECT },
                id: Some(&object.id),
                in_hand: last.is_some_and(|moved| moved.in_hand),
                is_used: object.is_used,
            }
        });
        colliders.chain(objects)
    }

    /// Height of the surface below feet at a place, metres.
    pub(crate) fn level(&self, feet: Vec3) -> f32 {
        let tops = self.colliders.iter().filter_map(|solid| solid.top_at(feet));
        tops.filter(|top| *top < feet.y + SINK_M)
            .fold(self.ground_m, f32::max)
    }
}

/// Whether an event begins to use an object.
fn starts(event: &Event, id: &str) -> bool {
    matches!(&event.kind, Kind::Started(of) if of.instance == id)
}

fn place_of(position: Option<v1::Vec3>, rotation: Option<v1::Quat>) -> (Vec3, Quat) {
    (
        position.map_or(Vec3::ZERO, |p| Vec3::new(p.x, p.y, p.z)),
        rotation.map_or(Quat::IDENTITY, |q| Quat::from_xyzw(q.x, q.y, q.z, q.w)),
    )
}

/// The shape in a definition's JSON document.
fn shape_of(document: &str) -> Result<Solid, Failure> {
    let definition: Definition = serde_json::from_str(document)
        .map_err(|e| Failure::Other(format!("an object definition of the server: {e}")))?;
    Ok(match definition.shape {
        Shape::Box {
            center_m,
            half_extents_m,
        } => Solid::cuboid(center_m.into(), half_extents_m.into()),
        Shape::Convex { points_m } => {
            let points = points_m.into_iter().map(Vec3::from).collect::<Vec<_>>();
            Solid::hull(&points)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_of_documents_are_read() {
        let cup = r#"{"name": "cup", "shape": {"box": {"center_m": [0, 0.5, 0], "half_extents_m": [0.1, 0.5, 0.1]}}}"#;
        assert!((shape_of(cup).unwrap().bounds().1.y - 1.0).abs() < 1e-6);
        let hull = r#"{"shape": {"convex": {"points_m": [[0,0,0],[1,0,0],[0,1,0],[0,0,1]]}}}"#;
        assert_eq!(shape_of(hull).unwrap().faces.len(), 4);
        assert!(shape_of("{}").is_err());
    }
}
