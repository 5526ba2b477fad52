//! `troupe say`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;
use troupe_client::{Key, Pack, Prompt};
use troupe_motion::clip::Clip;

use crate::context::Context;
use crate::failure::Failure;
use crate::feasibility::too_fast;
use crate::files::{Layout, read_clip};
use crate::film::draw_motion;
use crate::hero::{OntoHero, Writer};
use crate::output::print;
use crate::reading::Reading;
use crate::tokens::Tokens;
use crate::values::{Place, Seconds};

/// Make motion from words.
///
/// For packs with the capability `text`. Notes name what the model may not do well, such as words
/// that its training did not use. With --past the motion goes on from the end of a clip, and the
/// file has the new frames alone.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe say \"an elderly man waves\" --out wave.glb
  troupe say \"a person walks in a circle\" --seconds 6 --seed 3 --out circle.bvh --picture circle.png
  troupe say \"he sits down\" --past walk.bvh --out sit.glb --temperature 0.8 --top-p 0.9
  troupe say \"a person walks\" --seconds 4 --to 1.5,3,90 --out there.glb
  troupe say \"a person waves\" --beside \"a person bows\" --out meeting.glb
  troupe say \"a person waves\" --onto hero.vrm --out hero-waves.vrm")]
pub(crate) struct Say {
    /// A sentence for the character.
    #[arg(value_name = "WORDS")]
    pub(crate) text: String,

    /// File to write; its ending says the format: .bvh, .glb, .npz, or .csv and .npy (qpos) of a
    /// robot.
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,

    /// Layout of a robot's motion for its tracker.
    #[arg(long, value_enum)]
    pub(crate) layout: Option<Layout>,

    /// Model pack. Default: the first that acts out words.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(crate) pack: String,

    /// Length of the motion. Default: the model decides.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) seconds: Option<Seconds>,

    /// Go on from the end of this clip: .bvh, .glb, .gltf, .fbx or .npz, or a robot's .csv or
    /// .npy. horse.glb#Walk names one animation of several.
    #[arg(long, value_name = "FILE")]
    pub(crate) past: Option<PathBuf>,

    /// Place where the motion ends: x and z in metres, and the heading in degrees (0 faces +Z, 90
    /// faces +X). Without --past the motion begins at 0,0,0. Its way is bent to the place, and
    /// standing feet are held.
    #[arg(
        long,
        value_name = "X,Z,DEGREES",
        allow_hyphen_values = true,
        conflicts_with_all = ["beside", "raw"]
    )]
    pub(crate) to: Option<Place>,

    /// A sentence for another character in the same motion. May be given again. Each character gets
    /// its own file: wave.glb, wave-2.glb. For packs with the capability `agents`.
    #[arg(long, value_name = "WORDS", conflicts_with = "past")]
    pub(crate) beside: Vec<String>,

    #[command(flatten)]
    pub(crate) tokens: Tokens,

    /// Write the network's own frames: standing feet are not held.
    #[arg(long)]
    pub(crate) raw: bool,

    /// Also draw the motion: its path, and poses (PNG).
    #[arg(long, value_name = "FILE")]
    pub(crate) picture: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) onto: OntoHero,

    #[command(flatten)]
    pub(crate) reading: Reading,

    /// Print what was done as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

