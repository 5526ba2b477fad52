use super::*;

fn schedule(process: Process, stages: &str, seed: u64) -> Vec<f64> {
    let stages = stages.parse().unwrap();
    let times = Schedule::new(process, stages, seed).map(|at| at.as_secs_f64());
    times.collect()
}

#[test]
fn constant_arrivals_come_at_equal_distances() {
    let times = schedule(Process::Constant, "4:2", 0);
    assert_eq!(times, [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75]);
}

#[test]
fn arrivals_follow_a_ramp() {
    for process in [
        Process::Constant,
        Process::Poisson,
        Process::Bursts { size: 10 },
        Process::Periodic { period_s: 0.1 },
    ] {
        // From 0 to 400 a second in 10 s: 500 in the first half, 1500 in the second.
        let times = schedule(process, "0-400:10", 1);
        let first = times.iter().filter(|&&t| t < 5.0).count();
        assert!((430..570).contains(&first), "{process:?}: {first}");
        assert!(
            (1850..2150).contains(&times.len()),
            "{process:?}: {}",
            times.len()
        );
        assert!(times.is_sorted());
    }
}

#[test]
fn poisson_arrivals_are_as_irregular_as_they_should_be() {
    let times = schedule(Process::Poisson, "200:100", 7);
    let mean = times.len() as f64 / 100.0;
    assert!((mean - 200.0).abs() < 5.0, "{mean}");
    // The number in a second has a variance equal to its mean; for equal distances it would be 0.
    let mut seconds = vec![0.0_f64; 100];
    times.iter().for_each(|t| seconds[*t as usize] += 1.0);
    let variance = seconds.iter().map(|n| (n - mean).powi(2)).sum::<f64>() / 99.0;
    assert!((0.6..1.5).contains(&(variance / mean)), "{variance}");
    // A share e^-1 of distances is longer than the mean distance.
    let long = times.windows(2).filter(|w| w[1] - w[0] > 1.0 / 200.0).count();
    let share = long as f64 / times.len() as f64;
    assert!((share - 0.368).abs() < 0.02, "{share}");
}

#[test]
fn the_same_seed_gives_the_same_arrivals_and_another_does_not() {
    let of = |seed| schedule(Process::Poisson, "100:5", seed);
    assert_eq!(of(3), of(3));
    assert_ne!(of(3), of(4));
}

#[test]
fn bursts_come_at_once_and_keep_the_mean_rate() {
    let times = schedule(Process::Bursts { size: 20 }, "100:2", 0);
    assert_eq!(times.len(), 200);
    let mut moments = times.clone();
    moments.dedup();
    assert_eq!(moments.len(), 10);
    assert!((moments[1] - 0.2).abs() < 1e-9);

    let times = schedule(Process::Periodic { period_s: 0.5 }, "100:2", 0);
    assert_eq!(times.len(), 200);
    let mut moments = times;
    moments.dedup();
    assert_eq!(moments, [0.5, 1.0, 1.5, 2.0]);
}

#[test]
fn shares_together_are_the_whole() {
    for process in [Process::Poisson, Process::Bursts { size: 7 }] {
        let schedule = || Schedule::new(process, "50-150:4".parse().unwrap(), 5);
        let whole = (0..).zip(schedule()).collect::<Vec<_>>();
        let mut parts = (0..3)
            .flat_map(|nth| schedule().share(nth, 3))
            .collect::<Vec<_>>();
        parts.sort_unstable();
        assert_eq!(parts, whole);
    }
}
