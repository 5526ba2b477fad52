//! How a clip's file is read: the options that every command has that reads clips.

use std::path::Path;
use std::sync::Arc;

use clap::Args;
use troupe_client::Pack;
use troupe_motion::read::{
    AngleUnit, JointOrder, LeadingPose, Options, QuaternionOrder, ROBOT_ENDINGS, RestPose, Up, units,
};
use troupe_motion::skeleton::Skeleton;

const CLIPS: &str = "Clip files";
/// Unit of BVH files that are written without `--unit`, metres.
const CENTIMETRE_M: f64 = 0.01;

/// What a file may leave open. Without an option, the file's own motion decides if it can.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct Reading {
    /// Axis of the file that points up: x, y, z, -x, -y or -z. Default: the one along which the
    /// body stands.
    #[arg(long, help_heading = CLIPS, value_name = "AXIS", value_parser = up, allow_hyphen_values = true)]
    pub up: Option<Up>,

    /// Unit of length of the file: m, ft, dm, cmu, in, cm or mm. Default: the one in which the body
    /// has its size. `inbetween` and `say` also write BVH files in it, else in centimetres.
    #[arg(long, help_heading = CLIPS, value_name = "UNIT", value_parser = unit_m)]
    pub unit: Option<f64>,

    /// Frames a second of the file. Default: as the file says; 30 for a robot's .csv and .npy. A
    /// glTF file is sampled at this rate.
    #[arg(long, help_heading = CLIPS, value_name = "HZ")]
    pub fps: Option<f32>,

    /// Animation of a file that has several. horse.glb#Walk says the same.
    #[arg(long, help_heading = CLIPS, value_name = "NAME")]
    pub animation: Option<String>,

    /// Joint that is the character's root. Default: the one that carries the body.
    #[arg(long, help_heading = CLIPS, value_name = "JOINT")]
    pub root: Option<String>,

    /// Rest pose of the file's skeleton: t, a, standing or none. Default: as its bones stand.
    #[arg(long, help_heading = CLIPS, value_name = "POSE", value_parser = rest_pose)]
    pub rest_pose: Option<RestPose>,

    /// What to do with a first frame in the rest pose: find, keep or drop. Find leaves it out if
    /// the motion jumps from it, but keeps all frames of a clip on a pack's skeleton.
    #[arg(long, help_heading = CLIPS, value_name = "WAY", value_parser = leading_pose)]
    pub leading_pose: Option<LeadingPose>,

    /// Farthest that a joint may slide in its parent, in metres. It is held at its mean place.
    /// Default: a fifth of the body's height.
    #[arg(long, help_heading = CLIPS, value_name = "METRES")]
    pub max_slide: Option<f32>,

    /// Also take clips whose bones have other lengths. Their rotations are played on the pack's
    /// bones.
    #[arg(long, help_heading = CLIPS)]
    pub other_bones: bool,

    /// Order of a robot's quaternion: xyzw or wxyz. Default: the format's, if the robot is upright
    /// with it.
    #[arg(long, help_heading = CLIPS, value_name = "ORDER", value_parser = quaternion)]
    pub quaternion: Option<QuaternionOrder>,

    /// A robot's angles are in degrees. --degrees=false says that they are in radians.
    #[arg(
        long,
        help_heading = CLIPS,
        value_name = "BOOL",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "true"
    )]
    pub degrees: Option<bool>,

    /// Order of a robot's angles: tree (the pack's), isaaclab, or the names of all joints between
    /// commas.
    #[arg(long, help_heading = CLIPS, value_name = "ORDER", value_parser = joint_order)]
    pub joint_order: Option<JointOrder>,
}

impl Reading {
    /// The reader's options, to read onto a skeleton or onto the file's own.
    pub(crate) fn options(&self, skeleton: Option<&Arc<Skeleton>>) -> Options {
        Options {
            up: self.up,
            unit_m: self.unit,
            fps: self.fps,
            animation: self.animation.clone(),
            root: self.root.clone(),
            rest_pose: self.rest_pose,
            leading_pose: self.leading_pose.unwrap_or_default(),
            max_slide_m: self.max_slide,
            skeleton: skeleton.cloned(),
            other_bones: self.other_bones,
            quaternion: self.quaternion,
            angles: self.degrees.map(|are_degrees| match are_degrees {
                true => AngleUnit::Degrees,
                false => AngleUnit::Radians,
            }),
            joint_order: self.joint_order.clone(),
            ..Options::default()
        }
    }

