//! Joints' names without duplicates.

use std::collections::{HashMap, HashSet};

/// Names without duplicates: a second `Hand` becomes `Hand_2`. Returns the new names of those that
/// changed, with the old ones.
pub(super) fn unique(names: &mut [String]) -> Vec<(String, String)> {
    let mut taken: HashSet<String> = HashSet::with_capacity(names.len());
    let given: HashSet<String> = names.iter().cloned().collect();
    let mut next: HashMap<String, usize> = HashMap::new();
    let mut changed = Vec::new();
    for name in names {
        if taken.insert(name.clone()) {
            continue;
        }
        let number = next.entry(name.clone()).or_insert(1);
        let new = loop {
            *number += 1;
            let new = format!("{name}_{number}");
            if !given.contains(&new) && !taken.contains(&new) {
                break new;
            }
        };
        taken.insert(new.clone());
        changed.push((std::mem::replace(name, new.clone()), new));
    }
    changed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_joint_of_a_name_gets_a_number() {
        let mut names = ["a", "a", "a_2", "b", "a"].map(str::to_owned);
        let changed = unique(&mut names);
        assert_eq!(names, ["a", "a_3", "a_2", "b", "a_4"]);
        assert_eq!(changed.len(), 2);
        assert_eq!(changed[0], ("a".to_owned(), "a_3".to_owned()));
    }
}
