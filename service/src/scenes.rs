//! The calls of `troupe.v1.Scenes`.

use std::sync::Arc;

use troupe_proto::v1;

use crate::{Service, ServiceError};
use troupe_base::offload::offload;
use troupe_live::world::{ObjectsChanged, Store, WorldError};

/// Most objects of a call that is served on its own task.
const INLINE_OBJECTS: usize = 64;

impl Service {
    /// Runs slow work, or work that may write a file, on the pool for blocking work.
    async fn blocking<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Store) -> Result<T, WorldError> + Send + 'static,
    ) -> Result<T, ServiceError> {
        let store = Arc::clone(self.store()?);
        Ok(offload(usize::MAX, 0, move || work(&store)).await??)
    }

    /// Changes objects of a scene, on the server that has the scene. Without a shared store, a
    /// call for few objects is served on its own task.
    async fn change_objects(
        &self,
        objects: usize,
        scene: String,
        work: impl FnOnce(&Store) -> Result<ObjectsChanged, WorldError> + Send + 'static,
    ) -> Result<ObjectsChanged, ServiceError> {
        let (sessions, store) = (self.sessions().clone(), Arc::clone(self.store()?));
        let objects = if sessions.are_shared() {
            usize::MAX
        } else {
            objects
        };
        let changed = offload(objects, INLINE_OBJECTS, move || {
            sessions.own_scene(&scene, &store)?;
            Ok::<_, ServiceError>(work(&store)?)
        });
        changed.await?
    }

    /// `troupe.v1.Scenes/PutScene`.
    ///
    /// # Errors
    /// [`ServiceError`] for the first value that is not accepted, or if the scene cannot be saved.
    pub async fn put_scene(&self, request: v1::PutSceneRequest) -> Result<v1::SceneSummary, ServiceError> {
        let put = self.blocking(move |store| store.put(&request)).await?;
        self.common.metrics.scenes_uploaded.increment(1);
        Ok(put)
    }

    /// `troupe.v1.Scenes/GetScene`.
    ///
    /// # Errors
    /// [`ServiceError`] if there is no such scene, or if another server has it.
    pub async fn get_scene(&self, request: v1::GetSceneRequest) -> Result<v1::Scene, ServiceError> {
        self.sessions().check_scene(&request.name, "name").await?;
        // A scene may have a million heights.
        self.blocking(move |store| store.get(&request)).await
    }

    /// `troupe.v1.Scenes/ListScenes`.
    ///
    /// # Errors
    /// [`ServiceError::Starting`] while the server starts.
    pub fn list_scenes(&self) -> Result<v1::ListScenesResponse, ServiceError> {
        self.store().map(|store| store.list())
    }

    /// `troupe.v1.Scenes/DeleteScene`.
    ///
    /// # Errors
    /// [`ServiceError`] if there is no such scene, or if sessions are in it.
    pub async fn delete_scene(
        &self,
        request: v1::DeleteSceneRequest,
    ) -> Result<v1::DeleteSceneResponse, ServiceError> {
        self.blocking(move |store| store.delete(&request)).await
    }

    /// `troupe.v1.Scenes/AddObjects`.
    ///
    /// # Errors
    /// [`ServiceError`] for the request as a whole.
    pub async fn add_objects(&self, request: v1::AddObjectsRequest) -> Result<ObjectsChanged, ServiceError> {
        // This waits for definitions that are being uploaded.
        self.change_objects(usize::MAX, request.scene.clone(), move |store| {
            store.add_objects(&request)
        })
        .await
    }

    /// `troupe.v1.Scenes/MoveObjects`.
    ///
    /// # Errors
    /// [`ServiceError`] for the request as a whole.
    pub async fn move_objects(
        &self,
        request: v1::MoveObjectsRequest,
    ) -> Result<ObjectsChanged, ServiceError> {
        self.change_objects(request.moves.len(), request.scene.clone(), move |store| {
            store.move_objects(&request)
        })
        .await
    }

    /// `troupe.v1.Scenes/RemoveObjects`.
    ///
    /// # Errors
    /// [`ServiceError`] for the request as a whole.
    pub async fn remove_objects(
        &self,
        request: v1::RemoveObjectsRequest,
    ) -> Result<ObjectsChanged, ServiceError> {
        self.change_objects(request.ids.len(), request.scene.clone(), move |store| {
            store.remove_objects(&request)
        })
        .await
    }

    /// `troupe.v1.Scenes/PutObjectDefinition`.
    ///
    /// # Errors
    /// [`ServiceError`] for the first error in the document, or if it cannot be saved.
    pub async fn put_object_definition(
        &self,
        request: v1::PutObjectDefinitionRequest,
    ) -> Result<v1::PutObjectDefinitionResponse, ServiceError> {
        let pack = self.pack(&request.pack)?.pack.rig.clone();
        let put = self
            .blocking(move |store| store.put_object(&request, &pack))
            .await?;
        self.common.metrics.objects_uploaded.increment(1);
        Ok(put)
    }

    /// `troupe.v1.Scenes/GetObjectDefinition`.
    ///
    /// # Errors
    /// [`ServiceError`] if there is no such definition.
    pub async fn get_object_definition(
        &self,
        request: v1::GetObjectDefinitionRequest,
    ) -> Result<v1::GetObjectDefinitionResponse, ServiceError> {
        self.blocking(move |store| store.get_object(&request)).await
    }

    /// `troupe.v1.Scenes/ListObjectDefinitions`.
    ///
    /// # Errors
    /// [`ServiceError::Starting`] while the server starts.
    pub async fn list_object_definitions(&self) -> Result<v1::ListObjectDefinitionsResponse, ServiceError> {
        // This counts the objects of all scenes.
        self.blocking(|store| Ok(store.list_objects())).await
    }

    /// `troupe.v1.Scenes/DeleteObjectDefinition`.
    ///
    /// # Errors
    /// [`ServiceError`] if there is no such definition, or if scenes have objects of it.
    pub async fn delete_object_definition(
        &self,
        request: v1::DeleteObjectDefinitionRequest,
    ) -> Result<v1::DeleteObjectDefinitionResponse, ServiceError> {
        self.blocking(move |store| store.delete_object(&request)).await
    }

    /// `troupe.v1.Scenes/Detect`.
    ///
    /// # Errors
    /// [`ServiceError`] if a value is not accepted, if there is no such session or scene, or if
    /// another server has it.
    pub async fn detect(&self, request: &v1::DetectRequest) -> Result<v1::DetectResponse, ServiceError> {
        let sessions = self.sessions();
        match &request.r#box {
            None => sessions.bring([&request.session_id]).await,
            Some(given) => sessions.check_scene(&given.scene, "box.scene").await?,
        }
        let standing = |id: &str| sessions.standing(id, "session_id").map_err(ServiceError::from);
        self.store()?.detect(request, standing)
    }
}
