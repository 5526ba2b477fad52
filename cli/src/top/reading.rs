//! The server's metrics at a moment, and what changed between two.

use std::collections::BTreeSet;

use prometheus_parse::{Sample, Scrape, Value};

use crate::failure::Failure;

/// Labels that a series must have.
pub(super) type Labels<'a> = &'a [(&'a str, &'a str)];

/// All series of `/metrics` at a moment.
pub(super) struct Reading {
    /// When, seconds on any clock.
    at_s: f64,
    series: Vec<Sample>,
}

impl Reading {
    pub(super) fn parse(text: &str, at_s: f64) -> Result<Self, Failure> {
        let lines = text.lines().map(|line| Ok(line.to_owned()));
        let scrape = Scrape::parse(lines).map_err(|e| Failure::Other(format!("/metrics: {e}")))?;
        Ok(Self {
            at_s,
            series: scrape.samples,
        })
    }

    fn series<'a>(&'a self, name: &'a str, labels: Labels<'a>) -> impl Iterator<Item = &'a Sample> {
        self.series.iter().filter(move |series| {
            let has = |&(label, value): &(&str, &str)| series.labels.get(label) == Some(value);
            series.metric == name && labels.iter().all(has)
        })
    }

    /// The sum over the series of a counter or gauge. None without a series.
    pub(super) fn total(&self, name: &str, labels: Labels<'_>) -> Option<f64> {
        let values = self.series(name, labels).filter_map(|series| match series.value {
            Value::Counter(value) | Value::Gauge(value) | Value::Untyped(value) => Some(value),
            Value::Histogram(_) | Value::Summary(_) => None,
        });
        values.reduce(|a, b| a + b)
    }

    /// The values that a label has in the series of some name.
    pub(super) fn values_of(&self, name: &str, label: &str) -> BTreeSet<String> {
        let values = self
            .series(name, &[])
            .filter_map(|series| series.labels.get(label));
        values.map(str::to_owned).collect()
    }

    /// Upper bounds of a histogram's buckets and how many samples are not above each, all series
    /// together.
    fn buckets(&self, name: &str, labels: Labels<'_>) -> Vec<(f64, f64)> {
        let mut buckets: Vec<(f64, f64)> = Vec::new();
        for series in self.series(name, labels) {
            let Value::Histogram(counts) = &series.value else {
                continue;
            };
            for count in counts {
                match buckets.iter_mut().find(|(bound, _)| *bound == count.less_than) {
                    Some((_, sum)) => *sum += count.count,
                    None => buckets.push((count.less_than, count.count)),
                }
            }
        }
        buckets.sort_by(|a, b| a.0.total_cmp(&b.0));
        buckets
    }
}

/// What changed from one reading to a later one.
pub(super) struct Change<'a> {
    pub(super) before: &'a Reading,
    pub(super) after: &'a Reading,
}

