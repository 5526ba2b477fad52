//! `troupe generate`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use glam::{Vec2, Vec3};
use serde_json::json;
use troupe_client::{Client, FollowPath, Pack};
use troupe_motion::clip::Clip;
use troupe_proto::v1::PathPlanner;

use crate::context::Context;
use crate::failure::Failure;
use crate::feasibility::{too_fast, verdict};
use crate::files::{Layout, close};
use crate::film::draw_motion;
use crate::hero::{OntoHero, Writer};
use crate::output::print;
use crate::own_body::OwnBody;
use crate::path::Path;
use crate::reading::Reading;

const SAMPLING: &str = "Style and sampling";
/// Have a body follow a path.
///
/// The network of a pack with the capability `path` moves many bodies. Other packs, such as g1,
/// walk along the path in one of their styles. The path is a file as for `drive`. Its start and its
/// waypoints count, with their speeds, waits and headings. Its commands and styles do not.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe generate --path examples/paths/square.toml --out walk.bvh
  troupe generate --skeleton g1 --path examples/paths/square.toml --style walk --out walk.csv
  troupe generate --skeleton g1 --path examples/paths/square.toml --style walk --planner own --out own.csv
  troupe generate --skeleton human --path examples/paths/square.toml --style walk=0.6 --style old=0.4 --out old.glb
  troupe generate --pack g1 --path examples/paths/square.toml --style march --out march.csv
  troupe generate --skeleton my-character.fbx --path examples/paths/square.toml --out mine.glb --loop
  troupe generate --skeleton horse --path examples/paths/square.toml --speed 3 --style trot --out trot.glb
  troupe generate --path examples/paths/square.toml --style walk --onto hero.glb --out hero-walk.glb")]
pub(crate) struct Generate {
    /// Path to follow (TOML).
    #[arg(long, value_name = "FILE")]
    pub(crate) path: PathBuf,

    /// File to write; its ending says the format: .bvh, .glb, .npz, or .csv and .npy (qpos) of a
    /// robot.
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,

    /// Layout of a robot's motion for its tracker.
    #[arg(long, value_enum)]
    pub(crate) layout: Option<Layout>,

    /// Model pack. Default: the first that has the body, or follows paths.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(crate) pack: String,

    /// Body of the pack that moves, or a file of motion whose skeleton moves. Default: the pack's
    /// default body, or its only one.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME|FILE")]
    pub(crate) skeleton: String,

    /// Word of the pack, alone or with a weight of 0 to 1. May be given several times, for a blend;
    /// once for a pack that walks.
    #[arg(long, help_heading = SAMPLING, value_name = "WORD[=WEIGHT]")]
    pub(crate) style: Vec<Word>,

    /// Speed, in metres a second, instead of the speeds of the path.
    #[arg(long, help_heading = SAMPLING, value_name = "0.05-15")]
    pub(crate) speed: Option<f32>,

    /// Length of the motion, in seconds. Default: the time of the path.
    #[arg(long, help_heading = SAMPLING, value_name = "SECONDS")]
    pub(crate) seconds: Option<f32>,

    /// The same seed, path and pack give the same motion.
    #[arg(long, help_heading = SAMPLING, default_value_t = 0)]
    pub(crate) seed: u64,

    /// Refuse a path that is not feasible for the body, judged by its data.
    #[arg(long)]
    pub(crate) strict: bool,

    /// Whose network plans the path of a body on two legs. Notes say which pack it was.
    #[arg(long, value_enum, default_value_t = Planner::Auto)]
    pub(crate) planner: Planner,

    /// Write the network's own frames: standing feet are not held.
    #[arg(long)]
    pub(crate) raw: bool,

    /// Also draw the motion: its path, and poses along it (PNG).
    #[arg(long, value_name = "FILE")]
    pub(crate) picture: Option<PathBuf>,

    /// Make the motion loop. It is cut in its last quarter, at the frame most like the first. The
    /// rest of the difference is spread over all frames.
    #[arg(long = "loop")]
    pub(crate) loops: bool,

    #[command(flatten)]
    pub(crate) onto: OntoHero,

