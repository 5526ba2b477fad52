//! The most memory that a server can take with a given configuration.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

use super::Config;
use troupe_engine::pack::Pack;
use troupe_live::session::recording::{MAX_RECORDING_BYTES, MAX_RECORDINGS, MAX_REPLAY_BYTES, MAX_REPLAYS};
use troupe_live::session::{MAX_PERFORMERS, MAX_SESSION_BYTES, PERFORMER_BYTES};

/// The program and its libraries, without packs and clients, bytes. With two packs of 10 million
/// parameters it took 300 MiB (`scripts/measure-memory.py`).
const PROGRAM_BYTES: u64 = 128 << 20;
/// Copies of a pack's weights in the runtime, including the forms that it prepares.
const WEIGHT_COPIES: u64 = 4;
const WEIGHT_BYTES: u64 = 4;
/// Factor for requests and answers. The limit counts their bytes on the wire, and their decoded
/// form comes on top.
const TRANSFER_COPIES: u64 = 2;
/// Buffers of a connection, bytes.
const CONNECTION_BYTES: u64 = 32 << 10;
/// Data that a stream's client has not read yet (HTTP/2's window for a call), and the buffers of
/// the stream, bytes.
const STREAM_BYTES: u64 = (1 << 20) + (64 << 10);

/// The most memory that a server can take.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct WorstCase {
    /// One entry for each kind of memory.
    pub parts: Vec<MemoryUse>,
    /// Sum of all entries, bytes.
    pub total_bytes: u64,
}

/// A kind of memory, and how much of it the server can take.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MemoryUse {
    /// The use of the memory, in words.
    pub what: &'static str,
    /// Upper limit, bytes.
    pub bytes: u64,
    /// The options that set the limit.
    pub bounded_by: &'static str,
}

impl Config {
    /// The most memory that a server can take with these packs. `max_connections` is the number
    /// that the system allows.
    pub fn worst_case<'a>(
        &self,
        packs: impl IntoIterator<Item = &'a Pack>,
        max_connections: usize,
    ) -> WorstCase {
        let (mut count, mut weights) = (0, 0);
        for pack in packs {
            count += 1;
            weights += pack.manifest.parameters * WEIGHT_BYTES * WEIGHT_COPIES;
        }
        let part = |what, bytes, bounded_by| MemoryUse {
            what,
            bytes,
            bounded_by,
        };
        let parts = vec![
            part("program and weights", PROGRAM_BYTES + weights, "packs"),
            part("networks", self.network_bytes(count), "network_memory_mib"),
            part(
                "requests and answers",
                self.shares().all.bytes as u64 * TRANSFER_COPIES,
                "transfer_memory_mib",
            ),
            part(
                "sessions",
                self.max_sessions as u64 * MAX_SESSION_BYTES,
                "max_sessions",
            ),
            part(
                "performances",
                self.max_sessions.min(MAX_PERFORMERS) as u64 * PERFORMER_BYTES,
                "max_sessions",
            ),
            part(
                "recordings",
                (MAX_RECORDINGS * MAX_RECORDING_BYTES + MAX_REPLAYS * MAX_REPLAY_BYTES) as u64,
                "a constant",
            ),
            part("streams", self.max_streams as u64 * STREAM_BYTES, "max_streams"),
            part(
                "connections",
                max_connections as u64 * CONNECTION_BYTES,
                "max_connections",
            ),
            part(
                "scenes and styles",
                (self.max_scene_memory_mib as u64) << 20,
                "max_scene_memory_mib",
            ),
        ];
        let total_bytes = parts.iter().map(|part| part.bytes).sum();
        WorstCase { parts, total_bytes }
    }
}

impl WorstCase {
    /// Checks that the sum is at most `limit_bytes`. 0: no limit.
    ///
    /// # Errors
    /// A sentence that names the largest entries and the options that limit them.
    pub fn within(&self, limit_bytes: u64) -> Result<(), String> {
        if limit_bytes == 0 || self.total_bytes <= limit_bytes {
            return Ok(());
        }
        let mut parts: Vec<&MemoryUse> = self.parts.iter().collect();
        parts.sort_by_key(|part| std::cmp::Reverse(part.bytes));
        let largest: Vec<String> = parts
            .iter()
            .take(3)
            .map(|part| format!("{} {} MiB ({})", part.what, part.bytes >> 20, part.bounded_by))
            .collect();
        Err(format!(
            "memory_limit_mib is {}, but the server may take {} MiB: {}; lower one of these options, or allow more",
            limit_bytes >> 20,
            self.total_bytes.div_ceil(1 << 20),
            largest.join(", ")
        ))
    }
}

impl Display for WorstCase {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "Memory at worst, whatever clients do")?;
        for part in &self.parts {
            writeln!(
                f,
                "  {:<21} {:>6} MiB  {}",
                part.what,
                part.bytes >> 20,
                part.bounded_by
            )?;
        }
        writeln!(f, "  {:<21} {:>6} MiB", "all", self.total_bytes >> 20)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn the_worst_case_is_the_sum_of_what_options_bound() {
        let mut config = Config::local(Path::new("unused")).unwrap();
        config.transfer_memory_mib = 100;
        config.max_sessions = 1024;
        config.max_streams = 10;
        config.network_memory_mib = 50;
        config.max_scene_memory_mib = 7;
        let worst = config.worst_case([], 1000);
        let of = |what| worst.parts.iter().find(|part| part.what == what).unwrap().bytes >> 20;
        assert_eq!(
            (
                of("networks"),
                of("requests and answers"),
                of("scenes and styles")
            ),
            (50, 200, 7)
        );
        assert_eq!(
            worst.total_bytes,
            worst.parts.iter().map(|part| part.bytes).sum::<u64>()
        );
        assert_eq!(worst.within(0), Ok(()));
        assert_eq!(worst.within(worst.total_bytes), Ok(()));
        let error = worst.within(worst.total_bytes - 1).unwrap_err();
        assert!(
            error.contains("requests and answers 200 MiB (transfer_memory_mib)"),
            "{error}"
        );
    }
}
