//! `troupe object new`.

mod args;
mod draft;
mod seat;
mod stage;
mod wish;
mod write;
mod wrong;

#[cfg(test)]
mod tests;

use std::path::Path;

use troupe_client::Pack;
use troupe_proto::docs::ObjectDoc;

use self::draft::draft;
use self::wish::Limits;
use self::write::Source;
use crate::context::Context;
use crate::failure::Failure;
use crate::files::read_clip;
use crate::output::print;

pub(super) use self::args::New;

pub(super) async fn run(context: &Context, new: &New) -> Result<(), Failure> {
    // Before any work is done for nothing.
    if let Some(out) = new.out.as_deref().filter(|out| !new.force && out.exists()) {
        let why = "is there already; --into adds to it as one more variant, --force replaces it";
        return Err(Failure::file(out, why));
    }
    let pack = new.pack.get(context).await?;
    let clip = read_clip(&new.from, &pack, new.scale, &context.term)?;
    let old = new.into.as_deref().map(read).transpose()?;
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
        skeleton: pack.skeleton(),
    };
    let text = match &old {
        Some(old) => format!("{}\n{}", old.text.trim_end(), write::addition(&made.doc, &source)),
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

fn read(file: &Path) -> Result<Old, Failure> {
    let text = std::fs::read_to_string(file).map_err(|e| Failure::file(file, e))?;
    let doc = toml::from_str(&text).map_err(|e| Failure::file(file, e))?;
    Ok(Old { text, doc })
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
