//! Reading clips and writing motion.

use std::path::Path;
use std::sync::Arc;

use clap::{Args, ValueEnum};
use troupe_client::{ClientError, Pack};
use troupe_motion::bvh::{self, BvhFile, BvhOptions, BvhWriteOptions, ConvertError};
use troupe_motion::clip::Clip;
use troupe_motion::glb::write_glb;
use troupe_motion::robot::{read_csv, write_csv};
use troupe_motion::skeleton::Skeleton;
use troupe_proto::v1;

use crate::context::Context;
use crate::failure::Failure;
use crate::term::Term;

const BVH: &str = "BVH files";

/// How BVH files relate to the pack's skeleton.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Scale {
    /// Length unit of the BVH files.
    #[arg(long, help_heading = BVH, value_enum, default_value_t = Unit::Cm)]
    pub(crate) unit: Unit,

    /// Also take clips whose bones have other lengths; their rotations are played on the pack's bones.
    #[arg(long, help_heading = BVH)]
    pub(crate) other_bones: bool,
}

/// A length unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Unit {
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
    /// Inches.
    In,
}

impl Unit {
    /// Metres in one unit.
    pub(crate) fn metres(self) -> f32 {
        match self {
            Self::Mm => 0.001,
            Self::Cm => 0.01,
            Self::M => 1.0,
            Self::In => 0.0254,
        }
    }
}

/// Ending of clips of robots.
pub(super) const CSV: &str = "csv";
/// Rate of clips of robots, frames a second: the files know none.
const CSV_FPS: f32 = 30.0;

/// Ending of the clips that a pack is made from and measured with: a robot's are CSV, all others BVH.
pub(super) fn clip_ending(pack: &Pack) -> &'static str {
    match pack.robot() {
        Some(_) => CSV,
        None => "bvh",
    }
}

/// Reads a BVH file, or a robot's CSV, onto a pack's skeleton and at its rate.
pub(super) fn read_clip(path: &Path, pack: &Pack, scale: Scale, term: &Term) -> Result<Clip, Failure> {
    let clip = read_clip_on(path, pack.skeleton(), scale).map_err(|why| Failure::file(path, why))?;
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

/// Reads a clip onto a skeleton at the file's own rate: a BVH file, joints by name, or the CSV of the skeleton's robot.
///
/// # Errors
/// A sentence that says what is wrong with the file.
pub(super) fn read_clip_on(path: &Path, skeleton: &Arc<Skeleton>, scale: Scale) -> Result<Clip, String> {
    if ending(path).as_deref() == Some(CSV) {
        let text = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
        return read_csv(&text, skeleton, CSV_FPS).map_err(|e| e.to_string());
    }
    let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
    let file = bvh::parse_bytes(&bytes).map_err(|e| e.to_string())?;
    let mut options = BvhOptions {
        scale_to_metres: scale.unit.metres(),
        ..BvhOptions::default()
    };
    if scale.other_bones {
        options.max_offset_error_m = f32::INFINITY;
    }
    file.to_clip_on(skeleton, &options).map_err(|e| match e {
        ConvertError::OffsetMismatch { .. } => {
            format!("{e}; is --unit right? --other-bones plays the clip on the pack's own bones")
        }
        e => e.to_string(),
    })
}

/// Reads a scene or an object definition, as the server is to read it.
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

/// The failure of a call that was given the document in `path`: what is wrong with the document is wrong with the file.
pub(super) fn document_failure(path: &Path, error: ClientError) -> Failure {
    match error {
        ClientError::Refused(refusal) if refusal.reason.as_deref() == Some("INVALID_DOCUMENT") => {
            Failure::file(path, refusal.message)
        }
        other => other.into(),
    }
}

/// A format for motion, told by a file's ending.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Bvh,
    Glb,
    /// A robot's root and angles, as Unitree publishes them.
    Csv,
}

/// A file's ending, in lower case and without the dot.
fn ending(path: &Path) -> Option<String> {
    path.extension().map(|e| e.to_string_lossy().to_lowercase())
}

