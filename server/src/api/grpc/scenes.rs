//! The Scenes service over gRPC.

use std::sync::Arc;

use tonic::{Request, Response, Status};
use troupe_proto::v1;
use troupe_proto::v1::scenes_server::Scenes;

use super::answer;
use crate::api::answers;
use crate::api::ours::ours;
use troupe_service::Service;

/// The Scenes service.
pub(super) struct ScenesApi(pub(super) Arc<Service>);

#[tonic::async_trait]
impl Scenes for ScenesApi {
    async fn put_scene(
        &self,
        request: Request<v1::PutSceneRequest>,
    ) -> Result<Response<v1::SceneSummary>, Status> {
        answer(
            ours(&self.0, &request)
                .await?
                .put_scene(request.into_inner())
                .await,
        )
    }

    async fn get_scene(&self, request: Request<v1::GetSceneRequest>) -> Result<Response<v1::Scene>, Status> {
        answer(
            ours(&self.0, &request)
                .await?
                .get_scene(request.into_inner())
                .await,
        )
    }

    async fn list_scenes(
        &self,
        request: Request<v1::ListScenesRequest>,
    ) -> Result<Response<v1::ListScenesResponse>, Status> {
        answer(ours(&self.0, &request).await?.list_scenes())
    }

    async fn delete_scene(
        &self,
        request: Request<v1::DeleteSceneRequest>,
    ) -> Result<Response<v1::DeleteSceneResponse>, Status> {
        answer(
            ours(&self.0, &request)
                .await?
                .delete_scene(request.into_inner())
                .await,
        )
    }

    async fn add_objects(
        &self,
        request: Request<v1::AddObjectsRequest>,
    ) -> Result<Response<v1::ObjectsResponse>, Status> {
        answer(
            ours(&self.0, &request)
                .await?
                .add_objects(request.into_inner())
                .await
                .map(answers::objects),
        )
    }

    async fn move_objects(
        &self,
        request: Request<v1::MoveObjectsRequest>,
    ) -> Result<Response<v1::ObjectsResponse>, Status> {
        answer(
            ours(&self.0, &request)
                .await?
                .move_objects(request.into_inner())
                .await
                .map(answers::objects),
        )
    }

    async fn remove_objects(
        &self,
        request: Request<v1::RemoveObjectsRequest>,
    ) -> Result<Response<v1::ObjectsResponse>, Status> {
        answer(
            ours(&self.0, &request)
                .await?
                .remove_objects(request.into_inner())
                .await
                .map(answers::objects),
        )
    }

    async fn put_object_definition(
        &self,
        request: Request<v1::PutObjectDefinitionRequest>,
    ) -> Result<Response<v1::PutObjectDefinitionResponse>, Status> {
        answer(
            ours(&self.0, &request)
                .await?
                .put_object_definition(request.into_inner())
                .await,
        )
    }

    async fn get_object_definition(
        &self,
        request: Request<v1::GetObjectDefinitionRequest>,
    ) -> Result<Response<v1::GetObjectDefinitionResponse>, Status> {
        answer(
            ours(&self.0, &request)
                .await?
                .get_object_definition(request.into_inner())
                .await,
        )
    }

    async fn list_object_definitions(
        &self,
        request: Request<v1::ListObjectDefinitionsRequest>,
    ) -> Result<Response<v1::ListObjectDefinitionsResponse>, Status> {
        answer(ours(&self.0, &request).await?.list_object_definitions().await)
    }

    async fn delete_object_definition(
        &self,
        request: Request<v1::DeleteObjectDefinitionRequest>,
    ) -> Result<Response<v1::DeleteObjectDefinitionResponse>, Status> {
        answer(
            ours(&self.0, &request)
                .await?
                .delete_object_definition(request.into_inner())
                .await,
        )
    }

    async fn detect(
        &self,
        request: Request<v1::DetectRequest>,
    ) -> Result<Response<v1::DetectResponse>, Status> {
        answer(ours(&self.0, &request).await?.detect(request.get_ref()).await)
    }
}
