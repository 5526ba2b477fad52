//! gRPC: the Motion, Sessions, Scenes and Skeletons services, health and reflection.

mod scenes;
mod sessions;
mod skeletons;

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;

use axum::body::Body;
use axum::{Router, middleware};
use futures_util::Stream;
use tonic::server::NamedService;
use tonic::{Request, Response, Status};
use tonic_health::ServingStatus;
use tonic_health::pb::health_server::HealthServer;
use tonic_health::server::{HealthReporter, HealthService};
use tonic_reflection::server::{Builder, Error};
use troupe_proto::v1;
use troupe_proto::v1::motion_server::{Motion, MotionServer};
use troupe_proto::v1::scenes_server::ScenesServer;
use troupe_proto::v1::sessions_server::SessionsServer;
use troupe_proto::v1::skeletons_server::SkeletonsServer;

use self::scenes::ScenesApi;
use self::sessions::SessionsApi;
use self::skeletons::SkeletonsApi;
use super::ours::ours;
use super::track::{self, Tracker};
use super::{ApiError, ApiLimits, MAX_STREAM_MESSAGE_BYTES, early};
use troupe_edge::clients::Client;
use troupe_service::{Service, ServiceError, Streamed};

/// Sets the state that gRPC health checks report, for each service and for the server as a whole.
pub async fn set_serving(health: &HealthReporter, serving: bool) {
    let status = if serving {
        ServingStatus::Serving
    } else {
        ServingStatus::NotServing
    };
    for service in [
        "",
        MotionServer::<MotionApi>::NAME,
        SessionsServer::<SessionsApi>::NAME,
        ScenesServer::<ScenesApi>::NAME,
        SkeletonsServer::<SkeletonsApi>::NAME,
    ] {
        health.set_service_status(service, status).await;
    }
}

/// Converts an answer into gRPC's form.
fn answer<T>(result: Result<T, impl Into<ApiError>>) -> Result<Response<T>, Status> {
    match result {
        Ok(answer) => Ok(Response::new(answer)),
        Err(error) => Err(error.into().status()),
    }
}

/// An answer in parts.
type PartStream<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

/// Converts an answer in parts into gRPC's form.
fn parts<A: Streamed>(answer: Result<A, ServiceError>) -> Result<Response<PartStream<A::Part>>, Status> {
    let answer = answer.map_err(|error| ApiError::from(error).status())?;
    let parts = futures_util::stream::unfold(answer, |mut answer| async {
        let part = answer.next().await?;
        Some((part.map_err(|error| ApiError::from(error).status()), answer))
    });
    Ok(Response::new(Box::pin(parts)))
}

/// The Motion service over gRPC.
struct MotionApi(Arc<Service>);

#[tonic::async_trait]
impl Motion for MotionApi {
    async fn in_between(
        &self,
        request: Request<v1::InBetweenRequest>,
    ) -> Result<Response<v1::InBetweenResponse>, Status> {
        let service = ours(&self.0, &request).await?;
        let client = request.extensions().get::<Arc<Client>>().cloned();
        let request = request.into_inner();
        let pack = request.pack.clone();
        let made = service.in_between(request).await;
        early::note(client.as_ref(), &pack, made.as_ref().err());
        answer(made)
    }

    type GenerateStream = PartStream<v1::GenerateResponse>;

    async fn generate(
        &self,
        request: Request<v1::GenerateRequest>,
    ) -> Result<Response<Self::GenerateStream>, Status> {
        let service = ours(&self.0, &request).await?;
        let client = request.extensions().get::<Arc<Client>>().cloned();
        let request = request.into_inner();
        let pack = request.pack.clone();
        let answer = service.generate(request).await;
        early::note(client.as_ref(), &pack, answer.as_ref().err());
        parts(answer)
    }

    type DescribeStream = PartStream<v1::DescribeResponse>;

