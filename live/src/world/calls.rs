//! The calls of `troupe.v1.Scenes`, independent of HTTP and gRPC. Calls that write files block.

use std::sync::Arc;

use troupe_motion::conventions::Convention;
use troupe_proto::v1;

use super::WorldError;
use super::{Store, StoreError, definition, message};
use crate::wire::units;
use troupe_character::Path;
use troupe_character::document::{Format, read};
use troupe_character::object::Listed;
use troupe_character::scene::{
    MAX_ID_BYTES, MAX_INSTANCES, NamedScene, Scene, SceneCell, SceneDoc, SceneError,
};
use troupe_motion::model::Rig;

/// The answer to a call that changes objects of a scene.
#[derive(Debug)]
pub struct ObjectsChanged {
    /// One result per object, in the request's order.
    pub objects: Vec<ObjectOutcome>,
    /// The scene's revision after the change.
    pub revision: u64,
}

/// Result of one object.
#[derive(Debug)]
pub struct ObjectOutcome {
    /// Id of the object, or the start of what the request gave as one.
    pub id: String,
    /// Why the object was not changed. `None`: it was changed.
    pub error: Option<WorldError>,
}

impl Store {
    /// The scene called `name`, which the field at `path` has.
    pub(super) fn scene(&self, name: &str, path: &Path<'_>) -> Result<Arc<SceneCell>, WorldError> {
        self.scenes().get(name).map_err(|error| WorldError::Scene {
            error,
            field: path.to_string(),
        })
    }

    /// `troupe.v1.Scenes/PutScene`.
    ///
    /// # Errors
    /// [`WorldError`] for the first value that is not accepted, or if the scene cannot be written.
    /// Then nothing has changed.
    pub fn put(&self, request: &v1::PutSceneRequest) -> Result<v1::SceneSummary, WorldError> {
        let root = Path::root();
        let name = match (&request.scene, &request.document) {
            (Some(scene), None) => self.put_scene(None, |definitions| {
                let path = root.field("scene");
                definition::check_name(&scene.name, &request.name)?;
                message::read_scene(&path, scene, definitions)
            })?,
            (None, Some(document)) => {
                let (text, format) = definition::document(&root.field("document"), Some(document))?;
                self.put_text(text, format, &request.name)?
            }
            (None, None) => {
                let path = root.field("scene");
                return Err(path.error("is missing", "a scene, or a document").into());
            }
            (Some(_), Some(_)) => {
                let path = root.field("document");
                return Err(path
                    .error("is given together with scene", "one of the two")
                    .into());
            }
        };
        let cell = self.scene(&name, &root.field("name"))?;
        Ok(message::summary(&name, &cell))
    }

    fn put_text(&self, text: &str, format: Format, wanted: &str) -> Result<String, WorldError> {
        self.put_scene(Some((text, format)), |definitions| {
            let scene = read(text, format, |doc: SceneDoc| {
                definition::check_name(&doc.name, wanted)?;
                NamedScene::from_doc(doc, definitions)
            });
            Ok::<_, WorldError>(scene?)
        })
    }

    /// `troupe.v1.Scenes/GetScene`.
    ///
    /// # Errors
    /// [`WorldError`] for an unknown scene or convention.
    pub fn get(&self, request: &v1::GetSceneRequest) -> Result<v1::Scene, WorldError> {
        let root = Path::root();
        let convention = units::convention(&root.field("convention"), request.convention)?;
        let cell = self.scene(&request.name, &root.field("name"))?;
        Ok(message::write_scene(
            &request.name,
            &cell,
            convention,
            !request.without_colliders,
        ))
    }

    /// `troupe.v1.Scenes/ListScenes`.
    pub fn list(&self) -> v1::ListScenesResponse {
        let scenes = self.scenes().all();
        let each = scenes.iter().map(|(name, cell)| message::summary(name, cell));
        v1::ListScenesResponse {
            scenes: each.collect(),
        }
    }

    /// `troupe.v1.Scenes/DeleteScene`.
    ///
    /// # Errors
    /// [`WorldError`] for an unknown scene, or if sessions are in it.
    pub fn delete(&self, request: &v1::DeleteSceneRequest) -> Result<v1::DeleteSceneResponse, WorldError> {
        self.delete_scene(&request.name)?;
        Ok(v1::DeleteSceneResponse {})
    }

    /// `troupe.v1.Scenes/AddObjects`.
    ///
    /// # Errors
    /// [`WorldError`] for the request as a whole. The error of a single object is in its result.
    pub fn add_objects(&self, request: &v1::AddObjectsRequest) -> Result<ObjectsChanged, WorldError> {
        let root = Path::root();
        let (cell, convention) = self.place_of(&root, &request.scene, request.convention)?;
        units::length(&root.field("objects"), request.objects.len(), 1, MAX_INSTANCES)?;
        Ok(self.definitions().while_unchanged(|definitions| {
            change_each(
                &cell,
                &request.objects,
                |object| &object.id,
                |index, object, scene| {
                    let path = root.element("objects", index);
                    message::add_object(&path, object, convention, definitions, scene)
                },
            )
        }))
    }

    /// `troupe.v1.Scenes/MoveObjects`.
    ///
    /// # Errors
    /// [`WorldError`] for the request as a whole. The error of a single move is in its result.
    pub fn move_objects(&self, request: &v1::MoveObjectsRequest) -> Result<ObjectsChanged, WorldError> {
        let root = Path::root();
        let (cell, convention) = self.place_of(&root, &request.scene, request.convention)?;
        units::length(&root.field("moves"), request.moves.len(), 1, MAX_INSTANCES)?;
        Ok(change_each(
            &cell,
            &request.moves,
            |one| &one.id,
            |index, one, scene| move_object(&root.element("moves", index), one, convention, scene),
        ))
    }