impl Change<'_> {
    /// Growth of a counter. A counter that shrank began again, because the server was restarted.
    fn growth(&self, name: &str, labels: Labels<'_>) -> Option<f64> {
        let after = self.after.total(name, labels)?;
        let before = self.before.total(name, labels).unwrap_or(0.0);
        Some(if after < before { after } else { after - before })
    }

    /// How fast a counter grows, a second.
    pub(super) fn rate(&self, name: &str, labels: Labels<'_>) -> Option<f64> {
        let seconds = self.after.at_s - self.before.at_s;
        Some(self.growth(name, labels)? / seconds).filter(|rate| rate.is_finite())
    }

    /// The mean of a histogram's new samples; none without such.
    pub(super) fn mean(&self, name: &str, labels: Labels<'_>) -> Option<f64> {
        let sum = self.growth(&format!("{name}_sum"), labels)?;
        let count = self.growth(&format!("{name}_count"), labels)?;
        Some(sum / count).filter(|mean| mean.is_finite())
    }

    /// A quantile of a histogram's new samples, between the bounds of its bucket; none without
    /// samples. Above the last bound it is that bound.
    pub(super) fn quantile(&self, name: &str, labels: Labels<'_>, quantile: f64) -> Option<f64> {
        let (before, after) = (
            self.before.buckets(name, labels),
            self.after.buckets(name, labels),
        );
        let total = |buckets: &[(f64, f64)]| buckets.last().map_or(0.0, |&(_, count)| count);
        let restarted = total(&after) < total(&before);
        let counts: Vec<(f64, f64)> = after
            .iter()
            .map(|&(bound, count)| {
                let known = before.iter().find(|bucket| bucket.0 == bound);
                let known = known.filter(|_| !restarted).map_or(0.0, |bucket| bucket.1);
                (bound, count - known)
            })
            .collect();
        let rank = total(&counts) * quantile;
        if rank <= 0.0 {
            return None;
        }
        let (mut from, mut below) = (0.0, 0.0);
        for (bound, count) in counts {
            if count >= rank && count > below {
                let share = (rank - below) / (count - below);
                return Some(if bound.is_finite() {
                    from + (bound - from) * share
                } else {
                    from
                });
            }
            (from, below) = (bound, count);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(at_s: f64, calls: &str) -> Reading {
        let text = format!("# TYPE calls_total counter\n# TYPE wait_seconds histogram\n{calls}");
        Reading::parse(&text, at_s).unwrap()
    }

    #[test]
    fn rates_are_of_all_series_with_the_labels() {
        let before = reading(
            10.0,
            "calls_total{rpc=\"A\",code=\"OK\"} 5\ncalls_total{rpc=\"A\",code=\"NO\"} 1\n",
        );
        let after = reading(
            12.0,
            "calls_total{rpc=\"A\",code=\"OK\"} 9\ncalls_total{rpc=\"A\",code=\"NO\"} 2\ncalls_total{rpc=\"B\",code=\"OK\"} 8\n",
        );
        let change = Change {
            before: &before,
            after: &after,
        };
        assert_eq!(change.rate("calls_total", &[]), Some(6.5));
        assert_eq!(change.rate("calls_total", &[("rpc", "A")]), Some(2.5));
        assert_eq!(
            change.rate("calls_total", &[("rpc", "A"), ("code", "OK")]),
            Some(2.0)
        );
        assert_eq!(change.rate("others_total", &[]), None);
        let back = Change {
            before: &after,
            after: &before,
        };
        assert_eq!(
            back.growth("calls_total", &[]),
            Some(6.0),
            "the server began again"
        );
        assert_eq!(
            after
                .values_of("calls_total", "rpc")
                .into_iter()
                .collect::<Vec<_>>(),
            ["A", "B"]
        );
    }

    #[test]
    fn quantiles_are_of_what_is_new() {
        let buckets = |a: u32, b: u32, all: u32| {
            format!(
                "wait_seconds_bucket{{model=\"m\",le=\"0.1\"}} {a}\nwait_seconds_bucket{{model=\"m\",le=\"0.2\"}} {b}\n\
                 wait_seconds_bucket{{model=\"m\",le=\"+Inf\"}} {all}\nwait_seconds_sum{{model=\"m\"}} {}\nwait_seconds_count{{model=\"m\"}} {all}\n",
                f64::from(all) * 0.5
            )
        };
        let (before, after) = (
            reading(0.0, &buckets(100, 100, 100)),
            reading(1.0, &buckets(100, 104, 108)),
        );
        let change = Change {
            before: &before,
            after: &after,
        };
        let quantile = |q| change.quantile("wait_seconds", &[("model", "m")], q).unwrap();
        assert!((quantile(0.25) - 0.15).abs() < 1e-9);
        assert!((quantile(0.5) - 0.2).abs() < 1e-9);
        assert!((quantile(0.99) - 0.2).abs() < 1e-9, "above the last bound");
        assert_eq!(change.mean("wait_seconds", &[]), Some(0.5));
        let none = Change {
            before: &after,
            after: &after,
        };
        assert_eq!(none.quantile("wait_seconds", &[], 0.5), None);
        assert_eq!(none.mean("wait_seconds", &[]), None);
    }
}
