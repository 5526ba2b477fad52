//! The state machine of an interaction: which set comes next, from which frame on, and what has
//! happened by a frame.
//!
//! ```text
//! Approach ──Arrived──► Waiting ──Planned──► In { now, next } ──┐ the next set's motion takes over
//!                                             ▲                 │ (Planned, Again: the same set once more)
//!                                             └─────────────────┘
//!                                             └──Leaving──► Leaving ──Frame──► Over
//! ```
//!
//! It says what it wants ([`Interaction::want`]) and is told what came of it ([`Input`]); every
//! change of state is in [`Interaction::on`]. The motion of a set takes over at a frame that is
//! known only when it is there: one that comes late takes over later, the keyframe before it being
//! held meanwhile.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::Arc;

use super::Frame;
use crate::object::{Definition, Hold, Set};

/// Fewest frames that a soft set is in before the next takes over: as many as a motion fades in.
const LEAST_FRAMES: Frame = 8;

/// The frames of one set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stretch {
    /// Index of the set in the definition.
    pub set: usize,
    /// The frame from which on its motion goes.
    pub from: Frame,
    /// The frame of its last keyframe.
    pub key: Frame,
}

/// What an interaction is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// The character is where the first set may begin.
    Arrived,
    /// The motion of the set that was wanted goes from frame `from` on, to its last keyframe at
    /// `key`.
    Planned {
        /// First frame.
        from: Frame,
        /// Last keyframe.
        key: Frame,
    },
    /// The newest motion is wanted once more: that of the set to come, or else of the set that it
    /// is in, from where the character then is.
    Again,
    /// Locomotion takes over at this frame, as was wanted.
    Leaving(Frame),
    /// A command ends what is held.
    End,
    /// The timeline has come to this frame.
    At(Frame),
}

/// What has happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Output {
    /// A set began.
    Entered(Frame, usize),
    /// A set's last keyframe was reached, or left out for the next set.
    Reached(Frame, usize),
    /// A set was left.
    Left(Frame, usize),
    /// The interaction went through to its end.
    Over(Frame),
}

impl Output {
    /// The same, at frame `now` where it is to happen later.
    pub fn no_later_than(self, now: Frame) -> Self {
        match self {
            Self::Entered(at, set) => Self::Entered(at.min(now), set),
            Self::Reached(at, set) => Self::Reached(at.min(now), set),
            Self::Left(at, set) => Self::Left(at.min(now), set),
            Self::Over(at) => Self::Over(at.min(now)),
        }
    }
}

/// What motion is wanted next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Want {
    /// That of a set.
    Set {
        /// Index of the set in the definition.
        set: usize,
        /// The frame at which it is to take over. `None`: as soon as it can.
        from: Option<Frame>,
    },
    /// Locomotion's, from this frame on.
    Leave(Frame),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum State {
    Approach,
    /// The first set's motion is not there yet.
    Waiting,
    In {
        /// `None`: before the first set.
        now: Option<Stretch>,
        reached: bool,
        /// Motion that takes over at a frame to come.
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

/// One use of an object, from the approach to the end.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Interaction {
    #[serde(with = "crate::saved::definition")]
    definition: Arc<Definition>,
    variant: usize,
    /// Sets to come, by index in the definition.
    coming: VecDeque<usize>,
    /// A command has ended what is held, or will be held.
    ended: bool,
    /// The sets of the exit are to come or under way, and no others.
    exits: bool,
    state: State,
}

impl Interaction {
    /// An interaction by the variant of index `variant`, that begins with the approach.
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

    /// The way out alone, for an object that was taken by that variant and is in the hand still.
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

    /// The definition that it goes by, whatever becomes of the name.
    pub fn definition(&self) -> &Arc<Definition> {
        &self.definition
    }

    /// Index of its variant.
    pub fn variant(&self) -> usize {
        self.variant
    }

    /// Whether the character is on its way.
    pub fn approaches(&self) -> bool {
        self.state == State::Approach
    }

    /// Whether it is on the way out: no sets but those of the exit are to come.
    pub fn exits(&self) -> bool {
        self.exits
    }

    /// Whether it has gone through to its end.
    pub fn is_over(&self) -> bool {
        self.state == State::Over
    }

    /// Whether locomotion is to take over, or has.
    pub fn leaves(&self) -> bool {
        matches!(self.state, State::Leaving { .. } | State::Over)
    }

    /// The set that it is in, and whether its last keyframe has been reached.
    pub fn now(&self) -> Option<(Stretch, bool)> {
        match self.state {
            State::In { now, reached, .. } | State::Leaving { now, reached, .. } => Some((now?, reached)),
            _ => None,
        }
    }

    /// The set whose motion is there and takes over later.
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

    /// What motion is wanted, unless it is there already.
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

    /// Takes an input; what happened by it is added to `out`, in order. An input that does not suit
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
            // What takes over later is planned again, or what goes on now.
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

    /// Takes note of an end by command: the sets to come are those of the exit, where the set that
    /// is held waits for it. The exit comes once: an end on its way changes nothing, but where it
    /// holds until ended itself.
    fn end(&mut self, state: State) {
        if matches!(state, State::Leaving { .. } | State::Over) || self.ended {
            return;
        }
        // Where the next motion is there, what it follows has been ended or needed no end.
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
            // Sets behind the one that waits are left out.
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

    /// What happens up to a frame.
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

/// The end of a set at a frame, reached or left early.
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
