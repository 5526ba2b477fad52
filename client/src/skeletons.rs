//! Skeletons of users' own characters.

use std::future::Future;

use troupe_proto::v1;
use troupe_proto::v1::put_skeleton_request::Source;

use crate::connection::{Client, SkeletonsRpc};
use crate::error::ClientError;
use crate::pack::Pack;

impl Client {
    /// Adds a skeleton for the motion of a pack, or replaces one that no session wears. `file` is
    /// the name of a character's file, whose ending says the format, and its bytes. The answer has
    /// the certificate. [`Pack::wearing`] makes a pack whose characters wear the skeleton.
    ///
    /// # Errors
    /// See [`ClientError`]. A skeleton that does not fit is refused with motion and joint, unless
    /// `force` is set.
    pub async fn put_skeleton(
        &self,
        name: &str,
        file: (&str, Vec<u8>),
        pack: &Pack,
        force: bool,
    ) -> Result<v1::OwnSkeleton, ClientError> {
        let source = Source::File(v1::SkeletonFile {
            name: file.0.to_owned(),
            data: file.1,
        });
        self.put_source(name, source, pack, force).await
    }

    /// Adds a skeleton of these joints, or replaces one that no session wears, as
    /// [`Self::put_skeleton`] does with a file.
    ///
    /// # Errors
    /// As [`Self::put_skeleton`].
    pub async fn put_joints(
        &self,
        name: &str,
        joints: v1::BodySkeleton,
        pack: &Pack,
        force: bool,
    ) -> Result<v1::OwnSkeleton, ClientError> {
        self.put_source(name, Source::Joints(joints), pack, force).await
    }

    async fn put_source(
        &self,
        name: &str,
        source: Source,
        pack: &Pack,
        force: bool,
    ) -> Result<v1::OwnSkeleton, ClientError> {
        let request = v1::PutSkeletonRequest {
            name: name.to_owned(),
            source: Some(source),
            pack: pack.name().to_owned(),
            body: pack.body().to_owned(),
            force,
            ..v1::PutSkeletonRequest::default()
        };
        self.skeletons_call(|mut rpc| async move { rpc.put_skeleton(request).await })
            .await
    }

    /// A skeleton, and its certificate for a pack.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn skeleton(&self, name: &str, pack: &Pack) -> Result<v1::OwnSkeleton, ClientError> {
        let request = v1::GetSkeletonRequest {
            name: name.to_owned(),
            pack: pack.name().to_owned(),
            body: pack.body().to_owned(),
        };
        self.skeletons_call(|mut rpc| async move { rpc.get_skeleton(request).await })
            .await
    }

    /// All skeletons of the server, by name.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn skeletons(&self) -> Result<Vec<v1::SkeletonSummary>, ClientError> {
        let request = v1::ListSkeletonsRequest {};
        let answer = self.skeletons_call(|mut rpc| async move { rpc.list_skeletons(request).await });
        Ok(answer.await?.skeletons)
    }

    /// Deletes a skeleton that no session wears.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn delete_skeleton(&self, name: &str) -> Result<(), ClientError> {
        let request = v1::DeleteSkeletonRequest {
            name: name.to_owned(),
        };
        self.skeletons_call(|mut rpc| async move { rpc.delete_skeleton(request).await })
            .await
            .map(drop)
    }

    async fn skeletons_call<T, F>(&self, call: impl FnOnce(SkeletonsRpc) -> F) -> Result<T, ClientError>
    where
        F: Future<Output = Result<tonic::Response<T>, tonic::Status>>,
    {
        let answer = call(self.skeletons_rpc()).await;
        Ok(answer.map_err(|status| self.sort(&status))?.into_inner())
    }
}
