//! `troupe retarget`: the motion of a clip on another character.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::clip::Clip;
use troupe_motion::glb;
use troupe_motion::read::Understood;
use troupe_motion::retarget::{Certificate, Figure, Figures, Retargeter, retarget};

use crate::clip::Onto;
use crate::context::Context;
use crate::failure::Failure;
use crate::files::{Format, note, understand, understand_character};
use crate::output::{print, table, to_json};
use crate::reading::Reading;
use crate::term::Term;

/// Faults of the certificate that a message has at most.
const MOST_FAULTS: usize = 4;

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
  troupe retarget walk.csv --urdf g1.urdf --to h1.urdf --out h1-walk.csv")]
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

    /// Name of the animation that is added. Default: the clip's file name.
    #[arg(long, value_name = "NAME")]
    name: Option<String>,

    /// TOML with the character's parts, for those that are found wrongly. `troupe clip info
    /// --parts` prints what is found.
    #[arg(long, value_name = "FILE")]
    to_parts: Option<PathBuf>,

    /// The same for the clip's body.
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
    let clip = understand(&command.clip, options, None).map_err(|why| Failure::file(&command.clip, why))?;
    note(&command.clip, &clip.report, &context.term);
    let source = figure(&command.clip, &clip, command.clip_parts.as_deref())?;
    let target = character(&command.to, command.to_parts.as_deref(), &context.term)?;
    let is_robot = target.skeleton().robot.is_some();
    if format.is_some_and(Format::is_for_robots) && !is_robot {
        let why = "it would hold a robot's angles, but the character is no robot";
        return Err(Failure::file(&command.out, why));
    }
    let mut retargeter = Retargeter::new(source, target).map_err(|e| Failure::file(&command.to, e))?;
    let certificate = Certificate::of(&retargeter);
    let carried = retarget(&mut retargeter, &clip.clip);
    let (made, figures) = carried.map_err(|e| Failure::file(&command.clip, e))?;
    show(&figures, &certificate, command.json)?;
    let mut faults = figures.faults();
    faults.extend(shortened(certificate.faults()));
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
        None => dress(command, &made)?,
    }
    context.term.note(format_args!(
        "{} frames written to {}",
        made.frames(),
        command.out.display()
    ));
    Ok(())
}

/// Whether a file can hold a character with its mesh and skin.
pub(crate) fn is_whole(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
    ending.is_some_and(|ending| ending == "glb" || ending == "vrm")
}

/// The body of a file.
fn figure(path: &Path, found: &Understood, parts: Option<&Path>) -> Result<Figure, Failure> {
    let doc = read_parts(parts)?;
    found
        .figure(&doc)
        .map_err(|why| Failure::file(parts.unwrap_or(path), why))
}

/// The body of a character's file.
pub(crate) fn character(path: &Path, parts: Option<&Path>, term: &Term) -> Result<Figure, Failure> {
    let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
    if ending.is_some_and(|ending| ending == "urdf" || ending == "xml") {
        let skeleton = Onto::robot_of(path, &[], &[])?;
        let doc = read_parts(parts)?;
        return Figure::of_robot(skeleton.into(), &doc).map_err(|why| Failure::file(path, why));
    }
    let found = understand_character(path).map_err(|why| Failure::file(path, why))?;
    note(path, &found.report, term);
    figure(path, &found, parts)
}

/// Corrections of a body's parts.
fn read_parts(path: Option<&Path>) -> Result<PartsDoc, Failure> {
    let Some(path) = path else {
        return Ok(PartsDoc::default());
    };
    let text = std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))?;
    toml::from_str(&text).map_err(|e| Failure::file(path, e))
}

/// Writes the character's file with the motion.
fn dress(command: &Retarget, clip: &Clip) -> Result<(), Failure> {
    let bytes = std::fs::read(&command.to).map_err(|e| Failure::file(&command.to, e))?;
    let stem = command.clip.file_stem().unwrap_or_default().to_string_lossy();
    let name = command.name.as_deref().unwrap_or(&stem);
    let made = glb::add_animation(&bytes, clip, name).map_err(|e| Failure::file(&command.to, e))?;
    std::fs::write(&command.out, made).map_err(|e| Failure::output(&command.out, e))
}

/// The first faults of a certificate, and how many more it has.
pub(crate) fn shortened(mut faults: Vec<String>) -> Vec<String> {
    let more = faults.len().saturating_sub(MOST_FAULTS);
    faults.truncate(MOST_FAULTS);
    if more > 0 {
        faults.push(format!("{more} more faults of the built-in motions"));
    }
    faults
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
    let mut table = table();
    table.set_header(["what is kept", "value"]);
    for (what, value) in figures.rows() {
        table.add_row([what, &value]);
    }
    let trials = &certificate.trials;
    let passed = trials
        .iter()
        .filter(|trial| trial.figures.faults().is_empty())
        .count();
    let share = format!("{passed} of {}", trials.len());
    table.add_row(["built-in motions within the bar", &share]);
    print(&table.to_string())
}
