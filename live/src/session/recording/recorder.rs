//! How a session writes its recording: every input of its character, in the order in which the
//! character takes them.

use std::sync::{Arc, OnceLock, Weak};
use std::time::Instant;

use troupe_character::live::{Advance, Arrival, Clock, FrameOut, LivePlan, PlanFailed, Strain};
use troupe_character::style::Style;
use troupe_engine::machine::Machine;
use troupe_proto::v1;
use troupe_proto::v1::command::Intent;

use super::digest::{self, Digest};
use super::format::{Event, FORMAT, Head, Load, Origin, Why};
use super::tape::Tape;
use crate::packs::LoadedPack;
use crate::session::cell::{Live, SessionCell};

/// Writes the recording of one session.
#[derive(Debug)]
pub(crate) struct Recorder {
    tape: Arc<Tape>,
    /// What made the plans so far.
    pack: Weak<LoadedPack>,
    /// The newest of each, as written.
    clock: Option<Clock>,
    load: Option<Strain>,
    style: Arc<Style>,
    /// The cursor waits for a plan in the middle of a movement.
    is_halted: bool,
    /// Whether the recording goes on.
    goes_on: bool,
}

impl Recorder {
    /// Begins the recording of a session that was made from `options` and has not moved.
    pub(crate) fn new(cell: &SessionCell, options: &v1::SessionOptions) -> Self {
        let style = cell.live().style.clone();
        let head = Head {
            troupe_recording: FORMAT,
            made_with: Origin::of(cell, &style),
            session: v1::SessionOptions {
                id: cell.id().to_string(),
                pack: cell.pack().name().to_owned(),
                body: cell.pack().body_name().to_owned(),
                style: style.name.clone(),
                ..options.clone()
            },
        };
        Self {
            tape: Arc::new(Tape::new(&head)),
            pack: Arc::downgrade(&cell.pack().loaded()),
            clock: None,
            load: None,
            style,
            is_halted: false,
            goes_on: true,
        }
    }

    /// The recording.
    pub(super) fn tape(&self) -> &Arc<Tape> {
        &self.tape
    }

    /// Notes that the session ended.
    pub(crate) fn session_ended(&self, now: Instant) {
        self.tape.session_ended(now);
    }

    fn write(&mut self, event: &Event) {
        self.goes_on = self.goes_on && self.tape.write(event);
    }

    /// Writes a command that the session accepted. It left the session with `style`.
    fn commanded(&mut self, command: &v1::Command, style: &Arc<Style>) {
        if let Some(Intent::Perform(_)) = command.intent {
            self.goes_on = false;
            self.tape.end(Why::Sentence);
            return;
        }
        self.write(&Event::Command(Box::new(command.clone())));
        if !Arc::ptr_eq(style, &self.style) {
            self.style = style.clone();
            self.write(&Event::Style(style.name.clone(), Digest::of_style(style)));
        }
    }

    fn made_by(&mut self, loaded: &Arc<LoadedPack>) {
        if self.goes_on && !Weak::ptr_eq(&self.pack, &Arc::downgrade(loaded)) {
            self.goes_on = false;
            self.tape.end(Why::Swap);
        }
    }

    fn loaded(&mut self, strain: Strain) {
        if self.load != Some(strain) {
            self.load = Some(strain);
            self.write(&Event::Load(Load {
                expected_frames: strain.expected_frames,
                lead_frames: strain.lead_frames,
                stretch: strain.stretch,
            }));
        }
    }

    fn advanced(&mut self, sub_frames: u32, clock: Clock, advance: Advance) {
        // A step finishes what the step before left; mostly that is nothing.
        let does_nothing = sub_frames == 0 && clock == Clock::Waits && !self.is_halted;
        self.is_halted = advance == Advance::NeedsPlan;
        if does_nothing {
            return;
        }
        if self.clock != Some(clock) {
            self.clock = Some(clock);
            self.write(&Event::Clock(clock.into()));
        }
        self.write(&Event::Go(sub_frames));
    }

