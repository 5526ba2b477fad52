//! `troupe clip info`.

use std::path::{Path, PathBuf};

use clap::Args;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::read::{Options, Understood};

use super::onto::Onto;
use crate::context::Context;
use crate::failure::Failure;
use crate::film::draw_motion;
use crate::output::{print, table, to_json};
use crate::term::plain;
use crate::understand::{understand, understand_character};

/// Print what is understood of files of motion.
///
/// One line each with its evidence: format, producer, skeleton, up axis, unit, rate, rest pose,
/// frames and contacts. Then come what was repaired and what looks odd. What is assumed, because
/// the file does not show it, is marked. Files are read onto their own skeletons; a robot's files
/// need --pack, --pack-folder or --urdf.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe clip info walk.bvh
  troupe clip info dance.fbx horse.glb#Walk --json
  troupe clip info hero.glb --parts
  troupe clip info wave.csv --pack-folder models/g1 --picture wave.png")]
pub(super) struct Info {
    /// Motion clips: .bvh, .glb, .gltf, .fbx or .npz, or a robot's .csv or .npy. horse.glb#Walk
    /// names one animation of several.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,

    /// Also draw the motion of the one file: its path, and poses (PNG).
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,

    /// Print the parts of the one file's body as TOML: trunk, limbs and head, as `troupe retarget`
    /// finds them. A character needs no animation.
    #[arg(long, conflicts_with_all = ["picture", "json"])]
    parts: bool,

    /// Print JSON.
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    onto: Onto,
}

pub(super) async fn run(context: &Context, command: &Info) -> Result<(), Failure> {
    if command.picture.is_some() && command.files.len() > 1 {
        let why = "--picture draws one file, but several are given";
        return Err(Failure::Input(why.to_owned()));
    }
    let options = command.onto.options(context).await?;
    if command.parts {
        return print_parts(&command.files, options);
    }
    let (mut reports, mut refused) = (Vec::new(), Vec::new());
    for file in &command.files {
        match understand(file, options.clone(), None) {
            Ok(understood) => {
                if let Some(picture) = &command.picture {
                    draw(&understood, picture)?;
                }
                reports.push(understood.report);
            }
            Err(why) => refused.push(Failure::file(file, why).to_string()),
        }
    }
    match command.json {
        true if reports.is_empty() => {}
        true => print(&to_json(&reports)?)?,
        false => {
            for report in &reports {
                let mut table = table();
                table.set_header(["what", "value", "evidence"]);
                table.add_rows(
                    report
                        .rows()
                        .iter()
                        .map(|row| row.each_ref().map(|cell| plain(cell))),
                );
                print(&format!("{}\n{table}", report.file))?;
            }
        }
    }
    match refused.is_empty() {
        true => Ok(()),
        false => Err(Failure::Input(refused.join("\n"))),
    }
}

/// Prints the parts of a body.
fn print_parts(files: &[PathBuf], options: Options) -> Result<(), Failure> {
    let [file] = files else {
        let why = "--parts shows one file, but several are given";
        return Err(Failure::Input(why.to_owned()));
    };
    let found = understand_character(file, options).map_err(|why| Failure::file(file, why))?;
    let figure = found
        .figure(&PartsDoc::default())
        .map_err(|why| Failure::file(file, plain(&why.to_string())))?;
    let doc = PartsDoc::of(figure.parts(), figure.skeleton());
    print(&toml::to_string(&doc).map_err(|e| Failure::Other(e.to_string()))?)
}

fn draw(understood: &Understood, picture: &Path) -> Result<(), Failure> {
    let Understood { clip, report, .. } = understood;
    let about = format!(
        "{} · {} frames · {:.1} s",
        report.format.value,
        report.frames,
        clip.duration_s()
    );
    let png = draw_motion(clip, &[], "", (report.file.clone(), about)).map_err(Failure::Other)?;
    std::fs::write(picture, png).map_err(|e| Failure::output(picture, e))
}
