//! What the edge has to know of the routes behind it.

use axum::response::Response;
use http::{HeaderMap, Method, header};

use super::EdgeError;
use super::clients::Role;
use super::refusals::RequestRefusal;

/// What the edge has to know of the routes behind it.
#[derive(Debug, Clone, Copy)]
pub struct Front {
    /// The role that a call needs; none where it needs no key.
    pub needed: fn(&Method, &str) -> Option<Role>,
    /// Whether a path is that of a remote procedure. Other requests have no traces.
    pub is_rpc: fn(&str) -> bool,
    /// Whether a path is that of a live stream. The messages of one are short, and gone before the
    /// next is read, so they are not counted.
    pub is_stream: fn(&str) -> bool,
    /// Whether a path says how the server is: it is answered on connections beyond the limit too.
    pub is_health: fn(&str) -> bool,
    /// The one path that a ticket opens.
    pub ticketed: &'static str,
    /// The answer to a request that is turned away, as gRPC has it (`true`) or as HTTP has it.
    pub answer: fn(&EdgeError, bool) -> Response,
}

impl Front {
    /// The answer to a request that is turned away; `asked` are its headers.
    pub(crate) fn turn_away(&self, error: &EdgeError, asked: &HeaderMap) -> Response {
        self.turn_away_in(error, is_grpc(asked))
    }

    /// [`Front::turn_away`], for a caller who speaks gRPC or does not.
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
