//! Async Rust client of the Troupe motion server.
//!
//! ```no_run
//! use troupe_client::{Client, InBetween};
//! use troupe_motion::clip::Clip;
//!
//! # async fn example(walk: Clip) -> Result<(), troupe_client::ClientError> {
//! let client = Client::connect("http://127.0.0.1:8080").await?;
//! let pack = client.pack("").await?; // the server's default pack
//!
//! // Frame 40 and the three before it are the context, frame 75 is the target keyframe.
//! let gap = InBetween::from_clip(&walk, 40, 75)?.seed(7).temperature(0.8);
//! let answer = client.in_between(&pack, &gap).await?;
//! println!("{} frames on {} joints", answer.clip.frames(), answer.clip.skeleton.joint_count());
//! # Ok(())
//! # }
//! ```
//!
//! Live characters, which move until they get another command, are in [`live`]:
//!
//! ```no_run
//! use glam::Vec3;
//! use troupe_client::{Client, SessionOptions};
//!
//! # async fn example() -> Result<(), troupe_client::ClientError> {
//! let client = Client::connect("http://127.0.0.1:8080").await?;
//! let pack = client.pack("").await?;
//! let mut guard = client.session(&pack, &SessionOptions::new().seed(7)).await?;
//! guard.walk(Vec3::Z * 1.4).style("elderly");
//! for frame in guard.step(30).await?.iter() {
//!     println!("the hips are at {}", frame.root);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Frames of single requests go by the conventions of `motion.proto`: right-handed, Y up, +Z
//! forward, metres, radians.

mod connection;
mod error;
mod generate;
mod inbetween;
mod life;
pub mod live;
mod metrics;
mod pack;
mod problem;
mod root_key;
mod route;
mod scenes;
mod skeletons;
mod styles;
mod tls;
mod words;

pub use connection::{ApiKey, Bearer, Client, ConnectOptions, InBetweenAnswers, KeyedChannel, channel};
pub use error::{AnswerError, ClientError, RefusedCall, RequestError, Violation};
pub use generate::{FollowPath, Generated, GeneratedPart, Generating};
pub use inbetween::{CONTEXT_FRAMES, InBetween, InBetweenAnswer, Key, SegmentLength};
pub use live::{
    Act, Crowd, CrowdOptions, Drive, DriveEvent, DriveOptions, Encoding, Frame, FrameOptions, Frames,
    LivePath, Locomotion, MemberId, PathPoint, Performance, Rate, Recording, Replaying, Session,
    SessionOptions,
};
pub use pack::Pack;
pub use problem::{Problem, ProblemKind, SessionError};
pub use root_key::RootKey;
pub use route::Route;
pub use tls::{ClientCertificate, TlsOptions};
pub use words::{Describe, Describing, Description, DescriptionPart, Prompt, TokenSampling};
