//! The calls of `troupe.v1.Sessions`, independent of HTTP and gRPC.

use std::sync::Arc;
use std::time::Duration;

use troupe_proto::v1;

use super::cell::SessionCell;
use super::results::{Closed, CommandResult, SessionProblem};
use super::sessions::Sessions;
use super::{LivePacks, SessionError, StepPlan, Stepped};
use super::{commands, describe, options, peek, step};
use crate::wire::units;
use crate::world::{CharacterPlace, Store};
use troupe_base::offload::offload;
use troupe_base::telemetry::RequestContext;
use troupe_base::turns::Turns;
use troupe_character::Path;
use troupe_character::live::CommandError;

/// Sessions per page of a list: maximum and default.
const PAGE: (u32, u32) = (1000, 100);
/// Maximum number of sessions that one call closes.
const MAX_CLOSED: usize = 10_000;
/// A request for at most this many sessions is served on the task that received it. Larger ones go
/// to a thread for blocking work.
const INLINE_SESSIONS: usize = 16;

impl Sessions {
    /// `troupe.v1.Sessions/CreateSessions`.
    ///
    /// # Errors
    /// [`SessionError`] if one session cannot be created. Then none is.
    pub async fn create(
        self: &Arc<Self>,
        packs: &LivePacks,
        store: &Arc<Store>,
        request: v1::CreateSessionsRequest,
    ) -> Result<v1::CreateSessionsResponse, SessionError> {
        let count = request.sessions.len();
        units::length(
            &Path::root().field("sessions"),
            count,
            1,
            self.limits().per_request,
        )?;
        let usual_ttl = Duration::from_millis(self.limits().ttl_ms.into());
        self.registry().room_for(count, usual_ttl, self.time().now())?;
        let (this, packs, store) = (self.clone(), packs.clone(), store.clone());
        // A shared store is asked, which blocks.
        let inline = self.sharing().map_or(INLINE_SESSIONS, |_| 0);
        let work = move || this.create_now(&packs, &store, &request);
        offload(count, inline, work).await?
    }

    fn create_now(
        &self,
        packs: &LivePacks,
        store: &Store,
        request: &v1::CreateSessionsRequest,
    ) -> Result<v1::CreateSessionsResponse, SessionError> {
        let root = Path::root();
        let mut cells = Vec::with_capacity(request.sessions.len());
        for (index, wanted) in request.sessions.iter().enumerate() {
            let parts = options::parts(
                &root.element("sessions", index),
                wanted,
                packs,
                store,
                self.limits(),
            )?;
            cells.push(Arc::new(SessionCell::new(parts, self.time().clone())));
        }
        let leases = self.lease(&cells, store)?;
        let recordings = self.record(&cells, &request.sessions)?;
        let now = self.time().now();
        self.registry()
            .insert(&cells, now, |index| format!("sessions[{index}].id"))?;
        leases.keep();
        self.keep_recordings(recordings);
        Ok(v1::CreateSessionsResponse {
            sessions: cells.iter().map(|cell| describe::session(cell, now)).collect(),
        })
    }

    /// `troupe.v1.Sessions/GetSession`.
    ///
    /// # Errors
    /// [`SessionError`] if the session is not open.
    pub fn get(&self, id: &str) -> Result<v1::Session, SessionError> {
        let now = self.time().now();
        let cell = self.registry().get(id, now, &|| "id".to_owned())?;
        Ok(describe::session(&cell, now))
    }

    /// `troupe.v1.Sessions/ListSessions`.
    ///
    /// # Errors
    /// [`SessionError::Field`] for a page size out of range.
    pub fn list(&self, request: &v1::ListSessionsRequest) -> Result<v1::ListSessionsResponse, SessionError> {
        let root = Path::root();
        let (most, usual) = PAGE;
        let size = if request.page_size == 0 {
            usual
        } else {
            request.page_size
        };
        units::count_within(&root.field("page_size"), size, 1, most)?;
        let after = (!request.page_token.is_empty()).then_some(request.page_token.as_str());
        // One more than requested shows whether there is another page.
        let (mut cells, total) = self.registry().page(after, size as usize + 1);
        let more = cells.len() > size as usize;
        cells.truncate(size as usize);
        let now = self.time().now();
        let last = cells.last().filter(|_| more);
        Ok(v1::ListSessionsResponse {
            next_page_token: last.map(|cell| cell.id().to_string()).unwrap_or_default(),
            sessions: cells.iter().map(|cell| describe::session(cell, now)).collect(),
            total: total as u32,
        })
    }

