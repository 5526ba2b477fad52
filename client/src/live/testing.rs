//! A server that answers by a script. It records the client's messages, and sends answers that a
//! real server seldom gives.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::{Arc, Mutex};

use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};
use tonic_types::{ErrorDetails, StatusExt as _};
use troupe_proto::v1;
use troupe_proto::v1::sessions_server::{Sessions, SessionsServer};

use crate::connection::Client;
use crate::pack::Pack;

/// Joints of the pack of the tests.
const JOINTS: usize = 2;

/// The messages of the client, and the answers of the server.
#[derive(Debug, Default)]
pub(crate) struct Script {
    /// Steps, in the order of their arrival.
    pub(crate) steps: Vec<v1::StepRequest>,
    /// Messages of streams.
    pub(crate) asked: Vec<v1::DriveRequest>,
    /// Sessions that the server cannot serve, and the reason.
    pub(crate) broken: BTreeMap<String, &'static str>,
    /// Styles that are refused.
    pub(crate) unknown_style: Option<&'static str>,
    /// The next step fails as a whole.
    pub(crate) unavailable: bool,
    /// Answers of the next stream; it ends after them.
    pub(crate) stream: Vec<v1::DriveResponse>,
    /// Answers of the streams after that.
    pub(crate) later_streams: VecDeque<Vec<v1::DriveResponse>>,
    /// Last frames that returning clients sent.
    pub(crate) resumes: Vec<v1::ResumeSessionsRequest>,
    /// Answers to the first of them.
    pub(crate) not_resumed: VecDeque<v1::ResumeSessionsResponse>,
    /// Answer to the others.
    pub(crate) resumed: Option<v1::ResumeSessionsResponse>,
    /// The server that calls to resume, and streams, named in their headers.
    pub(crate) servers: Vec<Option<String>>,
    /// Servers of sessions that are not on the one that a call without a server reaches.
    pub(crate) homes: BTreeMap<String, String>,
    /// Calls that close sessions: the server that the header names, and the sessions.
    pub(crate) closings: Vec<(Option<String>, Vec<String>)>,
    frames: BTreeMap<String, u64>,
}

#[derive(Debug, Clone)]
struct Scripted(Arc<Mutex<Script>>);

/// Starts a server by script and connects to it.
pub(crate) async fn scripted() -> (Client, Pack, Arc<Mutex<Script>>) {
    let script = Arc::new(Mutex::new(Script::default()));
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let incoming = tonic::transport::server::TcpIncoming::from(listener);
    let service = SessionsServer::new(Scripted(script.clone()));
    let server = tonic::transport::Server::builder().add_service(service);
    tokio::spawn(server.serve_with_incoming(incoming));
    let client = Client::connect(&format!("http://{address}")).await.unwrap();
    let pack = Pack::try_from(crate::pack::tests::message()).unwrap();
    (client, pack, script)
}

/// A block of one frame for each slot, whose root's x is the slot and whose frame number is given.
pub(crate) fn block(slots: &[u32], frame_count: u32, first_frames: Vec<u64>) -> v1::FrameBlock {
    let frames = slots.len() * frame_count as usize;
    let roots = slots
        .iter()
        .flat_map(|&slot| (0..frame_count).flat_map(move |_| [slot as f32, 0.9, 0.0]));
    v1::FrameBlock {
        pack: "pair".to_owned(),
        slots: slots.to_vec(),
        frame_count,
        first_frames,
        root_positions: roots.collect(),
        rotations: [1.0, 0.0, 0.0, 0.0].repeat(frames * JOINTS),
        contacts: vec![1; frames],
        ..v1::FrameBlock::default()
    }
}

pub(crate) fn problem(reason: &str) -> v1::Problem {
    v1::Problem {
        reason: reason.to_owned(),
        message: format!("because of {reason}"),
        ..v1::Problem::default()
    }
}

fn server_of<T>(request: &Request<T>) -> Option<String> {
    let server = request.metadata().get(crate::route::SERVER)?;
    Some(server.to_str().unwrap().to_owned())
}

fn failed(reason: &str) -> Status {
    refused(&problem(reason))
}

/// A problem as the error of a call.
fn refused(problem: &v1::Problem) -> Status {
    let mut details = ErrorDetails::new();
    let more = [("field", &problem.field), ("allowed", &problem.allowed)];
    let given = more.into_iter().filter(|(_, text)| !text.is_empty());
    let given: HashMap<_, _> = given.map(|(key, text)| (key.to_owned(), text.clone())).collect();
    details.set_error_info(problem.reason.clone(), "troupe", given);
    Status::with_error_details(tonic::Code::NotFound, problem.message.clone(), details)
}

impl Script {
    /// Problems of the sessions that are not on a server.
    fn elsewhere(&self, server: Option<&String>, ids: &[String]) -> Vec<v1::SessionProblem> {
        let named = |(slot, id): (usize, &String)| {
            let home = self.homes.get(id)?;
            (Some(home) != server).then(|| v1::SessionProblem {
                slot: slot as u32,
                session_id: id.clone(),
                problem: Some(v1::Problem {
                    field: format!("ids[{slot}]"),
                    allowed: home.clone(),
                    ..problem("SESSION_ELSEWHERE")
                }),
            })
        };
        ids.iter().enumerate().filter_map(named).collect()
    }

