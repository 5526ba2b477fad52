//! The configured limits as metrics, so that alerts can compare other metrics with them.

use crate::config::Config;
use troupe_base::telemetry::{Labels, Metric, Telemetry};

const LIMIT: Metric = Metric::new(
    "troupe_limit",
    "Configured limits by option, in the option's unit; 0: no limit",
);

/// Sets the metrics of a server's limits. The server may have `max_connections`.
pub(super) fn show(config: &Config, max_connections: usize, telemetry: &Telemetry) {
    let limits = [
        ("max_connections", max_connections as f64),
        ("max_queued_characters", config.max_queued_characters() as f64),
        ("max_tenants", config.fixed.max_tenants as f64),
        ("max_scene_memory_mib", config.max_scene_memory_mib as f64),
        ("max_sessions", config.max_sessions as f64),
        ("max_streams", config.max_streams as f64),
        ("memory_limit_mib", config.memory_limit_mib as f64),
    ];
    for (option, value) in limits {
        let labels = Labels::default().with("option", option);
        telemetry.gauge(&LIMIT, &labels).set(value);
    }
}
