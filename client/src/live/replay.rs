//! Recordings that the server makes of sessions, and their replay.

use tonic::Streaming;
use troupe_proto::v1;

use crate::connection::Client;
use crate::error::{AnswerError, ClientError};

/// A replay in progress. Dropping it stops the replay.
#[derive(Debug)]
pub struct Replaying {
    client: Client,
    parts: Streaming<v1::ReplayResponse>,
    ended: bool,
}

impl Client {
    /// The server's recording of a session, also for an hour after the session's end. The session
    /// must have been opened with [`SessionOptions::record`](super::SessionOptions::record), or
    /// with a key whose sessions are all recorded.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn recording_of(&self, session: &str) -> Result<v1::SessionRecording, ClientError> {
        let session_id = session.to_owned();
        let request = v1::GetRecordingRequest { session_id };
        self.unary(|mut rpc| async move { rpc.get_recording(request).await })
            .await
    }

    /// Plays a recording on the server and compares its frames. `anyway`: also if the server has
    /// another version, engine, pack, style or skeleton than the recording.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn replay(&self, recording: String, anyway: bool) -> Result<Replaying, ClientError> {
        let request = v1::ReplayRequest { recording, anyway };
        let parts = self
            .unary(|mut rpc| async move { rpc.replay(request).await })
            .await?;
        Ok(Replaying {
            client: self.clone(),
            parts,
            ended: false,
        })
    }
}

impl Replaying {
    /// The next part: progress, or with `is_last` the result. None after the last.
    ///
    /// # Errors
    /// See [`ClientError`]. The replay ends with an error.
    pub async fn next(&mut self) -> Result<Option<v1::ReplayResponse>, ClientError> {
        if self.ended {
            return Ok(None);
        }
        let part = self.parts.message().await;
        let part = part.map_err(|status| self.client.sort(&status))?;
        let part = part.ok_or(AnswerError::Missing("is_last"))?;
        self.ended = part.is_last;
        Ok(Some(part))
    }
}

#[cfg(test)]
mod tests {
    use crate::live::testing::scripted;

    #[tokio::test]
    async fn a_replay_ends_with_its_result() {
        let (client, ..) = scripted().await;
        let recording = client.recording_of("a").await.unwrap();
        assert_eq!((recording.session_id.as_str(), recording.ended), ("a", true));
        let mut replaying = client.replay(recording.lines, true).await.unwrap();
        let first = replaying.next().await.unwrap().unwrap();
        assert_eq!((first.frames, first.is_last), (0, false));
        let last = replaying.next().await.unwrap().unwrap();
        assert_eq!((last.frames, last.is_last, last.equal), (7, true, true));
        assert_eq!(replaying.next().await.unwrap(), None);
    }
}
