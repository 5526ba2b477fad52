//! The model families by name, for tests, examples and measurements of one of them. The server goes
//! by a pack's capabilities and facts, and by [`Selector::generator`](crate::Selector::generator).

pub use crate::motionbricks::MotionBricks;

/// One network that moves many bodies along paths.
pub mod unimogen {
    pub use crate::unimogen::{CALL_ROWS, Call, Denoiser, PATH_FEATURES, ROW_CHANNELS, UniMoGen, probe_task};
}

/// A language model of text, motion and audio.
pub mod vermo {
    use crate::pack::Pack;

    pub use crate::onnx::vermo::OnnxVerMo;
    pub use crate::pack::Lexicon;
    pub use crate::pack::vermo::VerMoDoc;
    pub use crate::vermo::{
        Allowed, Condition, FlowCall, Frames, Kind, LanguageAnswer, LanguageCall, Message, Networks, Prompt,
        Reply, Rules, SLOTS, Said, Sampling, Sequences, Shape, VerMo, Vocabulary, check,
    };

    /// What a pack's manifest says of its language model.
    pub fn table(pack: &Pack) -> Option<&VerMoDoc> {
        pack.manifest.vermo.as_ref()
    }

    /// The text pieces and known words of a pack, where its files were read.
    pub fn lexicon(pack: &Pack) -> Option<&Lexicon> {
        pack.lexicon.as_deref()
    }
}
