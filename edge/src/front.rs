//! The routes behind the edge, as far as it needs them.

use axum::response::Response;
use http::{HeaderMap, Method, header};

use super::EdgeError;
use super::clients::Role;
use super::refusals::RequestRefusal;

/// Describes the routes behind the edge. The server fills it in.
#[derive(Debug, Clone, Copy)]
pub struct Front {
    /// The role that a call needs, by method and path; none if it needs no key.
    pub needed: fn(&Method, &str) -> Option<Role>,
    /// Whether a path is that of a remote procedure. Other requests have no traces.
    pub is_rpc: fn(&str) -> bool,
    /// Whether a path is that of a live stream. The memory of its messages is not counted: they are
    /// short, and each is freed before the next is read.
    pub is_stream: fn(&str) -> bool,
    /// Whether answers of a path may take longer than any request: streams, and answers in parts.
    /// They end with the credential of their caller.
    pub is_lasting: fn(&str) -> bool,
    /// Whether a path is for health checks or metrics. It is also answered on connections beyond
    /// the limit.
    pub is_health: fn(&str) -> bool,
    /// The one path that accepts tickets.
    pub ticketed: &'static str,
    /// Makes the answer to a refused request: for gRPC (`true`) or for HTTP.
    pub answer: fn(&EdgeError, bool) -> Response,
}

impl Front {
    /// The answer to a refused request; `asked` are the request's headers.
    pub(crate) fn turn_away(&self, error: &EdgeError, asked: &HeaderMap) -> Response {
        self.turn_away_in(error, is_grpc(asked))
    }

    /// As [`Front::turn_away`], for a caller that uses gRPC or plain HTTP.
    pub(crate) fn turn_away_in(&self, error: &EdgeError, grpc: bool) -> Response {
        let mut response = (self.answer)(error, grpc);
        if let Some(refusal) = RequestRefusal::of(error) {
            response.extensions_mut().insert(refusal);
        }
        response
    }
}

/// Whether a request's headers are those of a gRPC call.
pub fn is_grpc(headers: &HeaderMap) -> bool {
    headers
        .get(header::CONTENT_TYPE)
        .is_some_and(|form| form.as_bytes().starts_with(b"application/grpc"))
}
