//! Where traces go: to a collector that speaks OTLP over gRPC.

use opentelemetry_otlp::{ExporterBuildError, SpanExporter, WithExportConfig as _};
use troupe_base::telemetry::EXPORT_TIMEOUT;

/// Where traces go, and of which requests there are any.
#[derive(Debug, Clone)]
pub struct TraceOptions {
    /// The collector: `http://HOST:PORT`, OTLP over gRPC.
    pub endpoint: String,
    /// Which share of requests and plans is traced, where the caller does not say whether its
    /// request is.
    pub sample_ratio: f64,
}

/// Why there are no traces.
#[derive(Debug, thiserror::Error)]
#[error("otlp_endpoint cannot be used: {0}")]
pub struct TracesError(#[from] ExporterBuildError);

impl TraceOptions {
    /// What sends spans to the collector. The collector may come later.
    ///
    /// # Errors
    /// [`TracesError`] for an endpoint that is none.
    pub fn exporter(&self) -> Result<SpanExporter, TracesError> {
        let exporter = SpanExporter::builder()
            .with_tonic()
            .with_endpoint(&self.endpoint)
            .with_timeout(EXPORT_TIMEOUT);
        Ok(exporter.build()?)
    }
}