    fn planned(&mut self, number: u64, came: bool, arrival: Arrival) {
        if arrival != Arrival::Stray {
            self.write(&match came {
                true => Event::Plan(number),
                false => Event::Failed(number),
            });
        }
    }

    /// Writes a frame that the session gave.
    pub(crate) fn shown(&mut self, frame: &FrameOut) {
        if self.goes_on {
            self.write(&Event::Frame(digest::shown(frame)));
        }
    }
}

/// The inputs of a session's character, each with its line in the recording.
impl Live {
    /// [`Character::under_load`](troupe_character::live::Character::under_load).
    pub(crate) fn under_load(&mut self, strain: Strain) {
        self.character.under_load(strain);
        if let Some(recorder) = &mut self.recorder {
            recorder.loaded(strain);
        }
    }

    /// [`Character::advance`](troupe_character::live::Character::advance).
    pub(crate) fn advance(&mut self, sub_frames: u32, clock: Clock) -> Advance {
        let advance = self.character.advance(sub_frames, clock);
        if let Some(recorder) = &mut self.recorder {
            recorder.advanced(sub_frames, clock, advance);
        }
        advance
    }

    /// [`Character::plan_arrived`](troupe_character::live::Character::plan_arrived).
    pub(crate) fn plan_arrived(&mut self, number: u64, plan: Result<LivePlan, PlanFailed>) -> Arrival {
        let came = plan.is_ok();
        let arrival = self.character.plan_arrived(number, plan);
        if let Some(recorder) = &mut self.recorder {
            recorder.planned(number, came, arrival);
        }
        arrival
    }

    /// Ends the recording if another version of its pack makes the plans.
    pub(crate) fn record_pack(&mut self, loaded: &Arc<LoadedPack>) {
        if let Some(recorder) = &mut self.recorder {
            recorder.made_by(loaded);
        }
    }

    /// Records a command that the session accepted.
    pub(crate) fn record_command(&mut self, command: &v1::Command) {
        if let Some(recorder) = &mut self.recorder {
            recorder.commanded(command, &self.style);
        }
    }
}

impl Origin {
    /// What decides the frames of this session on this server. `style` is the one at its start.
    pub(super) fn of(cell: &SessionCell, style: &Style) -> Self {
        let pack = cell.pack();
        let loaded = pack.loaded();
        let manifest = &loaded.pack.manifest;
        Self {
            server: env!("CARGO_PKG_VERSION").to_owned(),
            pack: pack.name().to_owned(),
            pack_version: manifest.version.clone(),
            content_hash: manifest.content_hash.clone(),
            body: pack.body_name().to_owned(),
            engine: loaded.engine.to_owned(),
            cpu: cpu().to_owned(),
            style: Digest::of_style(style),
            skeleton: pack.worn().map(|worn| Digest::of_skeleton(worn)),
        }
    }

    /// What this server, `here`, has another of, if that may change the bits of frames.
    pub(super) fn differences(&self, here: &Self) -> Vec<String> {
        let skeleton = |origin: &Self| origin.skeleton.map_or("none".to_owned(), String::from);
        [
            ("server", self.server.clone(), here.server.clone()),
            ("pack", self.pack.clone(), here.pack.clone()),
            (
                "version of the pack",
                self.pack_version.clone(),
                here.pack_version.clone(),
            ),
            (
                "content_hash of the pack",
                self.content_hash.clone(),
                here.content_hash.clone(),
            ),
            ("body", self.body.clone(), here.body.clone()),
            ("engine", self.engine.clone(), here.engine.clone()),
            (
                "checksum of the first style",
                self.style.into(),
                here.style.into(),
            ),
            ("checksum of the skeleton", skeleton(self), skeleton(here)),
        ]
        .into_iter()
        .filter(|(_, recorded, here)| recorded != here)
        .map(|(what, recorded, here)| format!("{what} is {recorded:?}, and here {here:?}"))
        .collect()
    }
}

/// Model of this machine's CPU.
fn cpu() -> &'static str {
    static CPU: OnceLock<String> = OnceLock::new();
    CPU.get_or_init(|| Machine::detect().cpu)
}
