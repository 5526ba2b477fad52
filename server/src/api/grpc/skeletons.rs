//! The Skeletons service over gRPC.

use std::sync::Arc;

use tonic::{Request, Response, Status};
use troupe_proto::v1;
use troupe_proto::v1::skeletons_server::Skeletons;

use super::answer;
use crate::api::ours::ours;
use troupe_service::Service;

/// The Skeletons service.
pub(super) struct SkeletonsApi(pub(super) Arc<Service>);

#[tonic::async_trait]
impl Skeletons for SkeletonsApi {
    async fn put_skeleton(
        &self,
        request: Request<v1::PutSkeletonRequest>,
    ) -> Result<Response<v1::OwnSkeleton>, Status> {
        let service = ours(&self.0, &request).await?;
        answer(service.put_skeleton(request.into_inner()).await)
    }

    async fn get_skeleton(
        &self,
        request: Request<v1::GetSkeletonRequest>,
    ) -> Result<Response<v1::OwnSkeleton>, Status> {
        let service = ours(&self.0, &request).await?;
        answer(service.get_skeleton(request.into_inner()).await)
    }

    async fn list_skeletons(
        &self,
        request: Request<v1::ListSkeletonsRequest>,
    ) -> Result<Response<v1::ListSkeletonsResponse>, Status> {
        answer(ours(&self.0, &request).await?.list_skeletons())
    }

    async fn delete_skeleton(
        &self,
        request: Request<v1::DeleteSkeletonRequest>,
    ) -> Result<Response<v1::DeleteSkeletonResponse>, Status> {
        let service = ours(&self.0, &request).await?;
        answer(service.delete_skeleton(request.into_inner()).await)
    }
}
