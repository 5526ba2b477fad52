//! The parts of a request's time in the server, from the timing in its answer.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use troupe_proto::v1;

use super::latencies::Latencies;

/// The parts of one request's time in the server, microseconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ServerTiming {
    /// In the queue.
    pub queue_us: u64,
    /// Filling tensors.
    pub assemble_us: u64,
    /// In the networks.
    pub inference_us: u64,
    /// Making frames from tensors.
    pub scatter_us: u64,
    /// From the request's arrival until the answer is ready for encoding.
    pub total_us: u64,
    /// Number of characters in the batch that carried the request.
    pub batch_size: u32,
}

impl From<v1::Timing> for ServerTiming {
    fn from(of: v1::Timing) -> Self {
        Self {
            queue_us: of.queue_us,
            assemble_us: of.assemble_us,
            inference_us: of.inference_us,
            scatter_us: of.scatter_us,
            total_us: of.total_us,
            batch_size: of.batch_size,
        }
    }
}

/// The parts of the time in the server, summed over requests, microseconds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TimingSums {
    /// Number of answers with a timing.
    pub count: u64,
    /// In the queue.
    pub queue_us: u64,
    /// Filling tensors.
    pub assemble_us: u64,
    /// In the networks.
    pub inference_us: u64,
    /// Making frames from tensors.
    pub scatter_us: u64,
    /// All time in the server.
    pub total_us: u64,
    /// Answers by the size of the batch that carried them.
    pub batches: BTreeMap<u32, u64>,
    /// Waits in the queue.
    pub queue: Latencies,
}

impl TimingSums {
    /// Adds the timing of one answer.
    pub fn add(&mut self, of: &ServerTiming) {
        self.count += 1;
        self.queue_us += of.queue_us;
        self.assemble_us += of.assemble_us;
        self.inference_us += of.inference_us;
        self.scatter_us += of.scatter_us;
        self.total_us += of.total_us;
        *self.batches.entry(of.batch_size).or_default() += 1;
        self.queue.record(std::time::Duration::from_micros(of.queue_us));
    }

    /// Adds the sums of another process.
    pub fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.queue_us += other.queue_us;
        self.assemble_us += other.assemble_us;
        self.inference_us += other.inference_us;
        self.scatter_us += other.scatter_us;
        self.total_us += other.total_us;
        for (size, count) in &other.batches {
            *self.batches.entry(*size).or_default() += count;
        }
        self.queue.add(&other.queue);
    }
}
