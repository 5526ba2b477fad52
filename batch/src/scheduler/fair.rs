//! Fair order: start-time fair queueing (Goyal, Vin and Cheng, SIGCOMM 1996).
//!
//! Each key has a virtual time, which rises by the cost of what is taken for it. The key with the
//! least virtual time goes first. A key that begins to wait starts at the virtual time of what was
//! taken last, so being idle earns no credit, and neither does being passed over. While two keys
//! wait and none is passed over, what is taken for them differs by the cost of one piece at most.

use std::collections::{BTreeMap, BTreeSet};

/// Keys without work that are kept beyond those with work, before the list is cleaned.
const SPARE: usize = 64;

/// Keys with work, in fair order. Taking costs logarithmic time.
#[derive(Debug)]
pub(super) struct Fair<K, T> {
    entries: BTreeMap<K, Entry<T>>,
    /// The keys with work, by virtual time.
    working: BTreeSet<(u64, K)>,
    /// Virtual time: that of the key for which something was taken last.
    now: u64,
    /// The greatest virtual time of all keys. Once no key has work, it is `now`, so all are even.
    latest: u64,
}

#[derive(Debug, Default)]
struct Entry<T> {
    time: u64,
    works: bool,
    held: T,
}

impl<K, T> Default for Fair<K, T> {
    fn default() -> Self {
        Self {
            entries: BTreeMap::new(),
            working: BTreeSet::new(),
            now: 0,
            latest: 0,
        }
    }
}

impl<K: Copy + Ord, T: Default> Fair<K, T> {
    /// What is held for a key.
    pub(super) fn get(&self, key: K) -> Option<&T> {
        self.entries.get(&key).map(|entry| &entry.held)
    }

    /// What is held for a key, which may be new.
    pub(super) fn held(&mut self, key: K) -> &mut T {
        &mut self.entries.entry(key).or_default().held
    }

    /// Everything that is held.
    pub(super) fn each(&self) -> impl Iterator<Item = (K, &T)> {
        self.entries.iter().map(|(key, entry)| (*key, &entry.held))
    }

    /// Number of keys with work.
    pub(super) fn working(&self) -> usize {
        self.working.len()
    }

    /// The keys with work in their order, and by how much the virtual time of each is less than
    /// that of the next; none for the last.
    pub(super) fn in_order(&self) -> impl Iterator<Item = (K, Option<u64>)> {
        let mut keys = self.working.iter().peekable();
        std::iter::from_fn(move || {
            let &(time, key) = keys.next()?;
            Some((key, keys.peek().map(|(next, _)| next - time)))
        })
    }

    /// A key has work, or has none any more. Answers whether this is new.
    pub(super) fn set_working(&mut self, key: K, works: bool) -> bool {
        let entry = self.entries.entry(key).or_default();
        let is_new = entry.works != works;
        if works && !entry.works {
            entry.time = entry.time.max(self.now);
            self.working.insert((entry.time, key));
        } else if !works && entry.works {
            self.working.remove(&(entry.time, key));
        }
        entry.works = works;
        if self.working.is_empty() {
            self.now = self.latest;
        }
        is_new
    }

    /// Something was taken for a key. Keys before it were passed over. They earn no credit by that:
    /// from now on they are even with it.
    pub(super) fn charge(&mut self, key: K, cost: u64) {
        let Some(time) = self.entries.get(&key).map(|entry| entry.time) else {
            return;
        };
        while let Some(&(before, passed)) = self.working.first()
            && before < time
        {
            self.working.remove(&(before, passed));
            self.working.insert((time, passed));
            if let Some(entry) = self.entries.get_mut(&passed) {
                entry.time = time;
            }
        }
        let Some(entry) = self.entries.get_mut(&key) else {
            return;
        };
        self.now = self.now.max(entry.time);
        let charged = entry.time.saturating_add(cost);
        self.latest = self.latest.max(charged);
        if entry.works {
            self.working.remove(&(entry.time, key));
            self.working.insert((charged, key));
        }
        entry.time = charged;
    }

    /// Forgets keys for which nothing is held, and whose virtual time says nothing any more.
    pub(super) fn clean(&mut self, is_empty: impl Fn(&T) -> bool) {
        if self.entries.len() > 2 * self.working.len() + SPARE {
            let now = self.now;
            self.entries
                .retain(|_, entry| entry.works || entry.time > now || !is_empty(&entry.held));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How often each of three keys is taken in `rounds`.
    fn taken(fair: &mut Fair<u8, ()>, costs: [u64; 3], rounds: usize) -> [usize; 3] {
        let mut taken = [0; 3];
        for _ in 0..rounds {
            let (key, _) = fair.in_order().next().unwrap();
            fair.charge(key, costs[usize::from(key)]);
            taken[usize::from(key)] += 1;
        }
        taken
    }

    #[test]
    fn keys_with_work_get_the_same_cost() {
        let mut fair = Fair::default();
        for key in 0..3 {
            fair.set_working(key, true);
        }
        assert_eq!(taken(&mut fair, [1, 1, 1], 30), [10, 10, 10]);
        assert_eq!(taken(&mut fair, [4, 2, 1], 70), [10, 20, 40]);
    }

    #[test]
    fn rest_earns_no_credit_and_debts_are_kept() {
        let mut fair = Fair::default();
        fair.set_working(0, true);
        fair.set_working(1, true);
        taken(&mut fair, [1; 3], 100);
        fair.set_working(2, true);
        assert_eq!(
            taken(&mut fair, [1; 3], 30),
            [10, 10, 10],
            "it was away, and gets no more"
        );
        // One takes much and goes: it does not come back with a clean slate.
        fair.charge(0, 60);
        fair.set_working(0, false);
        fair.clean(|()| true);
        fair.set_working(0, true);
        assert_eq!(taken(&mut fair, [1; 3], 100)[0], 0);
        assert!(taken(&mut fair, [1; 3], 60)[0] > 0);
    }

    #[test]
    fn keys_that_say_nothing_any_more_are_forgotten() {
        let mut fair = Fair::<u32, ()>::default();
        for key in 0..10_000 {
            fair.set_working(key, true);
            fair.charge(key, 1);
            fair.set_working(key, false);
            fair.clean(|()| true);
        }
        assert!(fair.entries.len() <= SPARE + 2, "{}", fair.entries.len());
    }
}
