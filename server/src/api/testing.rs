//! Decoding and checking of messages, for fuzz targets.

use std::collections::VecDeque;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};

use axum::extract::ws::Message;
use futures_util::{Sink, Stream};
use troupe_proto::rpc::Request;
use troupe_proto::v1;

use super::ApiLimits;
use super::error::ApiError;
use super::http::json::{self, BodyLimits};
use super::shape::Shapes;
use super::ws;
use troupe_base::turns::Turns;
use troupe_service::{Service, ServiceError};

/// Decodes messages like the server.
pub struct Reader(BodyLimits);

impl Reader {
    /// A reader with these limits.
    pub fn new(limits: &ApiLimits) -> Self {
        Self(BodyLimits {
            bytes: limits.message_bytes,
            shapes: Arc::new(Shapes::new(limits)),
        })
    }

    /// Decodes a JSON message.
    ///
    /// # Errors
    /// [`ApiError`] if it is too large or cannot be read.
    pub fn json<T: Request>(&self, bytes: &[u8]) -> Result<T, ApiError> {
        json::read(bytes, &self.0)
    }

    /// Decodes a stream's protobuf message.
    ///
    /// # Errors
    /// [`ApiError`] if it is too large or cannot be read.
    pub fn drive(&self, bytes: &[u8]) -> Result<v1::DriveRequest, ApiError> {
        ws::decode(bytes, &self.0)
    }

    /// Sends `messages` on a WebSocket stream, one after another, and returns what the server
    /// sends.
    ///
    /// # Errors
    /// [`ApiError`] if no stream is free.
    pub async fn websocket(
        &self,
        service: &Service,
        messages: Vec<Message>,
    ) -> Result<Vec<Message>, ApiError> {
        let permit = service.sessions().open_stream().map_err(ServiceError::from)?;
        let said = Arc::new(Mutex::new(Vec::new()));
        let socket = Socket {
            asks: messages.into(),
            says: said.clone(),
        };
        let limits = self.0.clone().of_stream();
        ws::serve(socket, permit, limits, Turns::endless(), std::future::pending()).await;
        Ok(std::mem::take(
            &mut *said.lock().unwrap_or_else(PoisonError::into_inner),
        ))
    }
}

/// The client's end of a WebSocket. All that the client sends is in it from the start.
struct Socket {
    asks: VecDeque<Message>,
    says: Arc<Mutex<Vec<Message>>>,
}

impl Stream for Socket {
    type Item = Result<Message, axum::Error>;

    fn poll_next(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        Poll::Ready(self.asks.pop_front().map(Ok))
    }
}

impl Sink<Message> for Socket {
    type Error = axum::Error;

    fn poll_ready(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Result<(), axum::Error>> {
        Poll::Ready(Ok(()))
    }

    fn start_send(self: Pin<&mut Self>, message: Message) -> Result<(), axum::Error> {
        self.says
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(message);
        Ok(())
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Result<(), axum::Error>> {
        Poll::Ready(Ok(()))
    }

    fn poll_close(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Result<(), axum::Error>> {
        Poll::Ready(Ok(()))
    }
}
