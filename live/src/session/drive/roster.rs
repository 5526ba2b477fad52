//! The sessions on a stream.

use std::collections::HashSet;
use std::sync::{Arc, Weak};
use std::time::Instant;

use troupe_base::turns::Turns;
use troupe_proto::v1;

use crate::session::LivePack;
use crate::session::cell::{Held, SessionCell};
use crate::session::encode::{BlockWriter, Form};
use crate::session::executor::Turn;
use crate::session::owner::{End, Owner};
use crate::session::planner;
use crate::session::stream::{Attached, Audience, Departure};
use crate::session::wants::Patience;
use crate::session::{Registry, TimeSource, events};
use crate::session::{SessionError, SessionProblem};
use troupe_character::Path;
use troupe_character::live::budget::{self, MIDDLE_PRIORITY};
use troupe_character::live::load::ClientLoad;
use troupe_character::live::{Clock, FrameOut, Strain};

/// A session on the stream, which owns it.
#[derive(Debug)]
struct Member {
    slot: u32,
    held: Held,
    /// Index into the roster's packs.
    pack: usize,
}

/// The sessions on a stream. Dropping it frees them, or closes them if the client asked for that
/// with `close_sessions`.
#[derive(Debug)]
pub struct Roster {
    registry: Arc<Registry>,
    time: TimeSource,
    limit: usize,
    close_at_end: bool,
    next_slot: u32,
    /// Sorted by slot.
    members: Vec<Member>,
    packs: Vec<(Arc<LivePack>, Arc<ClientLoad>)>,
    /// The watchers of the stream.
    audience: Weak<Audience>,
    out: FrameOut,
    /// Mean priority of the members at the last tick.
    mean_priority: f32,
}

impl Roster {
    /// Makes a roster for at most `limit` sessions. `audience` sees their frames.
    pub fn new(
        registry: Arc<Registry>,
        time: TimeSource,
        limit: usize,
        close_at_end: bool,
        audience: &Arc<Audience>,
    ) -> Self {
        Self {
            registry,
            time,
            limit,
            close_at_end,
            next_slot: 0,
            members: Vec::new(),
            packs: Vec::new(),
            audience: Arc::downgrade(audience),
            out: FrameOut::default(),
            mean_priority: MIDDLE_PRIORITY,
        }
    }

    /// Whether no session is on the stream.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// Takes sessions onto the stream. Sessions that are not free, or whose frames cannot be
    /// written in `form`, become problems of the result.
    pub async fn attach(&mut self, ids: &[String], form: Form) -> Attached {
        let mut turn = Turn::begin();
        let mut attached = Attached::default();
        for (index, id) in ids.iter().enumerate() {
            match self.attach_one(index, id, form) {
                Ok(slot) => attached.sessions.push(v1::Attached {
                    session_id: id.clone(),
                    slot,
                }),
                Err(error) => attached.problems.push(SessionProblem::new(index, id, error)),
            }
            turn.pause().await;
        }
        attached
    }

    fn attach_one(&mut self, index: usize, id: &str, form: Form) -> Result<u32, SessionError> {
        let field = || format!("attach.session_ids[{index}]");
        if self.members.len() >= self.limit {
            return Err(SessionError::TooMany {
                open: self.members.len(),
                limit: self.limit,
                place: " on this stream",
            });
        }
        let cell = self.registry.get(id, self.time.now(), &field)?;
        form.check(&Path::root().field("open"), cell.pack())?;
        let held = cell.take(Owner::Drive, &field)?;
        cell.show_to(self.audience.clone());
        let known = self
            .packs
            .iter()
            .position(|(pack, _)| Arc::ptr_eq(pack, cell.pack()));
        let pack = known.unwrap_or_else(|| {
            let load = cell.pack().load.of(Turns::current().client().own);
            self.packs.push((cell.pack().clone(), load));
            self.packs.len() - 1
        });
        let slot = self.next_slot;
        self.next_slot += 1;
        ask(&cell);
        self.members.push(Member { slot, held, pack });
        Ok(slot)
    }

    /// Takes sessions off the stream. Ids of other sessions are ignored.
    pub fn detach(&mut self, ids: &[String]) -> Vec<Departure> {
        let ids: HashSet<&str> = ids.iter().map(String::as_str).collect();
        self.remove(|cell| ids.contains(&**cell.id()).then_some(None))
    }

    /// Takes off the sessions that have ended.
    pub fn ended(&mut self) -> Vec<Departure> {
        self.remove(|cell| cell.end().map(Some))
    }

