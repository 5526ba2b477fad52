//! Many characters, advanced together.

use std::collections::BTreeMap;
use std::time::Duration;

use futures_util::future::join_all;
use futures_util::{StreamExt as _, stream};
use troupe_motion::conventions::Convention;
use troupe_proto::v1;

use super::act::Act;
use super::frames::{Block, Frames};
use super::locomotion::Locomotion;
use super::options::{FrameOptions, SessionOptions};
use super::session::{Session, refusal};
use crate::connection::Client;
use crate::error::{AnswerError, ClientError};
use crate::pack::Pack;
use crate::problem::Problem;

/// Maximum number of concurrent queries of single sessions.
const QUESTIONS: usize = 32;

/// Options of a crowd.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CrowdOptions {
    /// Rate and form of frames.
    pub frames: FrameOptions,
    /// Characters of one request, at most 1024. More characters are split over requests that run at
    /// the same time.
    pub per_request: usize,
}

impl Default for CrowdOptions {
    /// 30 frames a second as floats, 1024 characters a request.
    fn default() -> Self {
        Self {
            frames: FrameOptions::default(),
            per_request: 1024,
        }
    }
}

/// A character of a crowd. No other character gets the same one later.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MemberId(usize);

impl MemberId {
    /// Index of the character, from 0 in the order in which characters were added.
    pub fn index(self) -> usize {
        self.0
    }
}

/// A problem of one character of a crowd.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// The character with the problem.
    pub member: MemberId,
    /// Id of the character's session.
    pub session: String,
    /// The problem, as the server reports it.
    pub problem: Problem,
    /// Whether it has left the crowd, because its session is gone. Else the next step tries it
    /// again.
    pub left: bool,
}

/// Many characters of one pack, advanced together by the game's clock.
///
/// Every character has an intent that the game may change at any time. A step sends the changed
/// ones and brings the next frames of all. Buffers are reused from step to step. A character whose
/// session is gone is reported and leaves. The others go on.
///
/// ```no_run
/// use glam::Vec3;
/// use troupe_client::{Client, Crowd, CrowdOptions, Locomotion, SessionOptions};
///
/// # async fn example() -> Result<(), troupe_client::ClientError> {
/// let client = Client::connect("http://127.0.0.1:8080").await?;
/// let pack = client.pack("").await?;
/// let mut crowd = Crowd::new(&client, &pack, CrowdOptions::default());
/// let places = (0..200).map(|i| SessionOptions::new().seed(i).at(Vec3::X * i as f32, 0.0));
/// let members = crowd.add(&places.collect::<Vec<_>>()).await?;
///
/// loop {
///     // The game decides ...
///     if let Some(intent) = crowd.intent_mut(members[7]) {
///         *intent = Locomotion::walk(Vec3::new(0.0, 0.0, 1.4));
///     }
///     // ... and all move.
///     let step = crowd.step(1).await?;
///     for (member, frames) in step.characters() {
///         let Some(frame) = frames.last() else { continue };
///         // draw(member, frame.root, frame.rotations)
/// #       let _ = (member, frame);
///     }
///     for fault in step.faults() {
///         eprintln!("{}: {}", fault.session, fault.problem);
///     }
/// #   return Ok(());
/// }
/// # }
/// ```
#[derive(Debug)]
pub struct Crowd {
    client: Client,
    pack: Pack,
    options: CrowdOptions,
    /// Characters that have not left.
    members: BTreeMap<MemberId, Member>,
    /// All characters that were ever in it.
    count: usize,
    /// One for each request of the last step.
    chunks: Vec<Chunk>,
    faults: Vec<Fault>,
    waited: Duration,
}

#[derive(Debug)]
struct Member {
    session: Session,
    /// Request of the last step and index in its block, if it has frames.
    place: Option<(usize, usize)>,
}

/// The characters of one request, and their frames.
#[derive(Debug, Default)]
struct Chunk {
    members: Vec<MemberId>,
    block: Block,
    events: Vec<v1::SessionEvents>,
    held: Vec<v1::HeldObject>,
}