impl Format {
    /// The format of a file by its ending, `.bvh`, `.glb` or `.csv`.
    pub(super) fn of(path: &Path) -> Result<Self, Failure> {
        match ending(path).as_deref() {
            Some("bvh") => Ok(Self::Bvh),
            Some("glb") => Ok(Self::Glb),
            Some(CSV) => Ok(Self::Csv),
            _ => Err(Failure::file(
                path,
                "the ending says the format and must be .bvh or .glb, or .csv for a robot",
            )),
        }
    }

    /// Checks that clips of a server's pack can be written so, before any are made for nothing.
    pub(super) async fn check(self, context: &Context, pack: &str, path: &Path) -> Result<(), Failure> {
        if self != Self::Csv {
            return Ok(());
        }
        let (_, pack) = context.connect_to_pack(pack).await?;
        self.fits(&pack, path)
    }

    /// The same for a pack that is known.
    pub(super) fn fits(self, pack: &Pack, path: &Path) -> Result<(), Failure> {
        if self != Self::Csv {
            return Ok(());
        }
        match pack.robot() {
            Some(_) => Ok(()),
            None => Err(Failure::file(
                path,
                format_args!(
                    "{} of pack `{}` is no robot, whose angles .csv holds; write .bvh or .glb",
                    if pack.body().is_empty() {
                        "the body"
                    } else {
                        pack.body()
                    },
                    pack.name()
                ),
            )),
        }
    }

    /// Writes a clip; BVH in the unit of `scale`, glTF and CSV in metres as they must be, CSV at 30 rows a second.
    pub(super) fn write(self, clip: &Clip, path: &Path, scale: Scale) -> Result<(), Failure> {
        let bytes = match self {
            Self::Bvh => {
                let units_per_metre = 1.0 / scale.unit.metres();
                let options = BvhWriteOptions {
                    units_per_metre,
                    ..BvhWriteOptions::default()
                };
                let file = BvhFile::from_clip(clip, &options).map_err(|e| Failure::output(path, e))?;
                bvh::write(&file).into_bytes()
            }
            Self::Glb => write_glb(clip).map_err(|e| Failure::output(path, e))?,
            Self::Csv => {
                let rows = clip.resample(CSV_FPS).map_err(|e| Failure::output(path, e))?;
                write_csv(&rows)
                    .map_err(|e| Failure::output(path, e))?
                    .into_bytes()
            }
        };
        std::fs::write(path, bytes).map_err(|e| Failure::output(path, e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_says_the_format() {
        assert_eq!(Format::of(Path::new("a/b.BVH")).unwrap(), Format::Bvh);
        assert_eq!(Format::of(Path::new("b.glb")).unwrap(), Format::Glb);
        assert_eq!(Format::of(Path::new("b.csv")).unwrap(), Format::Csv);
        for path in ["b.fbx", "bvh", "b."] {
            let failure = Format::of(Path::new(path)).unwrap_err().to_string();
            assert!(failure.contains(".bvh or .glb"), "{failure}");
        }
    }

    #[test]
    fn a_robots_clip_is_written_and_read() {
        let pack = Pack::try_from(crate::testing::hopper()).unwrap();
        let scale = Scale {
            unit: Unit::Cm,
            other_bones: false,
        };
        let folder = std::env::temp_dir().join(format!("troupe-robot-csv-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("hop.CSV");
        std::fs::write(&path, "2,1,0.9,0,0,0,1,0.4\n2.1,1,0.9,0,0,0,1,0.5\n").unwrap();
        let clip = read_clip(&path, &pack, scale, &Term::new(true)).unwrap();
        assert_eq!(
            (clip.frames(), clip.root_positions[1].z, clip_ending(&pack)),
            (2, 2.1, "csv")
        );
        Format::Csv.write(&clip, &path, scale).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.ends_with("0.000000,1.000000,0.500000\n"), "{text}");
        std::fs::write(&path, "2,1,0.9\n").unwrap();
        let failure = read_clip(&path, &pack, scale, &Term::new(true))
            .unwrap_err()
            .to_string();
        assert!(
            failure.contains("hop.CSV: line 1: 3 columns; robot hopper has 8"),
            "{failure}"
        );
        let human = Pack::try_from(crate::testing::pair()).unwrap();
        let failure = read_clip(&path, &human, scale, &Term::new(true))
            .unwrap_err()
            .to_string();
        assert!(failure.contains("no robot's"), "{failure}");
        std::fs::remove_dir_all(folder).unwrap();
    }
}
