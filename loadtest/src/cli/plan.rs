//! Turns arguments into plans.

use super::Planned;
use super::args::{
    ArrivalArgs, ArrivalsArg, BoundArgs, Common, LiveArgs, LoadArgs, Overload as OverloadArgs, RequestArgs,
    Run, Search as SearchArgs, Time, WorkloadArg,
};
use crate::arrivals::{Process, Stages};
use crate::failure::Failure;
use crate::figures::{BoundResult, Bounds};
use crate::overload::{Overload, OverloadReport};
use crate::plan::{Live, Load, Plan, Protocol, Requests, Stepping, Workload};
use crate::search::{Aim, Goal, SearchLimits};

/// Number of arrivals in a burst if no option sets it.
const BURST: u32 = 16;

impl Run {
    /// The load that the arguments describe.
    pub(super) fn plan(&self) -> Planned {
        let load = self.load.load(self.time.duration.0.as_secs_f64())?;
        let stages = match &load {
            Load::Open { stages, .. } | Load::Closed { stages, .. } => stages,
        };
        let calls = is_calls(self.common.workload);
        if !calls && self.load.is_given() {
            return Err(Failure::Input(
                "--clients, --rate and stages are for single requests; live characters need --characters"
                    .to_owned(),
            ));
        }
        let measured_s = if calls {
            stages.seconds()
        } else {
            self.time.duration.0.as_secs_f64()
        };
        let workload = workload(&self.common, &self.requests, &self.live, load)?;
        Ok(plan(
            &self.common,
            self.time.warmup.0.as_secs_f64(),
            measured_s,
            workload,
        ))
    }
}

impl BoundArgs {
    /// The bounds that the arguments state.
    pub(super) fn bounds(&self) -> Bounds {
        Bounds {
            p99_ms: self.expect_p99_ms,
            zero_underruns: self.expect_zero_underruns,
            zero_failures: self.expect_zero_failures,
            min_rate: self.expect_rate,
        }
    }
}

impl SearchArgs {
    /// The load, the kind of level, the goal, and the limits of the search.
    pub(super) fn search(&self) -> Result<(Plan, Aim, Goal, SearchLimits), Failure> {
        let aim = match self.common.workload {
            WorkloadArg::Drive | WorkloadArg::Step => Aim::Characters,
            WorkloadArg::Inbetween | WorkloadArg::Json | WorkloadArg::Http => Aim::Rate,
            WorkloadArg::Idle => {
                return Err(Failure::option(
                    "--workload",
                    "idle",
                    "inbetween, json, http, drive, step",
                ));
            }
        };
        let (first, most, step) = match aim {
            Aim::Characters => (16.0, 16_384.0, 1.0),
            Aim::Rate => (10.0, 100_000.0, 0.5),
        };
        let limits = SearchLimits {
            first: within("--first", self.first.unwrap_or(first), step, 1e6)?,
            least: step,
            most: within("--most", self.most.unwrap_or(most), step, 1e6)?,
            within: within("--within", self.within, 0.001, 1.0)?,
            step,
            confirmations: self.confirm,
            tries: self.tries,
        };
        let goal = Goal {
            p99_ms: within("--p99-ms", self.p99_ms, 0.001, 1e7)?,
            min_plans_per_s: within("--min-plans", self.min_plans, 0.0, 1000.0)?,
            right_share: within("--right-share", self.right_share, 0.0, 1.0)?,
        };
        let Time { warmup, duration } = &self.time;
        let duration = duration.0.as_secs_f64();
        let load = Load::Open {
            process: self.arrivals.process()?,
            stages: hold(limits.first, duration)?,
            max_in_flight: self.arrivals.max_in_flight,
        };
        let workload = workload(&self.common, &self.requests, &self.live, load)?;
        let plan = plan(&self.common, warmup.0.as_secs_f64(), duration, workload);
        Ok((plan, aim, goal, limits))
    }
}

