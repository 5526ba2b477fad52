//! Live characters in groups. Each group uses one connection, and one server of several.

use troupe_client::KeyedChannel;

use super::connect::channels;
use super::route::GroupRoute;
use super::sessions::{Opened, client_of, walkers};
use super::wander::Walker;
use crate::failure::Failure;
use crate::measure::Recorder;
use crate::plan::{Live, Plan, Share};

/// A share of a plan's characters, in groups of nearly equal size.
#[derive(Debug)]
pub(super) struct Groups {
    pub(super) opened: Opened,
    pub(super) joints: usize,
    pub(super) groups: Vec<Group>,
}

/// The characters of a stream, or those that are stepped together.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) channel: KeyedChannel,
    pub(super) route: GroupRoute,
    pub(super) walkers: Vec<Walker>,
}

impl Groups {
    /// Opens the sessions of the share's characters, and splits them into groups, one per stream.
    pub(super) async fn open(plan: &Plan, live: &Live, share: Share) -> Result<Self, Failure> {
        let channels = channels(plan).await?;
        let client = client_of(plan).await?;
        let (pack, walkers) = walkers(&client, plan, live, share).await?;
        let count = share
            .part(live.streams)
            .max(1)
            .min(u32::try_from(walkers.len()).unwrap_or(u32::MAX));
        let mut all = Self {
            opened: Opened::default(),
            joints: pack.skeleton().joint_count(),
            groups: Vec::new(),
        };
        let parts = split(walkers, count as usize).into_iter();
        for ((part, channel), nth) in parts
            .zip(channels.iter().cycle())
            .zip(share.before(live.streams)..)
        {
            let route = GroupRoute::new(plan.seed, nth)?;
            let opened = all.opened.open(route.client(&client)?, &pack, part).await;
            let walkers = match opened {
                Ok(walkers) => walkers,
                Err(error) => {
                    // The first error says most.
                    let _ = all.opened.close().await;
                    return Err(error);
                }
            };
            all.groups.push(Group {
                channel: channel.clone(),
                route,
                walkers,
            });
        }
        Ok(all)
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
