//! One sample of a take on its way.

use std::sync::Arc;

use troupe_motion::model::{Output, Task};

use super::finish::{Made, finish};
use super::follow::Follow;
use super::request::{Prompt, Take};
use super::walk::Walk;
use crate::FieldError;
use crate::post::NonFinite;

/// A motion on its way: it asks a generator for one window at a time.
#[derive(Debug)]
pub struct Making {
    take: Arc<Take>,
    chain: Chain,
}

#[derive(Debug)]
enum Chain {
    Walk(Box<Walk>),
    Follow(Box<Follow>),
}

impl Making {
    /// A sample of a take. Samples differ in their random choices.
    pub fn new(take: &Arc<Take>, sample: usize) -> Self {
        let is_free = take.parts.iter().all(|part| part.prompt == Prompt::Free);
        let chain = match &take.subject.follower {
            Some(follower) if is_free => Chain::Follow(Box::new(Follow::new(take, follower, sample))),
            Some(_) | None => Chain::Walk(Box::new(Walk::new(take, sample))),
        };
        Self {
            take: take.clone(),
            chain,
        }
    }

    /// The task of the next window; none behind the last.
    ///
    /// # Errors
    /// [`FieldError`] for a path that the network does not take.
    pub fn next_task(&mut self) -> Result<Option<Task>, FieldError> {
        match &mut self.chain {
            Chain::Walk(walk) => Ok(walk.next_task()),
            Chain::Follow(follow) => follow.next_task(),
        }
    }

    /// Takes what the generator made of [`next_task`](Self::next_task). A text is what it read in a
    /// motion, as long as a prompt may be: it is acted out next.
    ///
    /// # Errors
    /// [`NonFinite`] for numbers that are not usable.
    pub fn receive(&mut self, made: &Output) -> Result<(), NonFinite> {
        match (&mut self.chain, made) {
            (Chain::Walk(walk), Output::Motion(motion)) => walk.receive(motion),
            (Chain::Walk(walk), Output::Text(text)) => {
                walk.hear(text);
                Ok(())
            }
            (Chain::Follow(follow), Output::Motion(motion)) => follow.receive(motion),
            // No task of theirs has such an answer.
            (_, Output::Text(_) | Output::Motions(_) | Output::Audio(_)) => Err(NonFinite),
        }
    }

    /// The whole motion, which meets its constraints, once no task is left.
    ///
    /// # Errors
    /// [`NonFinite`] for a motion that lacks frames.
    pub fn finish(self) -> Result<Made, NonFinite> {
        let (track, boundaries, notes) = match self.chain {
            Chain::Walk(walk) => walk.done(),
            Chain::Follow(follow) => follow.done(),
        };
        match track.len() == self.take.frames {
            true => Ok(finish(&self.take, track, boundaries, notes)),
            false => Err(NonFinite),
        }
    }
}

#[cfg(test)]
#[path = "making_tests.rs"]
mod tests;
