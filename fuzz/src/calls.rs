//! Every call, through the routes of the server: over gRPC and over HTTP.

use axum::body::{Body, Bytes};
use http::{Method, Request, Uri};
use http_body_util::BodyExt as _;
use prost::Message as _;
use tower::ServiceExt as _;
use troupe_proto::v1;
use troupe_server::api::ErrorBody;

use crate::home::Local;
use crate::planted;

/// A call with its addresses over gRPC and over HTTP.
#[derive(Debug)]
pub struct Call {
    /// The name of the remote procedure, as in the protobuf files.
    pub rpc: &'static str,
    /// Its service over gRPC; `None` for a call that only HTTP has.
    service: Option<&'static str>,
    method: Method,
    /// Its path over HTTP. A call without a body puts its input behind the path.
    path: &'static str,
    changes: Changes,
}

/// The part of the server that a call may change, so that the target resets it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Changes {
    Nothing,
    Sessions,
    World,
}

const MOTION: Option<&str> = Some("Motion");
const SESSIONS: Option<&str> = Some("Sessions");
const SCENES: Option<&str> = Some("Scenes");
const SKELETONS: Option<&str> = Some("Skeletons");

#[rustfmt::skip]
/// Every call. The first byte of an input is an index into this array, plus [`HTTP`] for the call
/// over HTTP.
pub const CALLS: [Call; 39] = [
    Call { rpc: "InBetween", service: MOTION, method: Method::POST, path: "/v1/inbetween", changes: Changes::Nothing },
    Call { rpc: "Generate", service: MOTION, method: Method::POST, path: "/v1/generate", changes: Changes::Nothing },
    Call { rpc: "ListPacks", service: MOTION, method: Method::GET, path: "/v1/packs", changes: Changes::Nothing },
    Call { rpc: "GetPack", service: MOTION, method: Method::GET, path: "/v1/packs/", changes: Changes::Nothing },
    Call { rpc: "CreateSessions", service: SESSIONS, method: Method::POST, path: "/v1/sessions", changes: Changes::Sessions },
    Call { rpc: "ResumeSessions", service: SESSIONS, method: Method::POST, path: "/v1/sessions/resume", changes: Changes::Sessions },
    Call { rpc: "GetSession", service: SESSIONS, method: Method::GET, path: "/v1/sessions/", changes: Changes::Nothing },
    Call { rpc: "ListSessions", service: SESSIONS, method: Method::GET, path: "/v1/sessions", changes: Changes::Nothing },
    Call { rpc: "CloseSessions", service: SESSIONS, method: Method::DELETE, path: "/v1/sessions/", changes: Changes::Sessions },
    Call { rpc: "Command", service: SESSIONS, method: Method::POST, path: "/v1/commands", changes: Changes::Sessions },
    Call { rpc: "Step", service: SESSIONS, method: Method::POST, path: "/v1/step", changes: Changes::Sessions },
    Call { rpc: "Drive", service: SESSIONS, method: Method::GET, path: "/v1/drive", changes: Changes::Sessions },
    Call { rpc: "Peek", service: SESSIONS, method: Method::GET, path: "/v1/sessions/a/peek", changes: Changes::Nothing },
    Call { rpc: "ListStyles", service: SESSIONS, method: Method::GET, path: "/v1/packs/toy/styles", changes: Changes::Nothing },
    Call { rpc: "GetStyle", service: SESSIONS, method: Method::GET, path: "/v1/packs/toy/styles/", changes: Changes::Nothing },
    Call { rpc: "PutStyle", service: SESSIONS, method: Method::PUT, path: "/v1/packs/toy/styles/new", changes: Changes::Nothing },
    Call { rpc: "PutScene", service: SCENES, method: Method::PUT, path: "/v1/scenes/new", changes: Changes::World },
    Call { rpc: "GetScene", service: SCENES, method: Method::GET, path: "/v1/scenes/yard", changes: Changes::Nothing },
    Call { rpc: "ListScenes", service: SCENES, method: Method::GET, path: "/v1/scenes", changes: Changes::Nothing },
    Call { rpc: "DeleteScene", service: SCENES, method: Method::DELETE, path: "/v1/scenes/", changes: Changes::World },
    Call { rpc: "AddObjects", service: SCENES, method: Method::POST, path: "/v1/scenes/yard/add", changes: Changes::World },
    Call { rpc: "MoveObjects", service: SCENES, method: Method::POST, path: "/v1/scenes/yard/move", changes: Changes::World },
    Call { rpc: "RemoveObjects", service: SCENES, method: Method::POST, path: "/v1/scenes/yard/remove", changes: Changes::World },
    Call { rpc: "PutObjectDefinition", service: SCENES, method: Method::PUT, path: "/v1/objects/new", changes: Changes::World },
    Call { rpc: "GetObjectDefinition", service: SCENES, method: Method::GET, path: "/v1/objects/stool", changes: Changes::Nothing },
    Call { rpc: "ListObjectDefinitions", service: SCENES, method: Method::GET, path: "/v1/objects", changes: Changes::Nothing },
    Call { rpc: "DeleteObjectDefinition", service: SCENES, method: Method::DELETE, path: "/v1/objects/", changes: Changes::World },
    Call { rpc: "Detect", service: SCENES, method: Method::POST, path: "/v1/detect", changes: Changes::Nothing },
    Call { rpc: "CreateTicket", service: None, method: Method::POST, path: "/v1/tickets", changes: Changes::Nothing },
    Call { rpc: "Describe", service: MOTION, method: Method::POST, path: "/v1/describe", changes: Changes::Nothing },
    Call { rpc: "PutSkeleton", service: SKELETONS, method: Method::PUT, path: "/v1/skeletons/new", changes: Changes::World },
    Call { rpc: "GetSkeleton", service: SKELETONS, method: Method::GET, path: "/v1/skeletons/", changes: Changes::Nothing },
    Call { rpc: "ListSkeletons", service: SKELETONS, method: Method::GET, path: "/v1/skeletons", changes: Changes::Nothing },
    Call { rpc: "DeleteSkeleton", service: SKELETONS, method: Method::DELETE, path: "/v1/skeletons/", changes: Changes::World },
    Call { rpc: "GetRecording", service: SESSIONS, method: Method::GET, path: "/v1/sessions/a/recording", changes: Changes::Nothing },
    Call { rpc: "Replay", service: SESSIONS, method: Method::POST, path: "/v1/replay", changes: Changes::Nothing },
    // The only pack is the default one, which stays.
    Call { rpc: "LoadPack", service: MOTION, method: Method::POST, path: "/v1/packs/toy/load", changes: Changes::Nothing },
    Call { rpc: "UnloadPack", service: MOTION, method: Method::POST, path: "/v1/packs/toy/unload", changes: Changes::Nothing },
    Call { rpc: "SwapPack", service: MOTION, method: Method::POST, path: "/v1/packs/toy/swap", changes: Changes::Nothing },
];

