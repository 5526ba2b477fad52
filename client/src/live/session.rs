//! One character.

use glam::Vec3;
use troupe_motion::conventions::Convention;
use troupe_proto::v1;

use super::act::Act;
use super::frames::{Block, Frames};
use super::locomotion::{Intent, Locomotion};
use super::options::{FrameOptions, convention_from_wire};
use crate::connection::Client;
use crate::error::{AnswerError, ClientError};
use crate::pack::Pack;
use crate::problem::Problem;

/// One live character on a server, opened by [`Client::session`].
///
/// What it should do is set in place and goes to the server with the next step:
///
/// ```no_run
/// use glam::Vec3;
/// use troupe_client::{Client, SessionOptions};
///
/// # async fn example() -> Result<(), troupe_client::ClientError> {
/// let client = Client::connect("http://127.0.0.1:8080").await?;
/// let pack = client.pack("").await?;
/// let mut guard = client.session(&pack, &SessionOptions::new().seed(7)).await?;
///
/// guard.walk(Vec3::new(0.0, 0.0, 1.4)).style("elderly");
/// for frame in guard.step(30).await?.iter() {
///     println!("the hips are at {}", frame.root);
/// }
/// guard.stand();
/// guard.step(30).await?;
/// guard.close().await?;
/// # Ok(())
/// # }
/// ```
///
/// A session that is dropped stays on the server until its time to live has passed, and can be
/// taken up again with [`Client::resume_session`].
#[derive(Debug)]
pub struct Session {
    client: Client,
    pack: Pack,
    id: String,
    convention: Convention,
    options: FrameOptions,
    intent: Intent,
    block: Block,
    events: v1::SessionEvents,
    held: Option<v1::HeldObject>,
}

impl Session {
    pub(crate) fn new(client: &Client, pack: &Pack, of: &v1::Session) -> Self {
        Self {
            client: client.clone(),
            pack: pack.clone(),
            id: of.id.clone(),
            convention: convention_from_wire(of.convention()),
            options: FrameOptions::default(),
            intent: Intent::after(of.last_sequence),
            block: Block::default(),
            events: v1::SessionEvents::default(),
            held: of.held.clone(),
        }
    }

    /// Its name on the server.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Its pack.
    pub fn pack(&self) -> &Pack {
        &self.pack
    }

    /// Axes and unit of all that it takes and gives.
    pub fn convention(&self) -> Convention {
        self.convention
    }

    /// How its frames are taken.
    pub fn frame_options(&self) -> FrameOptions {
        self.options
    }

    /// Changes how its frames are taken.
    pub fn set_frame_options(&mut self, options: FrameOptions) {
        self.options = options;
    }

    /// Goes with this velocity from now on, in the session's units per second over the ground.
    pub fn walk(&mut self, velocity: Vec3) -> &mut Self {
        self.intent.wanted_mut().velocity = velocity;
        self
    }

    /// Stands.
    pub fn stand(&mut self) -> &mut Self {
        self.walk(Vec3::ZERO)
    }

    /// Faces this way, radians, whatever the velocity.
    pub fn face(&mut self, heading: f32) -> &mut Self {
        self.intent.wanted_mut().facing = Some(heading);
        self
    }

    /// Faces where it goes.
    pub fn face_ahead(&mut self) -> &mut Self {
        self.intent.wanted_mut().facing = None;
        self
    }

    /// Moves in this style.
    pub fn style(&mut self, style: impl Into<String>) -> &mut Self {
        self.intent.wanted_mut().style = Some(style.into());
        self
    }

    /// Uses this gait alone, or with none those that suit the velocity.
    pub fn gait(&mut self, gait: Option<&str>) -> &mut Self {
        self.intent.wanted_mut().gait = gait.map(str::to_owned);
        self
    }

    /// Holds the root joint at this height, or with none at the style's.
    pub fn height(&mut self, height: Option<f32>) -> &mut Self {
        self.intent.wanted_mut().height = height;
        self
    }

    /// Does something once, such as use an object of its scene. Until it is to walk again its
    /// locomotion is left alone: a change breaks off what it does. It goes with the next step;
    /// where that fails it may not have arrived, and is not sent again.
    pub fn act(&mut self, act: &Act) -> &mut Self {
        self.intent.act(act);
        self
    }

    /// How much it matters that it is planned for often, where there are more characters than the
    /// server can serve: 0 is far from the camera, 1 the hero. Changes nothing of what it does.
    pub fn priority(&mut self, priority: f32) -> &mut Self {
        self.intent.set_priority(priority);
        self
    }

    /// What it should do.
    pub fn intent(&self) -> &Locomotion {
        self.intent.wanted()
    }

    /// Replaces all of what it should do.
    pub fn set_intent(&mut self, intent: Locomotion) -> &mut Self {
        *self.intent.wanted_mut() = intent;
        self
    }

