//! A smoke run of the load tester: the real program against the real server with the repository's
//! pack, every workload for a moment.
//!
//! It needs the ONNX Runtime library (`make runtime` fetches it).

#![allow(clippy::unwrap_used, reason = "these are tests")]

use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, OnceLock};

use axum::body::Bytes;
use axum::http::StatusCode;
use serde_json::Value;
use tokio::net::TcpListener;
use tokio::process::Command;
use tokio::sync::Mutex;
use troupe_server::config::Config;
use troupe_server::server::serve;

/// Address of the server that all tests share.
fn server() -> &'static str {
    static SERVER: OnceLock<String> = OnceLock::new();
    SERVER.get_or_init(|| {
        let (send, receive) = std::sync::mpsc::channel();
        // Each test has a runtime of its own; the server needs one that outlives them all.
        std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_multi_thread()
                .worker_threads(2)
                .enable_all()
                .build()
                .unwrap();
            runtime.block_on(async move {
                let packs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/human");
                let mut config = Config::local(&packs).unwrap();
                config.fixed.max_queued_characters = Some(64);
                let listener = TcpListener::bind(config.listen).await.unwrap();
                let mut handle = serve(config, listener).await.unwrap();
                handle.ready().await.unwrap();
                send.send(format!("http://{}", handle.address())).unwrap();
                std::future::pending::<()>().await;
            });
        });
        receive.recv().unwrap()
    })
}

/// The results of a run of the program.
struct Ran {
    output: Output,
    report: Value,
    page: String,
    _folder: tempfile::TempDir,
    path: PathBuf,
}

impl Ran {
    fn text(&self) -> String {
        String::from_utf8_lossy(&self.output.stdout).into_owned()
    }

    fn number(&self, pointer: &str) -> f64 {
        let value = self.report.pointer(pointer).and_then(Value::as_f64);
        value.unwrap_or_else(|| panic!("{pointer} is missing: {:#}", self.report))
    }
}

/// Runs the program with a report and a page against the server. Runs wait for each other, so that
/// they do not disturb each other.
async fn program(arguments: &str) -> Ran {
    static ALONE: Mutex<()> = Mutex::const_new(());
    let _alone = ALONE.lock().await;
    program_at(server(), arguments).await
}

