//! A Godot 4 extension: characters of a scene that a Troupe motion server moves.
//!
//! [`nodes`] has the classes that Godot gets. [`link`] is the connection, on a thread of its own.
//! [`rig`] makes joints of bones. [`axes`] and [`convert`] lead from one frame of reference, and
//! one set of types, to the other. Only `nodes` calls the engine, so that all else is tested
//! without it.

#![allow(unsafe_code, reason = "the engine vouches for its calls")]

mod axes;
mod closing;
mod convert;
mod link;
mod nodes;
mod rig;

use godot::prelude::*;

struct TroupeExtension;

// SAFETY: the engine loads this library, and calls it as the interface of extensions says.
#[gdextension]
unsafe impl ExtensionLibrary for TroupeExtension {
    fn on_stage_deinit(stage: InitStage) {
        if stage == InitStage::Scene {
            closing::wait();
        }
    }
}