    /// Takes off the sessions for which `leaves` returns `Some`. The inner value is how the session
    /// ended; `None` if it stays open.
    fn remove(&mut self, leaves: impl Fn(&SessionCell) -> Option<Option<End>>) -> Vec<Departure> {
        let mut left = Vec::new();
        self.members.retain(|member| {
            let cell = member.held.cell();
            let Some(end) = leaves(cell) else {
                return true;
            };
            left.push(Departure {
                slot: member.slot,
                session_id: cell.id().to_string(),
                end,
            });
            false
        });
        left
    }

    /// Advances all characters by `sub_frames`. Returns their frames and the number of frames of
    /// each pack. The caller fills in `tick` and `dropped_ticks`. Events go to `happened`; without
    /// it they keep waiting in the sessions.
    pub async fn tick(
        &mut self,
        sub_frames: u32,
        form: Form,
        mut happened: Option<&mut Vec<v1::SessionEvents>>,
    ) -> (v1::DriveFrames, Vec<(Arc<LivePack>, usize)>) {
        let counts = self.counts();
        let mut writers: Vec<(BlockWriter, usize)> = counts
            .iter()
            .map(|(pack, count)| (BlockWriter::of(pack, form, *count, 1), 0))
            .collect();
        let mut underruns = 0;
        let mut in_hands = Vec::new();
        let mut priorities = 0.0;
        let mut turn = Turn::begin();
        for member in &self.members {
            let cell = member.held.cell();
            let pack = cell.pack();
            let wants = {
                let mut live = cell.live();
                priorities += live.priority;
                let load = &self.packs[member.pack].1;
                let strain = strain(
                    pack,
                    load,
                    budget::own_priority(live.priority, self.mean_priority),
                );
                live.under_load(strain);
                live.advance(sub_frames, Clock::Runs);
                live.sample(&mut self.out);
                let wants = cell.settle(&mut live);
                if cell.scene().is_some() {
                    in_hands.extend(events::held(&live.character, member.slot, cell.measure()));
                }
                if let Some(happened) = &mut happened {
                    happened.extend(live.events.take(member.slot, cell.id(), cell.measure()));
                }
                wants
            };
            planner::serve(cell, wants, Patience::Fails);
            underruns += u32::from(self.out.underrun);
            let (writer, place) = &mut writers[member.pack];
            writer.name(member.slot);
            writer.write((*place, 0), &self.out, cell.convention(), cell.pack().shown());
            *place += 1;
            turn.pause().await;
        }
        self.mean_priority = priorities / self.members.len().max(1) as f32;
        let blocks = writers.into_iter().filter(|(_, count)| *count > 0);
        let frames = v1::DriveFrames {
            blocks: blocks.map(|(writer, _)| writer.finish(|_| true)).collect(),
            underruns,
            held: in_hands,
            ..v1::DriveFrames::default()
        };
        (frames, counts)
    }

    /// Updates the measured load of the packs, if it is time to.
    pub fn read_load(&self) {
        let now = Instant::now();
        for (pack, load) in &self.packs {
            let workers = pack.loaded().batcher.workers();
            load.read(now, workers);
            if let Some(highest) = pack.load.read(now, workers) {
                pack.metrics.pressed(highest);
            }
        }
    }

    /// Number of sessions on the stream, for each pack that ever had one on it.
    pub fn counts(&self) -> Vec<(Arc<LivePack>, usize)> {
        let mut counts: Vec<_> = self.packs.iter().map(|(pack, _)| (pack.clone(), 0)).collect();
        for member in &self.members {
            counts[member.pack].1 += 1;
        }
        counts
    }
}

/// The load of the stream's client, as a character of this priority must plan for it.
fn strain(pack: &LivePack, load: &ClientLoad, priority: f32) -> Strain {
    let fps = pack.rig().fps;
    Strain {
        expected_frames: load.expected_frames(pack.loaded().batcher.workers(), fps),
        lead_frames: load.lead_frames(fps),
        stretch: budget::stretch(load.pressure(), priority),
    }
}

/// Requests a character's first plan before its first tick.
fn ask(cell: &Arc<SessionCell>) {
    let wants = cell.settle(&mut cell.live());
    planner::serve(cell, wants, Patience::Fails);
}

impl Drop for Roster {
    fn drop(&mut self) {
        if self.close_at_end {
            for member in &self.members {
                self.registry.close_cell(member.held.cell());
            }
        }
    }
}
