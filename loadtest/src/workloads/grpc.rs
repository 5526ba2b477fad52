//! Requests to `InBetween` over gRPC.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use http::uri::PathAndQuery;
use tonic::{Code, Request, Status};
use troupe_client::KeyedChannel;

use super::answer::{Form, check, read, wrong};
use super::codec::Raw;
use super::connect::{MOST_ANSWER_BYTES, channels};
use super::requests::{Item, RequestSet};
use crate::failure::Failure;
use crate::loops::Target;
use crate::measure::Outcome;
use crate::plan::Plan;

/// Path of the gRPC method.
const IN_BETWEEN: PathAndQuery = PathAndQuery::from_static("/troupe.v1.Motion/InBetween");

/// Sends requests over a few connections.
#[derive(Debug)]
pub struct Grpc {
    channels: Vec<KeyedChannel>,
    set: RequestSet,
    timeout: Duration,
    answers: AtomicU64,
}

impl Grpc {
    pub(super) async fn connect(plan: &Plan, set: RequestSet) -> Result<Self, Failure> {
        Ok(Self {
            channels: channels(plan).await?,
            set,
            timeout: plan.timeout(),
            answers: AtomicU64::new(0),
        })
    }

    async fn send(&self, caller: u64, item: &Item) -> Result<Outcome, Status> {
        let channel = &self.channels[(caller % self.channels.len() as u64) as usize];
        let mut rpc = tonic::client::Grpc::new(channel.clone()).max_decoding_message_size(MOST_ANSWER_BYTES);
        rpc.ready()
            .await
            .map_err(|e| Status::unavailable(e.to_string()))?;
        let answer = rpc
            .unary(Request::new(item.body.clone()), IN_BETWEEN, Raw)
            .await?
            .into_inner();
        if self.set.is_sample(self.answers.fetch_add(1, Ordering::Relaxed))
            && let Some(request) = &item.request
        {
            if let Err(why) = check(&answer, Form::Protobuf, request) {
                return Ok(wrong("WRONG_ANSWER", why));
            }
            self.set.note_verified();
        }
        Ok(read(answer, Form::Protobuf, item.expected()))
    }
}

impl Target for Grpc {
    async fn call(&self, caller: u64, number: u64) -> Outcome {
        let item = self.set.item(number);
        match tokio::time::timeout(self.timeout, self.send(caller, item)).await {
            Ok(Ok(outcome)) => outcome,
            Ok(Err(status)) => from_status(&status),
            Err(_) => wrong("TIMED_OUT", format!("no answer within {:?}", self.timeout)),
        }
    }

    fn verified(&self) -> u64 {
        self.set.verified()
    }
}

/// The outcome of a request that failed with `status`.
pub(super) fn from_status(status: &Status) -> Outcome {
    let name = name(status.code());
    if status.code() == Code::ResourceExhausted {
        return Outcome::Refused(name.into());
    }
    wrong(name, status.message().to_owned())
}

/// The name of a code in the gRPC specification.
fn name(code: Code) -> &'static str {
    match code {
        Code::Ok => "OK",
        Code::Cancelled => "CANCELLED",
        Code::Unknown => "UNKNOWN",
        Code::InvalidArgument => "INVALID_ARGUMENT",
        Code::DeadlineExceeded => "DEADLINE_EXCEEDED",
        Code::NotFound => "NOT_FOUND",
        Code::AlreadyExists => "ALREADY_EXISTS",
        Code::PermissionDenied => "PERMISSION_DENIED",
        Code::ResourceExhausted => "RESOURCE_EXHAUSTED",
        Code::FailedPrecondition => "FAILED_PRECONDITION",
        Code::Aborted => "ABORTED",
        Code::OutOfRange => "OUT_OF_RANGE",
        Code::Unimplemented => "UNIMPLEMENTED",
        Code::Internal => "INTERNAL",
        Code::Unavailable => "UNAVAILABLE",
        Code::DataLoss => "DATA_LOSS",
        Code::Unauthenticated => "UNAUTHENTICATED",
    }
}
