//! Streams over WebSocket: the messages of `troupe.v1.Sessions/Drive`, as JSON text or as protobuf
//! in binary messages. The server answers in the form of the first message.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::Extension;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{CloseFrame, Message, WebSocketUpgrade, close_code};
use axum::response::{IntoResponse as _, Response};
use futures_util::{Sink, SinkExt as _, Stream, StreamExt as _};
use prost::Message as _;
use tokio::sync::oneshot;
use tokio::time::{MissedTickBehavior, timeout};
use tracing::Instrument as _;
use troupe_proto::v1;
use troupe_proto::v1::drive_response::Message as Say;

use super::MAX_STREAM_MESSAGE_BYTES;
use super::answers;
use super::error::ApiError;
use super::http::json::{self, BodyLimits};
use super::ours::Ours;
use troupe_base::echo::{MAX_MESSAGE, cut};
use troupe_base::turns::Turns;
use troupe_edge::Lease;
use troupe_edge::clients::Client;
use troupe_live::session::StreamPermit;
use troupe_live::session::stream::{Outgoing, Outlet, outbox};

/// How long a client may take to read the rest after its stream has ended.
const FAREWELL: Duration = Duration::from_secs(2);
/// How often a silent client gets a ping.
const PING_INTERVAL: Duration = Duration::from_secs(20);
/// Most bytes of a reason in a close frame (RFC 6455, section 5.5).
const MAX_REASON_BYTES: usize = 123;

impl BodyLimits {
    /// The limits of a message on a stream.
    pub(super) fn of_stream(self) -> Self {
        let bytes = self.bytes.min(MAX_STREAM_MESSAGE_BYTES);
        Self { bytes, ..self }
    }
}

