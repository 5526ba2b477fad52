//! Reading clips and writing motion.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ValueEnum;
use troupe_client::{ClientError, Pack};
use troupe_motion::bvh::{self, BvhFile, BvhWriteOptions};
use troupe_motion::clip::{Clip, ClipError};
use troupe_motion::files;
use troupe_motion::glb::write_glb;
use troupe_motion::looping;
use troupe_motion::read::Understood;
use troupe_motion::robot::{reference, sonic_files, write_csv};
use troupe_motion::skeleton::Skeleton;
use troupe_proto::v1;

use crate::context::Context;
use crate::failure::Failure;
use crate::reading::Reading;
use crate::term::Term;
use crate::understand::{ending, note, understand};

/// Endings of formats that are read, but not written.
const ONLY_READ: [&str; 2] = ["gltf", "fbx"];

/// The file of a clip that is named without its ending: the first existing file of a format that
/// [`read_clip`] takes. If none exists, the name in the format of the pack's own clips: CSV of a
/// robot, else BVH.
pub fn clip_in(folder: &Path, name: &str, pack: &Pack) -> PathBuf {
    let first = match pack.robot() {
        Some(_) => "csv",
        None => "bvh",
    };
    let (name, animation) = match name.split_once('#') {
        Some((name, animation)) => (name, format!("#{animation}")),
        None => (name, String::new()),
    };
    let file = |ending: &str| folder.join(format!("{name}.{ending}"));
    let there = std::iter::once(first)
        .chain(files::Format::ALL.map(files::Format::ending))
        .chain(ONLY_READ)
        .find(|ending| file(ending).is_file());
    let mut path = file(there.unwrap_or(first)).into_os_string();
    path.push(animation);
    path.into()
}

/// Reads a clip of any format onto a pack's skeleton and at its rate. What was repaired, what looks
/// odd and an assumed rate are noted, a line each.
///
/// # Errors
/// [`Failure::Input`] with the file and what is wrong with it.
pub fn read_clip(path: &Path, pack: &Pack, reading: &Reading, term: &Term) -> Result<Clip, Failure> {
    let options = reading.options(Some(pack.skeleton()));
    let Understood { clip, report, .. } =
        understand(path, options, Some(pack.fps())).map_err(|why| Failure::file(path, why))?;
    note(path, &report, term);
    if (clip.fps - pack.fps()).abs() < 1e-2 {
        return Ok(Clip {
            fps: pack.fps(),
            ..clip
        });
    }
    let resampled = clip.resample(pack.fps()).map_err(|e| Failure::file(path, e))?;
    term.note(format_args!(
        "{}: resampled from {} to {} frames per second, {} frames; frame numbers count the resampled ones",
        path.display(),
        clip.fps,
        resampled.fps,
        resampled.frames()
    ));
    Ok(resampled)
}

/// Reads a clip onto a skeleton at the file's own rate, joints by name or by the hinges of the
/// skeleton's robot. The animation of a glTF file is sampled at `gltf_fps`, unless `--fps` says
/// otherwise. The path may end with `#` and the name of one animation of several.
///
/// # Errors
/// A sentence that says what is wrong with the file.
pub fn read_clip_on(
    path: &Path,
    skeleton: &Arc<Skeleton>,
    reading: &Reading,
    gltf_fps: Option<f32>,
) -> Result<Clip, String> {
    let understood = understand(path, reading.options(Some(skeleton)), gltf_fps);
    Ok(understood.map_err(|why| why.to_string())?.clip)
}

/// Reads the document of a scene or an object definition.
pub(super) fn read_document(path: &Path) -> Result<v1::Document, Failure> {
    let format = match ending(path).as_deref() {
        Some("toml") => v1::DocumentFormat::Toml,
        Some("json") => v1::DocumentFormat::Json,
        _ => {
            let why = "the ending says the format and must be .toml or .json";
            return Err(Failure::file(path, why));
        }
    };
    Ok(v1::Document {
        format: format.into(),
        text: std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))?,
    })
}

