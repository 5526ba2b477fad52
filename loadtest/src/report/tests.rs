use super::*;
use crate::arrivals::{Process, Stages};
use crate::measure::{Answer, Call, Clock, Outcome, Recorder, Scrape, Scrapes, ServerTiming};
use crate::plan::{Load, Protocol, Requests, Workload};
use std::time::Duration;
use tokio::time::Instant;

pub(super) fn plan() -> Plan {
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
    }
}

/// The metrics of a server that has run so many batches of four.
fn scrape(at_s: f64, batches: u32) -> Scrape {
    let text = format!(
        "# TYPE troupe_batch_size histogram\n\
         troupe_batch_size_bucket{{model=\"human\",le=\"4\"}} {batches}\n\
         troupe_batch_size_bucket{{model=\"human\",le=\"+Inf\"}} {batches}\n\
         troupe_batch_size_sum{{model=\"human\"}} {}\n\
         troupe_batch_size_count{{model=\"human\"}} {batches}\n\
         troupe_engine_info{{model=\"human\",engine=\"cpu\"}} 1\n\
         troupe_engine_lanes{{model=\"human\"}} 2\n\
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

/// A run of 400 requests, each answered after `latency_ms` of which the server says where 2 ms went.
pub(super) fn run(latency_ms: f64) -> Run {
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
    super::run(&plan, &ingredients)
}

pub(super) fn report(label: &str, latency_ms: f64) -> Report {
    let began = std::time::UNIX_EPOCH + Duration::from_secs(1_800_000_000);
    let mut report = Report::new(label.to_owned(), began, plan(), vec![run(latency_ms)]);
    report.machine = Machine {
        cpus: 2,
        cpu: "a processor".to_owned(),
        os: "linux x86_64".to_owned(),
    };
    report.tool = "0.0.0".to_owned();
    report
}

#[test]
fn the_parts_of_the_mean_latency_add_up_to_it() {
    let figures = run(5.0).figures;
    let split = figures.split_ms.unwrap();
    let parts = [
        split.client,
        split.transport,
        split.server_other,
        split.queue,
        split.assemble,
        split.inference,
        split.scatter,
    ];
    assert!((parts.iter().sum::<f64>() - figures.latency_ms.mean).abs() < 0.01);
    assert!((split.transport - 3.0).abs() < 1e-6);
    assert!((split.server_other - 0.5).abs() < 1e-6);
}

#[test]
fn what_the_server_says_is_of_the_measured_time() {
    let figures = run(5.0).figures;
    let server = figures.server.unwrap();
    assert_eq!((server.batches, server.batch_mean), (80.0, 4.0));
    assert!((server.cpus_busy - 0.2).abs() < 1e-9);
    assert_eq!(server.rss_peak_bytes, 100_000_100);
    assert!((figures.throughput.frames_per_s - 6400.0).abs() < 100.0);
}

fn assert_same(one: &serde_json::Value, two: &serde_json::Value) {
    use serde_json::Value::{Array, Number, Object};
    match (one, two) {
        (Object(one), Object(two)) => {
            assert!(one.keys().eq(two.keys()));
            one.values()
                .zip(two.values())
                .for_each(|(a, b)| assert_same(a, b));
        }
        (Array(one), Array(two)) => {
            assert_eq!(one.len(), two.len());
            one.iter().zip(two).for_each(|(a, b)| assert_same(a, b));
        }
        (Number(one), Number(two)) => {
            let (one, two) = (one.as_f64().unwrap(), two.as_f64().unwrap());
            assert!((one - two).abs() <= 1e-12 * one.abs(), "{one} {two}");
        }
        _ => assert_eq!(one, two),
    }
}

#[test]
fn a_report_comes_back_from_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.json");
    let report = report("one", 5.0);
    report.write(&path).unwrap();
    let back = Report::read(&path).unwrap();
    // Numbers come back within a last digit.
    assert_same(
        &serde_json::to_value(&back).unwrap(),
        &serde_json::to_value(&report).unwrap(),
    );
    assert_eq!(
        (back.plan, &back.runs[0].latencies),
        (report.plan, &report.runs[0].latencies)
    );

    std::fs::write(&path, r#"{"version": 99}"#).unwrap();
    let error = Report::read(&path).unwrap_err().to_string();
    assert!(error.contains("version 99; allowed: 1"), "{error}");
    std::fs::write(&path, "[]").unwrap();
    assert!(Report::read(&path).is_err());
}

#[test]
fn the_form_is_as_documented() {
    let schema = schemars::schema_for!(Report);
    insta::assert_snapshot!(serde_json::to_string_pretty(&schema).unwrap());
}

#[test]
fn the_table_is_as_documented() {
    insta::assert_snapshot!(table::report(&report("one", 5.0)));
}

#[test]
fn the_comparison_is_as_documented() {
    let text = compare::compare(&[report("before", 6.0), report("after", 3.0)]);
    insta::assert_snapshot!(text);
}

#[test]
fn the_page_needs_nothing_else() {
    let page = html::page(&report("a <label>", 5.0)).unwrap();
    for outside in ["http://", "https://", "<script", "<link", "@import", "src="] {
        let found = page
            .match_indices(outside)
            .map(|(at, _)| &page[at..(at + 60).min(page.len())])
            // Names of XML spaces and the address of the server that was measured are not fetched.
            .filter(|text| !text.contains("www.w3.org") && !text.contains("127.0.0.1:8080"))
            .collect::<Vec<_>>();
        assert!(found.is_empty(), "{outside}: {found:?}");
    }
    assert!(page.contains("a &#60;label&#62;"), "what was given is escaped");
    assert!(page.matches("<svg").count() >= 5);
}
