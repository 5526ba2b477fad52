//! Traces, as a collector gets them.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use opentelemetry_proto::tonic::collector::trace::v1::trace_service_server::{
    TraceService, TraceServiceServer,
};
use opentelemetry_proto::tonic::collector::trace::v1::{
    ExportTraceServiceRequest, ExportTraceServiceResponse,
};
use opentelemetry_proto::tonic::common::v1::any_value::Value;
use opentelemetry_proto::tonic::trace::v1::Span;
use tokio::net::TcpListener;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::{Request, Response, Status};
use troupe_proto::v1;
use troupe_server::config::Config;

use crate::common::{TestServer, request};

const TRACE_ID: &str = "0af7651916cd43dd8448eb211c80319c";
const PARENT_ID: &str = "b7ad6b7169203331";

/// A collector on a port of its own.
#[derive(Clone, Default)]
struct Collector(Arc<Mutex<Vec<Span>>>);

#[tonic::async_trait]
impl TraceService for Collector {
    async fn export(
        &self,
        request: Request<ExportTraceServiceRequest>,
    ) -> Result<Response<ExportTraceServiceResponse>, Status> {
        let resources = request.into_inner().resource_spans;
        let scopes = resources.into_iter().flat_map(|resource| resource.scope_spans);
        self.0
            .lock()
            .unwrap()
            .extend(scopes.flat_map(|scope| scope.spans));
        Ok(Response::new(ExportTraceServiceResponse::default()))
    }
}

impl Collector {
    /// A collector and a server that sends it all traces.
    async fn start(ratio: f64) -> (Self, TestServer) {
        let collector = Self::default();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let endpoint = format!("http://{}", listener.local_addr().unwrap());
        let serving = tonic::transport::Server::builder()
            .add_service(TraceServiceServer::new(collector.clone()))
            .serve_with_incoming(TcpListenerStream::new(listener));
        tokio::spawn(serving);
        let server = TestServer::start_with(|config: &mut Config| {
            config.otlp_endpoint = Some(endpoint);
            config.trace_sample_ratio = ratio;
        })
        .await;
        (collector, server)
    }

