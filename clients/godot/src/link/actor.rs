//! A character, between its node and the thread of the connection.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::{Quat, Vec3};
use troupe_client::{Frame, SessionOptions};

use super::orders::{Order, OrderError, Orders};
use super::{Note, Wake};
use crate::rig::Rig;

/// Notes of one character that may wait. Then the oldest are dropped.
const MOST_NOTES: usize = 256;

/// A character that the server shall have.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Its joints.
    pub rig: Rig,
    /// Name of the pack. Empty: the server's default pack.
    pub pack: String,
    /// Name of the pack's body. Empty: the default one.
    pub body: String,
    /// Place, seed, style and scene, in Troupe's frame.
    pub session: SessionOptions,
}

/// A frame of a character, in Troupe's frame of reference.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Pose {
    /// Place of the first joint in the world.
    pub root: Vec3,
    /// A rotation for each joint: of the first in the world, of the others relative to their
    /// parents.
    pub rotations: Vec<Quat>,
}

/// How far a character is.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Phase {
    /// The connection does not know it yet.
    New,
    /// It is being opened.
    Opening,
    /// It is on the stream, with the session of this id.
    Playing(String),
    /// It left the stream, or could not be opened.
    Gone,
}

/// What a node and the connection share of a character.
pub struct Actor {
    pub(super) wanted: Wanted,
    wake: Arc<Wake>,
    state: Mutex<State>,
}

struct State {
    phase: Phase,
    orders: Orders,
    notes: VecDeque<Note>,
    pose: Pose,
    is_fresh: bool,
    /// Its node is gone.
    leaves: bool,
}

impl Actor {
    pub(super) fn new(wanted: Wanted, wake: Arc<Wake>) -> Self {
        Self {
            wanted,
            wake,
            state: Mutex::new(State {
                phase: Phase::New,
                orders: Orders::default(),
                notes: VecDeque::new(),
                pose: Pose::default(),
                is_fresh: false,
                leaves: false,
            }),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a command. Those of a character that is being opened wait until it is there.
    ///
    /// # Errors
    /// See [`OrderError`].
    pub fn order(self: &Arc<Self>, order: Order) -> Result<(), OrderError> {
        let mut state = self.state();
        if state.phase == Phase::Gone {
            return Err(OrderError::Gone);
        }
        state.orders.push(order)?;
        drop(state);
        self.wake.changed(self);
        Ok(())
    }

    /// Has the character leave the server.
    pub fn leave(self: &Arc<Self>) {
        self.state().leaves = true;
        self.wake.changed(self);
    }

    /// Takes the newest frame, if one came since the last call. The old pose is used again.
    pub fn take_pose(&self, pose: &mut Pose) -> bool {
        let mut state = self.state();
        if state.is_fresh {
            std::mem::swap(&mut state.pose, pose);
        }
        std::mem::take(&mut state.is_fresh)
    }

    /// The oldest note that waits.
    pub fn take_note(&self) -> Option<Note> {
        self.state().notes.pop_front()
    }

    pub(super) fn phase(&self) -> Phase {
        self.state().phase.clone()
    }

    pub(super) fn set_phase(&self, phase: Phase) {
        self.state().phase = phase;
    }

    pub(super) fn leaves(&self) -> bool {
        self.state().leaves
    }

    pub(super) fn take_orders(&self) -> Vec<Order> {
        self.state().orders.take()
    }

    pub(super) fn note(&self, note: Note) {
        let notes = &mut self.state().notes;
        if notes.len() >= MOST_NOTES {
            notes.pop_front();
        }
        notes.push_back(note);
    }

    /// The character is over.
    pub(super) fn fail(&self, message: String) {
        self.set_phase(Phase::Gone);
        self.note(Note::Failed(message));
    }

    pub(super) fn show(&self, frame: Frame<'_>) {
        let mut state = self.state();
        state.pose.root = frame.root;
        state.pose.rotations.clear();
        state.pose.rotations.extend_from_slice(frame.rotations);
        state.is_fresh = true;
    }
}
