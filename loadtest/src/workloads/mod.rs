//! Kinds of load: single requests over gRPC, JSON or plain HTTP, and live characters.

mod answer;
mod codec;
mod connect;
mod drive;
mod frames;
mod groups;
mod grpc;
mod http;
mod idle;
mod requests;
mod route;
mod sessions;
mod step;
mod wander;

use std::sync::Arc;

use crate::arrivals::{Schedule, Stages};
use crate::failure::Failure;
use crate::loops::{Clients, Target, closed, open_on_a_thread};
use crate::measure::Recorder;
use crate::plan::{Load, Plan, Protocol, Share, Workload};

pub use requests::{Item, RequestSet};

/// A workload that is ready to start. Connections and sessions are open, requests are encoded.
#[derive(Debug)]
pub enum Prepared {
    /// Single requests over gRPC.
    Grpc(Arc<grpc::Grpc>),
    /// Single requests over HTTP.
    Http(Arc<http::Http>),
    /// Live characters with the server's clock.
    Drive(drive::Drive),
    /// Live characters with this client's clock.
    Step(step::Step),
    /// Open sessions without any calls.
    Idle(idle::Idle),
}

/// Prepares a process' share of a workload.
///
/// # Errors
/// See [`Failure`].
pub async fn prepare(plan: &Plan, share: Share) -> Result<Prepared, Failure> {
    Ok(match &plan.workload {
        Workload::Calls {
            protocol, requests, ..
        } => {
            let set = requests::load(plan, protocol, requests).await?;
            let http = match protocol {
                Protocol::Grpc => {
                    return Ok(Prepared::Grpc(Arc::new(grpc::Grpc::connect(plan, set).await?)));
                }
                Protocol::Json => http::Http::json(plan, set)?,
                Protocol::Http { headers } => http::Http::plain(plan, headers, set)?,
            };
            http.knock().await?;
            Prepared::Http(Arc::new(http))
        }
        Workload::Drive(live) => Prepared::Drive(drive::Drive::prepare(plan, live, share).await?),
        Workload::Step(stepping) => Prepared::Step(step::Step::prepare(plan, stepping, share).await?),
        Workload::Idle { characters, pack } => {
            Prepared::Idle(idle::Idle::prepare(plan, share, *characters, pack).await?)
        }
    })
}

impl Prepared {
    /// Runs the load by the recorder's clock, and returns after all answers.
    ///
    /// # Errors
    /// See [`Failure`]. Failed requests and sessions are recorded and do not cause an error.
    pub async fn carry_out(self, plan: &Plan, share: Share, recorder: &Arc<Recorder>) -> Result<(), Failure> {
        match self {
            Self::Grpc(target) => calls(plan, share, target, recorder).await,
            Self::Http(target) => calls(plan, share, target, recorder).await,
            Self::Drive(drive) => drive.carry_out(recorder).await,
            Self::Step(step) => step.carry_out(recorder).await,
            Self::Idle(idle) => idle.carry_out(recorder).await,
        }
    }
}

async fn calls<T: Target>(
    plan: &Plan,
    share: Share,
    target: Arc<T>,
    recorder: &Arc<Recorder>,
) -> Result<(), Failure> {
    let Workload::Calls { load, .. } = &plan.workload else {
        return Ok(());
    };
    match load {
        Load::Open {
            process,
            stages,
            max_in_flight,
        } => {
            let arrivals =
                Schedule::new(*process, warmed(stages, plan), plan.seed).share(share.nth, share.of);
            open_on_a_thread(target.clone(), recorder.clone(), arrivals, *max_in_flight).await?;
        }
        Load::Closed { stages, think_s } => {
            let clients = Clients {
                stages: warmed(stages, plan),
                think: std::time::Duration::from_secs_f64(*think_s),
                share,
            };
            closed(target.clone(), recorder.clone(), clients).await;
        }
    }
    recorder.verified(target.verified());
    Ok(())
}

/// The stages with a warm-up before them.
fn warmed(stages: &Stages, plan: &Plan) -> Stages {
    stages.clone().after_hold(plan.warmup_s)
}
