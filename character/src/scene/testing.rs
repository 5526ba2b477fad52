//! Scenes, shapes and values shared by tests.

use std::sync::Arc;

use proptest::prelude::*;
use troupe_motion::{Quat, Vec3};

use super::{Body, Shape, Transform, Volume};

/// A box around its origin.
pub fn box_shape(half: Vec3) -> Shape {
    Shape::Box {
        center_m: Vec3::ZERO,
        half_extents_m: half,
    }
}

/// A solid cube with a trigger 0.5 m around it.
pub fn boxed(half: f32) -> Arc<Body> {
    body(&box_shape(Vec3::splat(half)), 0.5)
}

/// A solid body of any shape.
pub fn body(shape: &Shape, reach_m: f32) -> Arc<Body> {
    Arc::new(Body {
        volume: Volume::new(shape).unwrap(),
        trigger: Volume::grown(shape, reach_m).unwrap(),
        solid: true,
        shared: false,
    })
}

/// A transform without rotation.
pub fn place(x: f32, y: f32, z: f32) -> Transform {
    Transform::new(Vec3::new(x, y, z), Quat::IDENTITY)
}

/// A vector with components up to `far`.
pub fn any_vector(far: f32) -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-far..far).prop_map(Vec3::from)
}

/// Any unit quaternion.
pub fn any_rotation() -> impl Strategy<Value = Quat> {
    prop::array::uniform4(-1.0_f32..1.0)
        .prop_filter("shorter than a direction may be", |q| {
            q.iter().map(|v| v * v).sum::<f32>() > 0.01
        })
        .prop_map(|q| Quat::from_array(q).normalize())
}

/// Any transform within `far` of the origin.
pub fn any_transform(far: f32) -> impl Strategy<Value = Transform> {
    (any_vector(far), any_rotation()).prop_map(|(position, rotation)| Transform::new(position, rotation))
}

/// A box or a convex hull of about a metre.
pub fn any_shape() -> impl Strategy<Value = Shape> {
    let boxes =
        (any_vector(0.5), prop::array::uniform3(0.05_f32..1.0)).prop_map(|(center_m, half)| Shape::Box {
            center_m,
            half_extents_m: Vec3::from(half),
        });
    let hulls = prop::collection::vec(any_vector(1.0), 5..24)
        .prop_map(|points_m| Shape::Convex { points_m })
        .prop_filter("almost without volume", |shape| Volume::new(shape).is_ok());
    prop_oneof![boxes, hulls]
}
