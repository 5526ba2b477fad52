//! Sessions, commands and steps as tests make them.

use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;
use tonic::transport::Channel;
use troupe_proto::v1;
use troupe_proto::v1::command::Intent;
use troupe_proto::v1::drive_request::Message as Ask;
use troupe_proto::v1::sessions_client::SessionsClient;

/// Gates of streams and calls.
pub type Client = SessionsClient<Channel>;

/// A session of that id at the origin, in the usual style.
pub fn options(id: &str) -> v1::SessionOptions {
    v1::SessionOptions {
        id: id.into(),
        seed: 7,
        ..v1::SessionOptions::default()
    }
}

/// Opens sessions of those ids.
pub async fn open(client: &mut Client, ids: &[impl AsRef<str>]) -> Vec<v1::Session> {
    let sessions = ids.iter().map(|id| options(id.as_ref())).collect();
    let request = v1::CreateSessionsRequest { sessions };
    client
        .create_sessions(request)
        .await
        .unwrap()
        .into_inner()
        .sessions
}

/// Ids `prefix-0` and so on.
pub fn ids(prefix: &str, count: usize) -> Vec<String> {
    (0..count).map(|index| format!("{prefix}-{index}")).collect()
}

/// A command to move with `(x, z)` m/s.
pub fn walk(id: &str, sequence: u64, (x, z): (f32, f32)) -> v1::Command {
    v1::Command {
        session_id: id.into(),
        sequence,
        at_frame: None,
        intent: Some(Intent::Locomote(v1::Locomote {
            velocity: Some(v1::Vec3 { x, y: 0.0, z }),
            ..v1::Locomote::default()
        })),
        priority: None,
    }
}

/// What the command asks for.
pub fn locomote(command: &mut v1::Command) -> &mut v1::Locomote {
    match &mut command.intent {
        Some(Intent::Locomote(locomote)) => locomote,
        other => panic!("{other:?}"),
    }
}

/// A step of `frames` frames.
pub fn step(ids: &[impl AsRef<str>], frames: u32, commands: Vec<v1::Command>) -> v1::StepRequest {
    v1::StepRequest {
        session_ids: ids.iter().map(|id| id.as_ref().to_owned()).collect(),
        frames,
        commands,
        ..v1::StepRequest::default()
    }
}

/// Steps, and gives the one block.
pub async fn stepped(client: &mut Client, request: v1::StepRequest) -> v1::FrameBlock {
    let mut answer = client.step(request).await.unwrap().into_inner();
    assert_eq!((answer.blocks.len(), answer.problems.len()), (1, 0), "{answer:?}");
    answer.blocks.remove(0)
}

/// Roots and rotations of the character at place `index` of a block.
pub fn frames_of(block: &v1::FrameBlock, index: usize) -> (Vec<f32>, Vec<f32>) {
    let part = |column: &[f32]| {
        let size = column.len() / block.slots.len();
        column[index * size..(index + 1) * size].to_vec()
    };
    (part(&block.root_positions), part(&block.rotations))
}

/// Both ends of a stream.
pub type Ends = (mpsc::Sender<v1::DriveRequest>, Streaming<v1::DriveResponse>);

/// A stream on which nothing was said.
pub async fn start_drive(client: &mut Client) -> Ends {
    let (ask, asked) = mpsc::channel(16);
    let answers = client
        .drive(ReceiverStream::new(asked))
        .await
        .unwrap()
        .into_inner();
    (ask, answers)
}

/// A stream with those sessions, which walk.
pub async fn drive(client: &mut Client, names: &[String]) -> Ends {
    let (ask, answers) = start_drive(client).await;
    let commands = names.iter().map(|id| walk(id, 1, (0.0, 1.2))).collect();
    for message in [
        Ask::Open(v1::DriveOpen::default()),
        Ask::Attach(v1::DriveAttach {
            session_ids: names.to_vec(),
        }),
        Ask::Command(v1::CommandRequest { commands }),
    ] {
        let message = Some(message);
        ask.send(v1::DriveRequest { message }).await.unwrap();
    }
    (ask, answers)
}