impl Crowd {
    /// An empty crowd.
    pub fn new(client: &Client, pack: &Pack, options: CrowdOptions) -> Self {
        Self {
            client: client.clone(),
            pack: pack.clone(),
            options,
            members: BTreeMap::new(),
            count: 0,
            chunks: Vec::new(),
            faults: Vec::new(),
            waited: Duration::ZERO,
        }
    }

    /// Opens sessions for new characters, all or none.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn add(&mut self, options: &[SessionOptions]) -> Result<Vec<MemberId>, ClientError> {
        let sessions = self.client.open_sessions(&self.pack, options).await?;
        Ok(sessions.into_iter().map(|s| self.adopt(s)).collect())
    }

    /// Adds a character with an open session, which must be of the crowd's pack.
    pub fn adopt(&mut self, session: Session) -> MemberId {
        let member = MemberId(self.count);
        self.count += 1;
        self.members.insert(member, Member { session, place: None });
        member
    }

    /// Removes a character, and returns its session.
    pub fn remove(&mut self, member: MemberId) -> Option<Session> {
        self.members.remove(&member).map(|member| member.session)
    }

    /// Characters that have not left.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Whether all have left.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// The characters that have not left.
    pub fn members(&self) -> impl Iterator<Item = MemberId> {
        self.members.keys().copied()
    }

    /// A character's session.
    pub fn session(&self, member: MemberId) -> Option<&Session> {
        self.members.get(&member).map(|m| &m.session)
    }

    /// The intent of a character, for changes. None once it has left.
    pub fn intent_mut(&mut self, member: MemberId) -> Option<&mut Locomotion> {
        let member = self.members.get_mut(&member)?;
        Some(member.session.intent_mut().wanted_mut())
    }

    /// Has a character do something with the next step, such as use an object of its scene. If the
    /// step fails it may not have arrived, and is not sent again. Nothing happens once the
    /// character has left.
    pub fn act(&mut self, member: MemberId, act: &Act) {
        if let Some(member) = self.members.get_mut(&member) {
            member.session.act(act);
        }
    }

    /// Sets the priority of a character for plans, 0 to 1, for instance by its distance from the
    /// camera. Every change is a command, so use steps of a tenth or so. It goes to the server with
    /// the next step. Nothing happens once the character has left.
    pub fn set_priority(&mut self, member: MemberId, priority: f32) {
        if let Some(member) = self.members.get_mut(&member) {
            member.session.priority(priority);
        }
    }

    /// Sends changed intents, and advances all characters by some frames, 1 to 120.
    ///
    /// # Errors
    /// See [`ClientError`]: the server cannot be reached, or refuses the request as a whole.
    /// Characters of other requests of the same step may then have moved on, as the number of their
    /// first frame shows.
    pub async fn step(&mut self, frames: u32) -> Result<CrowdStep<'_>, ClientError> {
        self.faults.clear();
        self.members.values_mut().for_each(|m| m.place = None);
        self.divide();
        let requests = (0..self.chunks.len())
            .map(|chunk| self.request(chunk, frames))
            .collect::<Vec<_>>();
        let calls = requests.into_iter().map(|request| {
            self.client
                .placed(request, |mut rpc, request| async move { rpc.step(request).await })
        });
        let answers = join_all(calls).await;

        self.waited = Duration::ZERO;
        let mut failed = None;
        for (chunk, answer) in answers.into_iter().enumerate() {
            let taken = match answer {
                Ok(answer) => self.take(chunk, answer),
                Err(error) => {
                    self.doubt(chunk);
                    self.take_error(chunk, error).await
                }
            };
            failed = failed.or(taken.err());
        }
        match failed {
            Some(error) => Err(error),
            None => Ok(CrowdStep { crowd: self }),
        }
    }

    /// Distributes all characters over requests.
    fn divide(&mut self) {
        let per_request = self.options.per_request.max(1);
        let mut here = self.members.keys().copied().peekable();
        let mut used = 0;
        while here.peek().is_some() {
            if used == self.chunks.len() {
                self.chunks.push(Chunk::default());
            }
            let chunk = &mut self.chunks[used];
            chunk.members.clear();
            chunk.members.extend(here.by_ref().take(per_request));
            chunk.block.clear();
            chunk.events.clear();
            chunk.held.clear();
            used += 1;
        }
        self.chunks.truncate(used);
    }

    fn request(&mut self, chunk: usize, frames: u32) -> v1::StepRequest {
        let members = &self.chunks[chunk].members;
        let mut session_ids = Vec::with_capacity(members.len());
        let mut commands = Vec::new();
        for member in members {
            let Some(Member { session, .. }) = self.members.get_mut(member) else {
                continue;
            };
            let id = session.id().to_owned();
            commands.extend(session.intent_mut().commands(&id));
            session_ids.push(id);
        }
        v1::StepRequest {
            session_ids,
            frames,
            rate_hz: self.options.frames.rate.hz(),
            commands,
            encoding: self.options.frames.encoding.to_wire(),
            return_positions: self.options.frames.positions,
            ..v1::StepRequest::default()
        }
    }

    /// Takes the answer to one request.
    fn take(&mut self, chunk: usize, answer: v1::StepResponse) -> Result<(), ClientError> {
        self.waited = self.waited.max(Duration::from_micros(answer.waited_us));
        let of = &mut self.chunks[chunk];
        if let Some(block) = answer.blocks.into_iter().next() {
            let convention = |slot: u32| {
                let member = of.members.get(slot as usize);
                let member = member.and_then(|member| self.members.get(member));
                member.map_or(Convention::Native, |m| m.session.convention())
            };
            of.block.read(block, self.pack.skeleton(), convention)?;
        }
        for (place, &slot) in of.block.slots().iter().enumerate() {
            let member = of.members.get(slot as usize);
            let member = member.ok_or(AnswerError::Missing("the character of a slot"))?;
            if let Some(member) = self.members.get_mut(member) {
                member.place = Some((chunk, place));
            }
        }
        for problem in answer.problems {
            let slot = problem.slot as usize;
            let problem = Problem::from(problem.problem.unwrap_or_default());
            let member = self.chunks[chunk].members.get(slot).copied();
            let member = member.ok_or(AnswerError::Missing("the character of a problem"))?;
            self.fault(member, problem);
        }
        let of = &mut self.chunks[chunk];
        (of.events, of.held) = (answer.events, answer.held);
        self.take_refusals(chunk, &answer.command_results);
        Ok(())
    }

    fn take_refusals(&mut self, chunk: usize, results: &[v1::CommandResult]) {
        if results.iter().all(|r| r.status() != v1::CommandStatus::Refused) {
            return;
        }
        for nth in 0..self.chunks[chunk].members.len() {
            let member = self.chunks[chunk].members[nth];
            let refused = self.session(member).and_then(|s| refusal(results, s.id()));
            // Its problem has been reported.
            if let Some(problem) = refused.filter(|p| !p.kind.is_gone()) {
                self.fault(member, problem);
            }
        }
    }

    /// If the server can serve no character of a request, it answers only with the problem of the
    /// first. So this queries each of them. Other errors concern the whole crowd.
    async fn take_error(&mut self, chunk: usize, error: ClientError) -> Result<(), ClientError> {
        let ClientError::Session(common) = error else {
            return Err(error);
        };
        let members = self.chunks[chunk].members.clone();
        let questions = members.into_iter().filter_map(|member| {
            let (client, id) = (self.client.clone(), self.session(member)?.id().to_owned());
            Some(async move { (member, client.session_info(&id).await) })
        });
        let questions = stream::iter(questions.collect::<Vec<_>>()).buffered(QUESTIONS);
        for (member, answer) in questions.collect::<Vec<_>>().await {
            match answer {
                Ok(_) => self.fault(member, common.problem.clone()),
                Err(ClientError::Session(own)) => self.fault(member, own.problem),
                Err(other) => return Err(other),
            }
        }
        Ok(())
    }

    /// Reports a character. It leaves if its session is gone.
    fn fault(&mut self, member: MemberId, problem: Problem) {
        let left = problem.kind.is_gone();
        let session = self.session(member).map(|s| s.id().to_owned());
        self.faults.push(Fault {
            member,
            session: session.unwrap_or_default(),
            problem,
            left,
        });
        if left {
            self.members.remove(&member);
        }
    }

    /// The commands of a request may not have arrived.
    fn doubt(&mut self, chunk: usize) {
        for member in &self.chunks[chunk].members {
            if let Some(member) = self.members.get_mut(member) {
                member.session.intent_mut().doubt();
            }
        }
    }

    /// The counts of all sessions, summed. It lists the server's sessions, so do not call it in
    /// every tick.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn stats(&self) -> Result<v1::SessionStats, ClientError> {
        let mut ids = self
            .members()
            .filter_map(|m| self.session(m).map(Session::id))
            .collect::<Vec<_>>();
        ids.sort_unstable();
        let open = self.client.list_sessions().await?;
        let of_crowd = open.iter().filter(|s| ids.binary_search(&s.id.as_str()).is_ok());
        Ok(of_crowd.filter_map(|s| s.stats.as_ref()).sum())
    }

    /// Closes all sessions.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn close(self) -> Result<(), ClientError> {
        let sessions = self.members.into_values().map(|m| m.session);
        let ids = sessions.map(|s| s.id().to_owned());
        self.client.close_sessions(ids).await.map(|_| ())
    }
}

