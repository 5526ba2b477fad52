//! Model families: they decide which generator runs a pack.

/// The family of a pack. Layers above the engine do not know families: they ask a
/// [`Pack`](super::Pack) for its capabilities and facts, and a [`Selector`](crate::Selector) for
/// its generator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Family {
    /// Three networks fill the gap between keyframes.
    MotionBricks,
    /// One diffusion network moves many bodies along paths.
    UniMoGen,
    /// A language model of text, motion and audio.
    VerMo,
    /// NVIDIA's planner for the G1: one graph from a direction, a speed and a mode to frames.
    SonicPlanner,
}

impl Family {
    /// All families that the engine runs.
    pub(crate) const ALL: [Self; 4] = [
        Self::MotionBricks,
        Self::UniMoGen,
        Self::VerMo,
        Self::SonicPlanner,
    ];

    /// The family that a manifest names. None for a name that the engine does not know: the caller
    /// that loads such a pack must bring its own generator.
    pub(crate) fn of(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|family| family.name() == name)
    }

    /// The name in manifests.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::MotionBricks => "motionbricks",
            Self::UniMoGen => "unimogen",
            Self::VerMo => "vermo",
            Self::SonicPlanner => "sonic_planner",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_family_is_found_by_its_name() {
        for family in Family::ALL {
            assert_eq!(Family::of(family.name()), Some(family));
        }
        assert_eq!(Family::of("toy"), None);
    }
}
