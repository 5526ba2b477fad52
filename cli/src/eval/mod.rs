//! `troupe eval`.

mod clips;
mod evaluator;
mod feasibility;
mod gaps;
mod live;
mod resampling;
mod stage;
mod wander;

use clap::{Args, Subcommand};

use self::feasibility::FeasibilityEval;
use self::gaps::GapEval;
use self::live::Live;
use self::wander::Wander;
use crate::context::Context;
use crate::failure::Failure;

/// Measure the pack on held-out clips, beside ground truth and interpolation.
///
/// Every clip of the split is cut into windows: four context frames, the gap, and one target
/// keyframe with full pose and root. The server fills the gap; so does interpolation (linear root,
/// slerp of joint rotations). Diversity comes from some windows, filled with several seeds at
/// temperature 1. FID, MMD and latent diversity are measured in the latent space of a motion
/// autoencoder, the `evaluator.onnx` that `troupe-train evaluator` makes. Each figure comes with a
/// 95 % interval.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe eval --data clips/
  troupe eval --data clips/ --split training/splits/bandai-namco-test.txt --json eval.json
  troupe eval --data clips/ --gaps 30 --stride 60 --max-windows 200 --seed 1
  troupe eval --data clips/ --evaluator models/human/evaluator.onnx --seeds 0")]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct Eval {
    #[command(subcommand)]
    pub(crate) what: Option<EvalWhat>,

    #[command(flatten)]
    pub(crate) gaps: GapEval,
}

/// What else can be measured.
#[derive(Debug, Subcommand)]
pub(crate) enum EvalWhat {
    Feasibility(FeasibilityEval),
    Live(Live),
    Wander(Wander),
}

pub(crate) async fn run(context: &Context, command: &Eval) -> Result<(), Failure> {
    match &command.what {
        Some(EvalWhat::Feasibility(command)) => feasibility::run(context, command).await,
        Some(EvalWhat::Live(command)) => live::run(context, command).await,
        Some(EvalWhat::Wander(command)) => wander::run(context, command).await,
        None => gaps::run(context, &command.gaps).await,
    }
}
