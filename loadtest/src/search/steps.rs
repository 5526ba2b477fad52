//! The search as a pure state machine. It returns the next level to try, and takes the result.

/// Limits of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchLimits {
    /// First level to try, above 0.
    pub first: f64,
    /// No level below this is tried.
    pub least: f64,
    /// No level above this is tried.
    pub most: f64,
    /// Precision: the search ends when the highest level that holds and the lowest that does not
    /// differ by at most this share of the former.
    pub within: f64,
    /// Levels are whole multiples of this.
    pub step: f64,
    /// Number of further runs in which the result must hold.
    pub confirmations: u32,
    /// Number of failed runs, at least 1, after which a level does not hold. Above 1 the search
    /// ignores single disturbances of the machine. A confirmation has one run.
    pub tries: u32,
}

/// The next step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Next {
    /// Try this level.
    Try {
        /// Level to try.
        level: f64,
        /// Whether it held before and is being confirmed.
        confirms: bool,
    },
    /// The search has ended, with the highest level that held each time. None if no level did.
    Done(Option<f64>),
}

/// A search. It doubles the level until it does not hold, then halves the distance until it is
/// small, and then confirms the result. A level that fails its confirmation does not hold.
#[derive(Debug, Clone)]
pub struct Search {
    limits: SearchLimits,
    /// Highest level that held, and the number of times.
    holds: Option<(f64, u32)>,
    /// Lowest level that did not hold.
    fails: Option<f64>,
    /// Failed tries of the current level.
    misses: u32,
    next: Next,
}

impl Search {
    /// Makes a search that begins with the first level.
    pub fn new(limits: SearchLimits) -> Self {
        let level = round(&limits, limits.first);
        Self {
            limits,
            holds: None,
            fails: None,
            misses: 0,
            next: Next::Try {
                level,
                confirms: false,
            },
        }
    }

    /// The next step.
    pub fn next(&self) -> Next {
        self.next
    }

    /// Takes the result of the current level.
    pub fn tell(&mut self, held: bool) {
        let Next::Try { level, confirms } = self.next else {
            return;
        };
        self.misses += u32::from(!held);
        if !held && !confirms && self.misses < self.limits.tries {
            return;
        }
        self.misses = 0;
        match (held, confirms) {
            (true, true) => {
                if let Some((_, times)) = &mut self.holds {
                    *times += 1;
                }
            }
            (true, false) => self.holds = Some((level, 1)),
            (false, _) => {
                self.fails = Some(self.fails.map_or(level, |fails| fails.min(level)));
                // After a failed confirmation the true level is lower, by an unknown distance.
                self.holds = self.holds.filter(|_| !confirms);
            }
        }
        self.next = self.decide();
    }

    fn decide(&self) -> Next {
        let limits = &self.limits;
        let fresh = |level: f64| {
            let level = round(limits, level);
            Next::Try {
                level,
                confirms: false,
            }
        };
        match (self.holds, self.fails) {
            (None, None) => fresh(limits.first),
            (None, Some(fails)) => {
                if fails <= round(limits, limits.least) {
                    return Next::Done(None);
                }
                // After a failed confirmation the next level is a little lower, otherwise half.
                let lower = if self.fails_near() {
                    fails * (1.0 - limits.within.clamp(0.01, 0.5))
                } else {
                    fails / 2.0
                };
                fresh(lower.min(fails - limits.step))
            }
            (Some((holds, _)), None) if holds < round(limits, limits.most) => fresh(holds * 2.0),
            (Some((holds, times)), fails) => {
                let gap = fails.map_or(0.0, |fails| fails - holds);
                let near = gap <= (limits.within * holds).max(limits.step);
                match (near, times > limits.confirmations) {
                    (true, true) => Next::Done(Some(holds)),
                    (true, false) => Next::Try {
                        level: holds,
                        confirms: true,
                    },
                    (false, _) => fresh(holds + gap / 2.0),
                }
            }
        }
    }

    /// Whether the last step was a confirmation that failed. The level below may then still hold.
    fn fails_near(&self) -> bool {
        matches!(self.next, Next::Try { confirms: true, .. })
    }
}

