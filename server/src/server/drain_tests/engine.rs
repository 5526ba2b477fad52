//! An engine that a test stops and resumes, and time that stands still while it works.
//!
//! A worker is a thread of the system, whose work takes real time. Simulated time advances by
//! itself as soon as all tasks are idle. It must not advance while a step waits for a worker.

use std::path::Path;
use std::sync::{Arc, Condvar, Mutex, mpsc};
use std::time::Duration;

use tokio::task::spawn_blocking;
use troupe_character::testing::toy_rig;
use troupe_engine::EngineError;
use troupe_engine::generator::{Generator, JobId, Progress, StepReport};
use troupe_engine::pack::testing::pack_of;
use troupe_engine::toy::Toy;
use troupe_motion::model::Task;

use super::super::PackSource;

/// Longest that a step may take while the engine works, in real time. Only a bug takes longer.
const STUCK: Duration = Duration::from_secs(10);

#[derive(Debug, Default)]
struct State {
    closed: bool,
    /// Steps that are not answered.
    steps: usize,
    /// The simulation is over: time does not matter any more.
    over: bool,
    /// A step waited longer than it may.
    stuck: bool,
    /// Keeps time from going on.
    hold: Option<mpsc::Sender<()>>,
}

/// A door before the engine.
#[derive(Debug, Clone, Default)]
pub(super) struct Gate(Arc<(Mutex<State>, Condvar)>);

impl Gate {
    fn change(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.0.0.lock().unwrap();
        change(&mut state);
        let busy = !state.closed && !state.over && state.steps > 0;
        if !busy {
            state.hold = None;
        } else if state.hold.is_none() {
            let (hold, held) = mpsc::channel::<()>();
            let gate = self.clone();
            // Time stands still while anything blocks.
            spawn_blocking(move || {
                if held.recv_timeout(STUCK) == Err(mpsc::RecvTimeoutError::Timeout) {
                    gate.0.0.lock().unwrap().stuck = true;
                }
            });
            state.hold = Some(hold);
        }
        drop(state);
        self.0.1.notify_all();
    }

    /// Has the engine wait from now on, or not any more.
    pub(super) fn set_closed(&self, closed: bool) {
        self.change(|state| state.closed = closed);
    }

    /// A step is sent.
    pub(super) fn step_begins(&self) {
        self.change(|state| state.steps += 1);
    }

    /// It is answered, or never will be.
    pub(super) fn step_ends(&self) {
        self.change(|state| state.steps -= 1);
    }

    /// Lets the engine go. Answers whether no step was stuck.
    pub(super) fn end(&self) -> bool {
        self.change(|state| {
            state.over = true;
            state.closed = false;
        });
        !self.0.0.lock().unwrap().stuck
    }

    fn pass(&self) {
        let state = self.0.0.lock().unwrap();
        drop(self.0.1.wait_while(state, |state| state.closed).unwrap());
    }
}

/// The toy family behind a gate.
struct Gated {
    toy: Toy,
    gate: Gate,
}

impl Generator for Gated {
    fn free(&self) -> usize {
        self.toy.free()
    }

    fn is_idle(&self) -> bool {
        self.toy.is_idle()
    }

    fn admit(&mut self, id: JobId, task: Task) {
        self.toy.admit(id, task);
    }

    fn cancel(&mut self, id: JobId) {
        self.toy.cancel(id);
    }

    fn step(&mut self, out: &mut dyn FnMut(JobId, Progress)) -> Result<StepReport, EngineError> {
        self.gate.pass();
        self.toy.step(out)
    }

    fn clear(&mut self) {
        self.toy.clear();
    }
}

/// A pack of two joints behind `gate`.
pub(super) fn source(gate: &Gate) -> PackSource {
    let gate = gate.clone();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/toy");
    let mut pack = pack_of(toy_rig());
    pack.folder = folder;
    PackSource {
        pack,
        workers: 1,
        generator: Box::new(move |pack, max_batch| {
            let (toy, gate) = (Toy::new(pack.rig.dims, max_batch), gate.clone());
            Ok(Box::new(Gated { toy, gate }) as Box<dyn Generator>)
        }),
        decision: None,
    }
}
