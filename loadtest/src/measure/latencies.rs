//! Times, in a histogram of high dynamic range.

use std::time::Duration;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hdrhistogram::Histogram;
use hdrhistogram::serialization::{Deserializer as HistogramReader, Serializer as _, V2Serializer};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum time in a histogram, microseconds: an hour. Longer times count as an hour.
const MOST_US: u64 = 3_600_000_000;

/// A text cannot be read as a histogram.
#[derive(Debug, thiserror::Error)]
#[error("this is not a histogram: {0}")]
pub struct LatenciesError(String);

/// A histogram of times in microseconds. Its JSON form is `HdrHistogram`'s V2 format in base64,
/// which other tools read too, or an empty text without times. Histograms of several processes add
/// up exactly.
#[derive(Clone, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Latencies {
    /// Significant decimal digits.
    digits: u8,
    /// `None` before the first time. Many seconds of a load stay without one, and need no memory.
    histogram: Option<Histogram<u64>>,
}

impl JsonSchema for Latencies {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Latencies".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "type": "string",
            "contentEncoding": "base64",
            "description": "A histogram of microseconds in HdrHistogram's V2 format; empty without times"
        })
    }
}

impl PartialEq for Latencies {
    /// Whether both hold the same times. Their capacity may differ.
    fn eq(&self, other: &Self) -> bool {
        self.recorded().eq(other.recorded())
    }
}

impl std::fmt::Debug for Latencies {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (count, digits) = (self.count(), self.digits);
        let (median, max) = (self.quantile_ms(0.5), self.max_ms());
        write!(
            f,
            "Latencies({count} to {digits} digits, p50 {median} ms, longest {max} ms)"
        )
    }
}

impl Default for Latencies {
    /// Makes an empty histogram with an error of at most 0.1 %.
    fn default() -> Self {
        Self {
            digits: 3,
            histogram: None,
        }
    }
}

impl Latencies {
    /// Makes an empty histogram with an error of at most 1 %. It needs an eighth of the memory.
    pub fn coarse() -> Self {
        Self {
            digits: 2,
            histogram: None,
        }
    }

    /// The histogram, created if needed. The library accepts 1 to 5 digits, so this never fails.
    fn made(&mut self) -> Option<&mut Histogram<u64>> {
        if self.histogram.is_none() {
            self.histogram = Histogram::new(self.digits).ok();
        }
        self.histogram.as_mut()
    }

    /// All times with their counts.
    fn recorded(&self) -> impl Iterator<Item = (u64, u64)> + '_ {
        let all = self.histogram.iter().flat_map(|h| h.iter_recorded());
        all.map(|of| (of.value_iterated_to(), of.count_at_value()))
    }

    /// Adds a time.
    pub fn record(&mut self, time: Duration) {
        let micros = u64::try_from(time.as_micros()).unwrap_or(MOST_US);
        if let Some(histogram) = self.made() {
            // The histogram resizes itself, and the time is within the limit.
            let _ = histogram.record(micros.min(MOST_US));
        }
    }

    /// Adds all times of another histogram.
    pub fn add(&mut self, other: &Self) {
        if let (Some(other), Some(histogram)) = (&other.histogram, self.made()) {
            // The histogram resizes itself.
            let _ = histogram.add(other);
        }
    }

    /// Number of times.
    pub fn count(&self) -> u64 {
        self.histogram.as_ref().map_or(0, Histogram::len)
    }

    /// A quantile, such as 0.99, in milliseconds. 0 without times.
    pub fn quantile_ms(&self, quantile: f64) -> f64 {
        let histogram = self.histogram.as_ref();
        histogram.map_or(0.0, |h| h.value_at_quantile(quantile) as f64 / 1e3)
    }

    /// The mean, milliseconds. 0 without times.
    pub fn mean_ms(&self) -> f64 {
        self.histogram.as_ref().map_or(0.0, |h| h.mean() / 1e3)
    }

    /// The longest time, milliseconds. 0 without times.
    pub fn max_ms(&self) -> f64 {
        self.histogram.as_ref().map_or(0.0, |h| h.max() as f64 / 1e3)
    }

    /// The curve of percentiles: pairs of a quantile and its time in milliseconds. Points are
    /// denser towards 1.
    pub fn curve_ms(&self) -> Vec<(f64, f64)> {
        let points = self.histogram.iter().flat_map(|h| h.iter_quantiles(8));
        let points = points.map(|p| (p.quantile_iterated_to(), p.value_iterated_to() as f64 / 1e3));
        points.collect()
    }
}

impl From<Latencies> for String {
    fn from(latencies: Latencies) -> Self {
        let mut bytes = Vec::new();
        if let Some(histogram) = &latencies.histogram {
            // Writing to memory does not fail.
            let _ = V2Serializer::new().serialize(histogram, &mut bytes);
        }
        STANDARD.encode(bytes)
    }
}

impl TryFrom<String> for Latencies {
    type Error = LatenciesError;

    fn try_from(text: String) -> Result<Self, LatenciesError> {
        if text.is_empty() {
            return Ok(Self::default());
        }
        let bytes = STANDARD.decode(text).map_err(|e| LatenciesError(e.to_string()))?;
        let mut histogram: Histogram<u64> = HistogramReader::new()
            .deserialize(&mut bytes.as_slice())
            .map_err(|e| LatenciesError(format!("{e:?}")))?;
        histogram.auto(true);
        Ok(Self {
            digits: histogram.sigfig(),
            histogram: Some(histogram),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of(micros: &[u64]) -> Latencies {
        let mut latencies = Latencies::default();
        micros
            .iter()
            .for_each(|&us| latencies.record(Duration::from_micros(us)));
        latencies
    }

    #[test]
    fn quantiles_are_in_milliseconds() {
        let latencies = of(&(1..=1000).map(|n| n * 1000).collect::<Vec<_>>());
        assert!((latencies.quantile_ms(0.5) - 500.0).abs() < 0.5);
        assert!((latencies.quantile_ms(0.999) - 999.0).abs() < 1.0);
        assert!((latencies.mean_ms() - 500.5).abs() < 0.5);
        let empty = Latencies::default();
        assert_eq!(
            (empty.quantile_ms(0.99), empty.mean_ms(), empty.max_ms()),
            (0.0, 0.0, 0.0)
        );
        assert_eq!(of(&[u64::MAX]).count(), 1);
    }

    #[test]
    fn texts_that_are_not_histograms_are_refused() {
        for text in ["no", "AAAA", "äöü"] {
            assert!(Latencies::try_from(text.to_owned()).is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn parts_that_went_over_a_pipe_add_up_to_the_whole(
            one in prop::collection::vec(0..100_000_000_u64, 0..200),
            two in prop::collection::vec(0..100_000_000_u64, 0..200),
        ) {
            let mut sum: Latencies = serde_json::from_str(&serde_json::to_string(&of(&one)).unwrap()).unwrap();
            sum.add(&serde_json::from_str(&serde_json::to_string(&of(&two)).unwrap()).unwrap());
            let whole = of(&[one, two].concat());
            prop_assert_eq!(&sum, &whole);
            prop_assert_eq!(sum.max_ms(), whole.max_ms());
        }
    }
}
