//! Scenes and their objects as messages, and back.

use troupe_motion::Quat;
use troupe_motion::conventions::Convention;
use troupe_motion::rotation::yaw;
use troupe_proto::v1;

use super::WorldError;
use super::shape;
use crate::wire::units::{self, position, quat};
use troupe_character::document::check;
use troupe_character::limits::UNIT_TOLERANCE;
use troupe_character::scene::{
    Bodies, Collider, Instance, MAX_COLLIDERS, MAX_COORDINATE_M, MAX_ID_BYTES, MAX_INSTANCES, NamedScene,
    Scene, SceneCell, SceneError, State, Transform, body_of, field_error,
};
use troupe_character::{FieldError, Path};

/// Checks a whole scene and makes it.
pub(super) fn read_scene(
    path: &Path<'_>,
    scene: &v1::Scene,
    bodies: &impl Bodies,
) -> Result<NamedScene, WorldError> {
    check::name(&path.field("name"), &scene.name)?;
    let convention = units::convention(&path.field("convention"), scene.convention)?;
    let unit = convention.units_per_metre();
    let limit = MAX_COORDINATE_M * unit;
    let ground = path.field("ground");
    let ground_m = units::within(&ground, scene.ground, -limit, limit)? / unit;
    let mut made = Scene::new(ground_m).map_err(|error| field_error(&ground, error))?;
    place_colliders(path, &scene.colliders, convention, &mut made)?;
    check::entries(&path.field("objects"), scene.objects.len(), 0, MAX_INSTANCES)?;
    check::unique(path, "objects", &scene.objects, "id", |object| &object.id)?;
    for (index, object) in scene.objects.iter().enumerate() {
        add_object(
            &path.element("objects", index),
            object,
            convention,
            bodies,
            &mut made,
        )?;
    }
    Ok(NamedScene {
        name: scene.name.clone(),
        scene: made,
    })
}

fn place_colliders(
    path: &Path<'_>,
    colliders: &[v1::Collider],
    convention: Convention,
    scene: &mut Scene,
) -> Result<(), FieldError> {
    check::entries(&path.field("colliders"), colliders.len(), 0, MAX_COLLIDERS)?;
    for (index, collider) in colliders.iter().enumerate() {
        check_id(&path.element("colliders", index).field("id"), &collider.id)?;
    }
    check::unique(path, "colliders", colliders, "id", |collider| &collider.id)?;
    let read = |(index, collider): (usize, &v1::Collider)| {
        let path = path.element("colliders", index);
        Ok(Collider {
            id: collider.id.clone(),
            shape: shape::read(&path.field("shape"), collider.shape.as_ref(), convention)?,
            transform: place(
                &path,
                (collider.position, collider.heading, collider.rotation),
                convention,
                Transform::IDENTITY,
            )?,
        })
    };
    let native = colliders
        .iter()
        .enumerate()
        .map(read)
        .collect::<Result<Vec<Collider>, FieldError>>()?;
    scene
        .set_colliders_each(&native)
        .map_err(|(index, error)| collider_error(path, index, error))
}

/// The error of the collider with this index, or of all colliders together.
fn collider_error(path: &Path<'_>, index: Option<usize>, error: SceneError) -> FieldError {
    let Some(index) = index else {
        return field_error(&path.field("colliders"), error);
    };
    let path = path.element("colliders", index);
    match error {
        // The coordinates were checked before, so only the shape as a whole can be wrong.
        SceneError::Shape { cause, .. } => path.field("shape").field("convex").field("points").error(
            cause.to_string(),
            "points apart from each other that span a volume",
        ),
        tilted => field_error(&path.field("rotation"), tilted),
    }
}

/// Checks an object and puts it into a scene.
pub(super) fn add_object(
    path: &Path<'_>,
    object: &v1::SceneObject,
    convention: Convention,
    bodies: &impl Bodies,
    scene: &mut Scene,
) -> Result<(), WorldError> {
    let id = path.field("id");
    check_id(&id, &object.id)?;
    let definition = path.field("definition");
    check::name(&definition, &object.definition)?;
    let body = body_of(&definition, &object.definition, bodies)?;
    let transform = place(
        path,
        (object.position, object.heading, object.rotation),
        convention,
        Transform::IDENTITY,
    )?;
    scene
        .add(&object.id, &object.definition, body, transform)
        .map_err(|error| WorldError::Object {
            error,
            field: id.to_string(),
        })
}

