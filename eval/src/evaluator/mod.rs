//! The motion autoencoder in whose latent space FID, MMD and latent diversity are measured: the
//! `evaluator.onnx` that `troupe-train evaluator` makes. It runs in this process, not in the
//! server.
//!
//! Its inputs are `root` `[B, T, 5]` (x, y, z, cos, sin), `positions` `[B, T, J, 3]` (relative to
//! the projected root, metres) and `six_d` `[B, T, J, 6]` (world rotations), all in the segment
//! frame: origin at the projected root of the last context frame, heading 0 there. Its output is
//! `latent` `[B, D]`. Normalisation is inside.

mod inputs;
mod network;

use std::path::{Path, PathBuf};

use serde::Serialize;
use troupe_cli::Failure;
use troupe_motion::clip::Clip;

use self::inputs::Inputs;
use self::network::Network;

/// Name of the file in a pack's folder.
const FILE_NAME: &str = "evaluator.onnx";

/// An evaluator that has been read.
pub(crate) struct Evaluator {
    origin: Origin,
    network: Network,
}

/// Which evaluator it is. Latents of different evaluators do not compare.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct Origin {
    pub(crate) file: PathBuf,
    /// Digest of the file, in hexadecimal.
    pub(crate) sha256: String,
}

impl Evaluator {
    /// The evaluator in a file or a pack's folder. Without one: that of the pack's folder below
    /// `models`, if it has one.
    ///
    /// # Errors
    /// [`Failure::Input`] if the file cannot be used.
    pub(crate) fn find(given: Option<&Path>, pack: &str) -> Result<Option<Self>, Failure> {
        match given {
            Some(folder) if folder.is_dir() => Self::open(folder.join(FILE_NAME)).map(Some),
            Some(file) => Self::open(file.to_owned()).map(Some),
            None => {
                let file = Path::new("models").join(pack).join(FILE_NAME);
                file.is_file().then(|| Self::open(file)).transpose()
            }
        }
    }

    /// Reads an evaluator.
    ///
    /// # Errors
    /// [`Failure::Input`] if the file cannot be read or is no evaluator.
    fn open(file: PathBuf) -> Result<Self, Failure> {
        let bytes = std::fs::read(&file).map_err(|e| Failure::file(&file, e))?;
        let sha256 = network::sha256(&bytes);
        let network = Network::load(bytes).map_err(|e| Failure::file(&file, e))?;
        let origin = Origin { file, sha256 };
        Ok(Self { origin, network })
    }

    /// File and digest.
    pub(crate) fn origin(&self) -> &Origin {
        &self.origin
    }

    /// The latents of clips of the same number of frames on the pack's skeleton. The fourth frame
    /// of each clip is its last context frame.
    pub(crate) fn latents(&self, clips: &[&Clip]) -> Result<Vec<Vec<f32>>, Failure> {
        let Some(first) = clips.first() else {
            return Ok(Vec::new());
        };
        let mut inputs = Inputs::default();
        clips.iter().for_each(|clip| inputs.push(clip));
        let shape = [clips.len(), first.frames(), first.skeleton.joint_count()];
        let latents = self.network.run(inputs, shape);
        latents.map_err(|e| Failure::file(&self.origin.file, e))
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;
    use std::sync::Arc;

    use glam::{Quat, Vec3};
    use troupe_motion::skeleton::{Joint, Skeleton};

    use super::*;

    /// Hips with a hand 1 m ahead, at rest.
    fn pointing(frames: usize) -> Clip {
        let joint = |name: &str, parent, offset_m| Joint {
            name: name.to_owned(),
            parent,
            offset_m,
        };
        let joints = vec![joint("Hips", None, Vec3::ZERO), joint("Hand", Some(0), Vec3::Z)];
        let skeleton = Arc::new(Skeleton::new(joints, Vec3::X, 0.0, None).unwrap());
        let rotations = vec![Quat::IDENTITY; 2 * frames];
        Clip::new(skeleton, 30.0, vec![Vec3::Y; frames], rotations).unwrap()
    }

    #[test]
    fn windows_begin_at_the_origin_and_head_ahead() {
        // It stands at x = 5 and faces +X until frame 3. Then it is 2 m further along +X, so 2 m
        // ahead, and faces -Z, so it has turned to the right.
        let mut clip = pointing(5);
        for f in 0..5 {
            clip.root_positions[f] = Vec3::new(if f < 4 { 5.0 } else { 7.0 }, 0.9, 3.0);
            let heading = if f < 4 { FRAC_PI_2 } else { 2.0 * FRAC_PI_2 };
            clip.rotations_at_mut(f)[0] = Quat::from_rotation_y(heading);
        }
        let mut inputs = Inputs::default();
        inputs.push(&clip);
        let near = |a: &[f32], b: &[f32]| {
            assert!(
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6),
                "{a:?} is not {b:?}"
            );
        };
        assert_eq!(
            (inputs.root.len(), inputs.positions.len(), inputs.six_d.len()),
            (25, 30, 60)
        );
        near(&inputs.root[15..20], &[0.0, 0.9, 0.0, 1.0, 0.0]);
        near(&inputs.root[20..], &[0.0, 0.9, 2.0, 0.0, 1.0]);
        // The hand is ahead of the hips, at their height. In the last frame it points along the
        // segment's +X.
        near(&inputs.positions[18..24], &[0.0, 0.9, 0.0, 0.0, 0.9, 1.0]);
        near(&inputs.positions[24..], &[0.0, 0.9, 0.0, 1.0, 0.9, 0.0]);
        // The rotation's columns: +X and +Y at first, then -Z and +Y.
        near(&inputs.six_d[36..42], &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        near(&inputs.six_d[48..54], &[0.0, 0.0, -1.0, 0.0, 1.0, 0.0]);
    }

    #[test]
    fn a_pack_may_have_no_evaluator_but_a_named_one_must_exist() {
        assert!(Evaluator::find(None, "no such pack").unwrap().is_none());
        let given = Evaluator::find(Some(Path::new("/nowhere/evaluator.onnx")), "human");
        assert!(given.err().is_some_and(|e| e.to_string().contains("/nowhere")));
    }

    #[test]
    fn the_tiny_evaluator_gives_what_its_script_says() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/evaluator/tiny.onnx");
        let evaluator = Evaluator::find(Some(&folder), "").unwrap().unwrap();
        // Means over the frames of root z, of the hand's z, and of twice the hips' first rotation
        // entry.
        let mut far = pointing(14);
        (4..14).for_each(|f| far.root_positions[f].z = 1.4);
        let latents = evaluator.latents(&[&pointing(14), &far]).unwrap();
        let wanted = [[0.0, 1.0, 2.0], [1.0, 1.0, 2.0]];
        for (latent, wanted) in latents.iter().zip(wanted) {
            assert!(
                latent.len() == 3 && latent.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-5),
                "{latents:?}"
            );
        }
        // Another number of frames, and another skeleton.
        assert_eq!(evaluator.latents(&[&pointing(33)]).unwrap(), [[0.0, 1.0, 2.0]]);
        let hips = Clip::new(
            crate::testing::lone_hips(),
            30.0,
            vec![Vec3::Y; 14],
            vec![Quat::IDENTITY; 14],
        );
        assert!(evaluator.latents(&[&hips.unwrap()]).is_err());
        assert_eq!(evaluator.origin().sha256.len(), 64);
    }
}
