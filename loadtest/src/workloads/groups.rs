//! Live characters in groups. Each group uses one connection.

use troupe_client::KeyedChannel;

use super::connect::channels;
use super::sessions::{Opened, open_walkers};
use super::wander::Walker;
use crate::failure::Failure;
use crate::measure::Recorder;
use crate::plan::{Live, Plan, Share};

/// A share of a plan's characters, in groups of nearly equal size.
#[derive(Debug)]
pub(super) struct Groups {
    pub(super) opened: Opened,
    pub(super) joints: usize,
    pub(super) groups: Vec<(KeyedChannel, Vec<Walker>)>,
}

impl Groups {
    /// Opens the sessions of the share's characters, and splits them into groups, one per stream.
    pub(super) async fn open(plan: &Plan, live: &Live, share: Share) -> Result<Self, Failure> {
        let channels = channels(plan).await?;
        let (opened, pack, walkers) = open_walkers(plan, live, share).await?;
        let groups = share
            .part(live.streams)
            .max(1)
            .min(u32::try_from(walkers.len()).unwrap_or(u32::MAX));
        let groups = split(walkers, groups as usize)
            .into_iter()
            .zip(channels.iter().cycle())
            .map(|(group, channel)| (channel.clone(), group))
            .collect();
        Ok(Self {
            opened,
            joints: pack.skeleton().joint_count(),
            groups,
        })
    }

    /// Sets the number of characters in the recorder.
    pub(super) fn count(&self, recorder: &Recorder) {
        let (characters, groups) = (self.opened.count() as u64, self.groups.len() as u64);
        recorder.live(|live| {
            live.characters = characters;
            live.streams = groups;
        });
    }
}

/// Splits a list into parts of nearly equal size, in order.
fn split<T>(mut whole: Vec<T>, parts: usize) -> Vec<Vec<T>> {
    let mut split = Vec::with_capacity(parts);
    for left in (1..=parts).rev() {
        let rest = whole.split_off(whole.len().div_ceil(left));
        split.push(std::mem::replace(&mut whole, rest));
    }
    split
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_differ_by_one_at_most_and_keep_the_order() {
        assert_eq!(split(vec![1, 2, 3, 4, 5], 2), [vec![1, 2, 3], vec![4, 5]]);
        assert_eq!(
            split((0..7).collect(), 3),
            [vec![0, 1, 2], vec![3, 4], vec![5, 6]]
        );
        assert_eq!(split(Vec::<u32>::new(), 0), Vec::<Vec<u32>>::new());
    }
}