impl OverloadArgs {
    /// The load of single requests, and the course of the overload.
    pub(super) fn overload(&self) -> Result<(Plan, Overload), Failure> {
        if !is_calls(self.common.workload) {
            return Err(Failure::Input(
                "an overload needs single requests; allowed: --workload inbetween, json, http".to_owned(),
            ));
        }
        let how = Overload {
            capacity: self
                .capacity
                .map(|rate| within("--capacity", rate, 0.1, 1e5))
                .transpose()?,
            clients: self.probe_clients,
            probe_s: self.probe.0.as_secs_f64(),
            factor: within("--factor", self.factor, 1.0, 1000.0)?,
            before_s: self.before.0.as_secs_f64(),
            seconds: self.seconds.0.as_secs_f64(),
            after_s: self.after.0.as_secs_f64(),
            after_share: within("--after-share", self.after_share, 0.01, 0.9)?,
            max_in_flight: self.max_in_flight,
            beside: (self.beside_characters > 0).then(|| beside(self.beside_characters, &self.requests)),
        };
        let load = Load::Closed {
            stages: hold(f64::from(self.probe_clients), how.probe_s)?,
            think_s: 0.0,
        };
        let workload = Workload::Calls {
            protocol: protocol(self.common.workload, &self.requests),
            requests: requests(&self.requests)?,
            load,
        };
        let plan = plan(&self.common, self.warmup.0.as_secs_f64(), how.probe_s, workload);
        Ok((plan, how))
    }

    /// The stated bounds, and whether they were kept.
    pub(super) fn bounds(&self, found: &OverloadReport) -> Vec<BoundResult> {
        let at_most = |bound: &str, allowed: f64, found: f64| BoundResult {
            bound: bound.to_owned(),
            allowed,
            found,
            kept: found <= allowed,
        };
        // Without an answer there is no ratio.
        let measured = found.before.counts.right > 0 && found.during.counts.right > 0;
        let ratio = self.expect_p99_ratio.map(|allowed| {
            let bound = at_most("expect-p99-ratio", allowed, found.p99_ratio);
            BoundResult {
                kept: bound.kept && measured,
                ..bound
            }
        });
        // If the server did not recover, the figure is the time that it was watched.
        let watched = self.after.0.as_secs_f64();
        let recovery = self.expect_recovery_s.map(|allowed| match found.recovery_s {
            Some(seconds) => at_most("expect-recovery-s", allowed, seconds),
            None => BoundResult {
                kept: false,
                ..at_most("expect-recovery-s", allowed, watched)
            },
        });
        let slowed = found.beside.map_or(0, |b| {
            b.slowed_before + b.slowed_during + b.slowed_after + b.missing
        });
        let underruns = self
            .expect_zero_underruns
            .then(|| at_most("expect-zero-underruns", 0.0, slowed as f64));
        [ratio, recovery, underruns].into_iter().flatten().collect()
    }
}

impl ArrivalArgs {
    fn process(&self) -> Result<Process, Failure> {
        let bursts = self.burst_size.is_some() || self.burst_period.is_some();
        if bursts && self.arrivals != ArrivalsArg::Bursty {
            return Err(Failure::Input(
                "--burst-size and --burst-period need --arrivals bursty".to_owned(),
            ));
        }
        Ok(match (self.arrivals, self.burst_period) {
            (ArrivalsArg::Constant, _) => Process::Constant,
            (ArrivalsArg::Poisson, _) => Process::Poisson,
            (ArrivalsArg::Bursty, Some(period)) => Process::Periodic {
                period_s: period.0.as_secs_f64(),
            },
            (ArrivalsArg::Bursty, None) => Process::Bursts {
                size: self.burst_size.unwrap_or(BURST),
            },
        })
    }
}

impl LoadArgs {
    /// Whether any of these options was given.
    fn is_given(&self) -> bool {
        self.clients.is_some() || self.client_stages.is_some() || self.rate.is_some() || self.stages.is_some()
    }