/// Drive sessions over a WebSocket
///
/// The messages are DriveRequest and DriveResponse: as JSON in text messages, or as protobuf in
/// binary messages. The server answers in the form of the first message, which must be `open`.
#[utoipa::path(
    get,
    path = "/v1/drive",
    operation_id = "Drive",
    tag = "sessions",
    params(("ticket" = Option<String>, Query, description = "A ticket of POST /v1/tickets instead of a key, which browsers cannot send here")),
    responses(
        (status = 101, description = "A WebSocket: the client sends DriveRequest, the server DriveResponse", body = v1::DriveResponse),
        (status = 400, description = "Not the start of a WebSocket"),
        (status = 429, description = "No room for another stream"),
        (status = 503, description = "Shutting down"),
    )
)]
pub(super) async fn drive(
    Ours(service): Ours,
    Extension(limits): Extension<BodyLimits>,
    Extension(client): Extension<Arc<Client>>,
    lease: Option<Extension<Lease>>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, ApiError> {
    let upgrade = upgrade.map_err(|rejection| ApiError::Malformed {
        message: format!("this path takes a WebSocket: {}", rejection.body_text()),
        field: None,
    })?;
    let (of_client, turns) = (client.stream()?, client.turns());
    let permit = service.sessions().open_stream()?;
    let limits = limits.of_stream();
    let bytes = limits.bytes;
    let upgrade = upgrade.max_message_size(bytes).max_frame_size(bytes);
    let span = tracing::Span::current();
    Ok(upgrade
        .on_upgrade(move |socket| {
            let serving = async move {
                let revoked = async {
                    match lease {
                        Some(Extension(lease)) => ApiError::from(lease.ended().await).problem(),
                        None => std::future::pending().await,
                    }
                };
                serve(socket, permit, limits, turns, revoked).await;
                drop(of_client);
            };
            serving.instrument(span)
        })
        .into_response())
}

/// The form of messages: JSON text or protobuf, as the client's first message.
#[derive(Debug, Default)]
struct Form {
    text: AtomicBool,
    known: AtomicBool,
}

impl Form {
    fn note(&self, text: bool) {
        if !self.known.swap(true, Ordering::Relaxed) {
            self.text.store(text, Ordering::Relaxed);
        }
    }

    /// Frames for several protobuf readers are encoded once.
    fn write(&self, said: &Outgoing) -> Result<Message, serde_json::Error> {
        // A client that is rejected before its first message gets text.
        let text = self.text.load(Ordering::Relaxed) || !self.known.load(Ordering::Relaxed);
        match text {
            true => Ok(Message::Text(serde_json::to_string(said.response())?.into())),
            false => Ok(Message::Binary(match said {
                Outgoing::Frames(message) => message.binary(),
                Outgoing::Control(response) => response.encode_to_vec().into(),
            })),
        }
    }
}

/// Serves a stream to its end. `socket` is a WebSocket, or a substitute in fuzz targets. `revoked`
/// completes if the client's credential ends, with the reason.
pub(super) async fn serve<S>(
    socket: S,
    permit: StreamPermit,
    limits: BodyLimits,
    turns: Turns,
    revoked: impl Future<Output = v1::Problem>,
) where
    S: Stream<Item = Result<Message, axum::Error>> + Sink<Message, Error = axum::Error> + Send + 'static,
{
    let form = Arc::new(Form::default());
    let sessions = permit.sessions().clone();
    let (mut sink, source) = socket.split();
    let read_form = form.clone();
    // Boxed so that it can be read further after the conversation has ended.
    let mut inbound = source
        .take_while(|message| std::future::ready(!matches!(message, Ok(Message::Close(_)))))
        .filter_map(move |message| std::future::ready(read(message, &read_form, &limits)))
        .map(|said| said.map_err(|error| error.problem()))
        .boxed();
    let (outbox, outlet) = outbox(answers::drive);
    let (ended, conversation) = oneshot::channel();
    sessions.spawn(turns, async move {
        permit.run(&mut inbound, outbox).await;
        // Sending fails only if the connection is already gone.
        let _ = ended.send((inbound, permit));
    });
    tokio::pin!(conversation);
    let ended = {
        let writing = write(outlet, &mut sink, &form);
        tokio::pin!(writing);
        tokio::select! {
            rest = &mut conversation => Ok((rest, timeout(FAREWELL, writing).await.is_ok())),
            // The client stopped reading.
            () = &mut writing => Err(None),
            reason = revoked => Err(Some(reason)),
        }
    };
    let (rest, written) = match ended {
        Ok(ended) => ended,
        // The outlet was dropped with the writer, which ends the conversation.
        Err(reason) => {
            let rest = conversation.await;
            if let Some(reason) = reason {
                let close = sink.send(Message::Close(Some(close_frame(&reason))));
                // A client that does not read gets no reason.
                let _ = timeout(FAREWELL, close).await;
            }
            (rest, true)
        }
    };
    // Keeps the stream's place until the connection ends.
    let Ok((mut inbound, _permit)) = rest else {
        return tracing::error!("a stream's conversation did not finish");
    };
    if !written {
        return tracing::debug!("a stream's client did not read the rest of it");
    }
    // Reads what the client still sends. Otherwise the system may reset the connection before the
    // client has our last messages.
    let rest = async { while inbound.next().await.is_some() {} };
    let _ = timeout(FAREWELL, rest).await;
}

/// Sends the stream's messages until its end, or until the client has left.
async fn write(
    mut outlet: Outlet,
    sink: &mut (impl Sink<Message, Error = axum::Error> + Unpin),
    form: &Form,
) {
    let mut pings = tokio::time::interval(PING_INTERVAL);
    pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
    pings.reset();
    let mut farewell = None;
    loop {
        let message = tokio::select! {
            said = outlet.next() => match said {
                None => break,
                Some(said) => {
                    if let Some(Say::Closing(closing)) = &said.response().message {
                        farewell = closing.reason.clone();
                    }
                    form.write(&said)
                }
            },
            _ = pings.tick() => Ok(Message::Ping(bytes::Bytes::new())),
        };
        let sent = match message {
            Ok(message) => sink.send(message).await,
            Err(error) => return tracing::error!(%error, "an answer cannot be written as JSON"),
        };
        if let Err(error) = sent {
            return tracing::debug!(%error, "a stream's client is gone");
        }
    }
    let close = sink
        .send(Message::Close(farewell.map(|reason| close_frame(&reason))))
        .await;
    if let Err(error) = close {
        tracing::debug!(%error, "a stream's client left before its end");
    }
}

fn close_frame(problem: &v1::Problem) -> CloseFrame {
    let code = match problem.reason.as_str() {
        "CLIENT_DONE" | "WATCHED_ENDED" => close_code::NORMAL,
        "DRAINING" => close_code::AWAY,
        _ => close_code::POLICY,
    };
    let text = match problem.reason.as_str() {
        reason @ ("INVALID_REQUEST" | "KEY_REMOVED" | "TOKEN_EXPIRED") => {
            format!("{reason}: {}", problem.message)
        }
        reason => reason.to_owned(),
    };
    let mut end = text.len().min(MAX_REASON_BYTES);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    CloseFrame {
        code,
        reason: text[..end].into(),
    }
}

/// Decodes a client's message. `None` for WebSocket's own messages.
fn read(
    message: Result<Message, axum::Error>,
    form: &Form,
    limits: &BodyLimits,
) -> Option<Result<v1::DriveRequest, ApiError>> {
    match message {
        Ok(Message::Text(text)) => {
            form.note(true);
            Some(json::read(text.as_bytes(), limits))
        }
        Ok(Message::Binary(bytes)) => {
            form.note(false);
            Some(decode(&bytes, limits))
        }
        Ok(Message::Ping(_) | Message::Pong(_) | Message::Close(_)) => None,
        Err(error) => Some(Err(broken(&error, limits.bytes))),
    }
}

pub(super) fn decode(bytes: &[u8], limits: &BodyLimits) -> Result<v1::DriveRequest, ApiError> {
    if let Some(shape) = limits.shapes.of("Drive") {
        shape.check_protobuf(bytes)?;
    }
    v1::DriveRequest::decode(bytes).map_err(|error| ApiError::Malformed {
        message: cut(&error.to_string(), MAX_MESSAGE),
        field: None,
    })
}

/// The error for a message that could not be received.
fn broken(error: &axum::Error, limit_bytes: usize) -> ApiError {
    let text = error.to_string();
    match text.contains("too long") || text.contains("too big") {
        true => ApiError::TooLarge { limit_bytes },
        false => ApiError::Malformed {
            message: cut(&text, MAX_MESSAGE),
            field: None,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_close_frame_holds_as_much_of_the_reason_as_it_may() {
        let problem = |reason: &str, message: String| v1::Problem {
            reason: reason.to_owned(),
            message,
            ..v1::Problem::default()
        };
        let frame = close_frame(&problem("INVALID_REQUEST", "é".repeat(200)));
        assert_eq!(frame.code, close_code::POLICY);
        assert!(frame.reason.len() <= MAX_REASON_BYTES && frame.reason.starts_with("INVALID_REQUEST: é"));
        let frame = close_frame(&problem("DRAINING", "the server is shutting down".into()));
        assert_eq!(
            (frame.code, frame.reason.as_str()),
            (close_code::AWAY, "DRAINING")
        );
    }

    #[test]
    fn answers_take_the_form_of_the_first_message() {
        let said = Outgoing::Control(v1::DriveResponse::default());
        let form = Form::default();
        assert!(matches!(form.write(&said).unwrap(), Message::Text(_)));
        form.note(false);
        form.note(true);
        assert!(matches!(form.write(&said).unwrap(), Message::Binary(_)));
    }
}
