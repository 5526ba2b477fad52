//! Arguments of `troupe style`.

use std::path::PathBuf;

use clap::{ArgMatches, Args, Command, FromArgMatches, Subcommand};

use crate::reading::Reading;

const HOW: &str = "How the style is used";
const BUILDING: &str = "Building";

/// Add ways to move, made from motion clips, and show those that a pack has.
#[derive(Debug, Args)]
pub(crate) struct Style {
    #[command(subcommand)]
    pub(super) action: Action,
}

#[derive(Debug, Subcommand)]
pub(super) enum Action {
    Add(Add),
    List(List),
    Show(Show),
    Build(Build),
}

/// Make a style from clips, and add it to the running server.
///
/// In each clip the command finds the cleanest cycle, from one strike of the left foot to the next,
/// and closes it so that it repeats without a seam. The pack's networks then rebuild every key pose
/// from the motion around it, so that the style holds poses that the pack can make. Styles that
/// come with the pack cannot be replaced.
#[derive(Debug, Args)]
#[command(after_long_help = "\
--gait, --from and --to belong to the --clip before them. Gaits whose names begin with `idle` stand still; \
every other goes somewhere.

Examples:
  troupe style add --name sneak --clip sneak.bvh
  troupe style add --name sneak --clip sneak.bvh --gait walk --from 40 --to 160 --clip stand.bvh --gait idle
  troupe style add --name guard --clip guard.bvh --static
  troupe style add --name sneak --clip sneak.bvh --out sneak.json")]
pub(super) struct Add {
    /// Name of the style: 1 to 64 letters, digits, '-', '_' or '.'.
    #[arg(long)]
    pub(super) name: String,

    #[command(flatten)]
    pub(super) sources: Sources,

    /// The style only stands. Its one --clip is searched for a still frame.
    #[arg(long = "static", help_heading = HOW)]
    pub(super) is_static: bool,

    /// Also write the style as JSON.
    #[arg(long, value_name = "FILE", help_heading = BUILDING)]
    pub(super) out: Option<PathBuf>,

    #[command(flatten)]
    pub(super) building: Building,

    /// Model pack. Default: the server's default pack.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME", help_heading = BUILDING)]
    pub(super) pack: String,

    #[command(flatten)]
    pub(super) reading: Reading,
}

/// How gaits are built.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct Building {
    /// Key poses of each moving gait, at equal steps through the cycle.
    #[arg(long, default_value_t = 12, value_name = "4-32", value_parser = clap::value_parser!(u32).range(4..=32), help_heading = BUILDING)]
    pub(super) keys: u32,
}

/// A clip, the gait that it shows, and the frames in which to look for it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Source {
    /// File of any format that is read.
    pub(super) clip: PathBuf,
    /// Name of the gait. None: `walk`, or `idle` of a style that only stands.
    pub(super) gait: Option<String>,
    /// First frame.
    pub(super) from: Option<usize>,
    /// Last frame.
    pub(super) to: Option<usize>,
}

/// One or more `--clip FILE [--gait NAME] [--from FRAME] [--to FRAME]`, distinguished by their
/// order.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sources(pub(super) Vec<Source>);

