//! The Sessions service over gRPC.

use std::pin::Pin;
use std::sync::Arc;

use futures_util::{Stream, StreamExt as _};
use tonic::{Request, Response, Status, Streaming};
use troupe_proto::v1;
use troupe_proto::v1::sessions_server::Sessions;

use super::{PartStream, answer, parts};
use crate::api::ours::ours;
use crate::api::{ApiError, answers, opening};
use troupe_base::turns::Turns;
use troupe_edge::clients::Client;
use troupe_edge::traffic;
use troupe_live::session::stream::{Outlet, outbox};
use troupe_service::Service;

/// The Sessions service.
pub(super) struct SessionsApi {
    pub(super) service: Arc<Service>,
    /// Size limit of a stream's message, for errors.
    pub(super) stream_message_bytes: usize,
}

/// The client that sent the request.
fn client<T>(request: &Request<T>) -> Option<Arc<Client>> {
    request.extensions().get().cloned()
}

/// The turns of the client that sent the request.
fn turns<T>(request: &Request<T>) -> Turns {
    client(request).map_or_else(Turns::endless, |client| client.turns())
}

#[tonic::async_trait]
impl Sessions for SessionsApi {
    async fn create_sessions(
        &self,
        request: Request<v1::CreateSessionsRequest>,
    ) -> Result<Response<v1::CreateSessionsResponse>, Status> {
        let client = client(&request);
        answer(
            opening::create_sessions(
                &*ours(&self.service, &request).await?,
                client.as_ref(),
                request.into_inner(),
            )
            .await,
        )
    }

    async fn resume_sessions(
        &self,
        request: Request<v1::ResumeSessionsRequest>,
    ) -> Result<Response<v1::ResumeSessionsResponse>, Status> {
        let turns = turns(&request);
        let service = ours(&self.service, &request).await?;
        answer(
            service
                .resume_sessions(request.into_inner(), turns)
                .await
                .map(answers::resumed),
        )
    }

    async fn get_session(
        &self,
        request: Request<v1::GetSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        let service = ours(&self.service, &request).await?;
        let sessions = service.sessions();
        sessions.bring([&request.get_ref().id]).await;
        answer(sessions.get(&request.get_ref().id))
    }

    async fn list_sessions(
        &self,
        request: Request<v1::ListSessionsRequest>,
    ) -> Result<Response<v1::ListSessionsResponse>, Status> {
        answer(
            ours(&self.service, &request)
                .await?
                .sessions()
                .list(request.get_ref()),
        )
    }

    async fn close_sessions(
        &self,
        request: Request<v1::CloseSessionsRequest>,
    ) -> Result<Response<v1::CloseSessionsResponse>, Status> {
        let service = ours(&self.service, &request).await?;
        let sessions = service.sessions();
        sessions.bring(&request.get_ref().ids).await;
        answer(sessions.close(request.get_ref()).map(answers::closed))
    }

    async fn command(
        &self,
        request: Request<v1::CommandRequest>,
    ) -> Result<Response<v1::CommandResponse>, Status> {
        let service = ours(&self.service, &request).await?;
        let turns = turns(&request);
        let commands = service.sessions().command(request.into_inner(), turns);
        answer(commands.await.map(answers::commands))
    }

    async fn step(&self, request: Request<v1::StepRequest>) -> Result<Response<v1::StepResponse>, Status> {
        let service = ours(&self.service, &request).await?;
        let sessions = service.sessions();
        sessions.bring(&request.get_ref().session_ids).await;
        let plan = sessions
            .plan_step(request.get_ref())
            .map_err(|error| ApiError::from(error).status())?;
        let (turns, bytes) = (turns(&request), plan.answer_bytes() * traffic::COPIES_AS_PROTOBUF);
        let reserved = traffic::reserve(client(&request).as_ref(), bytes)
            .map_err(|error| ApiError::from(error).status())?;
        let stepped = sessions.step(request.into_inner(), plan, turns).await;
        let mut response = answer(stepped.map(answers::step))?;
        response.extensions_mut().insert(reserved);
        Ok(response)
    }

    async fn get_recording(
        &self,
        request: Request<v1::GetRecordingRequest>,
    ) -> Result<Response<v1::SessionRecording>, Status> {
        answer(
            ours(&self.service, &request)
                .await?
                .sessions()
                .recording(request.get_ref()),
        )
    }

    type ReplayStream = PartStream<v1::ReplayResponse>;

    async fn replay(
        &self,
        request: Request<v1::ReplayRequest>,
    ) -> Result<Response<Self::ReplayStream>, Status> {
        let service = ours(&self.service, &request).await?;
        let turns = turns(&request);
        parts(service.replay(request.into_inner(), turns))
    }

    type DriveStream = Pin<Box<dyn Stream<Item = Result<v1::DriveResponse, Status>> + Send>>;

    async fn drive(
        &self,
        request: Request<Streaming<v1::DriveRequest>>,
    ) -> Result<Response<Self::DriveStream>, Status> {
        let service = ours(&self.service, &request).await?;
        let turns = turns(&request);
        let of_client = match client(&request).map(|client| client.stream()).transpose() {
            Ok(place) => place,
            Err(error) => return Err(ApiError::from(error).status()),
        };
        let place = match service.sessions().open_stream() {
            Ok(place) => place,
            Err(error) => return Err(ApiError::from(error).status()),
        };
        let limit = self.stream_message_bytes;
        let mut inbound = request
            .into_inner()
            .map(move |said| said.map_err(|status| ApiError::of_status(&status, limit).problem()));
        let (outbox, outlet) = outbox(answers::drive);
        // The task ends when the server stops, or when the client leaves and drops the outlet.
        let sessions = service.sessions().clone();
        sessions.spawn(turns, async move {
            place.run(&mut inbound, outbox).await;
            drop(of_client);
        });
        let outbound = futures_util::stream::unfold(outlet, |mut outlet: Outlet| async {
            let said = outlet.next().await?;
            Some((Ok(said.into_response()), outlet))
        });
        Ok(Response::new(Box::pin(outbound)))
    }

    async fn peek(&self, request: Request<v1::PeekRequest>) -> Result<Response<v1::PeekResponse>, Status> {
        let service = ours(&self.service, &request).await?;
        let sessions = service.sessions();
        sessions.bring([&request.get_ref().session_id]).await;
        answer(sessions.peek(request.get_ref()))
    }

    async fn list_styles(
        &self,
        request: Request<v1::ListStylesRequest>,
    ) -> Result<Response<v1::ListStylesResponse>, Status> {
        answer(
            ours(&self.service, &request)
                .await?
                .list_styles(request.get_ref()),
        )
    }

    async fn get_style(&self, request: Request<v1::GetStyleRequest>) -> Result<Response<v1::Style>, Status> {
        answer(ours(&self.service, &request).await?.get_style(request.get_ref()))
    }

    async fn put_style(&self, request: Request<v1::PutStyleRequest>) -> Result<Response<v1::Style>, Status> {
        answer(
            ours(&self.service, &request)
                .await?
                .put_style(request.into_inner())
                .await,
        )
    }
}
