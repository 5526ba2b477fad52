//! The metrics: all are in docs/metrics.md, and dashboard and alerts ask for no others.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use troupe_batch::PackMetrics;
use troupe_engine::accuracy::Accuracy;
use troupe_engine::onnx::Batching;
use troupe_engine::{Check, Decision, EngineKind, Workers};

use crate::common::{TestServer, request};
use crate::restart::Folder;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
const INTRODUCTION: &str = "# Metrics

What `/metrics` exports, for Prometheus. The test `metrics` makes this page from a running server:

    UPDATE_METRICS=1 cargo test -p troupe-server --test wire metrics

A histogram `x` is exported as `x_bucket`, `x_sum` and `x_count`. `model` and `version` are those of a pack. [Alerts](alerts.md) and the
dashboard of [compose.yaml](../compose.yaml) are built on these.
";

/// What the server of this test lacks, and the metrics that come with it: name, kind and labels.
const ELSEWHERE: [(&str, &[Row]); 2] = [
    (
        "With a shared store",
        &[
            ("troupe_store_leases_total", "counter", "`result`"),
            ("troupe_store_uploads_total", "counter", "`result`"),
        ],
    ),
    (
        "With a GPU",
        &[
            ("troupe_gpu_busy_ratio", "gauge", "`gpu`, `name`"),
            ("troupe_gpu_memory_bytes", "gauge", "`gpu`, `name`"),
            ("troupe_gpu_memory_used_bytes", "gauge", "`gpu`, `name`"),
        ],
    ),
];
type Row = (&'static str, &'static str, &'static str);

#[derive(Default)]
struct Family {
    kind: String,
    help: String,
    labels: BTreeSet<String>,
}

type Families = BTreeMap<String, Family>;

/// The family that a series belongs to.
fn base<'a>(families: &Families, series: &'a str) -> &'a str {
    let endings = ["_bucket", "_sum", "_count"];
    let stem = endings.iter().find_map(|ending| series.strip_suffix(ending));
    let histogram = |stem: &&str| {
        families
            .get(*stem)
            .is_some_and(|family| family.kind == "histogram")
    };
    stem.filter(histogram).unwrap_or(series)
}

fn read(exposition: &str) -> Families {
    let mut families = Families::new();
    for line in exposition.lines().filter(|line| !line.is_empty()) {
        if let Some(rest) = line.strip_prefix("# HELP ") {
            let (name, help) = rest.split_once(' ').unwrap();
            families.entry(name.to_owned()).or_default().help = help.to_owned();
        } else if let Some(rest) = line.strip_prefix("# TYPE ") {
            let (name, kind) = rest.split_once(' ').unwrap();
            families.entry(name.to_owned()).or_default().kind = kind.to_owned();
        } else {
            let end = line.find(['{', ' ']).unwrap();
            let name = base(&families, &line[..end]).to_owned();
            let family = families
                .get_mut(&name)
                .unwrap_or_else(|| panic!("no type: {line}"));
            // No label's value has a comma or a sign of equality.
            let labels = line[end..]
                .strip_prefix('{')
                .and_then(|rest| rest.split_once('}'));
            let keys = labels.into_iter().flat_map(|(labels, _)| labels.split(','));
            let keys = keys.map(|label| label.split_once('=').unwrap().0.to_owned());
            family.labels.extend(keys.filter(|key| key != "le"));
        }
    }
    families
}

/// What a server exports that has done a bit of everything.
async fn exported() -> Families {
    static CALLS: AtomicU32 = AtomicU32::new(0);
    let folder = Folder::new(&format!("metrics-{}", CALLS.fetch_add(1, Ordering::Relaxed)));
    let store = folder.path().to_owned();
    let server = TestServer::start_with(|config| {
        config.otlp_endpoint = Some("http://127.0.0.1:9".into());
        config.store = Some(store);
    })
    .await;
    server
        .send(reqwest::Method::POST, "/v1/inbetween", &request(1))
        .await;
    // The test packs have no engine that was chosen.
    let check = Check {
        engine: EngineKind::OpenvinoBf16,
        accuracy: Accuracy::default(),
        passed: true,
        took: Duration::ZERO,
    };
    PackMetrics::new(server.handle.service().telemetry(), "toy", "1").engine_chosen(&Decision {
        engine: EngineKind::OpenvinoBf16,
        workers: Workers { count: 1, threads: 1 },
        batching: Batching::UNKNOWN,
        why: String::new(),
        check: Some(check),
    });
    read(&server.get("/metrics").await.text().await.unwrap())
}

fn page(families: &Families) -> String {
    let mut page = INTRODUCTION.to_owned();
    for (title, start) in [("The server", "troupe_"), ("The process", "process_")] {
        page += &format!("\n## {title}\n\n| metric | kind | labels | meaning |\n|---|---|---|---|\n");
        for (name, family) in families.iter().filter(|(name, _)| name.starts_with(start)) {
            let labels: Vec<String> = family.labels.iter().map(|label| format!("`{label}`")).collect();
            let (labels, help) = (labels.join(", "), family.help.replace('|', "\\|"));
            page += &format!("| `{name}` | {} | {labels} | {help} |\n", family.kind);
        }
    }
    let helps = in_the_code();
    for (title, rows) in ELSEWHERE {
        page += &format!("\n## {title}\n\n| metric | kind | labels | meaning |\n|---|---|---|---|\n");
        for (name, kind, labels) in rows {
            page += &format!("| `{name}` | {kind} | {labels} | {} |\n", helps[*name]);
        }
    }
    page
}

