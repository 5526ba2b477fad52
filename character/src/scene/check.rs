//! Checks a written scene and turns it into a [`Scene`].

use std::sync::Arc;

use troupe_motion::Quat;
use troupe_motion::rotation::yaw;

use super::collider::Placed;
use super::error::{self, SceneError, ShapeError};
use super::{
    Body, Collider, ColliderDoc, ColliderShape, ColliderShapeDoc, FORMAT, InstanceDoc, MAX_COLLIDERS,
    MAX_COORDINATE_M, MAX_HEIGHT_SAMPLES, MAX_INSTANCES, Scene, SceneDoc, Transform,
};
use crate::document::check::{entries, format, listed, name, number, rotation, unique, vector};
use crate::{FieldError, Path};

/// Finds the bodies of the objects that a scene names.
pub trait Bodies {
    /// The body of the definition of this name.
    fn body(&self, definition: &str) -> Option<Arc<Body>>;

    /// Names of all definitions, for error messages.
    fn names(&self) -> Vec<&str>;
}

impl Scene {
    /// Checks a written scene and makes it.
    ///
    /// # Errors
    /// [`FieldError`] for the first value that is not accepted.
    pub fn from_doc(doc: &SceneDoc, bodies: &impl Bodies) -> Result<Self, FieldError> {
        let path = Path::root();
        format(&path, doc.format, FORMAT)?;
        name(&path.field("name"), &doc.name)?;
        let mut scene =
            Self::new(doc.ground_m).map_err(|error| field_error(&path.field("ground_m"), error))?;
        scene.place_colliders(check_colliders(&path, &doc.colliders)?);
        entries(&path.field("objects"), doc.objects.len(), 0, MAX_INSTANCES)?;
        unique(&path, "objects", &doc.objects, "id", |object| &object.id)?;
        for (index, object) in doc.objects.iter().enumerate() {
            scene.add_doc(object, &path.element("objects", index), bodies)?;
        }
        Ok(scene)
    }

    /// Checks an object written at `path`, and adds it to the scene.
    ///
    /// # Errors
    /// [`FieldError`] for the first value that is not accepted; then nothing has changed.
    pub fn add_doc(
        &mut self,
        doc: &InstanceDoc,
        path: &Path<'_>,
        bodies: &impl Bodies,
    ) -> Result<(), FieldError> {
        let body = body_of(&path.field("definition"), &doc.definition, bodies)?;
        let transform = place(path, doc.position_m, doc.heading_deg, doc.rotation)?;
        self.add(&doc.id, &doc.definition, body, transform)
            .map_err(|error| field_error(&path.field("id"), error))
    }
}

/// The body of the definition that `path` names.
pub fn body_of(path: &Path<'_>, definition: &str, bodies: &impl Bodies) -> Result<Arc<Body>, FieldError> {
    bodies.body(definition).ok_or_else(|| {
        let known = listed(bodies.names());
        path.error(
            format!("is {definition:?}, which is no object definition"),
            match known.is_empty() {
                true => "the name of a definition, of which there are none".to_owned(),
                false => known,
            },
        )
    })
}

fn check_colliders(path: &Path<'_>, docs: &[ColliderDoc]) -> Result<Vec<Placed>, FieldError> {
    entries(&path.field("colliders"), docs.len(), 0, MAX_COLLIDERS)?;
    unique(path, "colliders", docs, "id", |collider| &collider.id)?;
    let mut all_samples = 0;
    let check = |(index, doc): (usize, &ColliderDoc)| {
        let path = path.element("colliders", index);
        all_samples += samples(doc);
        if all_samples > MAX_HEIGHT_SAMPLES {
            return Err(path.field("shape").field("heightfield").field("heights_m").error(
                format!("brings the samples of the scene's heightfields to {all_samples}"),
                format!("at most {MAX_HEIGHT_SAMPLES} in total"),
            ));
        }
        check_collider(&path, doc)
    };
    docs.iter().enumerate().map(check).collect()
}

/// Number of height samples of a collider; 0 for other shapes.
fn samples(doc: &ColliderDoc) -> usize {
    match &doc.shape {
        ColliderShapeDoc::Heightfield(field) => field.heights_m.len(),
        _ => 0,
    }
}

fn check_collider(path: &Path<'_>, doc: &ColliderDoc) -> Result<Placed, FieldError> {
    error::id("the id", &doc.id).map_err(|error| field_error(&path.field("id"), error))?;
    let (kind, shape) = match &doc.shape {
        ColliderShapeDoc::Box(shape) => ("box", ColliderShape::Solid(shape.into())),
        ColliderShapeDoc::Convex(shape) => ("convex", ColliderShape::Solid(shape.into())),
        ColliderShapeDoc::Heightfield(field) => ("heightfield", ColliderShape::Heightfield(field.into())),
    };
    let collider = Collider {
        id: doc.id.clone(),
        shape,
        transform: place(path, doc.position_m, doc.heading_deg, doc.rotation)?,
    };
    Placed::new(Arc::new(collider)).map_err(|error| match error {
        SceneError::Shape { cause, .. } => shape_error(&path.field("shape"), kind, cause),
        tilted => field_error(&path.field("rotation"), tilted),
    })
}

/// Checks the transform of a thing.
fn place(
    path: &Path<'_>,
    position_m: [f32; 3],
    heading_deg: Option<f32>,
    wxyz: Option<[f32; 4]>,
) -> Result<Transform, FieldError> {
    let position = vector(path, "position_m", position_m, MAX_COORDINATE_M)?;
    let rotation = match (heading_deg, wxyz) {
        (None, None) => Quat::IDENTITY,
        (Some(degrees), None) => {
            number(&path.field("heading_deg"), degrees, -360.0, 360.0)?;
            yaw(degrees.to_radians())
        }
        (None, Some(wxyz)) => rotation(&path.field("rotation"), wxyz, "the rotation")?,
        (Some(_), Some(_)) => {
            return Err(path
                .field("rotation")
                .error("cannot be combined with heading_deg", "at most one of the two"));
        }
    };
    Ok(Transform::new(position, rotation))
}

/// The error of the value at `path`.
pub fn field_error(path: &Path<'_>, error: SceneError) -> FieldError {
    match error {
        SceneError::Value { found, allowed, .. } => path.error(format!("is {found}"), allowed),
        SceneError::Exists { id, .. } => {
            path.error(format!("is {id:?}, which the scene has already"), "another")
        }
        SceneError::Full { what, limit } => path.error("is one too many", format!("at most {limit} {what}")),
        other => path.error(other.to_string(), ""),
    }
}

/// The error of the shape at `path`, written as `kind`.
pub fn shape_error(path: &Path<'_>, kind: &'static str, error: ShapeError) -> FieldError {
    let path = path.field(kind);
    match error {
        ShapeError::Value {
            field,
            found,
            allowed,
        } => FieldError {
            field: format!("{path}.{field}"),
            message: format!("is {found}"),
            allowed,
        },
        ShapeError::Flat(least_m) => path.field("points_m").error(
            "are flat",
            format!("points that span at least {least_m} m in every direction"),
        ),
        ShapeError::Hull => path.field("points_m").error(
            "have no usable convex hull",
            "points apart from each other that span a volume",
        ),
    }
}