    /// The same for the input of a command that also writes BVH files in `--unit`. A robot's file
    /// is in metres, so that the option is of the output alone.
    pub(crate) fn of_input(&self, path: &Path, pack: &Pack) -> Self {
        let ending = path.extension().unwrap_or_default();
        let is_robots = ROBOT_ENDINGS.iter().any(|of| ending.eq_ignore_ascii_case(of));
        Self {
            unit: self.unit.filter(|_| !(is_robots && pack.robot().is_some())),
            ..self.clone()
        }
    }

    /// Units a metre of a BVH file that is written.
    pub(crate) fn bvh_units_per_metre(&self) -> f32 {
        (1.0 / self.unit.unwrap_or(CENTIMETRE_M)) as f32
    }
}

fn up(text: &str) -> Result<Up, String> {
    Up::of_name(text).ok_or_else(|| "must be x, y, z, -x, -y or -z".to_owned())
}

pub(crate) fn unit_m(text: &str) -> Result<f64, String> {
    units::metres_of(text).ok_or_else(|| format!("must be one of {}", units::names()))
}

fn rest_pose(text: &str) -> Result<RestPose, String> {
    RestPose::of_name(text).ok_or_else(|| "must be t, a, standing or none".to_owned())
}

fn leading_pose(text: &str) -> Result<LeadingPose, String> {
    LeadingPose::of_name(text).ok_or_else(|| "must be find, keep or drop".to_owned())
}

fn quaternion(text: &str) -> Result<QuaternionOrder, String> {
    QuaternionOrder::of_name(text).ok_or_else(|| "must be xyzw or wxyz".to_owned())
}

/// Names are checked when a robot is known.
fn joint_order(text: &str) -> Result<JointOrder, std::convert::Infallible> {
    Ok(JointOrder::of_name(text))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        reading: Reading,
    }

    fn parse(line: &str) -> Result<Reading, clap::Error> {
        let words = std::iter::once("line").chain(line.split_whitespace());
        Ok(Line::try_parse_from(words)?.reading)
    }

    #[test]
    fn every_option_reaches_the_reader() {
        let reading = parse(
            "--up -z --unit in --fps 60 --animation Walk --root Hips --rest-pose a --leading-pose keep \
             --max-slide 0.5 --other-bones --quaternion wxyz --degrees --joint-order isaaclab",
        );
        let options = reading.unwrap().options(None);
        assert_eq!((options.up, options.unit_m), (Some(Up::MinusZ), Some(0.0254)));
        assert_eq!((options.fps, options.max_slide_m), (Some(60.0), Some(0.5)));
        assert_eq!(options.animation.as_deref(), Some("Walk"));
        assert_eq!(options.root.as_deref(), Some("Hips"));
        assert_eq!(options.rest_pose, Some(RestPose::A));
        assert_eq!(options.leading_pose, LeadingPose::Keep);
        assert!(options.other_bones);
        assert_eq!(options.quaternion, Some(QuaternionOrder::Wxyz));
        assert_eq!(options.angles, Some(AngleUnit::Degrees));
        assert_eq!(options.joint_order, Some(JointOrder::BreadthFirst));
    }

    #[test]
    fn radians_can_be_asked_for() {
        let angles = |line: &str| parse(line).unwrap().options(None).angles;
        assert_eq!(angles("--degrees=false"), Some(AngleUnit::Radians));
        assert_eq!(angles(""), None);
    }

    #[test]
    fn wrong_values_are_named_with_those_that_are_allowed() {
        for (line, wanted) in [
            ("--up w", "x, y, z, -x, -y or -z"),
            ("--unit yard", "cm, mm"),
            ("--rest-pose sitting", "t, a, standing or none"),
            ("--leading-pose find-it", "find, keep or drop"),
            ("--quaternion zyxw", "xyzw or wxyz"),
        ] {
            let error = parse(line).unwrap_err().to_string();
            assert!(error.contains(wanted), "{line}: {error}");
        }
    }

    #[test]
    fn the_unit_of_a_written_file_is_not_that_of_a_robots_input() {
        let robot = Pack::try_from(crate::testing::hopper()).unwrap();
        let human = Pack::try_from(crate::testing::pair()).unwrap();
        let reading = parse("--unit m --fps 60").unwrap();
        let input = |path: &str, pack| reading.of_input(Path::new(path), pack);
        assert_eq!(
            (input("hop.CSV", &robot).unit, input("hop.csv", &robot).fps),
            (None, Some(60.0))
        );
        for (path, pack) in [("hop.bvh", &robot), ("walk.npz", &human)] {
            assert_eq!(input(path, pack), reading);
        }
    }

    #[test]
    fn bvh_files_are_written_in_centimetres_or_the_given_unit() {
        assert_eq!(Reading::default().bvh_units_per_metre(), 100.0);
        assert_eq!(parse("--unit m").unwrap().bvh_units_per_metre(), 1.0);
    }
}
