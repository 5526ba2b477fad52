//! `troupe style add`.

use troupe_proto::v1;

use super::args::{Add, Source};
use super::build::{Builder, speed, write};
use super::extract::{GaitSource, stands};
use super::list::USUAL_INTERVAL_FRAMES;
use crate::context::Context;
use crate::failure::Failure;

pub(super) async fn run(context: &Context, command: &Add) -> Result<(), Failure> {
    check(command)?;
    let (client, pack) = context.connect_to_pack(&command.pack).await?;
    let builder = Builder {
        context,
        client: &client,
        pack: &pack,
        reading: &command.reading,
        keys: command.building.keys as usize,
    };
    let mut gaits: Vec<v1::Gait> = Vec::new();
    for source in &command.sources.0 {
        let gait = gait_name(command, source);
        let place = GaitSource {
            path: &source.clip,
            gait,
            from: source.from,
            to: source.to,
        };
        gaits.push(builder.gait(&command.name, gait, &[place]).await?);
    }
    let moving = gaits.iter().find(|g| !stands(&g.name));
    let style = v1::Style {
        name: command.name.clone(),
        default_speed: moving.map_or(0.0, speed),
        replan_interval_frames: USUAL_INTERVAL_FRAMES,
        is_static: command.is_static,
        gaits,
        ..v1::Style::default()
    };
    if let Some(out) = &command.out {
        write(&style, out)?;
        context.term.note(format_args!("written to {}", out.display()));
    }
    let kept = client.put_style(&pack, style).await?;
    let speed = kept.default_speed;
    context.term.note(format_args!(
        "style `{}` added to pack `{}`: {} gaits, default speed {speed:.2} m/s",
        kept.name,
        pack.name(),
        kept.gaits.len()
    ));
    Ok(())
}

/// Refuses clips that cannot become a style, before any work on them.
fn check(command: &Add) -> Result<(), Failure> {
    let sources = &command.sources.0;
    let name = |source: &Source| gait_name(command, source).to_owned();
    if let Some(moving) = sources
        .iter()
        .map(name)
        .find(|gait| command.is_static && !stands(gait))
    {
        return Err(Failure::Input(format!(
            "--static: the style only stands, but its gait `{moving}` moves; the names of gaits that stand begin with `idle`"
        )));
    }
    for (nth, source) in sources.iter().enumerate() {
        let gait = name(source);
        if sources[..nth].iter().any(|before| name(before) == gait) {
            return Err(Failure::Input(format!(
                "--gait: two clips make the gait `{gait}`; give each --clip a --gait of its own"
            )));
        }
    }
    Ok(())
}

/// The name of the gait that a clip makes.
fn gait_name<'a>(command: &Add, source: &'a Source) -> &'a str {
    let usual = if command.is_static { "idle" } else { "walk" };
    source.gait.as_deref().unwrap_or(usual)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        add: Add,
    }

    #[test]
    fn clips_that_make_no_style_are_refused_before_any_work() {
        let checked = |line: &str| {
            let line = Line::try_parse_from(format!("x --name calm {line}").split(' ')).unwrap();
            check(&line.add).map_err(|e| e.to_string())
        };
        for good in [
            "--clip a.bvh",
            "--clip a.bvh --clip b.bvh --gait run --clip c.bvh --gait idle",
            "--clip a.bvh --static",
            "--clip a.bvh --gait idle-tall --static",
        ] {
            assert_eq!(checked(good), Ok(()), "{good}");
        }
        for (bad, wanted) in [
            ("--clip a.bvh --clip b.bvh", "two clips make the gait `walk`"),
            ("--clip a.bvh --gait run --static", "its gait `run` moves"),
        ] {
            let error = checked(bad).unwrap_err();
            assert!(error.contains(wanted), "{bad}: {error}");
        }
    }
}
