use super::*;
use crate::measure::tally::Answer;

fn recorder(start: Instant) -> Recorder {
    let stages = "10:1,20:1".parse().unwrap();
    let clock = Clock::new(start, Duration::from_secs(2), Duration::from_secs(2));
    Recorder::new(clock.stages(&stages))
}

fn right(start: Instant, due_ms: u64, done_ms: u64) -> Call {
    let due = start + Duration::from_millis(due_ms);
    let answer = Answer {
        characters: 2,
        frames: 128,
        bytes: 10,
        timing: None,
    };
    Call {
        due,
        sent: due + Duration::from_micros(10),
        done: start + Duration::from_millis(done_ms),
        outcome: Outcome::Right(answer),
    }
}

#[test]
fn the_warm_up_is_left_out_and_stages_are_counted_separately() {
    let start = Instant::now();
    let recorder = recorder(start);
    for (due, done) in [
        (500, 600),
        (1990, 2100),
        (2000, 2050),
        (3500, 3600),
        (3900, 4200),
        (4100, 4200),
    ] {
        recorder.sent(start);
        recorder.done(&right(start, due, done));
    }
    let harvest = recorder.harvest();
    // By the times at which they were due.
    assert_eq!(harvest.total.right, 3);
    assert_eq!(harvest.total.latency.max_ms().round(), 300.0);
    assert_eq!(harvest.stages.iter().map(|s| s.right).collect::<Vec<_>>(), [1, 2]);
    // By the times at which they came.
    assert_eq!((harvest.done.requests, harvest.done.frames), (3, 3 * 128));
    assert_eq!(
        harvest.seconds.iter().map(|s| s.right).collect::<Vec<_>>(),
        [1, 0, 2, 1, 2]
    );
    assert_eq!(harvest.seconds[0].in_flight, 1);
}

#[test]
fn refusals_failures_and_drops_are_apart() {
    let start = Instant::now();
    let recorder = recorder(start);
    let call = |outcome| Call {
        outcome,
        ..right(start, 2500, 2600)
    };
    recorder.done(&call(Outcome::Refused("RESOURCE_EXHAUSTED".into())));
    for nth in 0..40 {
        recorder.done(&call(Outcome::Failed {
            code: format!("CODE_{nth}").into(),
            message: "m".repeat(999),
        }));
    }
    recorder.dropped(start + Duration::from_millis(2500));
    recorder.dropped(start);
    let harvest = recorder.harvest();
    let total = &harvest.total;
    assert_eq!(
        (total.right, total.refused, total.failed, total.dropped),
        (0, 1, 40, 1)
    );
    assert_eq!(total.due(), 42);
    assert_eq!(
        (harvest.codes["RESOURCE_EXHAUSTED"], harvest.codes["OTHER"]),
        (1, 9)
    );
    assert_eq!(harvest.examples["CODE_3"].len(), 300);
}

#[test]
fn two_processes_merge_to_the_records_of_one() {
    let start = Instant::now();
    let (one, two, both) = (recorder(start), recorder(start), recorder(start));
    for nth in 0..100_u64 {
        let call = right(start, nth * 40, nth * 40 + nth * nth % 97);
        both.done(&call);
        if nth % 2 == 0 { &one } else { &two }.done(&call);
    }
    let mut merged = one.harvest();
    let sent: Harvest =
        serde_json::from_str(&serde_json::to_string(&two.harvest()).expect("JSON")).expect("the same back");
    merged.merge(&sent);
    assert_eq!(merged, both.harvest());
}

#[test]
fn a_pulse_tells_of_the_second_before() {
    let start = Instant::now();
    let recorder = recorder(start);
    recorder.done(&right(start, 1100, 1200));
    recorder.sent(start);
    assert_eq!(recorder.pulse(start).right, 0);
    let pulse = recorder.pulse(start + Duration::from_millis(2500));
    assert_eq!((pulse.right, pulse.frames, pulse.in_flight), (1, 128, 1));
    assert!((pulse.p99_ms - 100.0).abs() < 1.5);
}

#[test]
fn an_answer_that_comes_absurdly_late_takes_no_memory() {
    let start = Instant::now();
    let recorder = recorder(start);
    recorder.done(&right(start, 2500, 1_000_000_000));
    assert!(recorder.harvest().seconds.len() < 200);
}
