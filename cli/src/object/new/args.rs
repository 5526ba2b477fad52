//! Arguments of `troupe object new`.

use std::fmt::Display;
use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;

use crate::pack_folder::PackFrom;
use crate::reading::Reading;

const THING: &str = "The object";
const USE: &str = "What happens";
const WRITING: &str = "Writing";

/// Make a definition from a motion clip.
///
/// Each of FRAMES becomes one phase (a set), in order: the character comes to the pose of that
/// frame, at the same place relative to the object. From one to the next it takes the time of the
/// clip, if a segment can have that many frames. The clip has no object, so the command places one:
/// --distance before the character, or in its hand (--hand).
///
/// Frames count from 0, at the pack's rate. The output is TOML with comments; docs/objects.md
/// explains its fields.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe object new --from bow.bvh --frames 20,58,90 --name wayside --distance 1.0 --hold 58=15 --soft 90=10 --out wayside.toml
  troupe object new --from greet.bvh --frames 12,40,70 --variant nod --distance 1.0 --into wayside.toml
  troupe object new --from reach.bvh --frames 30,55,80 --name cup --points Hand_R --hand Hand_R --hold 55 \
--release 80 --out cup.toml
  troupe object new --from bow.bvh --frames 20,58 --name wayside --pack-folder models/human | less
  troupe object new --skill --rebuild --pack g1 --from walk3_subject1.csv --start 6503 --frames 6519,6560,6602,6630 --hold 6560 \
--name sit-on-ground --out models/g1/skills/sit-on-ground.toml")]
pub(crate) struct New {
    /// Motion clip: .bvh, .glb (reach.glb#Pick for one animation of several) or .npz, or a robot's
    /// .csv or .npy.
    #[arg(long, value_name = "FILE")]
    pub(super) from: PathBuf,

    /// Frames of the clip that become keyframes, one set each, in the order of the sets. A frame
    /// may come again.
    #[arg(long, required = true, value_delimiter = ',', value_name = "FRAME,...")]
    pub(super) frames: Vec<usize>,

    /// Name of the definition: 1 to 64 letters, digits, '-', '_' or '.'.
    #[arg(long, value_parser = name, required_unless_present = "into", help_heading = THING)]
    pub(super) name: Option<String>,

