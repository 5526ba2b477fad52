//! Objects placed in a scene.

use std::fmt;
use std::sync::Arc;

use super::{Transform, Volume};

/// What all instances of one definition share.
#[derive(Debug, Clone)]
pub struct Body {
    /// The object itself.
    pub volume: Volume,
    /// Where a character's box must reach to use it.
    pub trigger: Volume,
    /// Whether rays and boxes hit it.
    pub solid: bool,
    /// Whether any number of characters may use it at once. It is never reserved or held.
    pub shared: bool,
}

/// A session whose character has reserved or holds an object.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Holder {
    /// The session's id.
    pub session: Arc<str>,
}

impl Holder {
    /// The character of session `session`.
    pub fn new(session: impl Into<Arc<str>>) -> Self {
        Self {
            session: session.into(),
        }
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "session {:?}", self.session)
    }
}

/// Whose an instance is.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum State {
    /// Nobody's.
    #[default]
    Free,
    /// A character is on its way to it, or uses it where it is.
    Reserved(Holder),
    /// A character carries it. Until its release it is nowhere in the scene: nothing hits or finds
    /// it, and its transform is where it was taken.
    Held(Holder),
}

impl State {
    /// Whose it is, where it is somebody's.
    pub fn holder(&self) -> Option<&Holder> {
        match self {
            Self::Free => None,
            Self::Reserved(by) | Self::Held(by) => Some(by),
        }
    }
}

/// One object of a scene.
#[derive(Debug, Clone)]
pub struct Instance {
    /// Unique in the scene.
    pub id: Arc<str>,
    /// Name of its definition.
    pub object: Arc<str>,
    /// Shape and trigger, those of the definition.
    pub body: Arc<Body>,
    /// Where it is.
    pub transform: Transform,
    /// Whose it is.
    pub state: State,
    /// Grows whenever it moves or its body is replaced, so that a user of it can tell without
    /// comparing.
    pub revision: u64,
}

impl Instance {
    /// Whether it is in the scene, rather than in somebody's hand.
    pub fn is_placed(&self) -> bool {
        !matches!(self.state, State::Held(_))
    }

    /// The middle of its trigger volume in the world.
    pub fn trigger_center(&self) -> troupe_motion::Vec3 {
        self.transform.point(self.body.trigger.center())
    }
}
