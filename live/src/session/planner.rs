//! Generates plans. A character's request goes through the batcher of its pack and comes back as a
//! plan.
//!
//! Every plan is a request of its own, so plans of different sessions share batches. A character
//! has at most one request under way. Every request ends with
//! [`Character::plan_arrived`](troupe_character::live::Character::plan_arrived), even after a
//! failure or a panic. Only after that does the character request the next plan.

use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

use super::LivePack;
use super::cell::SessionCell;
use super::performer;
use super::wants::{Patience, Wants};
use crate::packs::LoadedPack;
use troupe_base::turns::Turns;
use troupe_batch::{Order, Served, SubmitError};
use troupe_character::live::load::ClientLoad;
use troupe_character::live::{
    Arrival, LivePlan, LiveShape, PathItem, Pins, PlanFailed, PlanItem, PlanRequest, finish_live, hold_plan,
};
use troupe_engine::EngineError;
use troupe_engine::pack::Pack;
use troupe_motion::model::{Body, PathTask, Task};

/// Minimum wait before the next attempt to enter a full queue.
const MIN_RETRY: Duration = Duration::from_millis(5);

/// Requests everything that a character wants. Returns at once.
pub fn serve(cell: &Arc<SessionCell>, wants: Wants, patience: Patience) {
    if let Some(request) = wants.plan {
        ask(cell, request, patience);
    }
    if let Some(request) = wants.words {
        performer::ask(cell, request, patience);
    }
}

/// Requests a plan for a character, hands it over and wakes the session's owner. Returns at once.
pub fn ask(cell: &Arc<SessionCell>, request: PlanRequest, patience: Patience) {
    let asked = Instant::now();
    let turns = Turns::current();
    let load = cell.pack().load.of(turns.client().own);
    let awaited = Awaited::new(cell.clone(), load.clone(), request.number);
    let cell = cell.clone();
    let deadline = deadline(&cell, &request);
    let loaded = cell.pack().loaded();
    let task = task(&loaded, cell.pack().place(), request.item);
    let (shape, pins) = (request.shape, request.pins);
    // On a stream, a plan enters the queue now, so the order is that of the calls. Its task may run
    // later.
    let entered = match patience {
        Patience::Fails => {
            let order = Order::live(cell.owner_id(), deadline).of(turns.client());
            Ok(loaded.batcher.enqueue(vec![task], order))
        }
        Patience::Waits => Err((task, turns.clone())),
    };
    let work = async move {
        let result = match entered {
            Ok(Ok(answer)) => answer.await,
            Ok(Err(error)) => Err(error),
            Err((task, turns)) => step_plan(&cell, task, deadline, &turns).await,
        };
        if let Ok(served) = &result {
            load.measured(asked.elapsed(), served.work);
            cell.pack().loaded().metrics.trace_plan(asked, served);
        }
        let plan = result.and_then(|served| finish(served, &shape, pins.as_deref(), cell.pack()));
        awaited.arrived(plan);
    };
    // Finishing the motion takes as long as the character's other work. It counts for the same
    // client, so it runs in that client's turns.
    tokio::spawn(turns.take(work));
}

/// Generates a plan that a step waits for. Tries again while the queue is full.
async fn step_plan(
    cell: &SessionCell,
    task: Task,
    deadline: Instant,
    turns: &Turns,
) -> Result<Served, SubmitError> {
    // Limits the plans that one client has in the queue, so that other clients do not wait for a
    // large step.
    let _place = turns.plan().await;
    let order = Order::step(cell.owner_id(), deadline).of(turns.client());
    loop {
        let loaded = cell.pack().loaded();
        match loaded.batcher.submit(vec![task.clone()], order).await {
            Err(SubmitError::QueueFull { retry_after, .. }) if cell.end().is_none() => {
                tokio::time::sleep(retry_after.max(MIN_RETRY)).await;
            }
            result => return result,
        }
    }
}

/// Makes a plan, however long that takes.
///
/// # Errors
/// [`SubmitError`] if the networks cannot make it.
pub async fn make(
    cell: &Arc<SessionCell>,
    request: PlanRequest,
    turns: &Turns,
) -> Result<LivePlan, SubmitError> {
    let deadline = deadline(cell, &request);
    let task = task(&cell.pack().loaded(), cell.pack().place(), request.item);
    let served = step_plan(cell, task, deadline, turns).await?;
    finish(served, &request.shape, request.pins.as_deref(), cell.pack())
}

/// The task of a plan for the pack's generator.
fn task(loaded: &LoadedPack, place: usize, item: PlanItem) -> Task {
    match (item, loaded.pack.bodies.get(place)) {
        (PlanItem::Keyframes(task), _) => task.into(),
        (PlanItem::Path(item), Some(body)) => path_task(&loaded.pack, body, item).into(),
        // Only rigs of bodies use plans by path.
        (PlanItem::Path(_), None) => unreachable!("a plan by a path for a pack without bodies"),
    }
}

fn path_task(own: &Pack, body: &Arc<Body>, item: PathItem) -> PathTask {
    let weight = |word: &String| {
        let given = item.words.iter().find(|(given, _)| given == word);
        given.map_or(0.0, |(_, weight)| *weight)
    };
    PathTask {
        sways: true,
        body: body.clone(),
        context: item.context,
        targets: Vec::new(),
        path: item.path,
        style: own.words.iter().map(weight).collect(),
        steps: own.sampler().map_or(1, |steps| steps.default),
        guidance: 1.0,
        seed: item.seed,
    }
}