/// Checks the length of an id.
pub(super) fn check_id(path: &Path<'_>, id: &str) -> Result<(), FieldError> {
    let allowed = || format!("1 to {MAX_ID_BYTES} bytes");
    match id.len() {
        0 => Err(path.error("is empty", allowed())),
        1..=MAX_ID_BYTES => Ok(()),
        found => Err(path.error(format!("has {found} bytes"), allowed())),
    }
}

/// Position, heading and rotation as in a message.
pub(super) type Given = (Option<v1::Vec3>, Option<f32>, Option<v1::Quat>);

/// Checks position and rotation of a message and makes them native. Values that are not given come
/// from `at`.
pub(super) fn place(
    path: &Path<'_>,
    (position, heading, rotation): Given,
    convention: Convention,
    at: Transform,
) -> Result<Transform, FieldError> {
    let position = match position {
        Some(given) => units::vector(&path.field("position"), given, MAX_COORDINATE_M, convention)?,
        None => at.position,
    };
    let rotation = match (heading, rotation) {
        (None, None) => at.rotation,
        (Some(heading), None) => yaw(units::heading(&path.field("heading"), heading, convention)?),
        (None, Some(given)) => convention.rotation_to_native(unit(&path.field("rotation"), given)?),
        (Some(_), Some(_)) => {
            return Err(path
                .field("rotation")
                .error("is given together with heading", "at most one of the two"));
        }
    };
    Ok(Transform::new(position, rotation))
}

/// Checks that a rotation's length is about 1, and makes it exactly 1.
fn unit(path: &Path<'_>, given: v1::Quat) -> Result<Quat, FieldError> {
    let rotation = Quat::from_xyzw(given.x, given.y, given.z, given.w);
    let length = rotation.length();
    let (low, high) = (1.0 - UNIT_TOLERANCE, 1.0 + UNIT_TOLERANCE);
    match (low..=high).contains(&length) {
        true => Ok(rotation / length),
        false => Err(path.error(
            format!("has length {length}"),
            format!("unit length, {low} to {high}"),
        )),
    }
}

/// The message of a whole scene.
pub(super) fn write_scene(
    name: &str,
    cell: &SceneCell,
    convention: Convention,
    with_colliders: bool,
) -> v1::Scene {
    let scene = cell.snapshot();
    let mut objects: Vec<v1::SceneObject> = scene
        .instances()
        .map(|instance| write_object(instance, convention))
        .collect();
    objects.sort_by(|a, b| a.id.cmp(&b.id));
    let colliders = with_colliders.then(|| scene.colliders()).into_iter().flatten();
    v1::Scene {
        name: name.to_owned(),
        convention: units::convention_name(convention).into(),
        ground: scene.ground_y_m() * convention.units_per_metre(),
        colliders: colliders
            .map(|collider| write_collider(collider, convention))
            .collect(),
        objects,
        revision: scene.revision(),
        sessions: cell.residents() as u32,
    }
}

/// The message of a scene in a list of scenes.
pub(super) fn summary(name: &str, cell: &SceneCell) -> v1::SceneSummary {
    let scene = cell.snapshot();
    v1::SceneSummary {
        name: name.to_owned(),
        revision: scene.revision(),
        colliders: scene.colliders().len() as u32,
        objects: scene.len() as u32,
        sessions: cell.residents() as u32,
    }
}

fn write_collider(collider: &Collider, convention: Convention) -> v1::Collider {
    v1::Collider {
        id: collider.id.clone(),
        position: Some(position(collider.transform.position, convention)),
        heading: None,
        rotation: Some(quat(collider.transform.rotation, convention)),
        shape: Some(shape::write(&collider.shape, convention)),
    }
}

/// The message of an object.
pub(super) fn write_object(instance: &Instance, convention: Convention) -> v1::SceneObject {
    let state = match &instance.state {
        State::Free => v1::ObjectState::Free,
        State::Reserved(_) => v1::ObjectState::Reserved,
        State::Held(_) => v1::ObjectState::Held,
    };
    let holder = instance.state.holder();
    v1::SceneObject {
        id: instance.id.to_string(),
        definition: instance.object.to_string(),
        position: Some(position(instance.transform.position, convention)),
        heading: None,
        rotation: Some(quat(instance.transform.rotation, convention)),
        state: state.into(),
        holder: holder.map(|by| by.session.to_string()).unwrap_or_default(),
        revision: instance.revision,
    }
}

#[cfg(test)]
#[path = "message_tests.rs"]
mod tests;