    /// `troupe.v1.Sessions/CloseSessions`.
    ///
    /// # Errors
    /// [`SessionError::Field`] for a list that is empty or too long. If no session was closed, the
    /// error of the first that may be open on another server.
    pub fn close(&self, request: &v1::CloseSessionsRequest) -> Result<Closed, SessionError> {
        let root = Path::root();
        units::length(&root.field("ids"), request.ids.len(), 1, MAX_CLOSED)?;
        let now = self.time().now();
        let mut answer = Closed::default();
        for (index, id) in request.ids.iter().enumerate() {
            let field = || root.element("ids", index).to_string();
            match self.registry().close(id, now, &field) {
                Ok(was_open) => answer.closed += u32::from(was_open),
                Err(error) => answer.problems.push(SessionProblem::new(index, id, error)),
            }
        }
        match answer.problems.first() {
            Some(problem) if answer.closed == 0 => Err(problem.error.clone()),
            _ => Ok(answer),
        }
    }

    /// `troupe.v1.Sessions/Command`.
    ///
    /// # Errors
    /// [`SessionError::Field`] for a list that is empty or too long. The error of a single command
    /// is in its result.
    pub async fn command(
        self: &Arc<Self>,
        request: v1::CommandRequest,
        turns: Turns,
    ) -> Result<Vec<CommandResult>, SessionError> {
        let root = Path::root();
        let count = request.commands.len();
        units::length(&root.field("commands"), count, 1, commands::MAX_COMMANDS)?;
        self.bring(request.commands.iter().map(|command| &command.session_id))
            .await;
        let this = self.clone();
        let work = async move { this.apply(&request.commands).await };
        Ok(self.executor().run(turns, work).await?)
    }

    /// Checks a step request and estimates the size of its answer.
    ///
    /// # Errors
    /// [`SessionError::Field`] for the first value that is not accepted.
    pub fn plan_step(&self, request: &v1::StepRequest) -> Result<StepPlan, SessionError> {
        let now = self.time().now();
        Ok(step::check(request, self.limits(), |id| {
            let cell = self.registry().get(id, now, &String::new).ok()?;
            Some(cell.pack().shown().joint_count())
        })?)
    }

    /// `troupe.v1.Sessions/Step`. `plan` is the result of [`Sessions::plan_step`].
    ///
    /// # Errors
    /// [`SessionError`] if no session could be served.
    pub async fn step(
        self: &Arc<Self>,
        request: v1::StepRequest,
        plan: StepPlan,
        turns: Turns,
    ) -> Result<Stepped, SessionError> {
        let arrived = std::time::Instant::now();
        let this = self.clone();
        let work = async move {
            let commands = this.apply(&request.commands).await;
            let stepped = step::step(this.registry(), this.time(), &request.session_ids, plan).await;
            (commands, stepped)
        };
        let (commands, stepped) = self.executor().run(turns, work).await?;
        RequestContext::part("advance", arrived, Vec::new);
        if let (true, Some(problem)) = (stepped.blocks.is_empty(), stepped.problems.first()) {
            return Err(problem.error.clone());
        }
        Ok(Stepped {
            commands,
            total: arrived.elapsed(),
            ..stepped
        })
    }

    /// Scene and position of a session's character. `field` is the field of the request that has
    /// the session's id.
    ///
    /// # Errors
    /// [`SessionError`] if the session is not open or has no scene.
    pub fn standing(&self, id: &str, field: &str) -> Result<CharacterPlace, SessionError> {
        let cell = self.registry().get(id, self.time().now(), &|| field.to_owned())?;
        let live = cell.live();
        let resident = live.resident().ok_or_else(|| SessionError::Refused {
            refusal: CommandError::NoScene,
            field: field.to_owned(),
        })?;
        Ok(CharacterPlace {
            scene: resident.name().clone(),
            cell: resident.cell().clone(),
            root: cell.measure().sized(live.character.view().root),
            convention: cell.convention(),
            pack: cell.pack().name().to_owned(),
        })
    }

    /// `troupe.v1.Sessions/Peek`.
    ///
    /// # Errors
    /// [`SessionError`] if the session is not open or the count is out of range.
    pub fn peek(&self, request: &v1::PeekRequest) -> Result<v1::PeekResponse, SessionError> {
        let root = Path::root();
        let most = peek::MAX_PEEK_FRAMES;
        let frames = if request.frames == 0 { most } else { request.frames };
        units::count_within(&root.field("frames"), frames, 1, most)?;
        let now = self.time().now();
        let field = || "session_id".to_owned();
        let cell = self.registry().get(&request.session_id, now, &field)?;
        Ok(peek::peek(&cell, frames as usize, now))
    }
}
