//! Export of traces to a collector that speaks OTLP over gRPC.

use opentelemetry_otlp::{ExporterBuildError, SpanExporter, WithExportConfig as _};
use troupe_base::telemetry::EXPORT_TIMEOUT;

/// The collector of traces, and the share of requests that are traced.
#[derive(Debug, Clone)]
pub struct TraceOptions {
    /// The collector: `http://HOST:PORT`, OTLP over gRPC.
    pub endpoint: String,
    /// Share of requests and plans that are traced, 0 to 1, if the caller does not decide.
    pub sample_ratio: f64,
}

/// The exporter of traces cannot be made.
#[derive(Debug, thiserror::Error)]
#[error("otlp_endpoint cannot be used: {0}")]
pub struct TracesError(#[from] ExporterBuildError);

impl TraceOptions {
    /// Makes the exporter that sends spans to the collector. The collector may start later.
    ///
    /// # Errors
    /// [`TracesError`] if the endpoint is not a valid URL.
    pub fn exporter(&self) -> Result<SpanExporter, TracesError> {
        let exporter = SpanExporter::builder()
            .with_tonic()
            .with_endpoint(&self.endpoint)
            .with_timeout(EXPORT_TIMEOUT);
        Ok(exporter.build()?)
    }
}
