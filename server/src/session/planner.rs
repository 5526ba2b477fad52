//! The way of a plan: from a character's request through its pack's batcher and back.
//!
//! Every plan travels on its own, so that it shares batches with everybody else's. A character has at most one under way:
//! it asks for the next only after [`Character::plan_arrived`](super::Character::plan_arrived), which every request
//! leads to, whatever becomes of it.

use std::sync::Arc;
use std::time::Duration;

use super::cell::SessionCell;
use super::{Arrival, LivePlan, PlanFailed, PlanRequest, finish_live};
use crate::batch::SubmitError;
use crate::engine::{EngineError, RawMotion};
use crate::service::LoadedPack;

/// Shortest wait before a place in a full queue is asked for again.
const MIN_RETRY: Duration = Duration::from_millis(5);

/// What to do where the batcher's queue is full.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Patience {
    /// Ask again until there is a place: the character waits for this very plan.
    Waits,
    /// Give up: the character asks anew at its next frame, from where it then is.
    Fails,
}

/// Has a plan made, and tells the character and whoever waits for it. Returns at once.
pub fn ask(cell: &Arc<SessionCell>, request: PlanRequest, patience: Patience) {
    let cell = cell.clone();
    cell.pack().load.asked();
    // It enters the queue now, in the order of the calls, and not when its task first runs.
    let spare = (patience == Patience::Waits).then(|| request.item.clone());
    let place = cell.pack().batcher.enqueue(vec![request.item]);
    let (number, shape) = (request.number, request.shape);
    tokio::spawn(async move {
        let mut result = match place {
            Ok(answer) => answer.await,
            Err(error) => Err(error),
        };
        while let (Err(SubmitError::QueueFull { retry_after, .. }), Some(item)) = (&result, &spare) {
            if cell.end().is_some() {
                break;
            }
            tokio::time::sleep((*retry_after).max(MIN_RETRY)).await;
            result = cell.pack().batcher.submit(vec![item.clone()]).await;
        }
        if let Ok(served) = &result {
            cell.pack().load.measured(served);
        }
        let plan = result
            .and_then(|served| {
                served
                    .motions
                    .into_iter()
                    .next()
                    .ok_or(EngineError::Stopped.into())
            })
            .and_then(|raw| finish(&raw, &shape, cell.pack()));
        cell.pack().load.answered();
        arrived(&cell, number, plan);
    });
}

fn finish(raw: &RawMotion, shape: &super::LiveShape, pack: &LoadedPack) -> Result<LivePlan, SubmitError> {
    let plan = finish_live(raw, shape, &pack.pack).map_err(|_| {
        SubmitError::Engine(EngineError::Output {
            stage: crate::pack::Stage::Decoder,
            problem: "frames that are not finite".to_owned(),
        })
    })?;
    pack.metrics.planned(plan.roots.len());
    Ok(plan)
}

/// Tells the character, and wakes the one who waits for it.
fn arrived(cell: &Arc<SessionCell>, number: u64, plan: Result<LivePlan, SubmitError>) {
    let fps = cell.pack().pack.manifest.fps;
    let mut live = cell.live();
    let plan = match plan {
        Ok(plan) => {
            live.trouble = None;
            Ok(plan)
        }
        Err(error) => {
            if !matches!(error, SubmitError::QueueFull { .. }) {
                tracing::warn!(session = %cell.id(), %error, "a plan failed");
            }
            let before = live.trouble.as_ref().map_or(0, |(count, _)| *count);
            live.trouble = Some((before.saturating_add(1), error));
            Err(PlanFailed)
        }
    };
    if let Arrival::InTime { lead_frames } = live.character.plan_arrived(number, plan) {
        cell.pack().sessions.came(f64::from(lead_frames / fps));
    }
    drop(live);
    cell.wake();
}
