//! The state machine of an interaction: which set comes next and when, and what has happened by a
//! frame.
//!
//! ```text
//! Approach ──Arrived──► Waiting ──Planned──► In { now, next } ──┐ the next set's motion takes over
//!                                             ▲                 │ (Planned, Again: the same set once more)
//!                                             └─────────────────┘
//!                                             └──Leaving──► Leaving ──Frame──► Over
//! ```
//!
//! [`Interaction::want`] says which motion it needs. [`Input`] brings what came of that, and
//! [`Interaction::on`] makes every change of state. The frame at which a set's motion takes over is
//! known only once the motion is there. Late motion takes over later, and the keyframe before it is
//! held until then.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::Arc;

use super::Frame;
use crate::object::{Definition, Hold, Set};

/// Fewest frames of a soft set before the next takes over: as many as a motion needs to fade in.
const LEAST_FRAMES: Frame = 8;

/// The frames of one set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stretch {
    /// Index of the set in the definition.
    pub set: usize,
    /// The first frame of the set's motion.
    pub from: Frame,
    /// The frame of the set's last keyframe.
    pub key: Frame,
}

/// Inputs of an interaction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// The character is at a place from which the first set may begin.
    Arrived,
    /// The motion of the wanted set exists.
    Planned {
        /// Its first frame.
        from: Frame,
        /// The frame of its last keyframe.
        key: Frame,
    },
    /// The newest motion is to be made once more: that of the next set if it exists, otherwise that
    /// of the current set from where the character then is.
    Again,
    /// Locomotion takes over at this frame, as wanted.
    Leaving(Frame),
    /// A command ends what is held.
    End,
    /// The timeline has come to this frame.
    At(Frame),
}

/// Something that has happened, with its frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Output {
    /// A set began.
    Entered(Frame, usize),
    /// A set's last keyframe was reached, or skipped for the next set.
    Reached(Frame, usize),
    /// The character left a set.
    Left(Frame, usize),
    /// The interaction came to its end.
    Over(Frame),
}

impl Output {
    /// The same output, at frame `now` if it would be later.
    pub fn no_later_than(self, now: Frame) -> Self {
        match self {
            Self::Entered(at, set) => Self::Entered(at.min(now), set),
            Self::Reached(at, set) => Self::Reached(at.min(now), set),
            Self::Left(at, set) => Self::Left(at.min(now), set),
            Self::Over(at) => Self::Over(at.min(now)),
        }
    }
}

/// The motion that an interaction wants next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Want {
    /// That of a set.
    Set {
        /// Index of the set in the definition.
        set: usize,
        /// The frame at which it should take over. `None`: as soon as possible.
        from: Option<Frame>,
    },
    /// Locomotion, from this frame on.
    Leave(Frame),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum State {
    Approach,
    /// The first set's motion does not exist yet.
    Waiting,
    In {
        /// The current set. `None`: before the first.
        now: Option<Stretch>,
        reached: bool,
        /// The set whose motion exists and takes over later.
        next: Option<Stretch>,
        /// The motion of `now` is wanted once more.
        again: bool,
    },
    Leaving {
        now: Option<Stretch>,
        reached: bool,
        at: Frame,
    },
    Over,
}

/// One use of an object, from the approach to its end.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Interaction {
    #[serde(with = "crate::saved::definition")]
    definition: Arc<Definition>,
    variant: usize,
    /// Sets to come, as indices into the definition.
    coming: VecDeque<usize>,
    /// A command has ended what is held, or will be.
    ended: bool,
    /// Only the sets of the exit are left.
    exits: bool,
    state: State,
}

impl Interaction {
    /// An interaction by the variant of index `variant`, beginning with the approach.
    pub fn new(definition: Arc<Definition>, variant: usize) -> Self {
        let sets = definition.variants.get(variant).map(|variant| &variant.entry);
        Self {
            coming: sets.into_iter().flatten().copied().collect(),
            definition,
            variant,
            ended: false,
            exits: false,
            state: State::Approach,
        }
    }

    /// Only the way out, for an object that this variant took and that is still in the hand.
    pub fn way_out(definition: Arc<Definition>, variant: usize) -> Self {
        let mut interaction = Self::new(definition, variant);
        interaction.coming = interaction.exit();
        interaction.exits = true;
        interaction
    }