    /// A sentence for people.
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true, help_heading = THING)]
    pub(super) description: String,

    /// Size of the object, metres: width, height and depth of a box that stands on its origin.
    /// Default: 0.4,0.9,0.4; with --hand 0.08,0.12,0.08; with --seat 0.45,M,0.45.
    #[arg(long, value_name = "box:W,H,D", help_heading = THING)]
    pub(super) shape: Option<Size>,

    /// Distance of the object before the character at --object-frame, metres. Below 0 it is behind
    /// the character.
    #[arg(
        long,
        default_value_t = 0.6,
        value_name = "M",
        value_parser = metres,
        allow_negative_numbers = true,
        help_heading = THING
    )]
    pub(super) distance: f32,

    /// Height of the object's origin over the ground in the clip, metres, for things that hang on a
    /// wall. Points count from there.
    #[arg(
        long,
        default_value_t = 0.0,
        value_name = "M",
        value_parser = metres,
        allow_negative_numbers = true,
        conflicts_with = "hand",
        help_heading = THING
    )]
    pub(super) height: f32,

    /// Frame at which the object is placed. Default: the first of FRAMES.
    #[arg(long, value_name = "FRAME", help_heading = THING)]
    pub(super) object_frame: Option<usize>,

    /// Whether keyframes turn about the object to the side from which the character comes, so that
    /// it works from every side. If not, the character must come from within 60 degrees of the
    /// object's front, which faces the character of the clip.
    #[arg(long, default_value_t = true, action = clap::ArgAction::Set, value_name = "BOOL", help_heading = THING)]
    pub(super) pivot: bool,

    /// Let any number of characters use it at once.
    #[arg(long, help_heading = THING, conflicts_with = "hand")]
    pub(super) shared: bool,

    /// Write a skill of a pack instead of an object. A character does a skill on the spot. Each
    /// keyframe is relative to the one before it, the first to --start. The file belongs into the
    /// folder `skills` of the pack.
    #[arg(
        long,
        conflicts_with_all = ["shape", "distance", "height", "object_frame", "pivot", "shared", "points", "seat", "from_stand",
            "hand", "release"],
        help_heading = THING
    )]
    pub(super) skill: bool,

    /// Frame of the clip at which the skill begins. Default: the first of FRAMES, which is then
    /// done on the spot.
    #[arg(long, value_name = "FRAME", requires = "skill", help_heading = THING)]
    pub(super) start: Option<usize>,

    /// At the last frame let the character stand as in its style, at that place, instead of in the
    /// pose of the clip.
    #[arg(long, requires = "skill", help_heading = THING)]
    pub(super) stand: bool,

    /// Name of this way to use the object. Default: the name of the definition.
    #[arg(long, value_name = "NAME", value_parser = name, help_heading = USE)]
    pub(super) variant: Option<String>,

    /// How often it is chosen, relative to other variants.
    #[arg(long, default_value_t = 1.0, value_name = "0-1000", allow_negative_numbers = true, help_heading = USE)]
    pub(super) weight: f32,

    /// Names of the sets, as many as FRAMES. Default: the variant's name and a number.
    #[arg(long, value_delimiter = ',', value_name = "NAME,...", value_parser = name, help_heading = USE)]
    pub(super) sets: Vec<String>,

    /// Positions of these joints alone, instead of whole poses. The rest of the body follows, at
    /// any height of the object.
    #[arg(long, value_delimiter = ',', value_name = "JOINT,...", help_heading = USE)]
    pub(super) points: Vec<String>,

    /// Hold this frame until the interaction is ended. The frames after it show how to leave. With
    /// FRAME=COUNT it is held for that number of frames. May be given again.
    #[arg(long, value_name = "FRAME[=COUNT]", value_parser = hold, help_heading = USE)]
    pub(super) hold: Vec<At<Option<u32>>>,

    /// The set of this frame need not be reached: the next may begin up to TAU frames before it.
    /// May be given again.
    #[arg(long, value_name = "FRAME=TAU", value_parser = at::<u32>, help_heading = USE)]
    pub(super) soft: Vec<At<u32>>,

    /// Sit at this frame, on a seat of this height in metres (0.3 to 0.7), in a clip without a
    /// seat: the hips go down and back, the feet stay, the hands lie on the thighs. The object is
    /// the seat, behind the character.
    #[arg(
        long,
        value_name = "FRAME=M",
        value_parser = at::<f32>,
        conflicts_with_all = ["hand", "points", "distance", "height", "object_frame"],
        help_heading = USE
    )]
    pub(super) seat: Option<At<f32>>,

    /// Stop before the first set. It looks calmer, and takes about a second longer.
    #[arg(long, help_heading = USE)]
    pub(super) from_stand: bool,

    /// Joint that takes the object at --object-frame. The middle of the object is --grip beyond the
    /// joint, and stays there.
    #[arg(long, value_name = "JOINT", conflicts_with = "distance", help_heading = USE)]
    pub(super) hand: Option<String>,

    /// Distance from the joint, along its bone, to the middle of the object, metres.
    #[arg(long, default_value_t = 0.09, value_name = "M", value_parser = metres, help_heading = USE)]
    pub(super) grip: f32,

    /// Frame at which the object is put down.
    #[arg(long, value_name = "FRAME", requires = "hand", help_heading = USE)]
    pub(super) release: Option<usize>,

    /// Have the networks of the server's pack rebuild every pose from the motion around it, so that
    /// the definition holds none of the clip.
    #[arg(long, conflicts_with = "pack_folder", help_heading = WRITING)]
    pub(super) rebuild: bool,

    /// File to write. Default: standard output.
    #[arg(long, value_name = "FILE", help_heading = WRITING)]
    pub(super) out: Option<PathBuf>,

    /// Replace --out if it exists, with all variants that were added to it.
    #[arg(long, requires = "out", help_heading = WRITING)]
    pub(super) force: bool,

    /// Definition (TOML) to add a variant to. The object itself stays as it is.
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["out", "name", "description", "shape", "shared"],
        requires = "variant",
        help_heading = WRITING
    )]
    pub(super) into: Option<PathBuf>,

    #[command(flatten)]
    pub(super) pack: PackFrom,

    #[command(flatten)]
    pub(super) reading: Reading,
}

/// A value for one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct At<T> {
    pub(super) frame: usize,
    pub(super) value: T,
}

/// Size of a box along x, y and z, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Size(pub(super) [f32; 3]);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "must be box:W,H,D, each 0.002 to 2000 metres, such as box:0.4,0.9,0.4".to_owned();
        let sizes = text.strip_prefix("box:").ok_or_else(wrong)?;
        let sizes: Vec<f32> =
            (sizes.split(',').map(str::parse).collect::<Result<_, _>>()).map_err(|_| wrong())?;
        match <[f32; 3]>::try_from(sizes) {
            Ok(sizes) if sizes.iter().all(|size| (0.002..=2000.0).contains(size)) => Ok(Self(sizes)),
            _ => Err(wrong()),
        }
    }
}

/// `FRAME=VALUE`.
fn at<T: FromStr<Err: Display>>(text: &str) -> Result<At<T>, String> {
    let (frame, value) = text.split_once('=').ok_or("must be FRAME=VALUE, such as 40=10")?;
    Ok(At {
        frame: frame.trim().parse().map_err(|e| format!("{frame:?}: {e}"))?,
        value: value.trim().parse().map_err(|e| format!("{value:?}: {e}"))?,
    })
}

/// `FRAME` or `FRAME=COUNT`.
fn hold(text: &str) -> Result<At<Option<u32>>, String> {
    match text.contains('=') {
        true => at(text).map(|At { frame, value }| At {
            frame,
            value: Some(value),
        }),
        false => Ok(At {
            frame: text.trim().parse().map_err(|e| format!("{text:?}: {e}"))?,
            value: None,
        }),
    }
}

fn metres(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(metres) if (-20.0..=20.0).contains(&metres) => Ok(metres),
        Ok(metres) => Err(format!("{metres} is not in -20 to 20 metres")),
        Err(e) => Err(e.to_string()),
    }
}

/// A name of a definition, variant or set.
fn name(text: &str) -> Result<String, String> {
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    match (1..=64).contains(&text.len()) && text.chars().all(fits) {
        true => Ok(text.to_owned()),
        false => Err("must have 1 to 64 letters, digits, '-', '_' or '.'".to_owned()),
    }
}