/// A plan that a character waits for. A panic or the end of the runtime can drop this without an
/// answer. Then the plan fails, and the character requests another.
struct Awaited {
    cell: Arc<SessionCell>,
    load: Arc<ClientLoad>,
    number: u64,
    answered: bool,
}

impl Awaited {
    fn new(cell: Arc<SessionCell>, load: Arc<ClientLoad>, number: u64) -> Self {
        load.asked();
        Self {
            cell,
            load,
            number,
            answered: false,
        }
    }

    fn arrived(mut self, plan: Result<LivePlan, SubmitError>) {
        self.answer(plan);
    }

    fn answer(&mut self, plan: Result<LivePlan, SubmitError>) {
        self.answered = true;
        self.load.answered();
        arrived(&self.cell, self.number, plan);
    }
}

impl Drop for Awaited {
    fn drop(&mut self) {
        if !self.answered {
            let lost = match std::thread::panicking() {
                true => EngineError::Panicked("its plan was not finished".to_owned()),
                false => EngineError::Stopped,
            };
            self.answer(Err(lost.into()));
        }
    }
}

/// The time by which a plan requested now is needed.
fn deadline(cell: &SessionCell, request: &PlanRequest) -> Instant {
    let frames = request.due_in_frames as f32;
    Instant::now() + Duration::from_secs_f32(frames / cell.pack().rig().fps)
}

fn finish(
    served: Served,
    shape: &LiveShape,
    pins: Option<&Pins>,
    pack: &LivePack,
) -> Result<LivePlan, SubmitError> {
    let raw = served.into_motions().next().ok_or(EngineError::Stopped)?;
    let mut plan = finish_live(&raw, shape, pack.rig()).map_err(|_| {
        SubmitError::Engine(EngineError::Output {
            stage: troupe_engine::pack::Stage::Decoder,
            problem: "frames that are not finite".to_owned(),
        })
    })?;
    match pins {
        Some(pins) => pins.pin_to_targets(&mut plan, &pack.rig().skeleton),
        None => hold_plan(pack.rig(), &mut plan),
    }
    pack.loaded().metrics.planned(plan.roots.len());
    Ok(plan)
}

/// Hands a plan, or its failure, to the character and wakes the session's owner.
fn arrived(cell: &Arc<SessionCell>, number: u64, plan: Result<LivePlan, SubmitError>) {
    let fps = cell.pack().rig().fps;
    let mut live = cell.live();
    let plan = match plan {
        Ok(plan) => {
            live.trouble = None;
            Ok(plan)
        }
        // A newer plan of the same character replaced this one.
        Err(SubmitError::Superseded) => Err(PlanFailed),
        Err(error) => {
            let failures = cell.pack().failures.lock();
            if !matches!(error, SubmitError::QueueFull { .. })
                && let Some(held_back) = failures
                    .unwrap_or_else(PoisonError::into_inner)
                    .next(Instant::now())
            {
                tracing::warn!(session = %cell.id(), %error, held_back, "a plan failed");
            }
            let before = live.trouble.as_ref().map_or(0, |(count, _)| *count);
            live.trouble = Some((before.saturating_add(1), error));
            Err(PlanFailed)
        }
    };
    live.record_pack(&cell.pack().loaded());
    if let Arrival::InTime { lead_frames } = live.plan_arrived(number, plan) {
        cell.pack().metrics.came(f64::from(lead_frames / fps));
    }
    drop(live);
    cell.wake();
}

#[cfg(test)]
mod tests {
    use super::super::registry::tests::Setup;
    use super::*;
    use troupe_character::live::{Clock, SUB_FRAMES};

    #[tokio::test]
    async fn a_plan_that_is_lost_to_a_panic_has_failed() {
        let setup = Setup::new(1).await;
        let cell = setup.cell("a");
        let asks = || {
            let mut live = cell.live();
            live.character.advance(SUB_FRAMES, Clock::Runs);
            cell.settle(&mut live).plan.map(|request| request.number)
        };
        let number = asks().unwrap();
        let awaited = Awaited::new(cell.clone(), cell.pack().load.of(1), number);
        assert_eq!(cell.pack().load.waiting(), 1);
        let task = tokio::spawn(async move {
            let _awaited = awaited;
            panic!("on the way");
        });
        assert!(task.await.unwrap_err().is_panic());
        assert_eq!(cell.pack().load.waiting(), 0);
        assert_eq!(cell.live().character.stats().failed_plans, 1);
        let trouble = cell.live().trouble.clone().unwrap().1;
        assert!(
            matches!(trouble, SubmitError::Engine(EngineError::Panicked(_))),
            "{trouble}"
        );
        // The owner wakes up, and the character requests another plan.
        cell.changed().await;
        assert_eq!(asks(), Some(number + 1));
    }

    #[tokio::test]
    async fn a_plan_replaced_by_a_newer_one_is_no_failure() {
        let setup = Setup::new(1).await;
        let cell = setup.cell("a");
        let awaited = Awaited::new(cell.clone(), cell.pack().load.of(1), 7);
        awaited.arrived(Err(SubmitError::Superseded));
        assert!(cell.live().trouble.is_none());
        assert_eq!(cell.live().character.stats().failed_plans, 0);
    }
}
