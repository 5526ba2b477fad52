//! The calls of `troupe.v1.Skeletons`.

use troupe_base::offload::offload;
use troupe_live::session::Space;
use troupe_live::skeleton::SkeletonError;
use troupe_proto::v1;

use crate::{Service, ServiceError};

impl Service {
    /// Runs work with the skeletons that takes milliseconds or writes a file.
    async fn with_skeletons<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Space) -> Result<T, SkeletonError> + Send + 'static,
    ) -> Result<T, ServiceError> {
        let space = self.space()?.clone();
        Ok(offload(usize::MAX, 0, move || work(&space)).await??)
    }

    /// `troupe.v1.Skeletons/PutSkeleton`.
    ///
    /// # Errors
    /// [`ServiceError`] for the first value that is not accepted, if the skeleton does not fit, or
    /// if it cannot be saved.
    pub async fn put_skeleton(
        &self,
        request: v1::PutSkeletonRequest,
    ) -> Result<v1::OwnSkeleton, ServiceError> {
        let put = self.with_skeletons(move |space| {
            let (table, store) = (&space.packs.table(), &space.store);
            store.skeletons().put_call(&request, table, store.memory())
        });
        let put = put.await?;
        self.common.metrics.skeletons_uploaded.increment(1);
        Ok(put)
    }

    /// `troupe.v1.Skeletons/GetSkeleton`.
    ///
    /// # Errors
    /// [`ServiceError`] if there is no such skeleton, pack or body.
    pub async fn get_skeleton(
        &self,
        request: v1::GetSkeletonRequest,
    ) -> Result<v1::OwnSkeleton, ServiceError> {
        self.with_skeletons(move |space| space.store.skeletons().get_call(&request, &space.packs.table()))
            .await
    }

    /// `troupe.v1.Skeletons/ListSkeletons`.
    ///
    /// # Errors
    /// [`ServiceError::Starting`] while the server starts.
    pub fn list_skeletons(&self) -> Result<v1::ListSkeletonsResponse, ServiceError> {
        Ok(self.store()?.skeletons().list_call())
    }

    /// `troupe.v1.Skeletons/DeleteSkeleton`.
    ///
    /// # Errors
    /// [`ServiceError`] if there is no such skeleton, or if characters wear it.
    pub async fn delete_skeleton(
        &self,
        request: v1::DeleteSkeletonRequest,
    ) -> Result<v1::DeleteSkeletonResponse, ServiceError> {
        self.with_skeletons(move |space| space.store.skeletons().delete_call(&request))
            .await
    }
}
