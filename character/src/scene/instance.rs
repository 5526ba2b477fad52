//! Objects placed in a scene.

use std::fmt;
use std::sync::Arc;

use super::{Transform, Volume};

/// Shape and rules that all instances of one definition share.
#[derive(Debug, Clone)]
pub struct Body {
    /// Shape of the object itself.
    pub volume: Volume,
    /// A character whose box reaches this volume can use the object.
    pub trigger: Volume,
    /// Whether rays and boxes hit the object.
    pub solid: bool,
    /// Whether any number of characters may use it at once. It is then never reserved or held.
    pub shared: bool,
}

/// Identifies a session whose character has reserved or holds an object.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Holder {
    /// Id of the session.
    pub session: Arc<str>,
}

impl Holder {
    /// The holder for the character of session `session`.
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

/// Who has an instance.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum State {
    /// No character has it.
    #[default]
    Free,
    /// A character is on its way to it, or uses it in place.
    Reserved(Holder),
    /// A character carries it. Until it is released it is not in the scene: nothing hits or finds
    /// it, and its transform is the place that it was taken from.
    Held(Holder),
}

impl State {
    /// The character that has it; none if it is free.
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
    /// Shape and trigger of the definition.
    pub body: Arc<Body>,
    /// Place in the world. While held: the place that it was taken from.
    pub transform: Transform,
    /// Who has it.
    pub state: State,
    /// Grows whenever the instance moves or its body is replaced, so that its user notices without
    /// comparing.
    pub revision: u64,
}

impl Instance {
    /// Whether it is in the scene, not in a hand.
    pub fn is_placed(&self) -> bool {
        !matches!(self.state, State::Held(_))
    }

    /// The middle of its trigger volume in the world.
    pub fn trigger_center(&self) -> troupe_motion::Vec3 {
        self.transform.point(self.body.trigger.center())
    }
}
