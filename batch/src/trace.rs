//! Spans for a request's time in the queue and in steps.

use std::time::{Duration, Instant};

use troupe_base::telemetry::KeyValue;

use super::served::{Served, ServedStep};
use troupe_base::telemetry::Trace;

/// Adds the spans of a served request that came to the batcher at `arrived`.
pub fn trace_served(trace: &Trace, arrived: Instant, served: &Served) {
    trace_queue(trace, arrived, served.queued);
    for step in &served.steps {
        trace_step(trace, step);
    }
}

/// Adds the span of a request's wait in the queue.
pub fn trace_queue(trace: &Trace, arrived: Instant, queued: Duration) {
    trace.part("queue", arrived, arrived + queued, Vec::new());
}

/// Adds the span of a step. `batch.jobs` counts the jobs of all requests that shared the step.
pub fn trace_step(trace: &Trace, step: &ServedStep) {
    let attributes = vec![
        KeyValue::new("batch.jobs", step.jobs as i64),
        KeyValue::new("batch.rows", step.rows as i64),
        KeyValue::new("inference_us", step.inference.as_micros() as i64),
    ];
    trace.part("step", step.started, step.ended, attributes);
}
