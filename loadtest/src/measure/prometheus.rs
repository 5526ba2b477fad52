//! The server's metrics at one moment, read from the Prometheus text format.

use prometheus_parse::{Sample, Value};

/// All samples of a scrape.
#[derive(Debug, Clone, Default)]
pub struct Metrics(Vec<Sample>);

impl Metrics {
    /// Reads a scrape. Lines that are not samples are skipped.
    pub fn parse(text: &str) -> Self {
        let lines = text.lines().map(|line| Ok(line.to_owned()));
        Self(prometheus_parse::Scrape::parse(lines).map_or_else(|_| Vec::new(), |scrape| scrape.samples))
    }

    /// The value of a counter or gauge, or of a histogram's `_sum` or `_count`. It is the sum over
    /// all series with these labels. `None` without a series.
    pub fn sum(&self, name: &str, labels: &[(&str, &str)]) -> Option<f64> {
        let fits = |sample: &&Sample| {
            sample.metric == name
                && labels
                    .iter()
                    .all(|(key, value)| sample.labels.get(key) == Some(value))
        };
        let values = self
            .0
            .iter()
            .filter(fits)
            .filter_map(|sample| match sample.value {
                Value::Counter(value) | Value::Gauge(value) | Value::Untyped(value) => Some(value),
                Value::Histogram(_) | Value::Summary(_) => None,
            });
        values.fold(None, |sum, value| Some(sum.unwrap_or(0.0) + value))
    }

    /// A label's value in the first sample of a metric.
    pub fn label(&self, name: &str, label: &str) -> Option<&str> {
        let sample = self.0.iter().find(|sample| sample.metric == name)?;
        sample.labels.get(label)
    }

    /// Growth of a counter since an earlier scrape. A counter that the earlier scrape does not have
    /// grew from 0. `None` without the counter.
    pub fn grown(&self, before: &Self, name: &str, labels: &[(&str, &str)]) -> Option<f64> {
        let now = self.sum(name, labels)?;
        Some((now - before.sum(name, labels).unwrap_or(0.0)).max(0.0))
    }

    /// Mean and number of the values that a histogram got since an earlier scrape. `None` without a
    /// value.
    pub fn mean(&self, before: &Self, name: &str, labels: &[(&str, &str)]) -> Option<(f64, f64)> {
        let count = self.grown(before, &format!("{name}_count"), labels)?;
        let sum = self.grown(before, &format!("{name}_sum"), labels)?;
        (count > 0.0).then_some((sum / count, count))
    }

    /// The values that a histogram got since an earlier scrape, as pairs of a bucket's upper bound
    /// and its own count. Histograms with different labels are added.
    pub fn buckets(&self, before: &Self, name: &str) -> Vec<(f64, f64)> {
        let (now, before) = (self.cumulative(name), before.cumulative(name));
        let mut below = 0.0;
        now.iter()
            .map(|&(bound, count)| {
                let since = count - at_bound(&before, bound);
                let own = (since - below).max(0.0);
                below = since;
                (bound, own)
            })
            .collect()
    }

    fn cumulative(&self, name: &str) -> Vec<(f64, f64)> {
        let mut sums: Vec<(f64, f64)> = Vec::new();
        let histograms = self
            .0
            .iter()
            .filter(|s| s.metric == name)
            .filter_map(|s| match &s.value {
                Value::Histogram(buckets) => Some(buckets),
                _ => None,
            });
        for bucket in histograms.flatten() {
            match sums.iter_mut().find(|(bound, _)| *bound == bucket.less_than) {
                Some((_, count)) => *count += bucket.count,
                None => sums.push((bucket.less_than, bucket.count)),
            }
        }
        sums.sort_by(|a, b| a.0.total_cmp(&b.0));
        sums
    }
}

fn at_bound(buckets: &[(f64, f64)], bound: f64) -> f64 {
    buckets.iter().find(|(b, _)| *b == bound).map_or(0.0, |b| b.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEFORE: &str = r#"
# HELP troupe_queue_duration_seconds Time
# TYPE troupe_queue_duration_seconds histogram
troupe_queue_duration_seconds_bucket{model="human",version="1",le="0.001"} 2
troupe_queue_duration_seconds_bucket{model="human",version="1",le="+Inf"} 4
troupe_queue_duration_seconds_sum{model="human",version="1"} 0.5
troupe_queue_duration_seconds_count{model="human",version="1"} 4
# TYPE process_resident_memory_bytes gauge
process_resident_memory_bytes 1048576
# TYPE troupe_replans_total counter
troupe_replans_total{model="human",cause="command"} 3
troupe_replans_total{model="human",cause="interval"} 10
"#;
    const AFTER: &str = r#"
# TYPE troupe_queue_duration_seconds histogram
troupe_queue_duration_seconds_bucket{model="human",version="1",le="0.001"} 12
troupe_queue_duration_seconds_bucket{model="human",version="1",le="+Inf"} 24
troupe_queue_duration_seconds_sum{model="human",version="1"} 2.5
troupe_queue_duration_seconds_count{model="human",version="1"} 24
troupe_replans_total{model="human",cause="command"} 5
troupe_replans_total{model="human",cause="interval"} 30
troupe_new_total 7
not a sample
"#;

    #[test]
    fn values_are_summed_up_over_labels() {
        let (before, after) = (Metrics::parse(BEFORE), Metrics::parse(AFTER));
        assert_eq!(
            before.sum("process_resident_memory_bytes", &[]),
            Some(1_048_576.0)
        );
        assert_eq!(before.sum("troupe_replans_total", &[]), Some(13.0));
        assert_eq!(
            before.sum("troupe_replans_total", &[("cause", "command")]),
            Some(3.0)
        );
        assert_eq!(before.sum("no_such", &[]), None);
        assert_eq!(before.label("troupe_replans_total", "model"), Some("human"));
        assert_eq!(before.label("troupe_replans_total", "engine"), None);
        assert_eq!(after.grown(&before, "troupe_replans_total", &[]), Some(22.0));
        assert_eq!(after.grown(&before, "troupe_new_total", &[]), Some(7.0));
    }

    #[test]
    fn means_and_buckets_are_of_what_came_between() {
        let (before, after) = (Metrics::parse(BEFORE), Metrics::parse(AFTER));
        let name = "troupe_queue_duration_seconds";
        assert_eq!(after.mean(&before, name, &[]), Some((0.1, 20.0)));
        assert_eq!(after.mean(&after, name, &[]), None);
        assert_eq!(
            after.buckets(&before, name),
            [(0.001, 10.0), (f64::INFINITY, 10.0)]
        );
    }
}