/// The bit of the first byte that asks for HTTP.
const HTTP: u8 = 0x40;
/// The bits of the first byte that hold the index of the call.
const WHICH: u8 = 0x3f;

impl Call {
    /// The first byte of an input for the call of this name.
    pub fn byte(rpc: &str, http: bool) -> Option<u8> {
        let index = CALLS.iter().position(|call| call.rpc == rpc)?;
        let index = u8::try_from(index).ok()?;
        Some(index | if http { HTTP } else { 0 })
    }

    fn over_http(&self, bytes: &[u8]) -> Option<Request<Body>> {
        // Over HTTP this call is a WebSocket, which has a target of its own.
        if self.rpc == "Drive" {
            return None;
        }
        let request = Request::builder()
            .method(self.method.clone())
            .header("host", "localhost");
        if self.method == Method::GET || self.method == Method::DELETE {
            let rest = std::str::from_utf8(bytes).ok()?;
            let uri: Uri = format!("{}{rest}", self.path).parse().ok()?;
            return request.uri(uri).body(Body::empty()).ok();
        }
        request
            .uri(self.path)
            .header("content-type", "application/json")
            .body(Body::from(bytes.to_vec()))
            .ok()
    }

    /// The input of a stream holds several messages with their frames, so it goes unchanged.
    fn over_grpc(&self, bytes: &[u8]) -> Option<Request<Body>> {
        let body = match self.rpc {
            "Drive" => bytes.to_vec(),
            _ => framed(bytes),
        };
        Request::builder()
            .method(Method::POST)
            .uri(format!("/troupe.v1.{}/{}", self.service?, self.rpc))
            .header("host", "localhost")
            .header("content-type", "application/grpc")
            .header("te", "trailers")
            .body(Body::from(body))
            .ok()
    }
}