    fn exit(&self) -> VecDeque<usize> {
        let variant = self.definition.variants.get(self.variant);
        variant.map_or_else(VecDeque::new, |variant| variant.exit.iter().copied().collect())
    }

    /// The definition that it began with, even if the name has another by now.
    pub fn definition(&self) -> &Arc<Definition> {
        &self.definition
    }

    /// Index of its variant.
    pub fn variant(&self) -> usize {
        self.variant
    }

    /// Whether the character is on its way to the object.
    pub fn approaches(&self) -> bool {
        self.state == State::Approach
    }

    /// Whether only the sets of the exit are left.
    pub fn exits(&self) -> bool {
        self.exits
    }

    /// Whether it has come to its end.
    pub fn is_over(&self) -> bool {
        self.state == State::Over
    }

    /// Whether locomotion is to take over, or has.
    pub fn leaves(&self) -> bool {
        matches!(self.state, State::Leaving { .. } | State::Over)
    }

    /// The current set, and whether its last keyframe has been reached.
    pub fn now(&self) -> Option<(Stretch, bool)> {
        match self.state {
            State::In { now, reached, .. } | State::Leaving { now, reached, .. } => Some((now?, reached)),
            _ => None,
        }
    }

    /// The set whose motion exists and takes over later.
    pub fn next(&self) -> Option<Stretch> {
        match self.state {
            State::In { next, .. } => next,
            _ => None,
        }
    }

    /// The first of the sets to come.
    pub fn coming(&self) -> Option<&Set> {
        self.definition.sets.get(*self.coming.front()?)
    }

    /// The motion that is wanted, unless it exists already.
    pub fn want(&self) -> Option<Want> {
        match self.state {
            State::Waiting => Some(match self.coming.front() {
                Some(&set) => Want::Set { set, from: None },
                None => Want::Leave(Frame::MIN),
            }),
            State::In {
                now: Some(now),
                again: true,
                ..
            } => Some(Want::Set {
                set: now.set,
                from: None,
            }),
            State::In {
                now: Some(now),
                next: None,
                ..
            } => {
                let from = self.end_of(now)?;
                Some(match self.coming.front() {
                    Some(&set) => Want::Set {
                        set,
                        from: Some(from),
                    },
                    None => Want::Leave(from),
                })
            }
            _ => None,
        }
    }

    /// The frame at which the next motion may take over. `None`: not before a command.
    fn end_of(&self, now: Stretch) -> Option<Frame> {
        let set = self.definition.sets.get(now.set)?;
        let early = now.key - Frame::from(set.drop_frames);
        let soonest = early.max(now.from + LEAST_FRAMES).min(now.key);
        match set.hold {
            Hold::Frames(0) => Some(soonest),
            Hold::Frames(frames) => Some(now.key + Frame::from(frames)),
            Hold::UntilEnded => self.ended.then_some(soonest),
        }
    }

    /// Takes an input, and adds what happened by it to `out`, in order. An input that does not suit
    /// the state changes nothing.
    pub fn on(&mut self, input: Input, out: &mut Vec<Output>) {
        self.state = match (self.state, input) {
            (State::Approach, Input::Arrived) => State::Waiting,
            (State::Waiting, Input::Planned { from, key }) => match self.coming.pop_front() {
                Some(set) => State::In {
                    now: None,
                    reached: false,
                    next: Some(Stretch { set, from, key }),
                    again: false,
                },
                None => State::Waiting,
            },
            (
                State::In {
                    now: Some(now),
                    reached,
                    again: true,
                    ..
                },
                Input::Planned { from, key },
            ) => State::In {
                now: Some(now),
                reached,
                next: Some(Stretch { from, key, ..now }),
                again: false,
            },
            (
                State::In {
                    now: Some(now),
                    reached,
                    next: None,
                    ..
                },
                Input::Planned { from, key },
            ) => {
                let next = self.coming.pop_front().map(|set| Stretch { set, from, key });
                self.ended &= !self.waits_for_end(now);
                State::In {
                    now: Some(now),
                    reached,
                    next,
                    again: false,
                }
            }
            // The motion that takes over later is planned again, or else the current one.
            (
                State::In {
                    now,
                    reached,
                    next: Some(next),
                    ..
                },
                Input::Again,
            ) if now.is_none_or(|now| now.set != next.set) => {
                self.coming.push_front(next.set);
                self.ended |= now.is_some_and(|now| self.waits_for_end(now));
                match now {
                    None => State::Waiting,
                    now => State::In {
                        now,
                        reached,
                        next: None,
                        again: false,
                    },
                }
            }
            (
                State::In {
                    now: Some(now),
                    reached: false,
                    ..
                },
                Input::Again,
            ) => State::In {
                now: Some(now),
                reached: false,
                next: None,
                again: true,
            },
            (State::In { now, reached, .. }, Input::Leaving(at)) => State::Leaving { now, reached, at },
            (State::Waiting, Input::Leaving(at)) => State::Leaving {
                now: None,
                reached: true,
                at,
            },
            (state, Input::End) => {
                self.end(state);
                state
            }
            (State::In { .. } | State::Leaving { .. }, Input::At(frame)) => self.pass(frame, out),
            (state, _) => state,
        };
    }