    /// `troupe.v1.Scenes/RemoveObjects`.
    ///
    /// # Errors
    /// [`WorldError`] for the request as a whole. The error of a single id is in its result.
    pub fn remove_objects(&self, request: &v1::RemoveObjectsRequest) -> Result<ObjectsChanged, WorldError> {
        let root = Path::root();
        let cell = self.scene(&request.scene, &root.field("scene"))?;
        units::length(&root.field("ids"), request.ids.len(), 1, MAX_INSTANCES)?;
        Ok(change_each(
            &cell,
            &request.ids,
            |id| id,
            |index, id, scene| {
                let path = root.element("ids", index);
                message::check_id(&path, id)?;
                scene.remove(id).map(drop).map_err(|error| at(&path, error))
            },
        ))
    }

    fn place_of(
        &self,
        root: &Path<'_>,
        scene: &str,
        convention: i32,
    ) -> Result<(Arc<SceneCell>, Convention), WorldError> {
        let convention = units::convention(&root.field("convention"), convention)?;
        Ok((self.scene(scene, &root.field("scene"))?, convention))
    }

    /// `troupe.v1.Scenes/PutObjectDefinition`, for `pack`.
    ///
    /// # Errors
    /// [`WorldError`] for the first error of the document, or if it cannot be written. Then nothing
    /// has changed.
    pub fn put_object(
        &self,
        request: &v1::PutObjectDefinitionRequest,
        pack: &Rig,
    ) -> Result<v1::PutObjectDefinitionResponse, WorldError> {
        let path = Path::root();
        let (text, format) = definition::document(&path.field("document"), request.document.as_ref())?;
        let read = definition::read_definition(text, format, &request.name, pack)?;
        if request.check_only {
            return Ok(v1::PutObjectDefinitionResponse {
                definition: Some(definition::write(&read, 0, 0)),
                replaced: self.definitions().get(&read.name).is_ok(),
                rebound: 0,
            });
        }
        let uploaded = self.put_definition(read, text, format)?;
        let objects = self.objects_of(&uploaded.definition.name);
        Ok(v1::PutObjectDefinitionResponse {
            definition: Some(definition::write(
                &uploaded.definition,
                uploaded.revision,
                objects,
            )),
            replaced: uploaded.replaced.is_some(),
            rebound: uploaded.rebound as u32,
        })
    }

    /// `troupe.v1.Scenes/GetObjectDefinition`.
    ///
    /// # Errors
    /// [`WorldError`] for an unknown definition or format.
    pub fn get_object(
        &self,
        request: &v1::GetObjectDefinitionRequest,
    ) -> Result<v1::GetObjectDefinitionResponse, WorldError> {
        let path = Path::root();
        let format = definition::format(&path.field("format"), request.format)?;
        let Listed { definition, revision } =
            self.definitions().get(&request.name).map_err(StoreError::from)?;
        let objects = self.objects_of(&definition.name);
        Ok(v1::GetObjectDefinitionResponse {
            definition: Some(definition::write(&definition, revision, objects)),
            document: Some(definition::write_document(&definition, format)?),
        })
    }

    /// `troupe.v1.Scenes/ListObjectDefinitions`.
    pub fn list_objects(&self) -> v1::ListObjectDefinitionsResponse {
        let counts = definition::count_objects(self.scenes());
        let list = self.definitions().snapshot();
        let each = list
            .iter()
            .map(|listed| definition::write_listed(listed, &counts));
        v1::ListObjectDefinitionsResponse {
            definitions: each.collect(),
        }
    }

    /// `troupe.v1.Scenes/DeleteObjectDefinition`.
    ///
    /// # Errors
    /// [`WorldError`] for an unknown definition, or if scenes have objects of it.
    pub fn delete_object(
        &self,
        request: &v1::DeleteObjectDefinitionRequest,
    ) -> Result<v1::DeleteObjectDefinitionResponse, WorldError> {
        self.delete_definition(&request.name)?;
        Ok(v1::DeleteObjectDefinitionResponse {})
    }

    fn objects_of(&self, name: &str) -> u32 {
        let counts = definition::count_objects(self.scenes());
        counts.get(name).copied().unwrap_or(0)
    }
}

/// Moves an object of a scene.
fn move_object(
    path: &Path<'_>,
    one: &v1::ObjectMove,
    convention: Convention,
    scene: &mut Scene,
) -> Result<(), WorldError> {
    let id = path.field("id");
    message::check_id(&id, &one.id)?;
    let unknown = || SceneError::Unknown {
        what: "object",
        id: one.id.clone(),
    };
    let now = scene
        .instance(&one.id)
        .ok_or_else(|| at(&id, unknown()))?
        .transform;
    let given = (one.position, one.heading, one.rotation);
    let then = message::place(path, given, convention, now)?;
    scene.move_to(&one.id, then).map_err(|error| at(&id, error))
}

fn at(path: &Path<'_>, error: SceneError) -> WorldError {
    WorldError::Object {
        error,
        field: path.to_string(),
    }
}

/// Calls `change` for each entry of `list` within one update of the scene. Returns all results.
fn change_each<T>(
    cell: &SceneCell,
    list: &[T],
    id: impl Fn(&T) -> &String,
    change: impl Fn(usize, &T, &mut Scene) -> Result<(), WorldError>,
) -> ObjectsChanged {
    let done: Result<_, std::convert::Infallible> = cell.update(|scene| {
        let each = list.iter().enumerate().map(|(index, one)| ObjectOutcome {
            id: id(one).chars().take(MAX_ID_BYTES).collect(),
            error: change(index, one, scene).err(),
        });
        Ok(ObjectsChanged {
            objects: each.collect(),
            revision: scene.revision(),
        })
    });
    let Ok(changed) = done;
    changed
}
