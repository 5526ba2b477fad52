//! Traces for an OpenTelemetry collector: they show how a request spent its time.
//!
//! They are off unless an endpoint is set, and then cost only a branch. The server measures the
//! parts of a request anyway, so it makes their spans after they have ended.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use http::HeaderMap;
use opentelemetry::propagation::{Extractor, TextMapPropagator as _};
use opentelemetry::trace::{
    SpanBuilder, SpanKind, Status, TraceContextExt as _, Tracer as _, TracerProvider as _,
};
use opentelemetry::{Context, KeyValue};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::error::OTelSdkResult;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::{
    BatchConfigBuilder, BatchSpanProcessor, Sampler, SdkTracer, SdkTracerProvider, Span, SpanData,
    SpanExporter, SpanProcessor,
};

use super::{Counter, Labels, Metric, Seldom, Telemetry};

const SPANS: Metric = Metric::new(
    "troupe_trace_spans_total",
    "Spans of traces, by outcome: the collector took them (exported) or did not (failed), or too many \
     waited for it (dropped)",
);

/// Spans that may wait for the collector. Further spans are dropped, so that no request ever waits
/// for a collector.
const MAX_WAITING: usize = 4096;
/// Most spans in one export.
const EXPORTED_AT_ONCE: usize = 512;
/// Time between two exports.
const EXPORT_INTERVAL: Duration = Duration::from_secs(1);
/// How long the collector may take for a batch of spans.
pub const EXPORT_TIMEOUT: Duration = Duration::from_secs(5);

/// The server's name in traces.
const SERVICE: &str = "troupe-server";

/// Makes traces. Clones share it.
#[derive(Debug, Clone)]
pub struct Traces {
    provider: SdkTracerProvider,
    tracer: SdkTracer,
}

impl Traces {
    /// Traces whose spans go to `exporter`. `sample_ratio` is the share of requests and plans that
    /// are traced, 0 to 1. If a request belongs to its caller's trace, the caller has decided
    /// whether it is sampled. Call this on a tokio runtime.
    pub fn new(exporter: impl SpanExporter + 'static, sample_ratio: f64, telemetry: &Telemetry) -> Self {
        let counter = |outcome| telemetry.counter(&SPANS, &Labels::default().with("outcome", outcome));
        let waiting = Arc::new(AtomicUsize::new(0));
        let counted = Counted {
            next: exporter,
            waiting: waiting.clone(),
            exported: counter("exported"),
            failed: counter("failed"),
            failures: Mutex::default(),
        };
        let batches = BatchConfigBuilder::default()
            .with_max_queue_size(MAX_WAITING)
            .with_max_export_batch_size(EXPORTED_AT_ONCE)
            .with_scheduled_delay(EXPORT_INTERVAL)
            .build();
        let gate = Gate {
            next: BatchSpanProcessor::builder(counted)
                .with_batch_config(batches)
                .build(),
            waiting,
            dropped: counter("dropped"),
        };
        let version = KeyValue::new("service.version", env!("CARGO_PKG_VERSION"));
        let resource = Resource::builder()
            .with_service_name(SERVICE)
            .with_attribute(version);
        let sampler = Sampler::ParentBased(Box::new(Sampler::TraceIdRatioBased(sample_ratio)));
        let provider = SdkTracerProvider::builder()
            .with_span_processor(gate)
            .with_sampler(sampler)
            .with_resource(resource.build())
            .build();
        Self {
            tracer: provider.tracer(SERVICE),
            provider,
        }
    }

    /// Begins the trace of a request, or continues the caller's trace that the header `traceparent`
    /// names. None if it is not sampled.
    pub fn request(&self, headers: &HeaderMap) -> Option<Trace> {
        let parent = TraceContextPropagator::new().extract_with_context(&Context::new(), &Headers(headers));
        self.begin(
            SpanBuilder::from_name("request").with_kind(SpanKind::Server),
            &parent,
        )
    }

    /// Begins a trace of other work that began at `from`. None if it is not sampled.
    pub fn root(&self, name: &'static str, from: Instant) -> Option<Trace> {
        self.begin(
            SpanBuilder::from_name(name).with_start_time(wall(from)),
            &Context::new(),
        )
    }

    fn begin(&self, span: SpanBuilder, parent: &Context) -> Option<Trace> {
        let span = self.tracer.build_with_context(span, parent);
        let context = Context::new().with_span(span);
        let is_sampled = context.span().span_context().is_sampled();
        is_sampled.then(|| Trace {
            tracer: self.tracer.clone(),
            context,
        })
    }

    /// Sends the waiting spans, for at most [`EXPORT_TIMEOUT`], and ends. This blocks.
    pub fn shut_down(&self) {
        if let Err(error) = self.provider.shutdown_with_timeout(EXPORT_TIMEOUT) {
            tracing::debug!(%error, "the last spans were not sent");
        }
    }
}

/// A trace's open span. Clones share it; it ends with the last of them.
#[derive(Debug, Clone)]
pub struct Trace {
    tracer: SdkTracer,
    context: Context,
}

impl Trace {
    /// 32 hexadecimal digits.
    pub fn id(&self) -> String {
        self.context.span().span_context().trace_id().to_string()
    }

    /// Names the span after its remote procedure.
    pub fn of_rpc(&self, rpc: &'static str) {
        let span = self.context.span();
        span.update_name(rpc);
        span.set_attribute(KeyValue::new("rpc.method", rpc));
    }