    /// Notes that a command ends what is held. If a held set waits for that, the sets to come
    /// become those of the exit. The exit comes only once: a further end changes nothing, unless a
    /// set of the exit is itself held until ended.
    fn end(&mut self, state: State) {
        if matches!(state, State::Leaving { .. } | State::Over) || self.ended {
            return;
        }
        // The newest motion follows a set that was ended, or needed no end.
        let newest = match state {
            State::In { now, next, .. } => next.or(now),
            _ => None,
        };
        let is_in = newest.is_some_and(|stretch| self.waits_for_end(stretch));
        if self.exits {
            self.ended = is_in;
            return;
        }
        let is_coming = (self.coming.iter()).any(|&set| self.holds_until_ended(set));
        if is_in || is_coming {
            (self.ended, self.exits) = (true, true);
            // Sets after the waiting one are dropped.
            while let Some(set) = self.coming.pop_back() {
                if !is_in
                    && self.holds_until_ended(set)
                    && !self.coming.iter().any(|&set| self.holds_until_ended(set))
                {
                    self.coming.push_back(set);
                    break;
                }
            }
            let exit = self.exit();
            self.coming.extend(exit);
        }
    }

    fn waits_for_end(&self, stretch: Stretch) -> bool {
        self.holds_until_ended(stretch.set)
    }

    fn holds_until_ended(&self, set: usize) -> bool {
        let set = self.definition.sets.get(set);
        set.is_some_and(|set| set.hold == Hold::UntilEnded)
    }

    /// Lets everything happen up to a frame.
    fn pass(&self, frame: Frame, out: &mut Vec<Output>) -> State {
        let mut state = self.state;
        loop {
            let until = match state {
                State::In { next, .. } => next.map_or(Frame::MAX, |next| next.from),
                State::Leaving { at, .. } => at,
                _ => Frame::MAX,
            };
            match &mut state {
                State::In {
                    now: Some(now),
                    reached,
                    ..
                }
                | State::Leaving {
                    now: Some(now),
                    reached,
                    ..
                } if !*reached && now.key <= frame.min(until) => {
                    *reached = true;
                    out.push(Output::Reached(now.key, now.set));
                }
                State::In {
                    now,
                    reached,
                    next: Some(next),
                    again,
                } if frame >= next.from => {
                    // The same set once more: nothing has begun.
                    let same = now.is_some_and(|now| now.set == next.set);
                    if !same {
                        leave(*now, *reached, next.from, out);
                        out.push(Output::Entered(next.from, next.set));
                    }
                    state = State::In {
                        now: Some(*next),
                        reached: same && *reached,
                        next: None,
                        again: *again,
                    };
                }
                State::Leaving { now, reached, at } if frame >= *at => {
                    leave(*now, *reached, *at, out);
                    out.push(Output::Over(*at));
                    return State::Over;
                }
                _ => return state,
            }
        }
    }
}

/// Ends a set at a frame, after its keyframe or early.
fn leave(now: Option<Stretch>, reached: bool, at: Frame, out: &mut Vec<Output>) {
    let Some(now) = now else { return };
    if !reached {
        out.push(Output::Reached(at, now.set));
    }
    out.push(Output::Left(at, now.set));
}

#[cfg(test)]
#[path = "interaction_tests.rs"]
mod tests;
