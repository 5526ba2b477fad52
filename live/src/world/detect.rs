//! The call `Detect`: the objects in front of a character, or on the way of any box.

use std::sync::Arc;

use troupe_motion::conventions::Convention;
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Vec3};
use troupe_proto::v1;

use super::WorldError;
use super::message::write_object;
use super::{Store, definition, shape};
use crate::wire::units;
use troupe_character::object::DefinitionList;
use troupe_character::scene::{self, BoxTrace, MAX_COORDINATE_M, SceneCell, State, Transform};
use troupe_character::{FieldError, Path};

/// Half the size of a character's box: to the sides, up and down, and to front and back, metres.
const CHARACTER_HALF_EXTENTS_M: Vec3 = Vec3::new(0.25, 0.9, 0.25);
/// Maximum distance by which a character's box is moved ahead, metres.
const MAX_AHEAD_M: f32 = 100.0;

/// Scene and position of a session's character.
#[derive(Debug)]
pub struct CharacterPlace {
    /// Name of the scene.
    pub scene: Arc<str>,
    /// The scene and its objects.
    pub cell: Arc<SceneCell>,
    /// Position in metres and heading in radians, native axes.
    pub root: GlobalRoot,
    /// Axes and units of the answer.
    pub convention: Convention,
    /// Name of the character's pack.
    pub pack: String,
}

/// A checked request.
struct Question {
    scene: Arc<str>,
    cell: Arc<SceneCell>,
    trace: BoxTrace,
    convention: Convention,
    /// Name of the character's pack. `None` for a box.
    pack: Option<String>,
    only_free: bool,
}

impl Store {
    /// `troupe.v1.Scenes/Detect`. `standing` returns the place of a session's character.
    ///
    /// # Errors
    /// [`WorldError`] for a value that is not accepted, or for an unknown session or scene.
    pub fn detect<E: From<WorldError>>(
        &self,
        request: &v1::DetectRequest,
        standing: impl FnOnce(&str) -> Result<CharacterPlace, E>,
    ) -> Result<v1::DetectResponse, E> {
        let root = Path::root();
        let question = match (&request.r#box, request.session_id.as_str()) {
            (None, "") => {
                let error = root.field("session_id").error("is empty", "a session, or a box");
                Err(error.into())
            }
            (None, id) => of_session(&root, request, standing(id)?).map_err(WorldError::from),
            (Some(given), "") => self.of_box(&root, request, given),
            (Some(_), _) => {
                let error = root
                    .field("box")
                    .error("is given together with session_id", "one of the two");
                Err(error.into())
            }
        };
        Ok(question?.answer(&self.definitions().snapshot()))
    }

    fn of_box(
        &self,
        root: &Path<'_>,
        request: &v1::DetectRequest,
        given: &v1::DetectBox,
    ) -> Result<Question, WorldError> {
        let convention = units::convention(&root.field("convention"), request.convention)?;
        let path = root.field("box");
        if given.scene.is_empty() {
            return Err(path
                .field("scene")
                .error("is empty", "the name of a scene")
                .into());
        }
        let cell = self.scene(&given.scene, &path.field("scene"))?;
        let vector = |name, value: Option<v1::Vec3>| {
            let value = value.unwrap_or_default();
            units::vector(&path.field(name), value, MAX_COORDINATE_M, convention)
        };
        let heading = units::heading(&path.field("heading"), given.heading, convention)?;
        let start = Transform::upright(vector("center", given.center)?, heading);
        let half = shape::half_extents(&path.field("half_extents"), given.half_extents, convention)?;
        let trace = BoxTrace::new(start, half, vector("sweep", given.sweep)?);
        Ok(Question {
            scene: Arc::from(given.scene.as_str()),
            cell,
            trace: trace.map_err(|error| scene::field_error(&path, error))?,
            convention,
            pack: None,
            only_free: request.only_free,
        })
    }
}

fn of_session(
    root: &Path<'_>,
    request: &v1::DetectRequest,
    standing: CharacterPlace,
) -> Result<Question, FieldError> {
    let path = root.field("ahead");
    let unit = standing.convention.units_per_metre();
    let ahead_m = units::within(&path, request.ahead, 0.0, MAX_AHEAD_M * unit)? / unit;
    let start = Transform::upright(standing.root.position, standing.root.heading);
    let sweep = yaw(standing.root.heading) * Vec3::Z * ahead_m;
    Ok(Question {
        trace: BoxTrace::new(start, CHARACTER_HALF_EXTENTS_M, sweep)
            .map_err(|error| scene::field_error(&path, error))?,
        scene: standing.scene,
        cell: standing.cell,
        convention: standing.convention,
        pack: Some(standing.pack),
        only_free: request.only_free,
    })
}

impl Question {
    fn answer(&self, definitions: &DefinitionList) -> v1::DetectResponse {
        let scene = self.cell.snapshot();
        let found = scene.detect(&self.trace);
        let objects = found
            .iter()
            .filter(|found| !self.only_free || found.instance.state == State::Free)
            .map(|found| self.detected(found, definitions));
        v1::DetectResponse {
            objects: objects.collect(),
            revision: scene.revision(),
            scene: self.scene.to_string(),
        }
    }

    fn detected(&self, found: &scene::Detected, definitions: &DefinitionList) -> v1::Detected {
        let (instance, convention) = (&found.instance, self.convention);
        let mut message = v1::Detected {
            object: Some(write_object(instance, convention)),
            distance: found.distance_m * convention.units_per_metre(),
            share: found.share,
            free: instance.state == State::Free,
            ..v1::Detected::default()
        };
        // A definition with objects cannot be removed. But this snapshot may be older than its
        // removal.
        if let Ok(listed) = definitions.get(&instance.object) {
            let definition = &listed.definition;
            let side = definition.side_of(instance.transform, self.trace.center());
            let choice = definition.approach_from(side);
            let approach = choice.index.and_then(|index| definition.approaches.get(index));
            message.side = convention.heading_from_native(side);
            message.approach = approach.map(|approach| approach.name.clone()).unwrap_or_default();
            message.off = choice.off;
            message.variants = definition::variants(definition);
            message.usable = self.pack.as_ref().is_none_or(|pack| *pack == definition.pack);
        }
        message
    }
}
