//! A run for tests.

use std::time::Duration;

use tokio::time::Instant;

use super::build::{Ingredients, run as figures_of};
use super::types::Run;
use crate::arrivals::{Process, Stages};
use crate::measure::{Answer, Call, Clock, Outcome, Recorder, Scrape, Scrapes, ServerTiming};
use crate::plan::{Load, Plan, Protocol, Requests, Workload};

pub(crate) fn plan() -> Plan {
    Plan {
        server: "http://127.0.0.1:8080".to_owned(),
        workload: Workload::Calls {
            protocol: Protocol::Grpc,
            requests: Requests {
                folder: None,
                clip: None,
                pack: String::new(),
                characters: 1,
                frames: 64,
                temperature: 0.0,
                variants: 64,
                verify_every: 100,
            },
            load: Load::Open {
                process: Process::Poisson,
                stages: "100:4".parse::<Stages>().unwrap(),
                max_in_flight: 1024,
            },
        },
        warmup_s: 1.0,
        measured_s: 4.0,
        seed: 1,
        connections: 4,
        timeout_s: 10.0,
        processes: 1,
        fine: false,
        access: Default::default(),
    }
}

/// The metrics of a server that has run a number of batches of four.
fn scrape(at_s: f64, batches: u32) -> Scrape {
    let text = format!(
        "# TYPE troupe_batch_size histogram\n\
         troupe_batch_size_bucket{{model=\"human\",le=\"4\"}} {batches}\n\
         troupe_batch_size_bucket{{model=\"human\",le=\"+Inf\"}} {batches}\n\
         troupe_batch_size_sum{{model=\"human\"}} {}\n\
         troupe_batch_size_count{{model=\"human\"}} {batches}\n\
         troupe_engine_info{{model=\"human\",engine=\"cpu\"}} 1\n\
         troupe_engine_workers{{model=\"human\"}} 2\n\
         process_cpu_seconds_total {}\n\
         process_resident_memory_bytes {}\n",
        4 * batches,
        f64::from(batches) * 0.01,
        100_000_000 + batches,
    );
    Scrape {
        at_s,
        metrics: crate::measure::Metrics::parse(&text),
    }
}

/// A run of 400 requests, each answered after `latency_ms`. The server accounts for 2 ms of it.
pub(crate) fn run(latency_ms: f64) -> Run {
    let plan = plan();
    let start = Instant::now();
    let clock = Clock::new(start, plan.warmup(), plan.measured());
    let recorder = Recorder::new(clock);
    for nth in 0..400_u32 {
        let due = start + Duration::from_secs(1) + Duration::from_millis(10) * nth;
        let timing = ServerTiming {
            queue_us: 500,
            inference_us: 1000,
            total_us: 2000,
            batch_size: 4,
            ..ServerTiming::default()
        };
        recorder.done(&Call {
            due,
            sent: due,
            done: due + Duration::from_secs_f64(latency_ms / 1e3),
            outcome: Outcome::Right(Answer {
                characters: 1,
                frames: 64,
                bytes: 100,
                timing: Some(timing),
            }),
        });
    }
    let scrapes = Scrapes {
        all: (0..6).map(|s| scrape(f64::from(s), s * 20)).collect(),
        first: 1,
        last: 5,
    };
    let ingredients = Ingredients {
        harvest: recorder.harvest(),
        scrapes: Some(scrapes),
        rss_before_bytes: 100_000_000,
    };
    figures_of(&plan, &ingredients)
}