    fn result(&self, command: &v1::Command) -> v1::CommandResult {
        let refused = match &command.intent {
            Some(v1::command::Intent::Locomote(l)) => self.unknown_style == Some(l.style.as_str()),
            Some(_) => false,
            None => true,
        };
        v1::CommandResult {
            session_id: command.session_id.clone(),
            sequence: command.sequence,
            status: if refused {
                v1::CommandStatus::Refused.into()
            } else {
                v1::CommandStatus::Accepted.into()
            },
            problem: refused.then(|| problem("UNKNOWN_STYLE")),
        }
    }

    fn step(&mut self, request: v1::StepRequest) -> Result<v1::StepResponse, Status> {
        self.steps.push(request.clone());
        if std::mem::take(&mut self.unavailable) {
            return Err(Status::unavailable("the queue is full"));
        }
        let (mut slots, mut first_frames, mut problems) = (Vec::new(), Vec::new(), Vec::new());
        for (slot, id) in request.session_ids.iter().enumerate() {
            if let Some(reason) = self.broken.get(id) {
                problems.push(v1::SessionProblem {
                    slot: slot as u32,
                    session_id: id.clone(),
                    problem: Some(problem(reason)),
                });
                continue;
            }
            let frame = self.frames.entry(id.clone()).or_default();
            slots.push(slot as u32);
            first_frames.push(*frame);
            *frame += u64::from(request.frames);
        }
        if slots.is_empty() {
            let reason = problems.first().and_then(|p| p.problem.clone());
            return Err(failed(&reason.unwrap_or_default().reason));
        }
        Ok(v1::StepResponse {
            blocks: vec![block(&slots, request.frames, first_frames)],
            command_results: request.commands.iter().map(|c| self.result(c)).collect(),
            problems,
            total_us: 900,
            waited_us: 700,
            events: interactions(&request)
                .map(|(slot, of)| started(slot, of))
                .collect(),
            held: interactions(&request)
                .map(|(slot, of)| v1::HeldObject {
                    slot,
                    instance: of.instance.clone(),
                    ..v1::HeldObject::default()
                })
                .collect(),
        })
    }
}

/// The sessions of a step that use an object. It is in their hands at once.
fn interactions(request: &v1::StepRequest) -> impl Iterator<Item = (u32, &v1::Interact)> {
    request.commands.iter().filter_map(|command| {
        let slot = request
            .session_ids
            .iter()
            .position(|id| *id == command.session_id)?;
        match &command.intent {
            Some(v1::command::Intent::Interact(interact)) => Some((slot as u32, interact)),
            _ => None,
        }
    })
}

fn started(slot: u32, of: &v1::Interact) -> v1::SessionEvents {
    let started = v1::InteractionStarted {
        instance: of.instance.clone(),
        variant: of.variant.clone(),
        ..v1::InteractionStarted::default()
    };
    v1::SessionEvents {
        slot,
        events: vec![v1::SessionEvent {
            frame: 1,
            kind: Some(v1::session_event::Kind::Started(started)),
        }],
        ..v1::SessionEvents::default()
    }
}

#[tonic::async_trait]
impl Sessions for Scripted {
    async fn create_sessions(
        &self,
        request: Request<v1::CreateSessionsRequest>,
    ) -> Result<Response<v1::CreateSessionsResponse>, Status> {
        let sessions = request.into_inner().sessions.into_iter();
        let session = |of: v1::SessionOptions| v1::Session {
            id: of.id,
            convention: of.convention,
            ..v1::Session::default()
        };
        Ok(Response::new(v1::CreateSessionsResponse {
            sessions: sessions.map(session).collect(),
        }))
    }

    async fn get_session(
        &self,
        request: Request<v1::GetSessionRequest>,
    ) -> Result<Response<v1::Session>, Status> {
        let id = request.into_inner().id;
        match self.0.lock().unwrap().broken.get(&id) {
            Some(&reason) if reason != "SESSION_BUSY" => Err(failed(reason)),
            _ => Ok(Response::new(v1::Session {
                id,
                ..v1::Session::default()
            })),
        }
    }

    async fn list_sessions(
        &self,
        request: Request<v1::ListSessionsRequest>,
    ) -> Result<Response<v1::ListSessionsResponse>, Status> {
        // The list has two pages.
        let first = request.into_inner().page_token.is_empty();
        let session = |id: &str, underruns| v1::Session {
            id: id.to_owned(),
            stats: Some(v1::SessionStats {
                underruns,
                plans_for_command: 1,
                ..v1::SessionStats::default()
            }),
            ..v1::Session::default()
        };
        Ok(Response::new(if first {
            v1::ListSessionsResponse {
                sessions: vec![session("c0", 2), session("foreign", 100)],
                next_page_token: "more".to_owned(),
                total: 3,
            }
        } else {
            v1::ListSessionsResponse {
                sessions: vec![session("c1", 3)],
                ..v1::ListSessionsResponse::default()
            }
        }))
    }