fn framed(message: &[u8]) -> Vec<u8> {
    let length = u32::try_from(message.len()).unwrap_or(u32::MAX);
    [&[0], length.to_be_bytes().as_slice(), message].concat()
}

/// A call: the index in [`CALLS`], then its body. No answer may be the server's fault, and every
/// error has a message.
pub fn calls(bytes: &[u8]) {
    let Some((&first, bytes)) = bytes.split_first() else {
        return;
    };
    let Some(call) = CALLS.get(usize::from(first & WHICH)) else {
        return;
    };
    let http = first & HTTP != 0;
    let request = match http {
        true => call.over_http(bytes),
        false => call.over_grpc(bytes),
    };
    let Some(request) = request else { return };
    Local::with(|local| {
        let served = local.run(async {
            let Ok(answer) = local.router.clone().oneshot(request).await;
            let status = answer.status();
            let head = grpc_status(answer.headers());
            let body = answer.into_body().collect().await.expect("an answer has an end");
            let code = head.or_else(|| body.trailers().and_then(grpc_status));
            let body = body.to_bytes();
            let served = match http {
                true => check_http(call, status, &body),
                false => check_grpc(call, code),
            };
            match call.changes {
                Changes::World if served => local.reset().await,
                // The server may refuse a step or command for one session and change another.
                Changes::Sessions => local.reset_sessions().await,
                _ => {}
            }
            served
        });
        planted(|| planted_step(served && call.rpc == "Step", http, bytes));
    });
}

fn check_http(call: &Call, status: http::StatusCode, body: &Bytes) -> bool {
    if status.is_success() {
        return true;
    }
    let answer: ErrorBody = match serde_json::from_slice(body) {
        Ok(answer) => answer,
        Err(error) => panic!("{}: {status} without an error: {error}", call.rpc),
    };
    let error = answer.error;
    assert!(!error.message.is_empty() && !error.reason.is_empty(), "{error:?}");
    if status == http::StatusCode::BAD_REQUEST {
        let named = error.field.as_ref().is_some_and(|field| !field.is_empty());
        assert!(named, "{}: {error:?}", call.rpc);
    }
    assert!(
        !status.is_server_error() || on_purpose(&error.message),
        "{}: {error:?}",
        call.rpc
    );
    false
}

/// The code and the message of a gRPC answer.
fn grpc_status(headers: &http::HeaderMap) -> Option<(u32, String)> {
    let text = |name| {
        headers
            .get(name)
            .map(|value: &http::HeaderValue| String::from_utf8_lossy(value.as_bytes()))
    };
    let code = text("grpc-status")?.parse().ok()?;
    Some((code, text("grpc-message").unwrap_or_default().into_owned()))
}

fn check_grpc(call: &Call, status: Option<(u32, String)>) -> bool {
    let Some((code, message)) = status else {
        panic!("{}: no grpc-status", call.rpc);
    };
    // UNKNOWN, UNIMPLEMENTED, INTERNAL, UNAVAILABLE, DATA_LOSS
    let fault = [2, 12, 13, 14, 15].contains(&code);
    assert!(!fault || on_purpose(&message), "{}: {code} {message}", call.rpc);
    assert!(
        code == 0 || !message.is_empty(),
        "{}: {code} without a message",
        call.rpc
    );
    code == 0
}

/// Whether the toy family failed because the prompt asked for it, or the server refused to change
/// packs that are no folder's.
fn on_purpose(message: &str) -> bool {
    let fixed = [
        "packs of this server cannot change",
        "packs%20of%20this%20server%20cannot%20change",
    ];
    let asked = ["asked to", "asked%20to"];
    asked
        .into_iter()
        .chain(fixed)
        .any(|purpose| message.contains(purpose))
}

fn planted_step(served: bool, http: bool, bytes: &[u8]) -> [bool; 3] {
    let request = match http {
        true => serde_json::from_slice::<v1::StepRequest>(bytes).ok(),
        false => v1::StepRequest::decode(bytes).ok(),
    };
    match request.filter(|_| served) {
        Some(step) => [true, step.return_six_d, step.rate_hz == 50],
        None => [false; 3],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_remote_procedure_is_called() {
        for rpc in troupe_proto::rpc::RPCS {
            assert!(Call::byte(rpc.name, true).is_some(), "{} is missing", rpc.name);
        }
        assert_eq!(CALLS.len(), troupe_proto::rpc::RPCS.len() + 1);
        assert!(CALLS.len() <= usize::from(WHICH) + 1);
    }
}