fn text(path: impl AsRef<Path>) -> String {
    let path = Path::new(ROOT).join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn sources(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => sources(&path, files),
            false => files.push(path),
        }
    }
}

/// The metrics of the code with their meanings.
fn in_the_code() -> BTreeMap<String, String> {
    let mut files = Vec::new();
    for layer in ["base", "batch", "live", "edge", "server"] {
        sources(&Path::new(ROOT).join(layer).join("src"), &mut files);
    }
    let mut metrics = BTreeMap::new();
    for file in files {
        let code = std::fs::read_to_string(&file).unwrap();
        for rest in code.split("Metric::new(").skip(1) {
            let mut strings = rest.split('"').skip(1).step_by(2);
            let Some(name) = strings.next().filter(|name| name.starts_with("troupe_")) else {
                continue;
            };
            // Lines of a text that goes on end in a backslash.
            let help = strings
                .next()
                .unwrap_or_default()
                .split('\\')
                .map(str::trim_start);
            metrics.insert(name.to_owned(), help.collect());
        }
    }
    metrics
}

/// The names that `text` mentions.
fn mentioned(text: &str) -> BTreeSet<&str> {
    let is_of_a_word = |sign: char| sign.is_ascii_alphanumeric() || sign == '_';
    text.split(|sign| !is_of_a_word(sign))
        .filter(|word| word.starts_with("troupe_") || word.starts_with("process_"))
        .collect()
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn the_page_of_metrics_is_current() {
    let families = exported().await;
    for (name, family) in &families {
        assert!(
            !family.help.is_empty() && ["counter", "gauge", "histogram"].contains(&family.kind.as_str()),
            "{name} is a {} that says {:?}",
            family.kind,
            family.help
        );
        assert!(
            name.starts_with("troupe_") || name.starts_with("process_"),
            "{name} is neither the server's nor the process's"
        );
    }
    let path = Path::new(ROOT).join("docs/metrics.md");
    let current = page(&families);
    if std::env::var_os("UPDATE_METRICS").is_some() {
        std::fs::write(&path, &current).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let line = committed.lines().zip(current.lines()).find(|(a, b)| a != b);
    assert!(
        committed == current,
        "docs/metrics.md differs from what a server exports ({line:?}). Update it with `UPDATE_METRICS=1 cargo test -p \
         troupe-server --test wire metrics`",
    );
}

#[tokio::test]
async fn every_metric_of_the_code_is_exported() {
    let families = exported().await;
    let elsewhere: BTreeSet<&str> = (ELSEWHERE.iter().flat_map(|(_, rows)| *rows))
        .map(|&(name, ..)| name)
        .collect();
    let metrics = in_the_code();
    for name in metrics.keys() {
        assert!(
            families.contains_key(name) != elsewhere.contains(&**name),
            "{name} is not exported by the server of this test; have it do what sets it, or say what it lacks"
        );
    }
    let count = metrics.len();
    assert!(count > 40, "{count}");
}

#[tokio::test]
async fn dashboard_and_alerts_use_existing_metrics() {
    let families = exported().await;
    for path in [
        "deploy/grafana/dashboards/troupe.json",
        "deploy/rules.yml",
        "deploy/rules_test.yml",
    ] {
        let text = text(path);
        let names = mentioned(&text);
        assert!(names.len() > 5, "{path}: {names:?}");
        for name in names {
            assert!(
                families.contains_key(base(&families, name)),
                "{path} asks for {name}, which is not exported"
            );
        }
    }
}

#[test]
fn every_alert_is_explained_and_tested() {
    let (rules, tests, page) = (
        text("deploy/rules.yml"),
        text("deploy/rules_test.yml"),
        text("docs/alerts.md"),
    );
    let named = |line: &'_ str| line.trim().strip_prefix("- alert: ").map(str::to_owned);
    let alerts: Vec<String> = rules.lines().filter_map(named).collect();
    assert!(alerts.len() > 8, "{alerts:?}");
    for alert in &alerts {
        let link = format!("docs/alerts.md#{}", alert.to_lowercase());
        assert!(
            rules.contains(&format!("runbook: \"{link}\"")),
            "{alert} has no runbook"
        );
        assert!(
            page.contains(&format!("\n## {alert}\n")),
            "docs/alerts.md lacks {alert}"
        );
        assert!(
            tests.contains(&format!("\n  - name: {alert}\n")),
            "nothing tests {alert}"
        );
    }
    assert_eq!(page.matches("\n## ").count(), alerts.len());
    let (config, compose) = (text("deploy/prometheus.yml"), text("compose.yaml"));
    assert!(config.contains("- rules.yml") && compose.contains("./deploy/rules.yml:"));
}