/// The results of a step, borrowed from the crowd.
#[derive(Debug, Clone, Copy)]
pub struct CrowdStep<'a> {
    crowd: &'a Crowd,
}

impl<'a> CrowdStep<'a> {
    /// The characters that moved, with their frames.
    pub fn characters(&self) -> impl Iterator<Item = (MemberId, Frames<'a>)> + use<'a> {
        let crowd = self.crowd;
        crowd.chunks.iter().flat_map(move |chunk| {
            let places = chunk.block.slots().iter().enumerate();
            places.map(move |(place, &slot)| (chunk.members[slot as usize], chunk.block.frames(place)))
        })
    }

    /// The frames of one character. None if it did not move.
    pub fn get(&self, member: MemberId) -> Option<Frames<'a>> {
        let (chunk, place) = self.crowd.members.get(&member)?.place?;
        Some(self.crowd.chunks[chunk].block.frames(place))
    }

    /// Events of characters in their scenes, in order for each.
    pub fn events(&self) -> impl Iterator<Item = (MemberId, &'a v1::SessionEvent)> + use<'a> {
        let crowd = self.crowd;
        crowd.chunks.iter().flat_map(|chunk| {
            let each = chunk.events.iter();
            each.filter_map(|of| Some((*chunk.members.get(of.slot as usize)?, &of.events)))
                .flat_map(|(member, events)| events.iter().map(move |event| (member, event)))
        })
    }

    /// Objects in the characters' hands.
    pub fn held(&self) -> impl Iterator<Item = (MemberId, &'a v1::HeldObject)> + use<'a> {
        let crowd = self.crowd;
        crowd.chunks.iter().flat_map(|chunk| {
            let each = chunk.held.iter();
            each.filter_map(|held| Some((*chunk.members.get(held.slot as usize)?, held)))
        })
    }

    /// Problems of single characters: of those that could not be served, and of those whose command
    /// was refused, which moved on as before.
    pub fn faults(&self) -> &'a [Fault] {
        &self.crowd.faults
    }

    /// Longest wait of a request of the step for plans on the server.
    pub fn waited(&self) -> Duration {
        self.crowd.waited
    }
}

#[cfg(test)]
#[path = "crowd_tests.rs"]
mod tests;
