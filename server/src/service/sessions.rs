//! The calls of `troupe.v1.Sessions` on the service: where they need its packs.

use std::sync::Arc;

use troupe_proto::v1;

use super::Service;
use crate::api::ApiError;
use crate::session::{Sessions, styles};

impl Service {
    /// The sessions and streams. They need packs only to be created.
    pub fn sessions(&self) -> &Arc<Sessions> {
        &self.sessions
    }

    /// `troupe.v1.Sessions/CreateSessions`.
    ///
    /// # Errors
    /// [`ApiError`]; no session is open then.
    pub async fn create_sessions(
        &self,
        request: v1::CreateSessionsRequest,
    ) -> Result<v1::CreateSessionsResponse, ApiError> {
        let (packs, store) = self.opened()?;
        self.sessions.create(packs, store, request).await
    }

    /// `troupe.v1.Sessions/ListStyles`.
    ///
    /// # Errors
    /// [`ApiError::UnknownPack`], or [`ApiError::Unavailable`] while the server starts.
    pub fn list_styles(&self, request: &v1::ListStylesRequest) -> Result<v1::ListStylesResponse, ApiError> {
        Ok(styles::list(self.table()?.find("pack", &request.pack)?))
    }

    /// `troupe.v1.Sessions/GetStyle`.
    ///
    /// # Errors
    /// [`ApiError::UnknownPack`], [`ApiError::UnknownStyle`], or [`ApiError::Unavailable`] while the server starts.
    pub fn get_style(&self, request: &v1::GetStyleRequest) -> Result<v1::Style, ApiError> {
        styles::get(self.table()?.find("pack", &request.pack)?, &request.style)
    }

    /// `troupe.v1.Sessions/PutStyle`.
    ///
    /// # Errors
    /// [`ApiError`] for the first value that is not accepted, or where the style cannot be kept.
    pub async fn put_style(&self, request: v1::PutStyleRequest) -> Result<v1::Style, ApiError> {
        let pack = self.table()?.find("pack", &request.pack)?.clone();
        // It may write a file.
        let put = tokio::task::spawn_blocking(move || styles::put(&pack, request.style.as_ref()));
        put.await
            .map_err(|_| ApiError::Internal("a worker stopped before it was done".to_owned()))?
    }
}
