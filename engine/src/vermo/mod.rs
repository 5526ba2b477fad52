//! VerMo: a language model whose vocabulary has text, motion and audio (docs/vermo-pack.md).
//!
//! A task is written as a message, and the model writes the reply token by token. [`Sequences`]
//! writes many replies in one call. Motion is given out in parts while its tokens are written. The
//! reference is `training/troupe_training/models/vermo`.

mod arena;
mod flow;
mod generator;
mod guidance;
mod job;
mod message;
mod motion;
mod network;
mod plan;
mod reply;
mod sampler;
mod sequences;
mod vocabulary;
mod wanted;
mod windows;

pub use arena::Shape;
pub use generator::{SLOTS, VerMo};
pub use message::{Condition, Message};
pub use motion::Frames;
pub use network::{FlowCall, LanguageAnswer, LanguageCall, Networks};
pub use plan::check;
pub use reply::{Allowed, Reply, Rules};
pub use sampler::Sampling;
pub use sequences::{Guide, Prompt, Said, Sequences};
pub use vocabulary::{Kind, Vocabulary};

#[cfg(test)]
mod generator_tests;
#[cfg(test)]
mod guidance_tests;
#[cfg(test)]
mod refusal_tests;
#[cfg(test)]
mod sequences_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) mod toy;
