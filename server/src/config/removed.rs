//! Options of earlier versions. Using one is an error that names its replacement.

use std::path::Path;

use super::ConfigError;

/// Each removed option with its replacement.
pub(super) const REMOVED: [(&str, &str); 21] = [
    ("allow_anonymous", "set without_keys to anyone"),
    ("drive_stall_timeout_ms", "always 30000"),
    ("idle_timeout_ms", "always 300000"),
    ("keepalive_ms", "always 20000"),
    ("max_batch_ms", "always 66"),
    ("max_calls_per_connection", "always 1024"),
    ("max_characters_per_request", "always 256"),
    ("max_connections_per_address", "half of max_connections"),
    ("max_message_bytes", "always 16777216"),
    (
        "max_queued_characters",
        "16 batches of max_batch for each worker, at least 1024",
    ),
    ("max_sessions_per_request", "always 1024"),
    ("max_sessions_per_stream", "always 4096"),
    ("max_streams_per_client", "a quarter of max_streams"),
    ("max_tenants", "always 256"),
    ("onnx_runtime", "set ORT_DYLIB_PATH in the environment"),
    ("one_time_key", "set without_keys to one-time-key"),
    ("session_ttl_ms", "60000, or the session's own ttl_ms"),
    ("snapshot_interval_ms", "always 250"),
    ("spin", "always false"),
    ("worker_spin_us", "always 800"),
    ("write_timeout_ms", "always 30000"),
];

/// The error for an option, by its name in a file, if it was removed.
fn removed(option: &str) -> Option<ConfigError> {
    let (option, instead) = REMOVED.iter().find(|(name, _)| *name == option)?;
    Some(ConfigError::Removed { option, instead })
}

/// Refuses variables of removed options.
pub(super) fn check_environment() -> Result<(), ConfigError> {
    // Other programs use the variable of this option too, and it still works.
    let own = REMOVED.iter().filter(|(name, _)| *name != "onnx_runtime");
    let is_set = |name: &str| std::env::var_os(format!("TROUPE_{}", name.to_ascii_uppercase())).is_some();
    match own.map(|(name, _)| *name).find(|name| is_set(name)) {
        Some(name) => removed(name).map_or(Ok(()), Err),
        None => Ok(()),
    }
}

/// Rejects a configuration file with removed options. A file that cannot be read or parsed passes:
/// loading gives the better error.
pub(super) fn check_file(file: &Path) -> Result<(), ConfigError> {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let table: toml::Table = text.parse().unwrap_or_default();
    table.keys().find_map(|name| removed(name)).map_or(Ok(()), Err)
}

/// The error for a flag such as `--max-batch-ms`, if its option was removed.
pub(super) fn of_flag(flag: &str) -> Option<ConfigError> {
    removed(&flag.trim_start_matches('-').replace('-', "_"))
}
