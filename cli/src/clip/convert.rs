//! `troupe clip convert`.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;
use troupe_motion::read::{Options, Understood};

use super::onto::Onto;
use crate::context::Context;
use crate::failure::Failure;
use crate::files::{Format, Layout, close};
use crate::output::print;
use crate::reading::Reading;
use crate::understand::{Misread, animation_of, note, understand, understand_character};

/// Write a file of motion in another format.
///
/// The ending of OUT says the format: .bvh (in centimetres), .glb or .npz, or .csv and .npy (qpos)
/// of a robot. The clip keeps its rate, but robots' rows are 30 a second. A character without
/// animation gives its rest pose, as one frame. What was repaired is
/// noted on standard error. Files are read onto their own skeletons; a robot's files need --pack,
/// --pack-folder or --urdf.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe clip convert dance.fbx dance.bvh
  troupe clip convert horse.glb#Walk walk.npz --loop
  troupe clip convert wave.csv wave.npz --pack-folder models/g1 --layout beyondmimic
  troupe clip convert wave.csv waves/wave --pack-folder models/g1 --layout sonic")]
pub(super) struct Convert {
    /// File to read: .bvh, .glb, .gltf, .fbx or .npz, or a robot's .csv or .npy. horse.glb#Walk
    /// names one animation of several.
    #[arg(value_name = "IN")]
    from: PathBuf,

    /// File to write, or the folder of --layout sonic.
    #[arg(value_name = "OUT")]
    out: PathBuf,

    /// Layout of a robot's motion for its tracker.
    #[arg(long, value_enum)]
    layout: Option<Layout>,

    /// Make the motion loop. It is cut in its last quarter, at the frame most like the first. The
    /// rest of the difference is spread over all frames.
    #[arg(long = "loop")]
    loops: bool,

    /// Print what was done as JSON.
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    onto: Onto,
}

/// The motion of the file, or the rest pose of a character without any.
fn read(command: &Convert, options: Options, context: &Context) -> Result<Understood, Misread> {
    let names_animation = animation_of(&command.from, &options).is_some();
    match understand(&command.from, options.clone(), None) {
        Err(why) if why.lacks_animation() && !names_animation => {
            let at_rest = understand_character(&command.from, options)?;
            context.term.note(format_args!(
                "{}: it has no animation; its rest pose becomes one frame",
                command.from.display()
            ));
            Ok(at_rest)
        }
        found => found,
    }
}

pub(super) async fn run(context: &Context, command: &Convert) -> Result<(), Failure> {
    // Checked first, so that no work is lost.
    let format = Format::of_layout(&command.out, command.layout)?;
    let options = command.onto.options(context).await?;
    let understood = read(command, options, context).map_err(|why| Failure::file(&command.from, why))?;
    if format.is_for_robots() && understood.clip.skeleton.robot.is_none() {
        let why = "it would hold a robot's angles, but the motion is no robot's; \
                   --pack, --pack-folder or --urdf gives the robot";
        return Err(Failure::file(&command.out, why));
    }
    note(&command.from, &understood.report, &context.term);
    let clip = match command.loops {
        true => close(&understood.clip, &context.term).map_err(|e| Failure::file(&command.from, e))?,
        false => understood.clip,
    };
    // --unit is that of the file that was read.
    format.write(&clip, &command.out, &Reading::default())?;
    let (frames, out) = (clip.frames(), command.out.display());
    if command.json {
        return print(&format!(
            "{:#}",
            json!({
                "out": out.to_string(),
                "frames": frames,
                "report": understood.report,
            })
        ));
    }
    context
        .term
        .note(format_args!("{frames} frames read, and written to {out}"));
    Ok(())
}