impl Args for Sources {
    fn augment_args(command: Command) -> Command {
        let repeated = |name: &'static str, value: &'static str| {
            clap::Arg::new(name)
                .long(name)
                .value_name(value)
                .action(clap::ArgAction::Append)
        };
        command
            .arg(
                repeated("clip", "FILE")
                    .required(true)
                    .value_parser(clap::value_parser!(PathBuf))
                    .help("Motion clip, .bvh, .glb (horse.glb#Walk for one animation of several) or .npz, or a robot's .csv or .npy; may be given again for another gait"),
            )
            .arg(repeated("gait", "NAME").help(
                "Gait that the clip shows, such as idle, walk, run, walk-left or walk-back; without it walk",
            ))
            .arg(
                repeated("from", "FRAME")
                    .value_parser(clap::value_parser!(usize))
                    .help("First frame of the clip to look at"),
            )
            .arg(
                repeated("to", "FRAME")
                    .value_parser(clap::value_parser!(usize))
                    .help("Last frame of the clip to look at"),
            )
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for Sources {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let clips = placed::<PathBuf>(matches, "clip");
        let mut sources: Vec<(usize, Source)> = clips
            .map(|(at, clip)| {
                let source = Source {
                    clip: clip.clone(),
                    gait: None,
                    from: None,
                    to: None,
                };
                (at, source)
            })
            .collect();
        for (at, gait) in placed::<String>(matches, "gait") {
            give(&mut sources, at, "--gait", gait.clone(), |s| &mut s.gait)?;
        }
        for (at, &from) in placed::<usize>(matches, "from") {
            give(&mut sources, at, "--from", from, |s| &mut s.from)?;
        }
        for (at, &to) in placed::<usize>(matches, "to") {
            give(&mut sources, at, "--to", to, |s| &mut s.to)?;
        }
        Ok(Self(sources.into_iter().map(|(_, source)| source).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The values of an argument with their places on the command line.
fn placed<'a, T: Clone + Send + Sync + 'static>(
    matches: &'a ArgMatches,
    name: &str,
) -> impl Iterator<Item = (usize, &'a T)> {
    let places = matches.indices_of(name).into_iter().flatten();
    places.zip(matches.get_many::<T>(name).into_iter().flatten())
}

/// Gives a value to the clip in front of it, once.
fn give<T>(
    sources: &mut [(usize, Source)],
    at: usize,
    flag: &str,
    value: T,
    slot: impl Fn(&mut Source) -> &mut Option<T>,
) -> Result<(), clap::Error> {
    let conflict = |why: &str| {
        clap::Error::raw(
            clap::error::ErrorKind::ArgumentConflict,
            format!("{flag} {why}\n"),
        )
    };
    let clip = sources.iter_mut().rev().find(|(place, _)| *place < at);
    let (_, source) =
        clip.ok_or_else(|| conflict("belongs to the --clip in front of it, and there is none"))?;
    if slot(source).replace(value).is_some() {
        return Err(conflict("is given twice for one --clip"));
    }
    Ok(())
}

/// List the styles of a pack.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe style list
  troupe style list --json | jq -r '.styles[].name'")]
pub(super) struct List {
    /// Model pack. Default: the server's default pack.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(super) pack: String,

    /// Print JSON.
    #[arg(long)]
    pub(super) json: bool,
}

/// Describe one style: its gaits, their speeds and periods.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe style show proud
  troupe style show proud --json > proud.json")]
pub(super) struct Show {
    /// The style.
    pub(super) name: String,

    /// Model pack. Default: the server's default pack.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(super) pack: String,

    /// Print JSON, keyframes included.
    #[arg(long)]
    pub(super) json: bool,
}

/// Make all styles of a list into files, such as a pack's own.
///
/// The list is a TOML file that names for each style the clips of its gaits. The running server's
/// pack rebuilds the poses; nothing is added to the server.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe style build --list models/human/styles.toml --data clips/ --out models/human/styles
  troupe style build --list models/human/styles.toml --data clips/ --out models/human/styles --only proud,sad")]
pub(super) struct Build {
    /// The list of styles.
    #[arg(long, value_name = "FILE")]
    pub(super) list: PathBuf,

    /// Folder of the files that the list names: .bvh, .glb or .npz, or .csv for a robot.
    #[arg(long, value_name = "DIR")]
    pub(super) data: PathBuf,

    /// Folder for the styles, a JSON file each.
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,

    /// Only these styles of the list.
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    pub(super) only: Vec<String>,

    #[command(flatten)]
    pub(super) building: Building,

    /// Model pack. Default: the server's default pack.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME", help_heading = BUILDING)]
    pub(super) pack: String,

    #[command(flatten)]
    pub(super) reading: Reading,
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        sources: Sources,
    }

    fn parse(line: &str) -> Result<Vec<Source>, String> {
        Line::try_parse_from(line.split(' '))
            .map(|l| l.sources.0)
            .map_err(|e| e.to_string())
    }

    #[test]
    fn each_flag_belongs_to_the_clip_in_front_of_it() {
        let sources =
            parse("x --clip a.bvh --gait run --to 9 --clip b.bvh --from 3 --clip c.bvh --gait idle").unwrap();
        let source = |clip: &str, gait: Option<&str>, from, to| Source {
            clip: clip.into(),
            gait: gait.map(str::to_owned),
            from,
            to,
        };
        let wanted = [
            source("a.bvh", Some("run"), None, Some(9)),
            source("b.bvh", None, Some(3), None),
            source("c.bvh", Some("idle"), None, None),
        ];
        assert_eq!(sources, wanted);
    }

    #[test]
    fn misplaced_flags_are_reported() {
        for (line, wanted) in [
            ("x", "--clip <FILE>"),
            (
                "x --gait run --clip a.bvh",
                "--gait belongs to the --clip in front of it",
            ),
            ("x --clip a.bvh --from 1 --from 2", "--from is given twice"),
            ("x --clip a.bvh --to end", "'end'"),
        ] {
            let error = parse(line).unwrap_err();
            assert!(error.contains(wanted), "{line}: {error}");
        }
    }
}
