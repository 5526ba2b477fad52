//! The model families by name, for tests, examples and measurements of one family. The server uses
//! a pack's capabilities and facts instead, and
//! [`Selector::generator`](crate::Selector::generator).

pub use crate::motionbricks::MotionBricks;

/// UniMoGen: one network that moves many bodies along paths.
pub mod unimogen {
    pub use crate::unimogen::{CALL_ROWS, Call, Denoiser, PATH_FEATURES, ROW_CHANNELS, UniMoGen, probe_task};
}

/// NVIDIA's planner for the G1: one graph from a direction, a speed and a mode to frames.
pub mod sonic_planner {
    pub use crate::sonic_planner::{Inputs, Planner, SonicPlanner, probe_task};
}

/// VerMo: a language model of text, motion and audio.
pub mod vermo {
    use crate::pack::Pack;

    pub use crate::onnx::vermo::OnnxVerMo;
    pub use crate::pack::Lexicon;
    pub use crate::pack::vermo::VerMoDoc;
    pub use crate::vermo::{
        Allowed, Condition, FlowCall, Frames, Guide, Kind, LanguageAnswer, LanguageCall, Message, Networks,
        Prompt, Reply, Rules, SLOTS, Said, Sampling, Sequences, Shape, VerMo, Vocabulary, check,
    };

    /// The language model's table in a pack's manifest.
    pub fn table(pack: &Pack) -> Option<&VerMoDoc> {
        pack.manifest.vermo.as_ref()
    }

    /// The text pieces and known words of a pack, if its files were read.
    pub fn lexicon(pack: &Pack) -> Option<&Lexicon> {
        pack.lexicon.as_deref()
    }
}
