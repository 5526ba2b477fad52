//! `troupe object new`.

mod args;
mod draft;
mod placement;
mod seat;
mod wish;
mod write;
mod wrong;

#[cfg(test)]
mod tests;

use std::path::Path;

use troupe_client::Pack;
use troupe_motion::clip::Clip;
use troupe_proto::docs::{ObjectDoc, SkillDoc};

use self::draft::{check_frames, draft};
use self::wish::Limits;
use self::write::Source;
use self::wrong::Wrong;
use crate::context::Context;
use crate::failure::Failure;
use crate::files::read_clip;
use crate::output::print;
use crate::rebuild::{KEY, SEGMENT, distance, grounded, rebuild};

pub(super) use self::args::New;

pub(super) async fn run(context: &Context, new: &New) -> Result<(), Failure> {
    // Before any work is done for nothing.
    if let Some(out) = new.out.as_deref().filter(|out| !new.force && out.exists()) {
        let why = "is there already; --into adds to it as one more variant, --force replaces it";
        return Err(Failure::file(out, why));
    }
    let pack = new.pack.get(context).await?;
    let mut clip = read_clip(&new.from, &pack, &new.reading, &context.term)?;
    let old = new
        .into
        .as_deref()
        .map(|file| read(file, new.skill))
        .transpose()?;
    if new.rebuild {
        check_frames(new, &clip).map_err(|wrong| Failure::file(&new.from, wrong))?;
        rebuilt(context, new, &mut clip).await?;
    }
    let into = old.as_ref().map(|old| &old.doc);
    let made = draft(new, &clip, limits(&pack), into).map_err(|wrong| Failure::file(&new.from, wrong))?;
    for note in &made.notes {
        context.term.note(note);
    }
    let source = Source {
        clip: new
            .from
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        frames: &new.frames,
        pack: pack.name(),
        rebuilt: new.rebuild,
        skeleton: pack.skeleton(),
    };
    let text = match &old {
        Some(old) => format!("{}\n{}", old.text.trim_end(), write::addition(&made.doc, &source)),
        None if new.skill => write::skill(&made.doc, &source),
        None => write::whole(&made.doc, &source),
    };
    let Some(file) = new.into.as_deref().or(new.out.as_deref()) else {
        return print(text.trim_end());
    };
    std::fs::write(file, text).map_err(|e| Failure::output(file, e))?;
    let sets = made.doc.sets.len();
    let what = if old.is_some() { "added to" } else { "written to" };
    context
        .term
        .note(format_args!("{sets} sets {what} {}", file.display()));
    Ok(())
}

/// A definition as it is in a file.
struct Old {
    text: String,
    doc: ObjectDoc,
}

fn read(file: &Path, is_skill: bool) -> Result<Old, Failure> {
    let text = std::fs::read_to_string(file).map_err(|e| Failure::file(file, e))?;
    let doc = match is_skill {
        true => toml::from_str(&text).map(|skill: SkillDoc| skill.into()),
        false => toml::from_str(&text),
    };
    let doc = doc.map_err(|e| Failure::file(file, e))?;
    Ok(Old { text, doc })
}

/// Puts into a clip, at each of the frames that become keyframes, the pose that the pack's networks
/// make there.
async fn rebuilt(context: &Context, new: &New, clip: &mut Clip) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_pack(&new.pack.pack).await?;
    let (least, most) = (KEY, clip.frames().saturating_sub(SEGMENT - KEY));
    let segment = |&frame: &usize| match (least..=most).contains(&frame) {
        true => (clip.slice(frame - KEY..frame - KEY + SEGMENT)).map_err(|e| Failure::file(&new.from, e)),
        false => {
            let message = format!("{frame} is too near to an end of the clip to be rebuilt");
            let wrong = Wrong::new("--frames", message, format!("{least} to {most}"));
            Err(Failure::file(&new.from, wrong))
        }
    };
    let segments: Vec<Clip> = new.frames.iter().map(segment).collect::<Result<_, _>>()?;
    let answers = rebuild(&client, &pack, &segments).await?;
    let mut off_m = 0.0_f32;
    for ((answer, source), &frame) in answers.iter().zip(&segments).zip(&new.frames) {
        off_m = off_m.max(distance(answer, source));
        clip.root_positions[frame] = answer.root_positions[KEY].with_y(grounded(answer, source));
        clip.rotations_at_mut(frame)
            .copy_from_slice(answer.rotations_at(KEY));
    }
    context.term.note(format_args!(
        "{} poses rebuilt by {}, at most {:.1} cm a joint from the clip",
        answers.len(),
        pack.name(),
        off_m * 100.0
    ));
    Ok(())
}

/// Frames that a set may take.
fn limits(pack: &Pack) -> Limits {
    let (least, most) = pack.segment_frames().into_inner();
    let frames =
        |segment: usize| u32::try_from(segment.saturating_sub(pack.context_frames())).unwrap_or(u32::MAX);
    Limits {
        least: frames(least),
        most: frames(most),
    }
}
