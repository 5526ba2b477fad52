//! `troupe drive`.

mod args;
mod keyboard;
mod keys;
mod screen;

use serde_json::json;
use troupe_client::FrameOptions;

use crate::context::Context;
use crate::failure::Failure;
use crate::feasibility::too_fast;
use crate::files::Format;
use crate::output::print;
use crate::path::Path;
use crate::reading::Reading;
use crate::take::{Event, Take, follow, pack_of, print_events};

pub(crate) use self::args::Drive;

pub(super) async fn run(context: &Context, command: &Drive) -> Result<(), Failure> {
    // Checked first, so that no work is lost.
    let format = command.out.as_deref().map(Format::of).transpose()?;
    let path = command.path.as_deref().map(Path::read).transpose()?;
    if let (Some(format), Some(out)) = (format, &command.out) {
        let pack = pack_of(path.as_ref(), &command.character);
        format.check(context, pack, out).await?;
    }
    let Some(mut path) = path else {
        return keyboard::run(context, command, format).await;
    };
    if let Some(seconds) = command.seconds {
        path.seconds = Some(std::time::Duration::from(seconds).as_secs_f32());
    }
    let options = FrameOptions {
        rate: command.rate.into(),
        ..FrameOptions::default()
    };
    let take = follow(context, &path, &command.character, options).await?;
    if let (Some(format), Some(out)) = (format, &command.out) {
        format.write(&take.clip, out, &Reading::default())?;
        context.term.note(format_args!(
            "{} frames written to {}",
            take.clip.frames(),
            out.display()
        ));
    }
    if command.json {
        return print(&format!("{:#}", to_json(&take)));
    }
    if let Some(text) = too_fast(&take.clip) {
        context.term.note(text);
    }
    print(&in_words(&take))?;
    print_events(&take.events)
}

fn in_words(take: &Take) -> String {
    let (stats, measures) = (&take.stats, take.measures());
    let miss = match measures.end_to_last_waypoint_m {
        Some(metres) => format!(", {metres:.2} m from the last waypoint"),
        None => String::new(),
    };
    let mean = match measures.mean_speed_mps {
        Some(mps) => format!("{mps:.2} m/s on average while commanded to go, "),
        None => String::new(),
    };
    format!(
        "{:.1} s, {:.1} m{miss}\n\
         speed: {mean}{:.2} m/s at most\n\
         plans: {} ({} for commands, {} for a low buffer, {} after the interval), {} late, {} failed\n\
         underruns: {}",
        take.clip.duration_s(),
        measures.distance_m,
        measures.most_speed_mps,
        stats.plans(),
        stats.plans_for_command,
        stats.plans_for_low_buffer,
        stats.plans_for_interval,
        stats.late_plans,
        stats.failed_plans,
        stats.underruns,
    )
}

fn to_json(take: &Take) -> serde_json::Value {
    let (stats, measures) = (&take.stats, take.measures());
    json!({
        "frames": take.clip.frames(),
        "fps": take.clip.fps,
        "seconds": take.clip.duration_s(),
        "distance_m": measures.distance_m,
        "mean_speed_mps": measures.mean_speed_mps,
        "most_speed_mps": measures.most_speed_mps,
        "end_to_last_waypoint_m": measures.end_to_last_waypoint_m,
        "commands": take.commands,
        "events": take.events.iter().map(Event::to_json).collect::<Vec<_>>(),
        "stats": stats,
    })
}