async fn program_at(server: &str, arguments: &str) -> Ran {
    let folder = tempfile::tempdir().unwrap();
    let (json, html) = (folder.path().join("r.json"), folder.path().join("r.html"));
    let output = Command::new(env!("CARGO_BIN_EXE_troupe-loadtest"))
        .args(arguments.split_whitespace())
        .args(["--server", server, "--json"])
        .arg(&json)
        .arg("--html")
        .arg(&html)
        .output()
        .await
        .unwrap();
    let read = |path: &Path| {
        std::fs::read_to_string(path)
            .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&output.stderr)))
    };
    Ran {
        report: serde_json::from_str(&read(&json)).unwrap(),
        page: read(&html),
        output,
        path: json,
        _folder: folder,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_closed_loop_of_several_processes() {
    let ran = program(
        "run --clients 4 --processes 2 --warmup 0.3 --duration 1.2 --verify-every 3 --expect-zero-failures \
         --expect-p99-ms 60000 --label closed",
    )
    .await;
    assert_eq!(ran.output.status.code(), Some(0), "{}", ran.text());
    let answers = ran.number("/runs/0/counts/right");
    assert!(answers > 4.0);
    assert!(ran.number("/runs/0/verified") >= 2.0);
    assert_eq!(ran.number("/runs/0/client/processes"), 2.0);
    let frames = ran.number("/runs/0/throughput/characters_per_s") * 64.0;
    assert!((ran.number("/runs/0/throughput/frames_per_s") / frames - 1.0).abs() < 1e-9);
    let latency = ran.number("/runs/0/latency_ms/mean");
    let split = ran
        .report
        .pointer("/runs/0/split_ms")
        .unwrap()
        .as_object()
        .unwrap();
    let parts = split.values().map(|v| v.as_f64().unwrap()).sum::<f64>();
    assert!((parts - latency).abs() < 0.05 * latency, "{parts} {latency}");
    assert!(ran.number("/runs/0/server/batch_mean") >= 1.0);
    assert!(ran.number("/runs/0/server/stage_ms/pose") > 0.0);
    assert!(ran.page.contains("<svg") && ran.text().contains("throughput"));

    let compare = Command::new(env!("CARGO_BIN_EXE_troupe-loadtest"))
        .arg("compare")
        .args([&ran.path, &ran.path])
        .output()
        .await
        .unwrap();
    assert!(String::from_utf8_lossy(&compare.stdout).contains("x 1.000"));
}

#[tokio::test(flavor = "multi_thread")]
async fn an_open_loop_over_json_in_stages() {
    let ran = program("run --workload json --stages 20:0.6,20-60:0.6 --warmup 0.3 --seed 3").await;
    assert_eq!(ran.output.status.code(), Some(0), "{}", ran.text());
    let right = |stage: u32| ran.number(&format!("/runs/0/stages/{stage}/counts/right"));
    assert!(right(0) > 2.0 && right(1) > 5.0);
    assert_eq!(right(0) + right(1), ran.number("/runs/0/counts/right"));
    assert_eq!(ran.report["latency_of"], "answer_from_due");
    // Standard error is no terminal here.
    let progress = String::from_utf8_lossy(&ran.output.stderr);
    let second = |line: &str| line.contains(" 1 s  ") && line.contains(" answers ") && line.contains(" p99 ");
    assert!(progress.lines().any(second), "{progress}");
}

#[tokio::test(flavor = "multi_thread")]
async fn live_characters_on_both_clocks_and_idle_ones() {
    let ran = program("run --workload drive --characters 6 --streams 2 --warmup 0.7 --duration 1.2 --command-every 0.5 --verify-every 5").await;
    assert_eq!(ran.output.status.code(), Some(0), "{}", ran.text());
    assert_eq!(ran.number("/runs/0/live/characters"), 6.0);
    assert_eq!(ran.number("/runs/0/live/faults"), 0.0);
    assert!(ran.number("/runs/0/counts/right") > 30.0);
    assert!(ran.number("/runs/0/live/plans_per_s_and_character") > 0.5);
    assert!(ran.number("/runs/0/verified") > 0.0);

    let ran =
        program("run --workload step --characters 3 --warmup 0.2 --duration 0.5 --unpaced --floats").await;
    assert_eq!(ran.output.status.code(), Some(0), "{}", ran.text());
    assert!(ran.number("/runs/0/counts/right") > 0.0);
    assert_eq!(ran.number("/runs/0/counts/failed"), 0.0);

    let ran = program("run --workload idle --sessions 500 --processes 2 --warmup 0.2 --duration 0.8").await;
    assert_eq!(ran.output.status.code(), Some(0), "{}", ran.text());
    assert_eq!(ran.number("/runs/0/live/characters"), 500.0);
    assert_eq!(ran.number("/runs/0/live/faults"), 0.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_search_and_an_overload() {
    let ran = program(
        "search --workload drive --p99-ms 1000 --first 1 --most 2 --confirm 1 --tries 1 --warmup 0.3 --duration 0.6",
    )
    .await;
    let found = &ran.report["search"];
    assert!(found["steps"].as_array().unwrap().len() >= 2, "{}", ran.text());

    let ran = program(
        "overload --capacity 20 --factor 40 --per-request 16 --warmup 0.3 --before 0.8 --seconds 1.2 --after 2 --beside-characters 2",
    )
    .await;
    let found = &ran.report["overload"];
    assert_eq!(found["capacity_found"], false);
    let during = &found["during"]["counts"];
    assert!(
        during["refused"].as_u64().unwrap() > 0,
        "12,800 characters a second are too many: {}",
        ran.text()
    );
    assert_eq!(during["failed"], 0);
    assert_eq!(found["beside"]["characters"], 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_exit_code_shows_a_missed_bound() {
    let ran = program("run --clients 1 --warmup 0.1 --duration 0.5 --expect-p99-ms 0.001").await;
    assert_eq!(ran.output.status.code(), Some(5));
    assert!(ran.text().contains("expect-p99-ms MISSED"));
}

/// A server of another kind. It answers every third post with 503, and the others with nine bytes.
async fn stub() -> String {
    let count = Arc::new(AtomicU32::new(0));
    let answer = move |body: Bytes| {
        let nth = count.fetch_add(1, Ordering::Relaxed);
        async move {
            match (&*body, nth % 3) {
                (b"problem", 0) => (StatusCode::SERVICE_UNAVAILABLE, "busy"),
                (b"problem", _) => (StatusCode::OK, "123456789"),
                _ => (StatusCode::BAD_REQUEST, "what?"),
            }
        }
    };
    let routes = axum::Router::new().route("/fill", axum::routing::post(answer));
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move { axum::serve(listener, routes).await.unwrap() });
    format!("http://{address}/fill")
}

#[tokio::test(flavor = "multi_thread")]
async fn posts_of_bytes_to_any_server() {
    let folder = tempfile::tempdir().unwrap();
    let list =
        r#"{"version": 1, "requests": [{"body": "a.bin", "grpc": null, "frames": 60, "answer_bytes": 9}]}"#;
    std::fs::write(folder.path().join("requests.json"), list).unwrap();
    std::fs::write(folder.path().join("a.bin"), "problem").unwrap();
    let arguments = format!(
        "run --workload http --requests {} --rate 200 --arrivals bursty --burst-size 10 --warmup 0.2 --duration 1",
        folder.path().display()
    );
    let ran = program_at(&stub().await, &arguments).await;
    assert_eq!(ran.output.status.code(), Some(0), "{}", ran.text());
    let count = |kind: &str| ran.number(&format!("/runs/0/counts/{kind}"));
    assert_eq!(count("right") + count("refused"), 200.0, "{}", ran.text());
    assert!((60.0..=72.0).contains(&count("refused")), "{}", count("refused"));
    assert_eq!(ran.number("/runs/0/codes/HTTP_503"), count("refused"));
    let rates = ["frames", "requests"].map(|of| ran.number(&format!("/runs/0/throughput/{of}_per_s")));
    assert!((rates[0] / rates[1] - 60.0).abs() < 1e-9, "{rates:?}");
}

#[tokio::test]
async fn without_a_server_the_exit_code_is_3() {
    for processes in ["1", "2"] {
        for workload in ["inbetween", "json", "drive"] {
            let output = Command::new(env!("CARGO_BIN_EXE_troupe-loadtest"))
                .args(["run", "--server", "http://127.0.0.1:9", "--workload", workload])
                .args(["--processes", processes])
                .output()
                .await
                .unwrap();
            assert_eq!(output.status.code(), Some(3), "{output:?}");
            let error = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(error.contains("127.0.0.1:9"), "{error}");
        }
    }
}
