//! Plays a recording: gives a new session the recorded inputs in their order, and compares what it
//! shows.

use std::collections::VecDeque;
use std::sync::Arc;

use tokio::sync::mpsc;
use troupe_character::Path;
use troupe_character::live::{
    Advance, CharacterEvent, Clock, CommandOutcome, FrameOut, PlanFailed, PlanRequest, SUB_FRAMES, Strain,
};
use troupe_proto::v1;
use troupe_proto::v1::command::Intent;

use super::digest::{self, Digest};
use super::format::{Event, Load, Reader, RecordingError, Shown};
use crate::session::cell::SessionCell;
use crate::session::executor::Turn;
use crate::session::owner::End;
use crate::session::{SessionError, commands, planner};
use troupe_base::turns::Turns;

/// Frames between two reports of progress.
const REPORT_FRAMES: u64 = 300;
/// Maximum number of plans that a character has asked for and that have not come. It has at most
/// one in flight, and one that it replaced.
const MAX_REQUESTS: usize = 4;
/// Most sub-frames that the cursor moves at once, or owes while it waits for a plan. A stream that
/// was held up catches up on 200 ms.
const MAX_SUB_FRAMES: u32 = 10 * SUB_FRAMES;
/// Highest share of a crowd's pressure that falls on a character.
const MAX_STRETCH: f32 = 2.0;

/// Plays one recording.
pub(super) struct Player {
    cell: Arc<SessionCell>,
    reader: Reader,
    /// Play on with another style than the recording's.
    anyway: bool,
    clock: Clock,
    /// Plans that the character asked for, oldest first.
    requests: VecDeque<PlanRequest>,
    /// The result so far.
    result: v1::ReplayResponse,
    /// The last frame slowed down.
    slowing: bool,
    /// Sub-frames that the cursor may still have to go, because it waits for a plan.
    owed: u32,
    out: FrameOut,
    events: Vec<CharacterEvent>,
}

/// Whether the replay goes on after an event.
enum Flow {
    GoesOn,
    Ends,
}

impl Player {
    /// `cell` is a session as at the start of the recording, which no client can find. `notes` say
    /// what limits the comparison.
    pub(super) fn new(cell: Arc<SessionCell>, reader: Reader, notes: Vec<String>, anyway: bool) -> Self {
        Self {
            cell,
            reader,
            anyway,
            clock: Clock::Waits,
            requests: VecDeque::new(),
            result: v1::ReplayResponse {
                notes,
                ..v1::ReplayResponse::default()
            },
            slowing: false,
            owed: 0,
            out: FrameOut::default(),
            events: Vec::new(),
        }
    }

    /// Plays to the end, to the first difference, or until no one reads the answer.
    pub(super) async fn run(mut self, to: &mpsc::Sender<Result<v1::ReplayResponse, SessionError>>) {
        let outcome = self.play(to).await;
        self.cell.finish(End::Closed);
        let last = outcome.map(|()| v1::ReplayResponse {
            is_last: true,
            equal: self.result.difference.is_none(),
            ..self.result
        });
        // The reader may have gone.
        let _ = to.send(last).await;
    }

    async fn play(
        &mut self,
        to: &mpsc::Sender<Result<v1::ReplayResponse, SessionError>>,
    ) -> Result<(), SessionError> {
        let mut turn = Turn::begin();
        // A character that begins in motion asks for a plan at once.
        self.collect();
        // The first part is an answer in time, however long the recording is.
        let mut next_report = 0;
        while !to.is_closed() {
            if self.result.frames >= next_report {
                next_report = self.result.frames + REPORT_FRAMES;
                let _ = to.send(Ok(self.progress())).await;
            }
            let Some(event) = self.reader.next()? else {
                self.note("the recording has no end: it is cut off, or its session was still open");
                break;
            };
            if let Flow::Ends = self.take(event).await? {
                break;
            }
            turn.pause().await;
        }
        Ok(())
    }

    fn progress(&self) -> v1::ReplayResponse {
        v1::ReplayResponse {
            frames: self.result.frames,
            ..v1::ReplayResponse::default()
        }
    }

    fn note(&mut self, note: impl Into<String>) {
        self.result.notes.push(note.into());
    }