    /// Sets an attribute of the span.
    pub fn note(&self, attribute: KeyValue) {
        self.context.span().set_attribute(attribute);
    }

    /// Marks the span as failed by the server, with a gRPC status code.
    pub fn failed(&self, code: &'static str) {
        self.context.span().set_status(Status::error(code));
    }

    /// Adds a child span that lasted from `from` to `to`.
    pub fn part(&self, name: &'static str, from: Instant, to: Instant, attributes: Vec<KeyValue>) {
        let span = SpanBuilder::from_name(name)
            .with_start_time(wall(from))
            .with_attributes(attributes);
        let context = Context::new().with_span(self.tracer.build_with_context(span, &self.context));
        context.span().end_with_timestamp(wall(to));
    }
}

/// The system time at an instant.
fn wall(then: Instant) -> SystemTime {
    SystemTime::now() - then.elapsed()
}

struct Headers<'a>(&'a HeaderMap);

impl Extractor for Headers<'_> {
    fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key)?.to_str().ok()
    }

    fn keys(&self) -> Vec<&str> {
        self.0.keys().map(http::HeaderName::as_str).collect()
    }
}

/// Drops spans beyond [`MAX_WAITING`] and counts them. The library's own queue would drop them too,
/// but it does not report how many.
#[derive(Debug)]
struct Gate {
    next: BatchSpanProcessor,
    waiting: Arc<AtomicUsize>,
    dropped: Counter,
}

impl SpanProcessor for Gate {
    fn on_start(&self, span: &mut Span, context: &Context) {
        self.next.on_start(span, context);
    }

    fn on_end(&self, span: SpanData) {
        if self.waiting.fetch_add(1, Ordering::AcqRel) >= MAX_WAITING {
            self.waiting.fetch_sub(1, Ordering::AcqRel);
            return self.dropped.increment(1);
        }
        self.next.on_end(span);
    }

    fn force_flush(&self) -> OTelSdkResult {
        self.next.force_flush()
    }

    fn shutdown_with_timeout(&self, timeout: Duration) -> OTelSdkResult {
        self.next.shutdown_with_timeout(timeout)
    }

    fn set_resource(&mut self, resource: &Resource) {
        self.next.set_resource(resource);
    }
}

/// Counts exported and failed spans.
#[derive(Debug)]
struct Counted<E> {
    next: E,
    waiting: Arc<AtomicUsize>,
    exported: Counter,
    failed: Counter,
    failures: Mutex<Seldom>,
}

impl<E: SpanExporter> SpanExporter for Counted<E> {
    async fn export(&self, batch: Vec<SpanData>) -> OTelSdkResult {
        let count = batch.len();
        let result = self.next.export(batch).await;
        self.waiting.fetch_sub(count, Ordering::AcqRel);
        match &result {
            Ok(()) => self.exported.increment(count as u64),
            Err(error) => {
                self.failed.increment(count as u64);
                let next = self
                    .failures
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .next(Instant::now());
                if let Some(held_back) = next {
                    tracing::warn!(%error, held_back, "the collector did not take spans");
                }
            }
        }
        result
    }

    fn shutdown_with_timeout(&self, timeout: Duration) -> OTelSdkResult {
        self.next.shutdown_with_timeout(timeout)
    }

    fn force_flush(&self) -> OTelSdkResult {
        self.next.force_flush()
    }

    fn set_resource(&mut self, resource: &Resource) {
        self.next.set_resource(resource);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Condvar;

    use super::*;

    /// A collector that takes nothing until it is opened.
    #[derive(Debug, Clone, Default)]
    struct Closed(Arc<(Mutex<bool>, Condvar)>);

    impl SpanExporter for Closed {
        async fn export(&self, _: Vec<SpanData>) -> OTelSdkResult {
            let (open, changed) = &*self.0;
            let mut open = open.lock().unwrap();
            while !*open {
                open = changed.wait(open).unwrap();
            }
            Ok(())
        }
    }

    #[test]
    fn a_hanging_collector_delays_no_request_and_drops_are_counted() {
        let (telemetry, collector) = (Telemetry::new().unwrap(), Closed::default());
        let traces = Traces::new(collector.clone(), 1.0, &telemetry);
        let begun = Instant::now();
        for _ in 0..MAX_WAITING + 7 {
            drop(traces.root("plan", Instant::now()).unwrap());
        }
        assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
        let outcome = |outcome| format!("troupe_trace_spans_total{{outcome=\"{outcome}\"}}");
        let text = telemetry.render();
        assert!(text.contains(&format!("{} 7\n", outcome("dropped"))), "{text}");
        *collector.0.0.lock().unwrap() = true;
        collector.0.1.notify_all();
        traces.shut_down();
        let text = telemetry.render();
        let exported = format!("{} {MAX_WAITING}\n", outcome("exported"));
        assert!(text.contains(&exported), "{text}");
    }

    #[test]
    fn an_unsampled_request_has_no_trace() {
        let telemetry = Telemetry::new().unwrap();
        let traces = Traces::new(Closed::default(), 0.0, &telemetry);
        assert!(traces.root("plan", Instant::now()).is_none());
        let parent = |flags: &str| {
            let value = format!("00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-{flags}");
            HeaderMap::from_iter([(
                http::HeaderName::from_static("traceparent"),
                value.parse().unwrap(),
            )])
        };
        assert!(traces.request(&parent("00")).is_none());
        // The caller has decided.
        let trace = traces.request(&parent("01")).unwrap();
        assert_eq!(trace.id(), "0af7651916cd43dd8448eb211c80319c");
    }
}