    /// Print what was done as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Whose network plans a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Planner {
    /// A pack of the same body, or for robots one of a robot, if it has the style and keeps up with
    /// the path. Otherwise the body's own pack.
    Auto,
    /// The body's own pack.
    Own,
    /// Another pack that walks; refused if none can.
    Carried,
}

impl From<Planner> for PathPlanner {
    fn from(planner: Planner) -> Self {
        match planner {
            Planner::Auto => Self::Auto,
            Planner::Own => Self::Own,
            Planner::Carried => Self::Carried,
        }
    }
}

/// A word and its weight.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Word {
    word: String,
    weight: f32,
}

impl FromStr for Word {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (word, weight) = match text.split_once('=') {
            Some((word, weight)) => (
                word,
                weight.parse().map_err(|_| format!("{weight:?} is no number"))?,
            ),
            None => (text, 1.0),
        };
        match word.is_empty() {
            true => Err("the word is missing".to_owned()),
            false => Ok(Self {
                word: word.to_owned(),
                weight,
            }),
        }
    }
}

pub(super) async fn run(context: &Context, command: &Generate) -> Result<(), Failure> {
    let hero = command.onto.read(&context.term)?;
    let hero = hero.as_ref();
    let writer = Writer::of(&command.out, command.layout, hero)?;
    let path = Path::read(&command.path)?;
    let own = OwnBody::read(&command.skeleton, &context.term)?;
    let (client, pack) = connect(context, command, own.is_some()).await?;
    let pack = match &own {
        Some(own) => own.on(&pack),
        None => pack.of_body(&command.skeleton)?,
    };
    writer.fits(&pack, (&command.out, hero))?;
    let scale = hero.map_or(Ok(1.0), |hero| hero.scale(pack.skeleton()))?;
    let asked = std::time::Instant::now();
    let mut request = request(&path.sized(1.0 / scale), command, scale);
    if let Some(own) = &own {
        request = request.skeleton(own.message());
    }
    let mut made = client.follow(&pack, &request).await?.whole().await?;
    let took_ms = asked.elapsed().as_secs_f64() * 1e3;
    if command.loops {
        made.clip = close(&made.clip, &context.term).map_err(|e| Failure::Other(e.to_string()))?;
    }
    if let Some(hero) = hero {
        made.clip = hero.wear(&made.clip, &made.clip, &context.term)?;
    }
    writer.write(&made.clip, &command.out, "generated", &Reading::default())?;
    if let Some(file) = &command.picture {
        let png = draw(&path, &pack, &made.clip, command).map_err(Failure::Other)?;
        std::fs::write(file, png).map_err(|e| Failure::output(file, e))?;
    }

    let (out, frames) = (command.out.display(), made.clip.frames());
    if command.json {
        return print(&format!(
            "{:#}",
            json!({
                "out": out.to_string(),
                "frames": frames,
                "pack": pack.name(),
                "pack_version": pack.description().version,
                "skeleton": body(&pack, command),
                "notes": made.notes,
                "feasibility": made.feasibility,
                "took_ms": took_ms,
            })
        ));
    }
    for note in &made.notes {
        context.term.note(format_args!("note: {note}"));
    }
    context.term.note(format_args!(
        "{frames} frames of {} by {} {} written to {out}",
        body(&pack, command),
        pack.name(),
        pack.description().version
    ));
    if let Some(found) = &made.feasibility {
        context
            .term
            .note(format_args!("{}", verdict(found, pack.skeleton())));
    }
    if let Some(text) = too_fast(&made.clip) {
        context.term.note(text);
    }
    Ok(())
}

/// Connects and fetches the pack that is named, or one for the body that is named.
async fn connect(context: &Context, command: &Generate, has_own: bool) -> Result<(Client, Pack), Failure> {
    if !command.pack.is_empty() || command.skeleton.is_empty() || has_own {
        return context.connect_to_able("path", &command.pack).await;
    }
    let client = context.connect().await?;
    let packs = client.packs().await?;
    let has_body = |pack: &&Pack| {
        let mut bodies = pack.description().bodies.iter();
        bodies.any(|body| body.name == command.skeleton)
    };
    let of_its_own = || packs.iter().find(|pack| pack.name() == command.skeleton);
    let Some(pack) = packs.iter().find(has_body).or_else(of_its_own) else {
        return Err(Failure::Other(format!(
            "the server has no pack with the body `{}`",
            command.skeleton
        )));
    };
    // The list leaves out the joints of bodies.
    let pack = client.pack(pack.name()).await?;
    Ok((client, pack))
}