pub(super) async fn run(context: &Context, command: &Say) -> Result<(), Failure> {
    let hero = command.onto.read(&context.term)?;
    let hero = hero.as_ref();
    let writer = Writer::of(&command.out, command.layout, hero)?;
    let (client, pack) = context.connect_to_able("text", &command.pack).await?;
    writer.fits(&pack, (&command.out, hero))?;
    let asked = std::time::Instant::now();
    let making = client.say(&pack, &prompt(context, command, &pack)?).await?;
    let mut made = making.whole().await?;
    let took_ms = asked.elapsed().as_secs_f64() * 1e3;
    let outs = outs(&command.out, made.others.len());
    if let Some(hero) = hero {
        for clip in [&mut made.clip].into_iter().chain(&mut made.others) {
            *clip = hero.wear(clip, clip, &context.term)?;
        }
    }
    for (clip, out) in [&made.clip].into_iter().chain(&made.others).zip(&outs) {
        writer.write(clip, out, &command.text, &command.reading)?;
    }
    if let Some(file) = &command.picture {
        let png = draw(command, &pack, &made.clip).map_err(Failure::Other)?;
        std::fs::write(file, png).map_err(|e| Failure::output(file, e))?;
    }

    let frames = made.clip.frames();
    let outs: Vec<String> = outs.iter().map(|out| out.display().to_string()).collect();
    if command.json {
        return print(&format!(
            "{:#}",
            json!({
                "out": outs[0],
                "beside": outs[1..],
                "text": command.text,
                "frames": frames,
                "pack": pack.name(),
                "pack_version": pack.description().version,
                "notes": made.notes,
                "took_ms": took_ms,
            })
        ));
    }
    for note in &made.notes {
        context.term.note(format_args!("note: {note}"));
    }
    for text in [&made.clip].into_iter().chain(&made.others).filter_map(too_fast) {
        context.term.note(text);
    }
    context.term.note(format_args!(
        "{frames} frames by {} {} written to {}",
        pack.name(),
        pack.description().version,
        outs.join(", ")
    ));
    Ok(())
}

/// A file for each character: the first has the given name, others have their number in it.
fn outs(out: &Path, others: usize) -> Vec<PathBuf> {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let ending = out
        .extension()
        .map_or_else(String::new, |ending| format!(".{}", ending.display()));
    let numbered = (2..others + 2).map(|number| out.with_file_name(format!("{stem}-{number}{ending}")));
    std::iter::once(out.to_owned()).chain(numbered).collect()
}

/// The request with the options.
fn prompt(context: &Context, command: &Say, pack: &Pack) -> Result<Prompt, Failure> {
    let mut prompt = Prompt::new(&*command.text)
        .seed(command.tokens.seed)
        .raw(command.raw)
        .sampling(command.tokens.sampling());
    for text in &command.beside {
        prompt = prompt.beside(&**text, &[]);
    }
    if let Some(seconds) = command.seconds {
        prompt = prompt.seconds(std::time::Duration::from(seconds).as_secs_f32());
    }
    if let Some(Place { ground, heading }) = command.to {
        prompt = prompt.ending_at(ground, heading);
    }
    if let Some(file) = &command.past {
        let clip = read_clip(file, pack, &command.reading.of_input(file, pack), &context.term)?;
        let keys = Key::all(&clip);
        prompt = prompt.after(&keys[keys.len().saturating_sub(most_past(pack))..]);
    }
    Ok(prompt)
}

/// Most frames of the past that a request may have.
fn most_past(pack: &Pack) -> usize {
    let of = pack.description();
    match &of.language {
        Some(_) => of.max_frames as usize,
        None => of.context_frames as usize,
    }
}

fn draw(command: &Say, pack: &Pack, clip: &Clip) -> Result<Vec<u8>, String> {
    let about = format!(
        "{} {} · seed {} · {:.1} s",
        pack.name(),
        pack.description().version,
        command.tokens.seed,
        clip.duration_s()
    );
    draw_motion(clip, &[], "", (command.text.clone(), about))
}

#[cfg(test)]
mod tests {
    use troupe_proto::v1;

    use super::*;

    #[test]
    fn each_character_has_a_file() {
        let names = ["takes/wave.glb", "takes/wave-2.glb", "takes/wave-3.glb"];
        assert_eq!(outs(Path::new("takes/wave.glb"), 2), names.map(PathBuf::from));
        assert_eq!(outs(Path::new("wave"), 1), ["wave", "wave-2"].map(PathBuf::from));
    }

    #[test]
    fn a_language_model_takes_more_of_the_past() {
        let mut pack = v1::Pack {
            context_frames: 16,
            max_frames: 256,
            ..crate::testing::pair()
        };
        assert_eq!(most_past(&Pack::try_from(pack.clone()).unwrap()), 16);
        pack.language = Some(v1::Language::default());
        assert_eq!(most_past(&Pack::try_from(pack).unwrap()), 256);
    }
}
