//! What the files of a folder agree on, for those that leave it open.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::report::Up;
use super::stance::{Sight, unit_by, up_by};
use super::survey::Stance;

/// Up axes and units that files of one origin show by themselves. A file that leaves one of them
/// open takes what all others show.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Agreement {
    ups: BTreeMap<Up, usize>,
    /// By the unit in nanometres.
    units: BTreeMap<u64, usize>,
}

impl Agreement {
    pub(super) fn add(&mut self, stance: &Stance) {
        if let Sight::Clear(up, _) = up_by(stance) {
            *self.ups.entry(up).or_default() += 1;
        }
        if let Some(unit_m) = unit_by(stance) {
            *self.units.entry((unit_m * 1e9).round() as u64).or_default() += 1;
        }
    }

    /// The axis that points up in all files that show one.
    pub fn up(&self) -> Option<Up> {
        only(&self.ups)
    }

    /// Metres a unit in all files that show it.
    pub fn unit_m(&self) -> Option<f64> {
        only(&self.units).map(|nanometres| nanometres as f64 * 1e-9)
    }
}

fn only<T: Copy>(counts: &BTreeMap<T, usize>) -> Option<T> {
    match counts.len() {
        1 => counts.keys().next().copied(),
        _ => None,
    }
}
