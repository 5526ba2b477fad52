//! Scenes and definitions of objects.

use std::future::Future;

use troupe_motion::conventions::Convention;
use troupe_proto::v1;

use crate::connection::{Client, ScenesRpc};
use crate::error::ClientError;
use crate::live::convention_to_wire;
use crate::pack::Pack;
use crate::route::MOVES;

impl Client {
    /// Creates a scene, or replaces the scene of its name. Sessions in it go on in the new one. The
    /// scene uses the convention that it names.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn put_scene(&self, scene: v1::Scene) -> Result<v1::SceneSummary, ClientError> {
        let name = scene.name.clone();
        let request = v1::PutSceneRequest {
            scene: Some(scene),
            ..v1::PutSceneRequest::default()
        };
        self.scenes_call(&name, request, |mut rpc, request| async move {
            rpc.put_scene(request).await
        })
        .await
    }

    /// The same as [`Client::put_scene`], for a scene as text.
    ///
    /// # Errors
    /// See [`ClientError`]. A refusal names line, column and field.
    pub async fn put_scene_document(&self, document: v1::Document) -> Result<v1::SceneSummary, ClientError> {
        let request = v1::PutSceneRequest {
            document: Some(document),
            ..v1::PutSceneRequest::default()
        };
        self.scenes_call("", request, |mut rpc, request| async move {
            rpc.put_scene(request).await
        })
        .await
    }

    /// A scene as it is now, in a convention.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn scene(&self, name: &str, convention: Convention) -> Result<v1::Scene, ClientError> {
        let request = v1::GetSceneRequest {
            name: name.to_owned(),
            convention: convention_to_wire(convention).into(),
            without_colliders: false,
        };
        self.scenes_call(name, request, |mut rpc, request| async move {
            rpc.get_scene(request).await
        })
        .await
    }

    /// All scenes of the server, by name.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn scenes(&self) -> Result<Vec<v1::SceneSummary>, ClientError> {
        let request = v1::ListScenesRequest {};
        let answer = self.scenes_call("", request, |mut rpc, request| async move {
            rpc.list_scenes(request).await
        });
        Ok(answer.await?.scenes)
    }

    /// Deletes a scene in which there are no sessions.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn delete_scene(&self, name: &str) -> Result<(), ClientError> {
        let request = v1::DeleteSceneRequest {
            name: name.to_owned(),
        };
        self.scenes_call(name, request, |mut rpc, request| async move {
            rpc.delete_scene(request).await
        })
        .await
        .map(|_| ())
    }

    /// Puts objects into a scene. The answer has the result of each.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn add_objects(
        &self,
        scene: &str,
        convention: Convention,
        objects: Vec<v1::SceneObject>,
    ) -> Result<v1::ObjectsResponse, ClientError> {
        let request = v1::AddObjectsRequest {
            scene: scene.to_owned(),
            convention: convention_to_wire(convention).into(),
            objects,
        };
        self.scenes_call(scene, request, |mut rpc, request| async move {
            rpc.add_objects(request).await
        })
        .await
    }

    /// Moves objects of a scene. The answer has the result of each.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn move_objects(
        &self,
        scene: &str,
        convention: Convention,
        moves: Vec<v1::ObjectMove>,
    ) -> Result<v1::ObjectsResponse, ClientError> {
        let request = v1::MoveObjectsRequest {
            scene: scene.to_owned(),
            convention: convention_to_wire(convention).into(),
            moves,
        };
        self.scenes_call(scene, request, |mut rpc, request| async move {
            rpc.move_objects(request).await
        })
        .await
    }

    /// Takes objects out of a scene. The answer has the result of each.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn remove_objects(
        &self,
        scene: &str,
        ids: impl IntoIterator<Item = impl Into<String>>,
    ) -> Result<v1::ObjectsResponse, ClientError> {
        let request = v1::RemoveObjectsRequest {
            scene: scene.to_owned(),
            ids: ids.into_iter().map(Into::into).collect(),
        };
        self.scenes_call(scene, request, |mut rpc, request| async move {
            rpc.remove_objects(request).await
        })
        .await
    }

    /// Adds an object definition for the characters of a pack, or replaces the definition of its
    /// name.
    ///
    /// # Errors
    /// See [`ClientError`]. A refusal names line, column and field.
    pub async fn put_object(
        &self,
        pack: &Pack,
        document: v1::Document,
    ) -> Result<v1::PutObjectDefinitionResponse, ClientError> {
        self.upload_object(pack, document, false).await
    }

    /// Checks an object definition for the characters of a pack. Nothing changes.
    ///
    /// # Errors
    /// As [`Client::put_object`].
    pub async fn check_object(
        &self,
        pack: &Pack,
        document: v1::Document,
    ) -> Result<v1::PutObjectDefinitionResponse, ClientError> {
        self.upload_object(pack, document, true).await
    }

    async fn upload_object(
        &self,
        pack: &Pack,
        document: v1::Document,
        check_only: bool,
    ) -> Result<v1::PutObjectDefinitionResponse, ClientError> {
        let request = v1::PutObjectDefinitionRequest {
            pack: pack.name().to_owned(),
            document: Some(document),
            name: String::new(),
            check_only,
        };
        self.scenes_call("", request, |mut rpc, request| async move {
            rpc.put_object_definition(request).await
        })
        .await
    }

    /// One object definition with its document.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn object(
        &self,
        name: &str,
        format: v1::DocumentFormat,
    ) -> Result<v1::GetObjectDefinitionResponse, ClientError> {
        let request = v1::GetObjectDefinitionRequest {
            name: name.to_owned(),
            format: format.into(),
        };
        self.scenes_call("", request, |mut rpc, request| async move {
            rpc.get_object_definition(request).await
        })
        .await
    }

    /// All object definitions of the server, by name.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn objects(&self) -> Result<Vec<v1::ObjectDefinition>, ClientError> {
        let request = v1::ListObjectDefinitionsRequest {};
        let answer = self.scenes_call("", request, |mut rpc, request| async move {
            rpc.list_object_definitions(request).await
        });
        Ok(answer.await?.definitions)
    }

    /// Deletes an object definition of which no scene has an object.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn delete_object(&self, name: &str) -> Result<(), ClientError> {
        let request = v1::DeleteObjectDefinitionRequest {
            name: name.to_owned(),
        };
        self.scenes_call("", request, |mut rpc, request| async move {
            rpc.delete_object_definition(request).await
        })
        .await
        .map(|_| ())
    }

    /// The objects that a character, or any box, reaches in its scene.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn detect(&self, request: v1::DetectRequest) -> Result<v1::DetectResponse, ClientError> {
        // A session is where this client's sessions are.
        let scene = (request.r#box.as_ref()).map_or_else(String::new, |of| of.scene.clone());
        self.scenes_call(&scene, request, |mut rpc, request| async move {
            rpc.detect(request).await
        })
        .await
    }

    /// A call about the scene of this name, or about none if the name is empty. If another server
    /// has the scene, the call is made again there.
    async fn scenes_call<R, T, F>(
        &self,
        scene: &str,
        request: R,
        call: impl Fn(ScenesRpc, R) -> F,
    ) -> Result<T, ClientError>
    where
        R: Clone,
        F: Future<Output = Result<tonic::Response<T>, tonic::Status>>,
    {
        let way = self.way.to_scene(scene);
        let mut moves = 0;
        loop {
            let error = match call(self.scenes_rpc(&way), request.clone()).await {
                Ok(answer) => return Ok(answer.into_inner()),
                Err(status) => self.sort(&status),
            };
            let is_elsewhere = error.session_problem().is_some_and(|problem| way.follow(problem));
            if !is_elsewhere || moves == MOVES {
                return Err(error);
            }
            moves += 1;
        }
    }
}