/// The failure of a call with the document in `path`. If the server refuses the document, the
/// failure names the file.
pub(super) fn document_failure(path: &Path, error: ClientError) -> Failure {
    match error {
        ClientError::Refused(refusal) if refusal.reason.as_deref() == Some("INVALID_DOCUMENT") => {
            Failure::file(path, refusal.message)
        }
        other => other.into(),
    }
}

/// A layout of a robot's motion for its tracker, 50 frames a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Layout {
    /// BeyondMimic's arrays in an .npz.
    #[value(name = "beyondmimic")]
    BeyondMimic,
    /// SONIC's CSV files in a folder.
    Sonic,
}

/// A format to write motion in, which follows from a file's ending or is a tracker's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    File(files::Format),
    Tracker(Layout),
}

impl Format {
    pub(super) const BVH: Self = Self::File(files::Format::Bvh);

    /// The format of a file by its ending.
    pub(super) fn of(path: &Path) -> Result<Self, Failure> {
        files::Format::of_ending(path).map(Self::File).ok_or_else(|| {
            Failure::file(
                path,
                "the ending says the format and must be .bvh or .glb, .npz for arrays, or .csv or .npy for a robot",
            )
        })
    }

    /// The format of a layout, or of a file by its ending.
    pub(super) fn of_layout(path: &Path, layout: Option<Layout>) -> Result<Self, Failure> {
        match layout {
            None => Self::of(path),
            Some(Layout::BeyondMimic) if ending(path).as_deref() != Some("npz") => {
                let why = "--layout beyondmimic writes one file, whose ending must be .npz";
                Err(Failure::file(path, why))
            }
            Some(Layout::Sonic) if path.is_file() => {
                let why = "--layout sonic writes several files into a folder, but this is a file";
                Err(Failure::file(path, why))
            }
            Some(layout) => Ok(Self::Tracker(layout)),
        }
    }

    /// Whether it holds hinge angles, so only a robot's motion.
    pub(super) fn is_for_robots(self) -> bool {
        match self {
            Self::File(format) => format.is_for_robots(),
            Self::Tracker(_) => true,
        }
    }

    /// Checks that clips of a server's pack can be written in this format, before any work on them.
    pub(super) async fn check(self, context: &Context, pack: &str, path: &Path) -> Result<(), Failure> {
        if !self.is_for_robots() {
            return Ok(());
        }
        let (_, pack) = context.connect_to_pack(pack).await?;
        self.fits(&pack, path)
    }

    /// The same for a known pack.
    pub(super) fn fits(self, pack: &Pack, path: &Path) -> Result<(), Failure> {
        if !self.is_for_robots() || pack.robot().is_some() {
            return Ok(());
        }
        let body = match pack.body() {
            "" => "the body",
            body => body,
        };
        Err(Failure::file(
            path,
            format_args!(
                "{body} of pack `{}` is no robot, whose angles {self} holds; write .bvh or .glb",
                pack.name()
            ),
        ))
    }

    /// Writes a clip: BVH in the unit of `--unit` or in centimetres, all other formats in metres.
    /// CSV and `qpos` have 30 rows a second, trackers' layouts 50.
    pub(super) fn write(self, clip: &Clip, path: &Path, reading: &Reading) -> Result<(), Failure> {
        let bytes = match self {
            Self::File(format) => bytes(format, clip, reading),
            Self::Tracker(Layout::BeyondMimic) => files::write_beyond_mimic(clip).map_err(|e| e.to_string()),
            Self::Tracker(Layout::Sonic) => return write_sonic(clip, path),
        };
        let bytes = bytes.map_err(|why| Failure::output(path, why))?;
        std::fs::write(path, bytes).map_err(|e| Failure::output(path, e))
    }
}

