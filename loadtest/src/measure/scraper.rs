//! Scrapes the server's `/metrics` before, during and after the measured time.

use std::time::Duration;

use bytes::Bytes;
use http::{HeaderValue, Request, header};
use http_body_util::{BodyExt as _, Empty, Limited};
use hyper_rustls::HttpsConnector;
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::TokioExecutor;
use tokio::time::Instant;

use super::prometheus::Metrics;
use super::recorder::Clock;
use crate::access::Access;

/// Maximum wait for one scrape.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Maximum size of a scrape, bytes.
const MOST_BYTES: usize = 16 << 20;

/// Scrapes one server.
#[derive(Debug, Clone)]
pub struct Scraper {
    uri: http::Uri,
    client: Client<HttpsConnector<HttpConnector>, Empty<Bytes>>,
    bearer: Option<HeaderValue>,
}

/// The server's metrics at one time.
#[derive(Debug, Clone)]
pub struct Scrape {
    /// Seconds from the start of the load.
    pub at_s: f64,
    /// The content of `/metrics`.
    pub metrics: Metrics,
}

/// All scrapes of a load.
#[derive(Debug, Clone, Default)]
pub struct Scrapes {
    /// Sorted by time.
    pub all: Vec<Scrape>,
    /// Index of the scrape at the start of the measured time.
    pub first: usize,
    /// Index of the scrape at the end of the measured time.
    pub last: usize,
}

impl Scrapes {
    /// The scrapes at both ends of the measured time, if both succeeded.
    pub fn ends(&self) -> Option<(&Scrape, &Scrape)> {
        let (first, last) = (self.all.get(self.first)?, self.all.get(self.last)?);
        (first.at_s < last.at_s).then_some((first, last))
    }
}

impl Scraper {
    /// Makes a scraper for a server such as `http://127.0.0.1:8080`. `None` if it has no
    /// `/metrics`, or does not show them for this key.
    pub async fn find(server: &str, access: &Access) -> Option<Self> {
        let uri: http::Uri = format!("{}/metrics", server.trim_end_matches('/')).parse().ok()?;
        let scraper = Self {
            uri,
            client: Client::builder(TokioExecutor::new()).build(access.connector(HttpConnector::new()).ok()?),
            bearer: access.bearer().ok()?,
        };
        let metrics = scraper.scrape().await?;
        metrics.sum("process_resident_memory_bytes", &[]).map(|_| scraper)
    }

    /// Reads the metrics now. `None` if the server does not answer in time.
    pub async fn scrape(&self) -> Option<Metrics> {
        let get = async {
            let mut request = Request::get(self.uri.clone()).body(Empty::new()).ok()?;
            if let Some(bearer) = &self.bearer {
                request
                    .headers_mut()
                    .insert(header::AUTHORIZATION, bearer.clone());
            }
            let answer = self.client.request(request).await.ok()?;
            if !answer.status().is_success() {
                return None;
            }
            let body = Limited::new(answer.into_body(), MOST_BYTES)
                .collect()
                .await
                .ok()?;
            let bytes = body.to_bytes();
            Some(Metrics::parse(&String::from_utf8_lossy(&bytes)))
        };
        tokio::time::timeout(TIMEOUT, get).await.ok().flatten()
    }

    /// Scrapes once a second during a load, including both ends of the measured time.
    pub async fn follow(self, clock: Clock) -> Scrapes {
        let mut scrapes = Scrapes::default();
        for due in sampling_times(&clock) {
            tokio::time::sleep_until(due).await;
            let at = Instant::now();
            let Some(metrics) = self.scrape().await else {
                continue;
            };
            if due <= clock.measured_from() {
                scrapes.first = scrapes.all.len();
            }
            scrapes.last = scrapes.all.len();
            let at_s = at.saturating_duration_since(clock.start()).as_secs_f64();
            scrapes.all.push(Scrape { at_s, metrics });
        }
        scrapes
    }
}

/// The times of scrapes and readings: both ends of the measured time, and whole seconds from its
/// start in both directions.
pub fn sampling_times(clock: &Clock) -> Vec<Instant> {
    const SECOND: Duration = Duration::from_secs(1);
    let middle = clock.measured_from();
    let before = u32::try_from(clock.warmup().as_secs()).unwrap_or(0);
    let after = u32::try_from(clock.measured().as_secs()).unwrap_or(0);
    let mut times = (0..=before)
        .rev()
        .map(|n| middle - SECOND * n)
        .collect::<Vec<_>>();
    times.extend((1..=after).map(|n| middle + SECOND * n));
    if times.last().is_none_or(|&last| last < clock.end()) {
        times.push(clock.end());
    }
    times
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scrapes_fall_on_both_ends() {
        let start = Instant::now();
        let of = |warmup, measured| {
            let clock = Clock::new(
                start,
                Duration::from_millis(warmup),
                Duration::from_millis(measured),
            );
            let times = sampling_times(&clock).into_iter();
            times.map(|at| (at - start).as_millis()).collect::<Vec<_>>()
        };
        assert_eq!(of(1500, 2000), [500, 1500, 2500, 3500]);
        assert_eq!(of(0, 500), [0, 500]);
        assert_eq!(of(1000, 1700), [0, 1000, 2000, 2700]);
    }
}
