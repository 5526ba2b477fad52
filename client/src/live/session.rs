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
/// Set its intent in place. The next step sends it to the server:
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
/// A session that is dropped stays on the server until its time to live has passed.
/// [`Client::resume_session`] resumes it.
#[derive(Debug)]
pub struct Session {
    client: Client,
    pack: Pack,
    id: String,
    convention: Convention,
    options: FrameOptions,
    intent: Intent,
    block: Block,
    /// Frames of the last call of [`Session::future`].
    ahead: Block,
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
            ahead: Block::default(),
            events: v1::SessionEvents::default(),
            held: of.held.clone(),
        }
    }

    /// Id on the server.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The pack that it was opened with.
    pub fn pack(&self) -> &Pack {
        &self.pack
    }

    /// Axes and unit of its input and output.
    pub fn convention(&self) -> Convention {
        self.convention
    }

    /// Rate and encoding of its frames.
    pub fn frame_options(&self) -> FrameOptions {
        self.options
    }

    /// Changes rate and encoding of its frames.
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

    /// Faces this heading, radians, at any velocity.
    pub fn face(&mut self, heading: f32) -> &mut Self {
        self.intent.wanted_mut().facing = Some(heading);
        self
    }

    /// Faces along its velocity.
    pub fn face_ahead(&mut self) -> &mut Self {
        self.intent.wanted_mut().facing = None;
        self
    }

    /// Moves in this style.
    pub fn style(&mut self, style: impl Into<String>) -> &mut Self {
        self.intent.wanted_mut().style = Some(style.into());
        self
    }

    /// Uses this gait alone. None: the gaits that suit the velocity.
    pub fn gait(&mut self, gait: Option<&str>) -> &mut Self {
        self.intent.wanted_mut().gait = gait.map(str::to_owned);
        self
    }

    /// Holds the root joint at this height. None: the style's height.
    pub fn height(&mut self, height: Option<f32>) -> &mut Self {
        self.intent.wanted_mut().height = height;
        self
    }

    /// Does something once, such as use an object of its scene. Do not change its locomotion
    /// until it is over, because a change ends the action. The next step sends the action. If that
    /// step fails, the action may not have arrived, and is not sent again.
    pub fn act(&mut self, act: &Act) -> &mut Self {
        self.intent.act(act);
        self
    }

    /// Sets the priority for plans, which counts if there are more characters than the server can
    /// serve: 0 is far from the camera, 1 the hero. Its motion does not change otherwise.
    pub fn priority(&mut self, priority: f32) -> &mut Self {
        self.intent.set_priority(priority);
        self
    }

    /// The current intent.
    pub fn intent(&self) -> &Locomotion {
        self.intent.wanted()
    }

    /// Replaces the whole intent.
    pub fn set_intent(&mut self, intent: Locomotion) -> &mut Self {
        *self.intent.wanted_mut() = intent;
        self
    }

    /// Advances it and returns its next frames, 1 to 120. A changed intent goes with the call.
    ///
    /// # Errors
    /// See [`ClientError`]. [`ClientError::Session`] if the session is gone, another client
    /// advances it, or it refuses its intent. In the last case it has moved on as before, and
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
            .placed(request, |mut rpc, request| async move { rpc.step(request).await })
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

    /// Its events in its scene in the last step.
    pub fn events(&self) -> &[v1::SessionEvent] {
        &self.events.events
    }

    /// The object in its hand at the last frame of the last step.
    pub fn held(&self) -> Option<&v1::HeldObject> {
        self.held.as_ref()
    }

    /// The frames of the last step.
    pub fn frames(&self) -> Frames<'_> {
        self.block.frames(0)
    }

    /// Sends a changed intent now, without a step.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Session`] if the session is gone or refuses it.
    pub async fn send(&mut self) -> Result<(), ClientError> {
        for command in self.intent.commands(&self.id) {
            self.send_command(command).await?;
        }
        Ok(())
    }

    /// Sends the intent for a frame of its timeline, such as one that a whole scene agreed on. A
    /// newer such command replaces one that still waits.
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
            .placed(
                request,
                |mut rpc, request| async move { rpc.command(request).await },
            )
            .await;
        let answer = answer.inspect_err(|_| self.intent.doubt())?;
        self.take_results(&answer.results)
    }

    /// The first refusal is an error. A late command is not, because a newer one has come.
    fn take_results(&mut self, results: &[v1::CommandResult]) -> Result<(), ClientError> {
        match refusal(results, &self.id) {
            Some(problem) => Err(ClientError::session(&self.id, problem)),
            None => Ok(()),
        }
    }

    /// The state of the session on the server. It also takes the sequence numbers of other clients,
    /// so that this client's next command is newer.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Session`] if the session is gone.
    pub async fn info(&mut self) -> Result<v1::Session, ClientError> {
        let info = self.client.session_info(&self.id).await?;
        self.intent.seen(info.last_sequence);
        Ok(info)
    }

    /// Up to `frames` of its buffered future (0: all), and the plan behind it. Changes nothing.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Session`] if the session is gone.
    pub async fn peek(&self, frames: u32) -> Result<v1::PeekResponse, ClientError> {
        let request = v1::PeekRequest {
            session_id: self.id.clone(),
            frames,
        };
        self.client
            .placed(request, |mut rpc, request| async move { rpc.peek(request).await })
            .await
    }

    /// Its buffered future: the frames of its timeline after the last step, at the pack's rate. A
    /// command or a new plan changes them.
    ///
    /// # Errors
    /// As [`Self::peek`].
    pub async fn future(&mut self) -> Result<Frames<'_>, ClientError> {
        let block = self.peek(0).await?.future;
        let convention = self.convention;
        let block = block.ok_or(AnswerError::Missing("future"))?;
        self.ahead.read(block, self.pack.skeleton(), |_| convention)?;
        Ok(self.ahead.frames(0))
    }

    /// Closes it on the server.
    ///
    /// # Errors
    /// See [`ClientError`]. A session that is gone already is no error.
    pub async fn close(self) -> Result<(), ClientError> {
        self.client.close_sessions([self.id]).await.map(|_| ())
    }

    pub(crate) fn intent_mut(&mut self) -> &mut Intent {
        &mut self.intent
    }
}

/// The refusal of the session's command, if any.
pub(crate) fn refusal(results: &[v1::CommandResult], session: &str) -> Option<Problem> {
    results
        .iter()
        .filter(|result| result.session_id == session && result.status() == v1::CommandStatus::Refused)
        .map(|result| Problem::from(result.problem.clone().unwrap_or_default()))
        .next()
}
