//! What `troupe top` shows, in words.

use troupe_proto::v1;

use super::reading::{Change, Reading};

/// Text for an unknown figure.
const NONE: &str = "-";

/// Headers of the packs' table.
pub(super) const PACK_HEADERS: [&str; 10] = [
    "pack",
    "sessions",
    "frames/s",
    "sent/s",
    "batch",
    "waiting",
    "wait p50",
    "wait p99",
    "late/s",
    "underruns",
];
/// Headers of the calls' table.
pub(super) const CALL_HEADERS: [&str; 4] = ["call", "per s", "p50", "p99"];
/// Headers of the sessions' table, which is sorted by one of them.
pub(super) const SESSION_HEADERS: [&str; 9] = [
    "session",
    "pack",
    "style",
    "speed",
    "time",
    "buffer",
    "plans",
    "late",
    "underruns",
];

/// Everything of one moment.
#[derive(Debug, Default, Clone, PartialEq)]
pub(super) struct Figures {
    /// The server and its process: a line.
    pub(super) head: String,
    pub(super) packs: Vec<[String; 10]>,
    pub(super) calls: Vec<[String; 4]>,
}

impl Figures {
    /// What the last reading says, and with one before it how fast things change.
    pub(super) fn new(before: Option<&Reading>, now: &Reading, unix_s: f64) -> Self {
        let change = Change {
            before: before.unwrap_or(now),
            after: now,
        };
        Self {
            head: head(&change, unix_s),
            packs: packs(&change),
            calls: calls(&change),
        }
    }
}

fn head(change: &Change<'_>, unix_s: f64) -> String {
    let now = change.after;
    let gauge = |name: &str| now.total(name, &[]).unwrap_or(0.0);
    let ready = if gauge("troupe_ready") == 1.0 {
        "ready"
    } else {
        "not ready"
    };
    let up = match now.total("process_start_time_seconds", &[]) {
        Some(start) => format!(" · up {}", span(unix_s - start)),
        None => String::new(),
    };
    let cores = change.rate("process_cpu_seconds_total", &[]);
    let refused = [
        change.rate("troupe_rejections_total", &[]),
        change.rate("troupe_refusals_total", &[]),
    ];
    let refused = refused.into_iter().flatten().reduce(|a, b| a + b);
    format!(
        "{ready}{up} · {} cores · {:.0} MiB · {:.0} connections · {:.0} streams · {} calls/s · {} refused/s · {} frames dropped/s",
        number(cores, 2),
        gauge("process_resident_memory_bytes") / f64::from(1 << 20),
        gauge("troupe_connections_active"),
        gauge("troupe_streams_active"),
        number(change.rate("troupe_requests_total", &[]), 1),
        number(refused, 1),
        number(change.rate("troupe_stream_dropped_frames_total", &[]), 1),
    )
}

fn packs(change: &Change<'_>) -> Vec<[String; 10]> {
    let now = change.after;
    let row = |model: String| {
        let of = [("model", &*model)];
        let rate = |name: &str| change.rate(name, &of);
        let wait = |quantile| change.quantile("troupe_queue_duration_seconds", &of, quantile);
        [
            model.clone(),
            number(now.total("troupe_sessions_active", &of), 0),
            number(rate("troupe_frames_generated_total"), 0),
            number(rate("troupe_frames_sent_total"), 0),
            number(change.mean("troupe_batch_size", &of), 1),
            number(now.total("troupe_pending_characters", &of), 0),
            milliseconds(wait(0.5)),
            milliseconds(wait(0.99)),
            number(rate("troupe_late_plans_total"), 1),
            number(now.total("troupe_underruns_total", &of), 0),
        ]
    };
    now.values_of("troupe_engine_info", "model")
        .into_iter()
        .map(row)
        .collect()
}

