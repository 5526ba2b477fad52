//! `troupe retarget`: the motion of a clip on another character.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;
use troupe_motion::retarget::{Certificate, Figures, Retargeter, retarget};

use crate::character::{Character, Hints, figure, is_whole};
use crate::clip::Onto;
use crate::context::Context;
use crate::failure::Failure;
use crate::files::Format;
use crate::kept;
use crate::output::{print, to_json};
use crate::reading::{Reading, unit_m};
use crate::understand::{animation_of, note, understand};

/// Carry the motion of a clip over to another character.
///
/// Bodies are found by the names of their joints, and otherwise by how they stand at rest. Both
/// stand on two legs, or both on four; robots bend by their hinges. Feet stand where they stand in
/// the clip, in the character's size. Fingers keep the character's rest pose.
///
/// The figures say what was kept of the motion: angles between the bones of limbs, sliding of
/// standing feet, feet under the ground, and feet that do not reach their places. The same figures
/// of walks, turns, a crouch and reaches say whether the two bodies go together. Beyond the bar
/// nothing is written, unless --force is given. No server is needed.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe retarget examples/walk.bvh --to hero.glb --out hero-walk.glb
  troupe retarget walk.fbx --to hero.vrm --out hero-walk.vrm --to-parts hero.toml
  troupe retarget walk.csv --urdf h1_2.urdf --to g1.urdf --out g1-walk.csv")]
pub(super) struct Retarget {
    /// Clip to carry over: .bvh, .glb, .gltf, .fbx or .npz, or a robot's .csv or .npy.
    /// horse.glb#Walk names one animation of several.
    #[arg(value_name = "CLIP")]
    clip: PathBuf,

    /// The character: a .glb or .vrm with a skin, a file of motion on its skeleton, or a robot's
    /// .urdf or .xml (MJCF).
    #[arg(long, value_name = "FILE")]
    to: PathBuf,

    /// File to write. A .glb or .vrm keeps mesh, skin and animations of a character of that format,
    /// and gets one animation more. Other endings as for `clip convert`.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Name of the animation that is added. Default: that of the clip's animation if one is named,
    /// or else of its file.
    #[arg(long, value_name = "NAME")]
    name: Option<String>,

    /// TOML with the character's parts, for those that are found wrongly. `troupe clip info
    /// --parts` prints what is found.
    #[arg(long, value_name = "FILE")]
    to_parts: Option<PathBuf>,

    /// Unit of length of the character's file: m, ft, dm, cmu, in, cm or mm. Default: the one in
    /// which the body has its size.
    #[arg(long, value_name = "UNIT", value_parser = unit_m)]
    to_unit: Option<f64>,

    /// Joint that is the character's root. Default: the one that carries the body.
    #[arg(long, value_name = "JOINT")]
    to_root: Option<String>,

    /// TOML with the parts of the clip's body.
    #[arg(long, value_name = "FILE")]
    clip_parts: Option<PathBuf>,

    /// Write the motion even if its figures are beyond the bar.
    #[arg(long)]
    force: bool,

    /// Print the figures as JSON.
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    onto: Onto,
}

pub(super) async fn run(context: &Context, command: &Retarget) -> Result<(), Failure> {
    // Checked first, so that no work is lost.
    let format = match is_whole(&command.to) && is_whole(&command.out) {
        true => None,
        false => Some(Format::of(&command.out)?),
    };
    let options = command.onto.options(context).await?;
    let animation = animation_of(&command.clip, &options);
    let clip = understand(&command.clip, options, None).map_err(|why| Failure::file(&command.clip, why))?;
    note(&command.clip, &clip.report, &context.term);
    let source = figure(&command.clip, &clip, command.clip_parts.as_deref())?;
    let hints = Hints {
        parts: command.to_parts.as_deref(),
        unit_m: command.to_unit,
        root: command.to_root.as_deref(),
        option: "to",
    };
    let target = Character::read(&command.to, hints, &context.term)?;
    let is_robot = target.figure.skeleton().robot.is_some();
    if format.is_some_and(Format::is_for_robots) && !is_robot {
        let why = "it would hold a robot's angles, but the character is no robot";
        return Err(Failure::file(&command.out, why));
    }
    let retargeter = Retargeter::new(source, target.figure.clone());
    let mut retargeter = retargeter.map_err(|e| Failure::file(&command.to, e))?;
    let certificate = Certificate::of(&retargeter);
    let carried = retarget(&mut retargeter, &clip.clip);
    let (made, figures) = carried.map_err(|e| Failure::file(&command.clip, e))?;
    show(&figures, &certificate, command.json)?;
    let faults = kept::faults(&mut retargeter, [&clip.clip, &made], &figures);
    let mut faults = faults.map_err(|e| Failure::file(&command.clip, e))?;
    faults.extend(kept::shortened(certificate.faults()));
    if !faults.is_empty() && !command.force {
        return Err(Failure::file(
            &command.to,
            format_args!("{}; --force writes the motion all the same", faults.join("; ")),
        ));
    }
    for fault in faults {
        context
            .term
            .note(format_args!("{}: {fault}", command.to.display()));
    }
    match format {
        Some(format) => format.write(&made, &command.out, &Reading::default())?,
        None => {
            let stem = command.clip.file_stem().unwrap_or_default().to_string_lossy();
            let name = command.name.as_deref().or(animation.as_deref());
            target.write(&made, &command.out, name.unwrap_or(&stem))?;
        }
    }
    context.term.note(format_args!(
        "{} frames written to {}",
        made.frames(),
        command.out.display()
    ));
    Ok(())
}

/// Prints the figures.
fn show(figures: &Figures, certificate: &Certificate, as_json: bool) -> Result<(), Failure> {
    if as_json {
        return print(&to_json(&json!({
            "figures": figures,
            "faults": figures.faults(),
            "certificate": { "trials": certificate.trials, "faults": certificate.faults() },
        }))?);
    }
    print(&kept::table(figures, certificate).to_string())
}
