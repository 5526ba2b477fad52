//! The loops against simulated servers, in virtual time.

use super::*;
use crate::arrivals::{Process, Schedule};
use crate::loops::closed::{Clients, closed};
use crate::loops::wait::Timer;
use crate::measure::{Answer, Clock, Harvest, Outcome};
use crate::plan::Share;

/// A server that takes 2 ms for a request but stands still from `from` to `to`.
struct Stalls {
    from: Instant,
    to: Instant,
}

impl Target for Stalls {
    async fn call(&self, _caller: u64, _number: u64) -> Outcome {
        let now = Instant::now();
        if now >= self.from && now < self.to {
            tokio::time::sleep_until(self.to).await;
        }
        tokio::time::sleep(Duration::from_millis(2)).await;
        Outcome::Right(Answer {
            characters: 1,
            frames: 64,
            ..Answer::default()
        })
    }
}

/// A server that stands still for the second of ten seconds, and its recorder.
fn stalls() -> (Arc<Stalls>, Arc<Recorder>) {
    let start = Instant::now();
    let clock = Clock::new(start, Duration::ZERO, Duration::from_secs(10));
    let stalls = Stalls {
        from: start + Duration::from_secs(1),
        to: start + Duration::from_secs(2),
    };
    (Arc::new(stalls), Arc::new(Recorder::new(clock)))
}

async fn open_at_100_a_second(max_in_flight: u32) -> Harvest {
    let (target, recorder) = stalls();
    let schedule = Schedule::new(Process::Constant, "100:10".parse().unwrap(), 0);
    let arrivals = schedule.share(0, 1);
    open(
        target,
        recorder.clone(),
        arrivals,
        max_in_flight,
        Timer,
        Handle::current(),
    )
    .await;
    recorder.harvest()
}

#[tokio::test(start_paused = true)]
async fn an_open_loop_charges_a_stall_to_all_that_was_due_in_it() {
    let harvest = open_at_100_a_second(1000).await;
    assert_eq!(harvest.total.right, 1000);
    // A tenth of all requests was due in the stall. They waited for 0 to 1 s.
    let latency = &harvest.total.latency;
    assert!(latency.quantile_ms(0.89) < 5.0);
    assert!((latency.quantile_ms(0.95) - 500.0).abs() < 30.0);
    assert!((latency.quantile_ms(0.999) - 1000.0).abs() < 30.0);
    assert!(
        (98..=102).contains(&harvest.seconds[1].in_flight),
        "{}",
        harvest.seconds[1].in_flight
    );
}

#[tokio::test(start_paused = true)]
async fn a_closed_loop_hides_it() {
    let (target, recorder) = stalls();
    let clients = Clients {
        stages: "1:10".parse().unwrap(),
        think: Duration::from_millis(8),
        share: Share::WHOLE,
    };
    closed(target, recorder.clone(), clients).await;
    let latency = recorder.harvest().total.latency;
    // The rate is the same without the stall, and a single request saw it.
    assert!((880..=920).contains(&latency.count()), "{}", latency.count());
    assert!(latency.quantile_ms(0.99) < 5.0);
    assert!(latency.max_ms() > 900.0);
}

#[tokio::test(start_paused = true)]
async fn requests_beyond_the_limit_are_dropped_and_counted() {
    let harvest = open_at_100_a_second(40).await;
    assert_eq!(harvest.total.right + harvest.total.dropped, 1000);
    assert!(
        (58..=62).contains(&harvest.total.dropped),
        "{}",
        harvest.total.dropped
    );
    assert_eq!(
        harvest.seconds.iter().map(|s| s.dropped).sum::<u64>(),
        harvest.total.dropped
    );
    assert_eq!(harvest.seconds.iter().map(|s| s.in_flight).max(), Some(40));
}

#[tokio::test(start_paused = true)]
async fn clients_come_and_go_with_the_stages() {
    let start = Instant::now();
    let clock = Clock::new(start, Duration::ZERO, Duration::from_secs(4));
    let recorder = Arc::new(Recorder::new(clock));
    let never = start + Duration::from_secs(100);
    let target = Arc::new(Stalls {
        from: never,
        to: never,
    });
    let clients = Clients {
        stages: "1:2,4:2".parse().unwrap(),
        think: Duration::from_millis(8),
        share: Share::WHOLE,
    };
    closed(target, recorder.clone(), clients).await;
    let seconds = recorder.harvest().seconds;
    let right = seconds.iter().map(|s| s.right).collect::<Vec<_>>();
    assert!((95..=101).contains(&right[1]), "{right:?}");
    assert!((380..=404).contains(&right[3]), "{right:?}");
}
