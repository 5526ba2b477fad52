//! Reading clips and writing motion.

use std::path::Path;
use std::sync::Arc;

use troupe_motion::bvh::{self, BvhFile, BvhOptions, BvhWriteOptions, ConvertError};
use troupe_motion::clip::Clip;
use troupe_motion::glb::write_glb;
use troupe_motion::skeleton::Skeleton;
use troupe_proto::v1;

use super::args::Scale;
use super::failure::Failure;
use super::term::Term;
use crate::error::ClientError;
use crate::pack::Pack;

/// Reads a BVH file onto a pack's skeleton and at its rate.
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

/// Reads a BVH file onto a skeleton, joints by name, at the file's own rate.
///
/// # Errors
/// A sentence that says what is wrong with the file.
pub(super) fn read_clip_on(path: &Path, skeleton: &Arc<Skeleton>, scale: Scale) -> Result<Clip, String> {
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
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let format = match ending.as_deref() {
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
}

impl Format {
    /// The format of a file by its ending, `.bvh` or `.glb`.
    pub(super) fn of(path: &Path) -> Result<Self, Failure> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("bvh") => Ok(Self::Bvh),
            Some("glb") => Ok(Self::Glb),
            _ => Err(Failure::file(
                path,
                "the ending says the format and must be .bvh or .glb",
            )),
        }
    }

    /// Writes a clip; BVH in the unit of `scale`, glTF in metres as it must be.
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
        for path in ["b.fbx", "bvh", "b."] {
            let failure = Format::of(Path::new(path)).unwrap_err().to_string();
            assert!(failure.contains(".bvh or .glb"), "{failure}");
        }
    }
}