    /// Gives one event to the character.
    async fn take(&mut self, event: Event) -> Result<Flow, SessionError> {
        let flow = match event {
            Event::Command(command) => self.command(&command)?,
            Event::Style(name, digest) => return self.style(&name, digest),
            Event::Load(load) => {
                if !(0.0..=MAX_STRETCH).contains(&load.stretch) {
                    let problem = format!("stretch is {}; allowed: 0 to {MAX_STRETCH}", load.stretch);
                    return Err(self.reader.wrong(problem).into());
                }
                self.cell.live().character.under_load(load.into());
                Flow::GoesOn
            }
            Event::Clock(word) => {
                self.clock = word.into();
                Flow::GoesOn
            }
            Event::Go(sub_frames) => self.go(sub_frames)?,
            Event::Plan(number) => self.plan(number).await?,
            Event::Failed(number) => {
                self.requests.retain(|request| request.number != number);
                let mut live = self.cell.live();
                live.character.plan_arrived(number, Err(PlanFailed));
                Flow::GoesOn
            }
            Event::Frame(recorded) => self.frame(&recorded),
            Event::End(end) => {
                let why = end.why.text();
                self.note(format!("the recording ends at frame {} because {why}", end.frame));
                Flow::Ends
            }
        };
        self.collect();
        Ok(flow)
    }

    /// Collects what the character asks for.
    fn collect(&mut self) {
        let mut live = self.cell.live();
        live.character.take_events(&mut self.events);
        self.events.clear();
        if let Some(request) = live.character.take_request() {
            self.requests.push_back(request);
            if self.requests.len() > MAX_REQUESTS {
                self.requests.pop_front();
            }
        }
    }

    fn differs(&mut self, field: &str, message: String) -> Flow {
        let frame = self.cell.live().character.frame();
        self.result.difference = Some(v1::ReplayDifference {
            frame,
            field: field.to_owned(),
            message,
        });
        Flow::Ends
    }

    /// Moves the cursor.
    fn go(&mut self, sub_frames: u32) -> Result<Flow, SessionError> {
        self.owed = self.owed.saturating_add(sub_frames);
        if self.owed > MAX_SUB_FRAMES {
            let owed = self.owed;
            let problem = format!("the cursor goes {owed} sub-frames at once; allowed: {MAX_SUB_FRAMES}");
            return Err(self.reader.wrong(problem).into());
        }
        let moved = self.cell.live().character.advance(sub_frames, self.clock);
        if moved == Advance::Moved {
            self.owed = 0;
        }
        Ok(Flow::GoesOn)
    }

    fn command(&mut self, command: &v1::Command) -> Result<Flow, SessionError> {
        if let Some(Intent::Perform(_)) = command.intent {
            let problem = "the command performs a sentence; allowed: any other";
            return Err(self.reader.wrong(problem).into());
        }
        let root = Path::root();
        let given = commands::give(&root.field("command"), &self.cell, command);
        let number = command.sequence;
        Ok(match given {
            Ok(CommandOutcome::Accepted) => {
                self.result.commands += 1;
                Flow::GoesOn
            }
            Ok(_) => {
                let message = format!("command {number} was accepted, and its number now comes too late");
                self.differs("command", message)
            }
            Err(error) => {
                let message = format!("command {number} was accepted, and is now refused: {error}");
                self.differs("command", message)
            }
        })
    }

    /// Compares the style that a command has set.
    fn style(&mut self, name: &str, recorded: Digest) -> Result<Flow, SessionError> {
        let style = self.cell.live().style.clone();
        let here = Digest::of_style(&style);
        if style.name == name && here == recorded {
            return Ok(Flow::GoesOn);
        }
        let (recorded, here) = (String::from(recorded), String::from(here));
        let difference = format!(
            "style {name:?} has the checksum {recorded}, and here {:?} has {here}",
            style.name
        );
        match self.anyway {
            true => {
                self.note(difference);
                Ok(Flow::GoesOn)
            }
            false => Err(RecordingError::Differs(vec![difference]).into()),
        }
    }

    /// Makes a plan, and gives it to the character where the recording has it.
    async fn plan(&mut self, number: u64) -> Result<Flow, SessionError> {
        let asked = self.requests.iter().position(|request| request.number == number);
        let Some(request) = asked.and_then(|index| self.requests.remove(index)) else {
            let message = format!("plan {number} came, and is now not asked for");
            return Ok(self.differs("plan", message));
        };
        let plan = planner::make(&self.cell, request, &Turns::current()).await?;
        self.cell.live().character.plan_arrived(number, Ok(plan));
        Ok(Flow::GoesOn)
    }

    fn frame(&mut self, recorded: &Shown) -> Flow {
        let mut live = self.cell.live();
        live.sample(&mut self.out);
        drop(live);
        let shown = digest::shown(&self.out);
        self.result.underruns += u64::from(shown.underrun && !self.slowing);
        self.slowing = shown.underrun;
        let Some(field) = recorded.differs(&shown) else {
            self.result.frames += 1;
            return Flow::GoesOn;
        };
        let message = format!(
            "frame {} differs in its {field}, after {} equal frames",
            shown.number, self.result.frames
        );
        self.differs(field, message)
    }
}

impl From<Load> for Strain {
    fn from(load: Load) -> Self {
        Self {
            expected_frames: load.expected_frames,
            lead_frames: load.lead_frames,
            stretch: load.stretch,
        }
    }
}