/// Rounds a level to a multiple of the step, within the limits.
fn round(limits: &SearchLimits, level: f64) -> f64 {
    let steps = (level / limits.step).round();
    (steps * limits.step).clamp(limits.least, limits.most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn limits() -> SearchLimits {
        SearchLimits {
            first: 50.0,
            least: 1.0,
            most: 10_000.0,
            within: 0.05,
            step: 1.0,
            confirmations: 2,
            tries: 1,
        }
    }

    /// Searches a simulated server, and gives the levels that were tried and the result.
    fn run(limits: SearchLimits, mut holds: impl FnMut(f64) -> bool) -> (Vec<f64>, Option<f64>) {
        let mut search = Search::new(limits);
        let mut tried = Vec::new();
        loop {
            match search.next() {
                Next::Try { level, .. } => {
                    assert!(tried.len() < 200, "it does not end: {tried:?}");
                    tried.push(level);
                    search.tell(holds(level));
                }
                Next::Done(found) => return (tried, found),
            }
        }
    }

    #[test]
    fn it_doubles_then_halves_the_distance_then_confirms() {
        let (tried, found) = run(limits(), |level| level <= 430.0);
        assert_eq!(tried[..4], [50.0, 100.0, 200.0, 400.0]);
        assert_eq!(tried[4], 800.0);
        let found = found.unwrap();
        assert!((400.0..=430.0).contains(&found), "{tried:?}");
        assert_eq!(tried[tried.len() - 2..], [found, found]);
    }

    #[test]
    fn it_goes_down_if_the_first_level_is_too_high() {
        let (_, found) = run(limits(), |level| level <= 7.0);
        assert_eq!(found, Some(7.0));
        let (tried, found) = run(limits(), |_| false);
        assert_eq!((tried.last(), found), (Some(&1.0), None));
    }

    #[test]
    fn it_stops_at_the_limit() {
        let (tried, found) = run(limits(), |_| true);
        assert_eq!(found, Some(10_000.0));
        assert_eq!(tried.iter().filter(|&&level| level == 10_000.0).count(), 3);
    }

    #[test]
    fn several_tries_ignore_a_single_disturbance() {
        let limits = SearchLimits { tries: 2, ..limits() };
        let mut first = true;
        let (tried, found) = run(limits, |level| level <= 430.0 && !std::mem::take(&mut first));
        assert_eq!(tried[..3], [50.0, 50.0, 100.0]);
        assert!((400.0..=430.0).contains(&found.unwrap()));
        // A level that never holds is tried twice each time.
        assert_eq!(tried.iter().filter(|&&level| level == 800.0).count(), 2);
    }

    #[test]
    fn a_level_that_fails_its_confirmation_does_not_hold() {
        // 400 holds only the first two times.
        let mut times = 0;
        let (tried, found) = run(limits(), |level| {
            times += u32::from((395.0..=430.0).contains(&level));
            level < 380.0 || (level <= 430.0 && times <= 2)
        });
        let found = found.unwrap();
        assert!((355.0..=380.0).contains(&found), "{tried:?} {found}");
    }

    proptest! {
        #[test]
        fn it_finds_the_highest_level_of_a_server(can in 1.0..9000.0_f64, first in 1.0..5000.0_f64, step in prop::sample::select(vec![0.5, 1.0, 10.0])) {
            let limits = SearchLimits { first, step, least: step, ..limits() };
            let (tried, found) = run(limits, |level| level <= can);
            match found {
                Some(found) => {
                    prop_assert!(found <= can);
                    prop_assert!(can - found <= (0.05 * found).max(step) + step, "{can} {found}");
                }
                None => prop_assert!(can < step),
            }
            prop_assert!(tried.len() < 40);
        }

        #[test]
        fn a_server_with_random_results_does_not_stop_it_from_ending(moods in prop::collection::vec(any::<bool>(), 300)) {
            let mut moods = moods.into_iter().cycle();
            let mut search = Search::new(limits());
            let mut steps = 0;
            while let Next::Try { level, .. } = search.next() {
                prop_assert!((1.0..=10_000.0).contains(&level));
                search.tell(moods.next().unwrap());
                steps += 1;
                prop_assert!(steps < 2000);
            }
        }
    }
}
