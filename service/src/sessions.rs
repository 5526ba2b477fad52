//! The calls of `troupe.v1.Sessions` that need packs.

use std::sync::Arc;

use troupe_proto::v1;

use crate::{Service, ServiceError, Streamed};
use troupe_base::offload::WorkerStopped;
use troupe_base::turns::Turns;
use troupe_live::session::recording::Replaying;
use troupe_live::session::{Resumed, Sessions, Space, styles};

impl Service {
    /// The sessions and streams. Only creating them needs packs.
    pub fn sessions(&self) -> &Arc<Sessions> {
        match &self.space {
            Some(space) => &space.sessions,
            None => &self.common.sessions,
        }
    }

    /// `troupe.v1.Sessions/CreateSessions`.
    ///
    /// # Errors
    /// [`ServiceError`] if a session cannot be opened. Then none is opened.
    pub async fn create_sessions(
        &self,
        request: v1::CreateSessionsRequest,
    ) -> Result<v1::CreateSessionsResponse, ServiceError> {
        let Space { packs, store, .. } = &**self.space()?;
        Ok(self.sessions().create(packs, store, request).await?)
    }

    /// `troupe.v1.Sessions/ResumeSessions`. While the server starts this is an error: no sessions
    /// are loaded yet, and that does not mean that they are gone.
    ///
    /// # Errors
    /// [`ServiceError`] for the request as a whole. The error of a single session is in its
    /// problem.
    pub async fn resume_sessions(
        &self,
        request: v1::ResumeSessionsRequest,
        turns: Turns,
    ) -> Result<Resumed, ServiceError> {
        self.space()?;
        Ok(self.sessions().resume(request, turns).await?)
    }

    /// `troupe.v1.Sessions/Replay`.
    ///
    /// # Errors
    /// [`ServiceError`] for a recording that cannot be played here.
    pub fn replay(&self, request: v1::ReplayRequest, turns: Turns) -> Result<Replaying, ServiceError> {
        let Space { packs, store, .. } = &**self.space()?;
        Ok(self.sessions().replay(packs, store, request, turns)?)
    }

    /// `troupe.v1.Sessions/ListStyles`.
    ///
    /// # Errors
    /// [`ServiceError::UnknownPack`], [`SessionError::UnknownBody`], or [`ServiceError::Starting`]
    /// while the server starts.
    pub fn list_styles(
        &self,
        request: &v1::ListStylesRequest,
    ) -> Result<v1::ListStylesResponse, ServiceError> {
        let loaded = self.pack(&request.pack)?;
        Ok(styles::list(&loaded, &request.body)?)
    }

    /// `troupe.v1.Sessions/GetStyle`.
    ///
    /// # Errors
    /// [`ServiceError::UnknownPack`], [`SessionError::UnknownStyle`], or [`ServiceError::Starting`]
    /// while the server starts.
    pub fn get_style(&self, request: &v1::GetStyleRequest) -> Result<v1::Style, ServiceError> {
        Ok(styles::get(
            &*self.pack(&request.pack)?,
            &request.body,
            &request.style,
        )?)
    }

    /// `troupe.v1.Sessions/PutStyle`.
    ///
    /// # Errors
    /// [`ServiceError`] for the first value that is not accepted, or if the style cannot be saved.
    pub async fn put_style(&self, request: v1::PutStyleRequest) -> Result<v1::Style, ServiceError> {
        let pack = self.pack(&request.pack)?;
        let store = self.space()?.store.clone();
        // This may write a file.
        let put = move || styles::put(&pack, &request.body, request.style.as_ref(), &store);
        let put = tokio::task::spawn_blocking(put);
        let style = put.await.map_err(|_| WorkerStopped)??;
        self.common.metrics.styles_uploaded.increment(1);
        Ok(style)
    }
}

impl Streamed for Replaying {
    type Part = v1::ReplayResponse;

    async fn next(&mut self) -> Option<Result<v1::ReplayResponse, ServiceError>> {
        // The name is also that of the trait's method.
        Some(Self::next(self).await?.map_err(Into::into))
    }
}
