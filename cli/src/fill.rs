//! Filling a gap of a clip, as `inbetween` and `draw` do it.

use std::path::PathBuf;

use clap::Args;
use troupe_client::{AnswerError, InBetween, InBetweenAnswer, InBetweenAnswers, Pack, SegmentLength};
use troupe_motion::clip::Clip;

use crate::context::Context;
use crate::failure::Failure;
use crate::files::read_clip;
use crate::hero::Hero;
use crate::reading::Reading;
use crate::roots::read_roots;
use crate::splice::gap_of;

const SAMPLING: &str = "Pack and sampling";

/// A gap of a clip, and how to fill it.
#[derive(Debug, Args)]
pub(crate) struct Gap {
    /// Motion clip: .bvh, .glb, .gltf, .fbx or .npz, or a robot's .csv (root x y z qx qy qz qw,
    /// then the hinges' angles) or .npy (qpos). horse.glb#Walk names one animation of several.
    #[arg(long, value_name = "FILE")]
    pub(crate) clip: PathBuf,

    /// Last context frame; the first frame of the clip is 0.
    #[arg(long, value_name = "FRAME")]
    pub(crate) from: usize,

    /// Target keyframe.
    #[arg(long, value_name = "FRAME")]
    pub(crate) to: usize,

    /// Number of target keyframes: consecutive frames from TO on.
    #[arg(long, default_value_t = 1, value_name = "1-4", value_parser = clap::value_parser!(u8).range(1..=4))]
    pub(crate) target_frames: u8,

    /// TOML file of roots that the motion must pass: [[root]] with a `frame`, counted like FROM and
    /// TO, and any of `at` ([x, z] in metres), `height_m` and `heading_deg`.
    #[arg(long, value_name = "FILE")]
    pub(crate) roots: Option<PathBuf>,

    /// Refuse a gap that no motion like that in the pack's data can fill, and print what would be
    /// possible.
    #[arg(long)]
    pub(crate) strict: bool,

    #[command(flatten)]
    pub(crate) sampling: Sampling,

    #[command(flatten)]
    pub(crate) reading: Reading,
}

/// Pack and sampling.
#[derive(Debug, Args)]
pub struct Sampling {
    /// Model pack. Default: the server's default pack.
    #[arg(long, help_heading = SAMPLING, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub pack: String,

    /// The same seed, clip and pack give the same frames.
    #[arg(long, help_heading = SAMPLING, default_value_t = 0)]
    pub seed: u64,

    /// 0 takes the most likely motion. Above 0 motion is sampled with the seed.
    #[arg(long, help_heading = SAMPLING, default_value_t = 0.0, value_name = "0-2")]
    pub temperature: f32,

    /// Passes of the pose module, 1 to 10.
    #[arg(long, help_heading = SAMPLING, default_value_t = 1, value_name = "1-10")]
    pub pose_steps: u32,

    /// Leave feet as the networks make them. Without it feet that stand are held still.
    #[arg(long, help_heading = SAMPLING)]
    pub free_feet: bool,
}

impl Default for Sampling {
    fn default() -> Self {
        Self {
            pack: String::new(),
            seed: 0,
            temperature: 0.0,
            pose_steps: 1,
            free_feet: false,
        }
    }
}

/// A clip and the answer for its gap.
pub(super) struct Filled {
    /// The pack that filled it.
    pub(super) pack: Pack,
    /// The clip on the pack's skeleton and at its rate.
    pub(super) clip: Clip,
    /// The whole segment.
    pub(super) answer: InBetweenAnswer,
    /// The frames between context and target.
    pub(super) generated: Clip,
    /// The rest of the answer.
    pub(super) answers: InBetweenAnswers,
}

/// Reads the clip and has the server fill its gap. Without `length` the gap keeps its length. Roots
/// are in the size of the character that wears the motion.
pub(super) async fn fill(
    context: &Context,
    gap: &Gap,
    length: Option<SegmentLength>,
    hero: Option<&Hero<'_>>,
) -> Result<Filled, Failure> {
    // Checked first, so that no work is lost.
    let roots = gap
        .roots
        .as_deref()
        .map(|file| read_roots(file, gap.from))
        .transpose()?;
    let (client, pack) = context.connect_to_pack(&gap.sampling.pack).await?;
    let clip = read_clip(
        &gap.clip,
        &pack,
        &gap.reading.of_input(&gap.clip, &pack),
        &context.term,
    )?;
    let roots = match (roots, hero) {
        (None, _) => Vec::new(),
        (Some(roots), hero) => {
            let scale = hero.map_or(Ok(1.0), |hero| hero.scale(pack.skeleton()))?;
            roots.into_iter().map(|root| root.key(scale)).collect()
        }
    };
    let targets = usize::from(gap.target_frames);
    let last_target = gap.to + targets - 1;
    let task = InBetween::from_clip_range(&clip, gap.from, gap.to..=last_target)?
        .seed(gap.sampling.seed)
        .temperature(gap.sampling.temperature)
        .pose_steps(gap.sampling.pose_steps)
        .hold_feet(!gap.sampling.free_feet)
        .strict(gap.strict)
        .root(roots);
    let task = match length {
        Some(length) => task.length(length),
        None => {
            pack.check_span(gap.from, last_target)?;
            task
        }
    };
    let mut answers = client.in_between_many(&pack, &[task]).await?;
    let broken = |e: AnswerError| Failure::Client(e.into());
    let answer = answers
        .characters
        .pop()
        .ok_or(AnswerError::Missing("characters"))
        .map_err(broken)?;
    let generated = answer
        .clip
        .slice(gap_of(&answer.clip, targets))
        .map_err(|e| broken(AnswerError::Frames(e)))?;
    Ok(Filled {
        pack,
        clip,
        answer,
        generated,
        answers,
    })
}