    fn load(&self, duration: f64) -> Result<Load, Failure> {
        let process = self.arrivals.process()?;
        let open = |stages| Load::Open {
            process,
            stages,
            max_in_flight: self.arrivals.max_in_flight,
        };
        let closed = |stages| Load::Closed {
            stages,
            think_s: self.think.0.as_secs_f64(),
        };
        Ok(match (self.rate, &self.stages, &self.client_stages) {
            (Some(rate), ..) => open(hold(within("--rate", rate, 0.001, 1e6)?, duration)?),
            (_, Some(stages), _) => open(stages.clone()),
            (.., Some(stages)) => closed(stages.clone()),
            _ => closed(hold(f64::from(self.clients.unwrap_or(8)), duration)?),
        })
    }
}

fn hold(level: f64, seconds: f64) -> Result<Stages, Failure> {
    Stages::hold(level, seconds).map_err(|e| Failure::Input(e.to_string()))
}

fn within(option: &str, value: f64, least: f64, most: f64) -> Result<f64, Failure> {
    if (least..=most).contains(&value) {
        return Ok(value);
    }
    Err(Failure::option(option, value, format_args!("{least} to {most}")))
}

fn is_calls(workload: WorkloadArg) -> bool {
    matches!(
        workload,
        WorkloadArg::Inbetween | WorkloadArg::Json | WorkloadArg::Http
    )
}

fn plan(common: &Common, warmup_s: f64, measured_s: f64, workload: Workload) -> Plan {
    Plan {
        server: common.server.clone(),
        workload,
        warmup_s,
        measured_s,
        seed: common.seed,
        connections: common.connections,
        timeout_s: common.timeout.0.as_secs_f64(),
        processes: common.processes,
        fine: false,
        access: common.access.clone().into(),
    }
}

fn workload(common: &Common, of: &RequestArgs, live: &LiveArgs, load: Load) -> Result<Workload, Failure> {
    Ok(match common.workload {
        calls @ (WorkloadArg::Inbetween | WorkloadArg::Json | WorkloadArg::Http) => Workload::Calls {
            protocol: protocol(calls, of),
            requests: requests(of)?,
            load,
        },
        WorkloadArg::Drive => Workload::Drive(characters(live, of)?),
        WorkloadArg::Step => Workload::Step(Stepping {
            live: characters(live, of)?,
            paced: !live.unpaced,
        }),
        WorkloadArg::Idle => Workload::Idle {
            characters: live.characters,
            pack: of.pack.clone(),
        },
    })
}

fn protocol(workload: WorkloadArg, of: &RequestArgs) -> Protocol {
    match workload {
        WorkloadArg::Json => Protocol::Json,
        WorkloadArg::Http => Protocol::Http {
            headers: of
                .header
                .iter()
                .map(|header| (header.0.clone(), header.1.clone()))
                .collect(),
        },
        _ => Protocol::Grpc,
    }
}

fn requests(of: &RequestArgs) -> Result<Requests, Failure> {
    within("--temperature", f64::from(of.temperature), 0.0, 2.0)?;
    Ok(Requests {
        folder: of.requests.clone(),
        clip: of.clip.clone(),
        pack: of.pack.clone(),
        characters: of.per_request,
        frames: of.frames,
        temperature: of.temperature,
        variants: of.variants,
        verify_every: of.verify_every,
    })
}

fn characters(live: &LiveArgs, of: &RequestArgs) -> Result<Live, Failure> {
    Ok(Live {
        characters: live.characters,
        streams: live.streams,
        rate_hz: live.hz,
        compact: !live.floats,
        pack: of.pack.clone(),
        skeleton: live.skeleton.clone(),
        styles: live.styles.clone(),
        command_every_s: live.command_every.0.as_secs_f64(),
        look_ahead: live.look_ahead,
        spread_priorities: live.spread_priorities,
        performers: within("--performers", live.performers, 0.0, 1.0)?,
        verify_every: of.verify_every,
    })
}

/// Live characters that run during an overload.
fn beside(characters: u32, of: &RequestArgs) -> Live {
    Live {
        characters,
        streams: 1,
        rate_hz: 30,
        compact: true,
        pack: of.pack.clone(),
        skeleton: None,
        styles: Vec::new(),
        command_every_s: 2.5,
        look_ahead: None,
        spread_priorities: false,
        performers: 0.0,
        verify_every: of.verify_every,
    }
}