/// As a sentence names it: an ending, or an option.
impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(format) => write!(f, ".{}", format.ending()),
            Self::Tracker(Layout::BeyondMimic) => f.write_str("--layout beyondmimic"),
            Self::Tracker(Layout::Sonic) => f.write_str("--layout sonic"),
        }
    }
}

/// Makes a motion loop, and notes how far poses were changed.
///
/// # Errors
/// [`ClipError`] if it has one frame.
pub(super) fn close(clip: &Clip, term: &Term) -> Result<Clip, ClipError> {
    let looped = looping::close(clip)?;
    term.note(format_args!(
        "looped at frame {}: joints turned by up to {:.1}°, the root raised or lowered by up to {:.0} mm",
        looped.clip.frames(),
        looped.turned_rad.to_degrees(),
        1e3 * looped.raised_m
    ));
    Ok(looped.clip)
}

/// The whole file of a clip.
fn bytes(format: files::Format, clip: &Clip, reading: &Reading) -> Result<Vec<u8>, String> {
    let rows = || clip.resample(files::DEFAULT_FPS).map_err(|e| e.to_string());
    match format {
        files::Format::Bvh => {
            let options = BvhWriteOptions {
                units_per_metre: reading.bvh_units_per_metre(),
                ..BvhWriteOptions::default()
            };
            let file = BvhFile::from_clip(clip, &options).map_err(|e| e.to_string())?;
            Ok(bvh::write(&file).into_bytes())
        }
        files::Format::Glb => write_glb(clip).map_err(|e| e.to_string()),
        files::Format::Npz => files::write_npz(clip).map_err(|e| e.to_string()),
        files::Format::Csv => write_csv(&rows()?)
            .map(String::into_bytes)
            .map_err(|e| e.to_string()),
        files::Format::Npy => files::write_qpos(&rows()?).map_err(|e| e.to_string()),
    }
}

