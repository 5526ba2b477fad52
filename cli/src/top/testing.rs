//! A server's metrics and sessions, for tests.

use troupe_proto::v1;

use super::figures::Figures;
use super::reading::Reading;

/// What the metrics are a second after others.
fn metrics(second: u64) -> String {
    let mut text = include_str!("metrics.txt").to_owned();
    for (name, before, growth) in [
        ("FRAMES", 1000, 900),
        ("SENT", 500, 90),
        ("BATCHES", 10, 4),
        ("BATCHED", 40, 10),
        ("CALLS", 100, 7),
        ("FAST", 90, 3),
        ("LATE", 2, 1),
    ] {
        text = text.replace(&format!("@{name}@"), &(before + second * growth).to_string());
    }
    text.replace("@CPU@", &(5.0 + 1.25 * second as f64).to_string())
}

pub(super) fn figures() -> Figures {
    let [before, now] = [0, 1].map(|second| Reading::parse(&metrics(second), second as f64).unwrap());
    Figures::new(Some(&before), &now, 4000.0)
}

pub(super) fn sessions() -> Vec<v1::Session> {
    let session = |id: &str, pack: &str, speed, underruns| v1::Session {
        id: id.to_owned(),
        pack: pack.to_owned(),
        style: "normal".to_owned(),
        speed,
        frame: 450,
        buffered_frames: 20,
        stats: Some(v1::SessionStats {
            plans_for_command: 3,
            plans_for_interval: 9,
            late_plans: 1,
            underruns,
            ..v1::SessionStats::default()
        }),
        ..v1::Session::default()
    };
    vec![
        session("robot", "g1", 0.8, 0),
        session("guard-1", "human", 1.25, 1),
        session("guard-2", "human", 1.4, 3),
    ]
}