/// Name of the body that moves, or its file.
fn body<'a>(pack: &'a Pack, command: &'a Generate) -> &'a str {
    match (pack.body(), &*command.skeleton) {
        ("", "") => pack.name(),
        ("", own) => own,
        (body, _) => body,
    }
}

fn draw(path: &Path, pack: &Pack, clip: &Clip, command: &Generate) -> Result<Vec<u8>, String> {
    let words: Vec<&str> = command.style.iter().map(|style| &*style.word).collect();
    let way: Vec<Vec2> = std::iter::once(path.start)
        .chain(path.waypoints.iter().map(|point| point.at))
        .collect();
    let title = match &path.title {
        Some(title) => format!("{title}, {}", body(pack, command)),
        None => body(pack, command).to_owned(),
    };
    let end = clip.root_positions.last().zip(way.last());
    let off = end.map(|(root, end)| end.distance(Vec2::new(root.x, root.z)));
    let end = off.map_or_else(String::new, |off| {
        format!(" · ends {off:.2} m from the path's end")
    });
    let about = format!(
        "{} {} · {:.1} s{end}",
        pack.name(),
        pack.description().version,
        clip.duration_s()
    );
    draw_motion(clip, &way, &words.join(" "), (title, about))
}

/// The request for the path with the options, whose speed is divided by `scale`.
fn request(path: &Path, command: &Generate, scale: f32) -> FollowPath {
    let place = |at: Vec2| Vec3::new(at.x, 0.0, at.y);
    let (mut time_s, mut from, mut facing) = (0.0, path.start, None);
    let mut points = vec![(place(path.start), Some(path.heading), Some(0.0))];
    // Headings count only if a waypoint has one. Else the body heads along its way.
    let says = path.waypoints.iter().any(|point| point.manner.facing.is_some());
    for point in &path.waypoints {
        let speed = command.speed.map_or(point.speed_mps, |speed| speed / scale);
        time_s += (from.distance(point.at) / speed.max(0.01)).max(0.01);
        facing = point.manner.facing.or(facing);
        points.push((place(point.at), facing, Some(time_s)));
        if point.wait_s > 0.0 {
            time_s += point.wait_s;
            points.push((place(point.at), facing, Some(time_s)));
        }
        from = point.at;
    }
    if !says {
        points.iter_mut().for_each(|point| point.1 = None);
    }
    let mut asked = FollowPath::through(points)
        .strict(command.strict)
        .raw(command.raw)
        .planner(command.planner.into())
        .seed(command.seed);
    for Word { word, weight } in &command.style {
        asked = asked.style(word, *weight);
    }
    if let Some(seconds) = command.seconds.or(path.seconds) {
        asked = asked.seconds(seconds);
    }
    asked
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Command {
        #[command(flatten)]
        generate: Generate,
    }

    #[test]
    fn the_planner_is_automatic_unless_another_is_named() {
        let parse = |more: &[&str]| {
            let given = ["generate", "--path", "p.toml", "--out", "o.bvh"];
            Command::try_parse_from(given.iter().chain(more))
        };
        let planner = |more: &[&str]| PathPlanner::from(parse(more).unwrap().generate.planner);
        assert_eq!(planner(&[]), PathPlanner::Auto);
        assert_eq!(planner(&["--planner", "own"]), PathPlanner::Own);
        assert_eq!(planner(&["--planner", "carried"]), PathPlanner::Carried);
        let error = parse(&["--planner", "both"]).unwrap_err().to_string();
        assert!(error.contains("auto, own, carried"), "{error}");
    }

    #[test]
    fn a_word_may_have_a_weight() {
        let word = |word: &str, weight| {
            Ok(Word {
                word: word.into(),
                weight,
            })
        };
        assert_eq!("walk".parse(), word("walk", 1.0));
        assert_eq!("old=0.4".parse(), word("old", 0.4));
        assert!("old=much".parse::<Word>().unwrap_err().contains("much"));
        assert!("=1".parse::<Word>().is_err());
    }
}