    /// Advances it and returns its next frames, 1 to 120. What it should do goes with it where it
    /// changed.
    ///
    /// # Errors
    /// See [`ClientError`]. [`ClientError::Session`] where the session is gone, in another's hands,
    /// or refuses what it should do; in the last case it has moved on as before, and
    /// [`Self::frames`] has the frames.
    pub async fn step(&mut self, frames: u32) -> Result<Frames<'_>, ClientError> {
        let request = v1::StepRequest {
            session_ids: vec![self.id.clone()],
            frames,
            rate_hz: self.options.rate.hz(),
            commands: self.intent.commands(&self.id),
            encoding: self.options.encoding.to_wire(),
            return_positions: self.options.positions,
            ..v1::StepRequest::default()
        };
        let answer = self
            .client
            .unary(|mut rpc| async move { rpc.step(request).await })
            .await;
        let answer = answer.inspect_err(|_| self.intent.doubt())?;
        if let Some(problem) = answer.problems.into_iter().find_map(|p| p.problem) {
            return Err(ClientError::session(&self.id, problem.into()));
        }
        let block = answer.blocks.into_iter().next();
        let convention = self.convention;
        let block = block.ok_or(AnswerError::Missing("blocks"))?;
        self.block.read(block, self.pack.skeleton(), |_| convention)?;
        self.events = answer.events.into_iter().next().unwrap_or_default();
        self.held = answer.held.into_iter().next();
        self.take_results(&answer.command_results)?;
        Ok(self.frames())
    }

    /// What happened to it in its scene in the last step.
    pub fn events(&self) -> &[v1::SessionEvent] {
        &self.events.events
    }

    /// What is in its hand at the last frame of the last step.
    pub fn held(&self) -> Option<&v1::HeldObject> {
        self.held.as_ref()
    }

    /// The frames of the last step.
    pub fn frames(&self) -> Frames<'_> {
        self.block.frames(0)
    }

    /// Sends what it should do now, where it changed, without a step.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Session`] where the session is gone or refuses it.
    pub async fn send(&mut self) -> Result<(), ClientError> {
        for command in self.intent.commands(&self.id) {
            self.send_command(command).await?;
        }
        Ok(())
    }

    /// Sends what it should do from a frame of its timeline on, such as one that the whole scene
    /// agreed on. The newest such command replaces one that still waits.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub async fn send_at(&mut self, frame: u64) -> Result<(), ClientError> {
        let command = self.intent.command(&self.id, Some(frame));
        self.send_command(command).await
    }

    async fn send_command(&mut self, command: v1::Command) -> Result<(), ClientError> {
        let request = v1::CommandRequest {
            commands: vec![command],
        };
        let answer = self
            .client
            .unary(|mut rpc| async move { rpc.command(request).await })
            .await;
        let answer = answer.inspect_err(|_| self.intent.doubt())?;
        self.take_results(&answer.results)
    }

    /// The first refusal is an error. A late command is none: whoever commanded since knows better.
    fn take_results(&mut self, results: &[v1::CommandResult]) -> Result<(), ClientError> {
        match refusal(results, &self.id) {
            Some(problem) => Err(ClientError::session(&self.id, problem)),
            None => Ok(()),
        }
    }

    /// The session as the server has it. Commands that others gave meanwhile are taken note of, so
    /// that this client's next one is newer.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Session`] where it is gone.
    pub async fn info(&mut self) -> Result<v1::Session, ClientError> {
        let info = self.client.session_info(&self.id).await?;
        self.intent.seen(info.last_sequence);
        Ok(info)
    }

    /// Up to `frames` of its buffered future (0: all), and the plan behind it. Changes nothing.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Session`] where it is gone.
    pub async fn peek(&self, frames: u32) -> Result<v1::PeekResponse, ClientError> {
        let request = v1::PeekRequest {
            session_id: self.id.clone(),
            frames,
        };
        self.client
            .unary(|mut rpc| async move { rpc.peek(request).await })
            .await
    }

    /// Closes it on the server.
    ///
    /// # Errors
    /// See [`ClientError`]; that it is gone already is none.
    pub async fn close(self) -> Result<(), ClientError> {
        self.client.close_sessions([self.id]).await.map(|_| ())
    }

    pub(crate) fn intent_mut(&mut self) -> &mut Intent {
        &mut self.intent
    }
}

/// Why the session's command was refused, where it was.
pub(crate) fn refusal(results: &[v1::CommandResult], session: &str) -> Option<Problem> {
    results
        .iter()
        .filter(|result| result.session_id == session && result.status() == v1::CommandStatus::Refused)
        .map(|result| Problem::from(result.problem.clone().unwrap_or_default()))
        .next()
}
