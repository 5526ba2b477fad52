//! The limits that are set, as metrics: alerts compare others with them.

use crate::config::Config;
use troupe_base::telemetry::{Labels, Metric, Telemetry};

const LIMIT: Metric = Metric::new(
    "troupe_limit",
    "Limits that are set, by option and in its unit; 0 for none",
);

/// Shows the limits of a server that may have `max_connections`.
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