    async fn close_sessions(
        &self,
        request: Request<v1::CloseSessionsRequest>,
    ) -> Result<Response<v1::CloseSessionsResponse>, Status> {
        let server = server_of(&request);
        let ids = request.into_inner().ids;
        let mut script = self.0.lock().unwrap();
        script.closings.push((server.clone(), ids.clone()));
        let problems = script.elsewhere(server.as_ref(), &ids);
        let closed = ids.len() - problems.len();
        if let (
            0,
            Some(v1::SessionProblem {
                problem: Some(of), ..
            }),
        ) = (closed, problems.first())
        {
            return Err(refused(of));
        }
        Ok(Response::new(v1::CloseSessionsResponse {
            closed: closed as u32,
            problems,
        }))
    }

    async fn command(
        &self,
        request: Request<v1::CommandRequest>,
    ) -> Result<Response<v1::CommandResponse>, Status> {
        let script = self.0.lock().unwrap();
        let commands = request.into_inner().commands;
        Ok(Response::new(v1::CommandResponse {
            results: commands.iter().map(|c| script.result(c)).collect(),
        }))
    }

    async fn step(&self, request: Request<v1::StepRequest>) -> Result<Response<v1::StepResponse>, Status> {
        self.0
            .lock()
            .unwrap()
            .step(request.into_inner())
            .map(Response::new)
    }

    type DriveStream = ReceiverStream<Result<v1::DriveResponse, Status>>;

    async fn drive(
        &self,
        request: Request<Streaming<v1::DriveRequest>>,
    ) -> Result<Response<Self::DriveStream>, Status> {
        let server = server_of(&request);
        let mut asked = request.into_inner();
        let answers = {
            let mut script = self.0.lock().unwrap();
            script.servers.push(server);
            let later = script.later_streams.pop_front().unwrap_or_default();
            std::mem::replace(&mut script.stream, later)
        };
        let (send, receive) = mpsc::channel(answers.len().max(1));
        for answer in answers {
            send.try_send(Ok(answer)).unwrap();
        }
        let script = self.0.clone();
        tokio::spawn(async move {
            while let Ok(Some(message)) = asked.message().await {
                script.lock().unwrap().asked.push(message);
            }
            drop(send);
        });
        Ok(Response::new(ReceiverStream::new(receive)))
    }

    async fn resume_sessions(
        &self,
        request: Request<v1::ResumeSessionsRequest>,
    ) -> Result<Response<v1::ResumeSessionsResponse>, Status> {
        let mut script = self.0.lock().unwrap();
        script.servers.push(server_of(&request));
        script.resumes.push(request.into_inner());
        let resumed = script.not_resumed.pop_front().or_else(|| script.resumed.clone());
        Ok(Response::new(
            resumed.ok_or_else(|| Status::unavailable("it starts"))?,
        ))
    }

    async fn get_recording(
        &self,
        request: Request<v1::GetRecordingRequest>,
    ) -> Result<Response<v1::SessionRecording>, Status> {
        Ok(Response::new(v1::SessionRecording {
            session_id: request.into_inner().session_id,
            lines: "{}\n".to_owned(),
            ended: true,
        }))
    }

    type ReplayStream = ReceiverStream<Result<v1::ReplayResponse, Status>>;

    async fn replay(
        &self,
        request: Request<v1::ReplayRequest>,
    ) -> Result<Response<Self::ReplayStream>, Status> {
        let asked = request.into_inner();
        let (send, receive) = mpsc::channel(2);
        send.try_send(Ok(v1::ReplayResponse::default())).unwrap();
        let result = v1::ReplayResponse {
            frames: 7,
            is_last: true,
            equal: asked.anyway && asked.recording == "{}\n",
            ..v1::ReplayResponse::default()
        };
        send.try_send(Ok(result)).unwrap();
        Ok(Response::new(ReceiverStream::new(receive)))
    }

    async fn peek(&self, _: Request<v1::PeekRequest>) -> Result<Response<v1::PeekResponse>, Status> {
        Ok(Response::new(v1::PeekResponse {
            future: Some(block(&[0], 3, vec![11])),
            ..v1::PeekResponse::default()
        }))
    }

    async fn list_styles(
        &self,
        _: Request<v1::ListStylesRequest>,
    ) -> Result<Response<v1::ListStylesResponse>, Status> {
        Err(Status::unimplemented("not part of the script"))
    }

    async fn get_style(&self, _: Request<v1::GetStyleRequest>) -> Result<Response<v1::Style>, Status> {
        Err(Status::unimplemented("not part of the script"))
    }

    async fn put_style(&self, _: Request<v1::PutStyleRequest>) -> Result<Response<v1::Style>, Status> {
        Err(Status::unimplemented("not part of the script"))
    }
}
