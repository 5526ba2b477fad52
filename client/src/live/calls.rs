//! The client's calls about sessions.

use std::future::Future;

use troupe_proto::v1;

use super::options::SessionOptions;
use super::session::Session;
use crate::connection::{Client, SessionsRpc};
use crate::error::{AnswerError, ClientError};
use crate::pack::Pack;
use crate::route::MOVES;

/// Sessions on a page of a list, which is the server's maximum.
const PAGE: u32 = 1000;
/// Sessions of a request to create or close them, within the default limits of a server.
const CHUNK: usize = 1000;

impl Client {
    /// Opens a session: one character of a pack.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn session(&self, pack: &Pack, options: &SessionOptions) -> Result<Session, ClientError> {
        let mut sessions = self.open_sessions(pack, std::slice::from_ref(options)).await?;
        Ok(sessions.pop().ok_or(AnswerError::Missing("sessions"))?)
    }

    /// Opens many sessions of a pack, in order. If one cannot be opened, the others are closed
    /// again.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn open_sessions(
        &self,
        pack: &Pack,
        options: &[SessionOptions],
    ) -> Result<Vec<Session>, ClientError> {
        let mut sessions = Vec::with_capacity(options.len());
        for chunk in options.chunks(CHUNK) {
            match self.open_chunk(pack, chunk).await {
                Ok(opened) => sessions.extend(opened),
                Err(error) => {
                    let ids = sessions.iter().map(Session::id);
                    // The first error says most.
                    let _ = self.close_sessions(ids).await;
                    return Err(error);
                }
            }
        }
        Ok(sessions)
    }

    async fn open_chunk(&self, pack: &Pack, options: &[SessionOptions]) -> Result<Vec<Session>, ClientError> {
        let request = v1::CreateSessionsRequest {
            sessions: options.iter().map(|o| o.to_message(pack)).collect(),
        };
        let answer = self
            .placed(request, |mut rpc, request| async move {
                rpc.create_sessions(request).await
            })
            .await?;
        if answer.sessions.len() != options.len() {
            return Err(AnswerError::Length {
                field: "sessions",
                got: answer.sessions.len(),
                expected: options.len(),
            }
            .into());
        }
        let sessions = answer.sessions.iter();
        Ok(sessions.map(|of| Session::new(self, pack, of)).collect())
    }

    /// Resumes a session that is open, such as one of a client that went away.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Session`] if the session is gone.
    pub async fn resume_session(&self, id: &str) -> Result<Session, ClientError> {
        let of = self.session_info(id).await?;
        let mut pack = self.pack(&of.pack).await?;
        if !of.skeleton.is_empty() {
            let own = self.skeleton(&of.skeleton, &pack).await?;
            pack = pack.wearing(&own)?;
        }
        Ok(Session::new(self, &pack, &of))
    }

    /// The state of a session: its place, activity and counts.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Session`] if the session is gone.
    pub async fn session_info(&self, id: &str) -> Result<v1::Session, ClientError> {
        let request = v1::GetSessionRequest { id: id.to_owned() };
        self.placed(request, |mut rpc, request| async move {
            rpc.get_session(request).await
        })
        .await
    }

    /// All open sessions of the server by id, those of other clients too.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn list_sessions(&self) -> Result<Vec<v1::Session>, ClientError> {
        let mut sessions = Vec::new();
        let mut page_token = String::new();
        loop {
            let request = v1::ListSessionsRequest {
                page_size: PAGE,
                page_token,
            };
            let page = self
                .unary(|mut rpc| async move { rpc.list_sessions(request).await })
                .await?;
            sessions.extend(page.sessions);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(sessions);
            }
        }
    }

    /// Closes sessions on whatever servers have them, and returns how many were still open.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Session`] for the first session that may still be open,
    /// because its server does not answer.
    pub async fn close_sessions(
        &self,
        ids: impl IntoIterator<Item = impl Into<String>>,
    ) -> Result<usize, ClientError> {
        let ids = ids.into_iter().map(Into::into).collect::<Vec<String>>();
        let mut closed = 0;
        for chunk in ids.chunks(CHUNK) {
            closed += self.close_chunk(chunk.to_vec()).await?;
        }
        Ok(closed)
    }

    /// A server closes what it has and names the rest. If it has nothing, its error says who has,
    /// and the call goes there.
    async fn close_chunk(&self, mut ids: Vec<String>) -> Result<usize, ClientError> {
        let mut closed = 0;
        while !ids.is_empty() {
            let request = v1::CloseSessionsRequest { ids: ids.clone() };
            let answer = self
                .placed(request, |mut rpc, request| async move {
                    rpc.close_sessions(request).await
                })
                .await?;
            closed += answer.closed as usize;
            let left: Vec<String> = answer.problems.into_iter().map(|of| of.session_id).collect();
            if left.len() >= ids.len() {
                return Err(AnswerError::Length {
                    field: "problems",
                    got: left.len(),
                    expected: ids.len() - 1,
                }
                .into());
            }
            ids = left;
        }
        Ok(closed)
    }

    /// A call about sessions of this client. If they are on another server, it is made again there.
    pub(crate) async fn placed<R, T, F>(
        &self,
        request: R,
        call: impl Fn(SessionsRpc, R) -> F,
    ) -> Result<T, ClientError>
    where
        R: Clone,
        F: Future<Output = Result<tonic::Response<T>, tonic::Status>>,
    {
        for _ in 0..MOVES {
            let asked = request.clone();
            match self.unary(|rpc| call(rpc, asked)).await {
                Err(error) if self.follows(&error) => {}
                answer => return answer,
            }
        }
        self.unary(|rpc| call(rpc, request)).await
    }

    /// Whether the error names another server than the one that was asked. The next call goes
    /// there.
    fn follows(&self, error: &ClientError) -> bool {
        error
            .session_problem()
            .is_some_and(|problem| self.way.follow(problem))
    }

    /// A call with one answer.
    pub(crate) async fn unary<T, F>(&self, call: impl FnOnce(SessionsRpc) -> F) -> Result<T, ClientError>
    where
        F: Future<Output = Result<tonic::Response<T>, tonic::Status>>,
    {
        match call(self.sessions_rpc()).await {
            Ok(answer) => Ok(answer.into_inner()),
            Err(status) => Err(self.sort(&status)),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::live::testing::scripted;

    #[tokio::test]
    async fn sessions_are_closed_on_the_servers_that_have_them() {
        let (client, _, script) = scripted().await;
        let homes = [("b", "b:2"), ("c", "c:3")].map(|(id, home)| (id.to_owned(), home.to_owned()));
        script.lock().unwrap().homes = homes.into();
        assert_eq!(client.close_sessions(["a", "b", "c"]).await.unwrap(), 3);
        let script = script.lock().unwrap();
        let calls: Vec<_> = script
            .closings
            .iter()
            .map(|(server, ids)| (server.as_deref(), ids.concat()))
            .collect();
        let wanted = [
            (None, "abc"),
            (None, "bc"),
            (Some("b:2"), "bc"),
            (Some("b:2"), "c"),
            (Some("c:3"), "c"),
        ];
        assert_eq!(calls, wanted.map(|(server, ids)| (server, ids.to_owned())));
    }
}