/// Writes SONIC's files into a folder, whose name is that of the motion.
fn write_sonic(clip: &Clip, folder: &Path) -> Result<(), Failure> {
    let reference = reference(clip).map_err(|e| Failure::output(folder, e))?;
    std::fs::create_dir_all(folder).map_err(|e| Failure::output(folder, e))?;
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    for (file, text) in sonic_files(&reference, &name) {
        let path = folder.join(file);
        std::fs::write(&path, text).map_err(|e| Failure::output(&path, e))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;

    #[test]
    fn the_ending_says_the_format() {
        assert_eq!(Format::of(Path::new("a/b.BVH")).unwrap(), Format::BVH);
        for format in files::Format::ALL {
            let path = PathBuf::from(format!("b.{}", format.ending()));
            assert_eq!(Format::of(&path).unwrap(), Format::File(format));
        }
        for path in ["b.fbx", "bvh", "b."] {
            let failure = Format::of(Path::new(path)).unwrap_err().to_string();
            assert!(failure.contains(".bvh or .glb"), "{failure}");
        }
    }

    #[test]
    fn a_robots_clip_is_written_and_read() {
        let pack = Pack::try_from(crate::testing::hopper()).unwrap();
        let reading = &Reading::default();
        let folder = std::env::temp_dir().join(format!("troupe-robot-csv-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("hop.CSV");
        std::fs::write(&path, "2,1,0.9,0,0,0,1,0.4\n2.1,1,0.9,0,0,0,1,0.5\n").unwrap();
        let clip = read_clip(&path, &pack, reading, &Term::new(true)).unwrap();
        assert_eq!((clip.frames(), clip.root_positions[1].z), (2, 2.1));
        Format::of(&path).unwrap().write(&clip, &path, reading).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.ends_with("0.000000,1.000000,0.500000\n"), "{text}");
        let qpos = folder.join("hop.npy");
        Format::of(&qpos).unwrap().write(&clip, &qpos, reading).unwrap();
        let again = read_clip(&qpos, &pack, reading, &Term::new(true)).unwrap();
        assert!(again.root_positions[1].abs_diff_eq(clip.root_positions[1], 1e-6));
        std::fs::write(&path, "2,1,0.9\n").unwrap();
        let failure = read_clip(&path, &pack, reading, &Term::new(true))
            .unwrap_err()
            .to_string();
        assert!(
            failure.contains("hop.CSV: 3 columns; robot hopper has 8"),
            "{failure}"
        );
        let human = Pack::try_from(crate::testing::pair()).unwrap();
        let failure = read_clip(&path, &human, reading, &Term::new(true))
            .unwrap_err()
            .to_string();
        assert!(failure.contains("angles of a robot's hinges"), "{failure}");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_layout_says_what_its_files_are() {
        let of = |path: &str, layout| Format::of_layout(Path::new(path), Some(layout));
        assert_eq!(
            of("walk.npz", Layout::BeyondMimic).unwrap(),
            Format::Tracker(Layout::BeyondMimic)
        );
        assert_eq!(of("walk", Layout::Sonic).unwrap(), Format::Tracker(Layout::Sonic));
        let failure = of("walk.csv", Layout::BeyondMimic).unwrap_err().to_string();
        assert!(failure.contains("must be .npz"), "{failure}");
    }

    #[test]
    fn a_clip_is_found_in_any_format() {
        let pack = Pack::try_from(crate::testing::pair()).unwrap();
        let robot = Pack::try_from(crate::testing::hopper()).unwrap();
        let folder = std::env::temp_dir().join(format!("troupe-clip-in-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let found = |name: &str, pack: &Pack| {
            let path = clip_in(&folder, name, pack);
            path.file_name().unwrap().to_str().unwrap().to_owned()
        };
        assert_eq!(
            (found("walk", &pack), found("walk", &robot)),
            ("walk.bvh".into(), "walk.csv".into())
        );
        std::fs::write(folder.join("walk.glb"), "").unwrap();
        assert_eq!(found("walk", &pack), "walk.glb");
        assert_eq!(found("walk#Slow", &robot), "walk.glb#Slow");
        std::fs::write(folder.join("walk.bvh"), "").unwrap();
        assert_eq!(
            (found("walk", &pack), found("walk", &robot)),
            ("walk.bvh".into(), "walk.bvh".into())
        );
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_glb_is_read_onto_the_packs_skeleton_at_its_rate() {
        let pack = Pack::try_from(crate::testing::pair()).unwrap();
        let reading = &Reading::default();
        let clip = Clip::new(
            Arc::clone(pack.skeleton()),
            60.0,
            (0..5).map(|f| Vec3::Z * f as f32).collect(),
            vec![Quat::IDENTITY; 10],
        );
        let path = std::env::temp_dir().join(format!("troupe-pair-{}.glb", std::process::id()));
        Format::of(&path)
            .unwrap()
            .write(&clip.unwrap(), &path, reading)
            .unwrap();
        let read = read_clip(&path, &pack, reading, &Term::new(true)).unwrap();
        assert_eq!((read.fps, read.frames()), (30.0, 3));
        assert!(read.root_positions[1].abs_diff_eq(Vec3::Z * 2.0, 1e-5));
        let mut other = crate::testing::pair();
        other.joints[1].offset = Some(v1::Vec3 {
            x: 0.0,
            y: -1.5,
            z: 0.0,
        });
        let other = Pack::try_from(other).unwrap();
        let failure = read_clip(&path, &other, reading, &Term::new(true))
            .unwrap_err()
            .to_string();
        assert!(
            failure.contains("\"Foot\" stands 0.6") && failure.contains("--other-bones"),
            "{failure}"
        );
        let reading = &Reading {
            other_bones: true,
            ..Reading::default()
        };
        assert!(read_clip(&path, &other, reading, &Term::new(true)).is_ok());
        std::fs::remove_file(path).unwrap();
    }
}
