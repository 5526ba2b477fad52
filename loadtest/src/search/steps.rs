//! The search as a pure state machine: it names the next level, and takes the result.

/// Limits of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchLimits {
    /// First level to try, above 0.
    pub first: f64,
    /// No level below this is tried.
    pub least: f64,
    /// No level above this is tried.
    pub most: f64,
    /// The search ends once the highest level that holds and the lowest that does not are this
    /// near, as a share of the former.
    pub within: f64,
    /// Levels are whole multiples of this.
    pub step: f64,
    /// Times that the result must hold again.
    pub confirmations: u32,
    /// Tries of a level, at least 1, until it counts as one that does not hold, because machines
    /// have hiccups. A confirmation has one try.
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
    /// The end, with the highest level that held each time. None if no level did.
    Done(Option<f64>),
}

/// Doubles until a level does not hold, halves the distance until it is small, and then confirms. A
/// level that fails its confirmation counts as one that does not hold.
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
    /// A search that begins with the first level.
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
                // The true level is lower, but how far is unknown.
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
                // After a failed confirmation it goes down a little, else far.
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

    /// Whether a level near the lowest that did not hold has held before, so that its confirmation
    /// failed.
    fn fails_near(&self) -> bool {
        matches!(self.next, Next::Try { confirms: true, .. })
    }
}

/// A level that may be tried: a multiple of the step within the limits.
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
    fn where_the_first_is_too_much_it_goes_down() {
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
    fn a_hiccup_is_forgiven_where_there_are_several_tries() {
        let limits = SearchLimits { tries: 2, ..limits() };
        let mut first = true;
        let (tried, found) = run(limits, |level| level <= 430.0 && !std::mem::take(&mut first));
        assert_eq!(tried[..3], [50.0, 50.0, 100.0]);
        assert!((400.0..=430.0).contains(&found.unwrap()));
        // A level that never holds is tried twice each time.
        assert_eq!(tried.iter().filter(|&&level| level == 800.0).count(), 2);
    }

    #[test]
    fn what_does_not_hold_again_is_given_up() {
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
        fn it_finds_what_a_server_can_do(can in 1.0..9000.0_f64, first in 1.0..5000.0_f64, step in prop::sample::select(vec![0.5, 1.0, 10.0])) {
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
        fn a_server_with_moods_does_not_keep_it_for_ever(moods in prop::collection::vec(any::<bool>(), 300)) {
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