    async fn describe(
        &self,
        request: Request<v1::DescribeRequest>,
    ) -> Result<Response<Self::DescribeStream>, Status> {
        let answer = ours(&self.0, &request).await?.describe(request.get_ref());
        let client = request.extensions().get::<Arc<Client>>();
        early::note(client, &request.get_ref().pack, answer.as_ref().err());
        parts(answer)
    }

    async fn list_packs(
        &self,
        _: Request<v1::ListPacksRequest>,
    ) -> Result<Response<v1::ListPacksResponse>, Status> {
        answer(self.0.list_packs())
    }

    async fn get_pack(&self, request: Request<v1::GetPackRequest>) -> Result<Response<v1::Pack>, Status> {
        answer(self.0.get_pack(&request.into_inner().name))
    }

    async fn load_pack(
        &self,
        request: Request<v1::LoadPackRequest>,
    ) -> Result<Response<v1::PackChange>, Status> {
        answer(self.0.load_pack(request.into_inner()).await)
    }

    async fn unload_pack(
        &self,
        request: Request<v1::UnloadPackRequest>,
    ) -> Result<Response<v1::PackChange>, Status> {
        answer(self.0.unload_pack(request.into_inner()).await)
    }

    async fn swap_pack(
        &self,
        request: Request<v1::SwapPackRequest>,
    ) -> Result<Response<v1::PackChange>, Status> {
        answer(self.0.swap_pack(request.into_inner()).await)
    }
}

/// The routes of gRPC's health service.
pub(super) fn health(health: &HealthReporter) -> Router {
    let service = HealthService::from_health_reporter(health.clone());
    mount(Router::new(), HealthServer::new(service))
}

/// The routes of all gRPC services.
pub(super) fn router(
    service: &Arc<Service>,
    health: &HealthReporter,
    limits: &ApiLimits,
) -> Result<Router, Error> {
    let tracker = Arc::new(Tracker::new(service, limits));
    // Answers may be of any size: the limits on requests bound them.
    let motion = MotionServer::new(MotionApi(service.clone()))
        .max_decoding_message_size(limits.message_bytes)
        .max_encoding_message_size(usize::MAX);
    let sessions = |limit_bytes: usize| {
        let api = SessionsApi {
            service: service.clone(),
            stream_message_bytes: limit_bytes,
        };
        SessionsServer::new(api)
            .max_decoding_message_size(limit_bytes)
            .max_encoding_message_size(usize::MAX)
    };
    let router = mount(Router::new(), motion);
    // Stream messages are decoded one by one, without a check of their shape. A small size limit
    // protects the memory.
    let drive = format!("/{}/Drive", SessionsServer::<SessionsApi>::NAME);
    let stream_limit = limits.message_bytes.min(MAX_STREAM_MESSAGE_BYTES);
    let router = router.route_service(&drive, sessions(stream_limit));
    let scenes = ScenesServer::new(ScenesApi(service.clone()))
        .max_decoding_message_size(limits.message_bytes)
        .max_encoding_message_size(usize::MAX);
    let router = mount(router, scenes);
    let skeletons = SkeletonsServer::new(SkeletonsApi(service.clone()))
        .max_decoding_message_size(limits.message_bytes)
        .max_encoding_message_size(usize::MAX);
    let router = mount(router, skeletons);
    let router = mount(router, sessions(limits.message_bytes))
        .layer(middleware::from_fn_with_state(tracker, track::grpc));
    let router = router.merge(self::health(health));
    let router = mount(router, reflection().build_v1()?);
    // Older tools use only the alpha version.
    Ok(mount(router, reflection().build_v1alpha()?))
}

fn reflection() -> Builder<'static> {
    Builder::configure()
        .register_encoded_file_descriptor_set(v1::FILE_DESCRIPTOR_SET)
        .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
}

fn mount<S>(router: Router, service: S) -> Router
where
    S: tower::Service<http::Request<Body>, Error = Infallible, Response = http::Response<tonic::body::Body>>
        + NamedService
        + Clone
        + Send
        + Sync
        + 'static,
    S::Future: Send + 'static,
{
    router.route_service(&format!("/{}/{{*rpc}}", S::NAME), service)
}
