//! `troupe-eval wander`: characters that wander about.

mod against;
mod args;
mod measure;
mod report;
mod script;

pub(crate) use args::Wander;

use troupe_cli::{Context, Failure};
use troupe_client::Pack;
use troupe_motion::metrics::Gaussian;

use self::measure::{WINDOW_FRAMES, fid, figures, latents};
use self::report::{Report, Row};
use self::script::{Replan, wanderers};
use super::crowd::{Role, play, styles};
use super::publish;
use crate::clips::{clip_names, drop_short, read_clips};
use crate::evaluator::Evaluator;

/// Look-ahead of sessions that ask for none.
const LOOK_AHEAD_FRAMES: u32 = 4;
/// The shortest that a session can have.
const LEAST_LOOK_AHEAD_FRAMES: u32 = 2;

pub(crate) async fn run(context: &Context, command: &Wander) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_pack(&command.pack).await?;
    let against = match &command.against {
        Some(file) => Some(against::read(file, &pack)?),
        None => None,
    };
    let captured = captured(context, command, &pack)?;
    let mut styles = styles(&client, &pack, &command.styles).await?;
    // Those that only stand do not wander.
    styles.retain(|style| !style.is_static);
    if styles.is_empty() {
        return Err(Failure::Input(
            "--styles: none of these styles goes anywhere".to_owned(),
        ));
    }
    let count = command.characters.unwrap_or(2 * styles.len());
    let mut rows = Vec::new();
    for replan in replans(&command.replan) {
        let roles = wanderers(&styles, count, command.seconds, command.seed, replan);
        let bar = context
            .term
            .bar(roles.iter().map(|role| role.frames).sum(), "live frames");
        let (clips, stats) = play((&client, &pack), &roles, &bar).await?;
        bar.finish_and_clear();
        let figures = figures(&clips, command.seed).map_err(|e| Failure::Other(e.to_string()))?;
        let fid = match &captured {
            Some((evaluator, truth)) => fid(evaluator, &clips, truth, command.seed)?,
            None => None,
        };
        let seconds: usize = roles.iter().map(|role: &Role| role.frames).sum::<usize>() / 30;
        rows.push(Row::new(replan, figures, fid, against, &stats, seconds));
    }
    let report = Report::new(&pack, count, command, rows);
    publish(&report.to_text(), &report, command.json.as_deref())
}

/// The intervals between plans, one for each run. All runs have the look-ahead that suits the
/// shortest interval.
fn replans(intervals: &[u32]) -> Vec<Option<Replan>> {
    let Some(&shortest) = intervals.iter().min() else {
        return vec![None];
    };
    let look_ahead_frames = shortest.clamp(LEAST_LOOK_AHEAD_FRAMES, LOOK_AHEAD_FRAMES);
    let replan = |&interval_frames: &u32| {
        Some(Replan {
            interval_frames,
            look_ahead_frames,
        })
    };
    intervals.iter().map(replan).collect()
}

/// The evaluator and the latents of the clips, if FID is to be measured.
fn captured(
    context: &Context,
    command: &Wander,
    pack: &Pack,
) -> Result<Option<(Evaluator, Gaussian)>, Failure> {
    let Some((file, data)) = command.distribution() else {
        return Ok(None);
    };
    let Some(evaluator) = Evaluator::find(Some(file), pack.name())? else {
        return Ok(None);
    };
    let names = clip_names(data, command.split.as_deref())?;
    let (mut clips, mut skipped) = read_clips(data, &names, pack, &command.reading, &context.term);
    skipped.extend(drop_short(&mut clips, WINDOW_FRAMES));
    for clip in &skipped {
        context
            .term
            .note(format_args!("{} is left out: {}", clip.clip, clip.reason));
    }
    let latents = latents(&evaluator, clips.iter().map(|named| &named.clip), 0)?;
    let truth = Gaussian::fit(&latents, &vec![1; clips.len()]);
    match truth {
        Some(truth) => Ok(Some((evaluator, truth))),
        None => Err(Failure::file(data, "no two windows can be cut from its clips")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_compared_at_one_look_ahead() {
        assert_eq!(replans(&[]), [None]);
        let of = |intervals: &[u32]| -> Vec<(u32, u32)> {
            let all = replans(intervals).into_iter().flatten();
            all.map(|r| (r.interval_frames, r.look_ahead_frames)).collect()
        };
        assert_eq!(of(&[9, 3]), [(9, 3), (3, 3)]);
        assert_eq!(of(&[9, 30]), [(9, 4), (30, 4)]);
        assert_eq!(of(&[1]), [(1, 2)]);
    }
}