    /// The spans of the trace that has one of this name, with their root. Waits for it.
    async fn trace(&self, name: &str) -> Vec<Span> {
        for _ in 0..500 {
            let spans = self.0.lock().unwrap().clone();
            if let Some(found) = spans.iter().find(|span| span.name == name) {
                let of_trace = spans.iter().filter(|span| span.trace_id == found.trace_id);
                return of_trace.cloned().collect();
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        panic!("no span {name}");
    }
}

fn hex(id: &[u8]) -> String {
    id.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn named<'a>(spans: &'a [Span], name: &str) -> &'a Span {
    let names: Vec<&str> = spans.iter().map(|span| span.name.as_str()).collect();
    let found = spans.iter().find(|span| span.name == name);
    found.unwrap_or_else(|| panic!("{name} is not in {names:?}"))
}

fn attribute(span: &Span, key: &str) -> Option<Value> {
    let found = span.attributes.iter().find(|attribute| attribute.key == key)?;
    found.value.clone()?.value
}

fn text(value: &str) -> Option<Value> {
    Some(Value::StringValue(value.to_owned()))
}

/// Asserts that these are parts of `root`, within its time.
fn assert_parts(spans: &[Span], root: &Span, parts: &[&str]) {
    for part in parts {
        let part = named(spans, part);
        assert_eq!(part.parent_span_id, root.span_id, "{}", part.name);
        // The clock on the wall and the one that measures may differ by some microseconds.
        let slack_ns = 1_000_000;
        assert!(
            part.start_time_unix_nano <= part.end_time_unix_nano
                && root.start_time_unix_nano <= part.start_time_unix_nano + slack_ns
                && part.end_time_unix_nano <= root.end_time_unix_nano + slack_ns,
            "{part:?} is not within {root:?}"
        );
    }
    assert_eq!(spans.len(), 1 + parts.len(), "{spans:#?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_over_http_goes_on_with_its_callers_trace() {
    let (collector, server) = Collector::start(0.0).await;
    let response = reqwest::Client::new()
        .post(server.url("/v1/inbetween"))
        .header("traceparent", format!("00-{TRACE_ID}-{PARENT_ID}-01"))
        .header("x-request-id", "mine")
        .json(&request(3))
        .send()
        .await
        .unwrap();
    assert!(response.status().is_success());
    response.bytes().await.unwrap();
    let spans = collector.trace("InBetween").await;
    let root = named(&spans, "InBetween");
    assert_eq!(hex(&root.trace_id), TRACE_ID);
    assert_eq!(hex(&root.parent_span_id), PARENT_ID);
    assert_eq!(attribute(root, "code"), text("OK"));
    assert_eq!(attribute(root, "request.id"), text("mine"));
    assert_parts(&spans, root, &["queue", "step", "finish", "encode", "reply"]);
    let step = named(&spans, "step");
    assert_eq!(attribute(step, "batch.jobs"), Some(Value::IntValue(3)));
    // This one is not traced.
    server
        .send(reqwest::Method::POST, "/v1/inbetween", &request(1))
        .await;
    server
        .metric(r#"troupe_trace_spans_total{outcome="exported"}"#, "6")
        .await;
    let ids = collector.0.lock().unwrap().clone();
    assert!(ids.iter().all(|span| hex(&span.trace_id) == TRACE_ID));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_over_grpc_has_a_trace_of_its_own() {
    let (collector, server) = Collector::start(1.0).await;
    let mut client = server.grpc().await;
    client.in_between(request(1)).await.unwrap();
    let spans = collector.trace("InBetween").await;
    let root = named(&spans, "InBetween");
    assert_eq!(root.parent_span_id, Vec::<u8>::new());
    assert_parts(&spans, root, &["queue", "step", "finish", "reply"]);

    let unknown = v1::GetPackRequest { name: "none".into() };
    client.get_pack(unknown).await.unwrap_err();
    let spans = collector.trace("GetPack").await;
    let root = named(&spans, "GetPack");
    assert_eq!(attribute(root, "code"), text("NOT_FOUND"));
    assert_parts(&spans, root, &["reply"]);
    // Health checks and metrics are no procedures.
    server.get("/metrics").await;
    server.get("/v1/packs").await;
    collector.trace("ListPacks").await;
    assert!(
        collector
            .0
            .lock()
            .unwrap()
            .iter()
            .all(|span| span.name != "request")
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn plans_of_characters_have_traces_of_their_own() {
    let (collector, server) = Collector::start(1.0).await;
    let mut client = server.sessions().await;
    let session = v1::SessionOptions {
        id: "a".into(),
        ..v1::SessionOptions::default()
    };
    let create = v1::CreateSessionsRequest {
        sessions: vec![session],
    };
    client.create_sessions(create).await.unwrap();
    let step = v1::StepRequest {
        session_ids: vec!["a".into()],
        frames: 1,
        ..v1::StepRequest::default()
    };
    client.step(step).await.unwrap();
    let spans = collector.trace("plan").await;
    assert_parts(&spans, named(&spans, "plan"), &["queue", "step"]);
    let spans = collector.trace("Step").await;
    assert_parts(&spans, named(&spans, "Step"), &["advance", "reply"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_last_spans_are_sent_when_the_server_stops() {
    let (collector, server) = Collector::start(1.0).await;
    server.get("/v1/packs").await.bytes().await.unwrap();
    assert!(server.handle.shut_down().await);
    let spans = collector.0.lock().unwrap().clone();
    assert_parts(&spans, named(&spans, "ListPacks"), &["reply"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_missing_collector_does_no_harm() {
    let server = TestServer::start_with(|config| {
        config.otlp_endpoint = Some("http://127.0.0.1:9".into());
        config.trace_sample_ratio = 1.0;
    })
    .await;
    let mut client = server.grpc().await;
    for _ in 0..20 {
        client.in_between(request(1)).await.unwrap();
    }
    server
        .metric(r#"troupe_trace_spans_total{outcome="exported"}"#, "0")
        .await;
}