/// A row for each procedure that was called since the reading before.
fn calls(change: &Change<'_>) -> Vec<[String; 4]> {
    let row = |rpc: String| {
        let of = [("rpc", &*rpc)];
        let rate = change
            .rate("troupe_requests_total", &of)
            .filter(|&rate| rate > 0.0)?;
        let latency = |quantile| change.quantile("troupe_request_duration_seconds", &of, quantile);
        Some([
            rpc.clone(),
            number(Some(rate), 1),
            milliseconds(latency(0.5)),
            milliseconds(latency(0.99)),
        ])
    };
    let rpcs = change.after.values_of("troupe_requests_total", "rpc");
    rpcs.into_iter().filter_map(row).collect()
}

/// A session's row.
pub(super) fn session_row(session: &v1::Session) -> [String; 9] {
    let stats = session.stats.unwrap_or_default();
    [
        session.id.clone(),
        session.pack.clone(),
        session.style.clone(),
        format!("{:.2} m/s", session.speed),
        format!("{:.1} s", session.frame as f64 / 30.0),
        format!("{} frames", session.buffered_frames),
        stats.plans().to_string(),
        stats.late_plans.to_string(),
        stats.underruns.to_string(),
    ]
}

/// Sorts sessions by a column of [`SESSION_HEADERS`]; those that are the same in it by name.
pub(super) fn sort(sessions: &mut [v1::Session], column: usize, reverse: bool) {
    let stats = |session: &v1::Session| session.stats.unwrap_or_default();
    sessions.sort_by(|a, b| {
        let order = match column {
            1 => a.pack.cmp(&b.pack),
            2 => a.style.cmp(&b.style),
            3 => a.speed.total_cmp(&b.speed),
            4 => a.frame.cmp(&b.frame),
            5 => a.buffered_frames.cmp(&b.buffered_frames),
            6 => stats(a).plans().cmp(&stats(b).plans()),
            7 => stats(a).late_plans.cmp(&stats(b).late_plans),
            8 => stats(a).underruns.cmp(&stats(b).underruns),
            _ => a.id.cmp(&b.id),
        };
        let order = if reverse { order.reverse() } else { order };
        order.then_with(|| a.id.cmp(&b.id))
    });
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| NONE.to_owned(), |value| format!("{value:.digits$}"))
}

fn milliseconds(seconds: Option<f64>) -> String {
    seconds.map_or_else(|| NONE.to_owned(), |seconds| format!("{:.1} ms", seconds * 1e3))
}

/// A time span in its two largest units.
fn span(seconds: f64) -> String {
    let seconds = seconds.max(0.0) as u64;
    let (minutes, hours, days) = (seconds / 60, seconds / 3600, seconds / 86_400);
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{minutes} min {} s", seconds % 60),
        3600..86_400 => format!("{hours} h {} min", minutes % 60),
        _ => format!("{days} d {} h", hours % 24),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sessions_are_sorted_by_any_column() {
        let session = |id: &str, speed, underruns| v1::Session {
            id: id.to_owned(),
            speed,
            stats: Some(v1::SessionStats {
                underruns,
                ..v1::SessionStats::default()
            }),
            ..v1::Session::default()
        };
        let mut sessions = vec![session("b", 1.0, 2), session("a", 2.0, 2), session("c", 0.5, 9)];
        let mut ids = |column, reverse| {
            sort(&mut sessions, column, reverse);
            sessions
                .iter()
                .map(|session| session.id.clone())
                .collect::<String>()
        };
        assert_eq!(ids(0, false), "abc");
        assert_eq!(ids(0, true), "cba");
        assert_eq!(ids(3, true), "abc");
        assert_eq!(ids(8, true), "cab", "the same underruns: by name");
        for column in 0..SESSION_HEADERS.len() {
            ids(column, true);
        }
    }

    #[test]
    fn spans_are_short() {
        assert_eq!(span(-1.0), "0 s");
        assert_eq!(span(59.9), "59 s");
        assert_eq!(span(61.0), "1 min 1 s");
        assert_eq!(span(7322.0), "2 h 2 min");
        assert_eq!(span(200_000.0), "2 d 7 h");
    }
}
