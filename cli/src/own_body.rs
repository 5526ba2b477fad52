//! A body of the user's own for `troupe generate`, from a file of motion.

use std::path::Path;

use glam::Vec3;
use troupe_client::Pack;
use troupe_motion::read::{Options, Understood};
use troupe_proto::v1;

use crate::failure::Failure;
use crate::term::Term;
use crate::understand::{note, understand};

/// Endings of files with a skeleton.
const ENDINGS: [&str; 5] = ["bvh", "fbx", "glb", "gltf", "npz"];

/// Shortest bone of a body that servers take, metres. Hips and shoulders of many files have none.
const MIN_BONE_M: f32 = 2e-4;

/// Says which bones are made [`MIN_BONE_M`] long.
fn note_short_bones(path: &Path, understood: &Understood, term: &Term) {
    let bones = understood.clip.skeleton.joints.iter().skip(1);
    let short = bones.filter(|joint| joint.offset_m.length() < MIN_BONE_M);
    let names: Vec<&str> = short.map(|joint| &*joint.name).collect();
    if !names.is_empty() {
        term.note(format_args!(
            "{}: bones without length are made {} mm long, as bodies need: {}",
            path.display(),
            1e3 * MIN_BONE_M,
            names.join(", ")
        ));
    }
}

/// The skeleton of a file, with its neutral pose.
pub(super) struct OwnBody(Understood);

impl OwnBody {
    /// Reads the file, if the text is the name of one and not that of a body.
    ///
    /// # Errors
    /// [`Failure::Input`] with the file and what is wrong with it.
    pub(super) fn read(text: &str, term: &Term) -> Result<Option<Self>, Failure> {
        let path = Path::new(text);
        let file = text.split('#').next().unwrap_or(text);
        let ending = Path::new(file)
            .extension()
            .map(|ending| ending.to_ascii_lowercase());
        if !ending.is_some_and(|ending| ENDINGS.iter().any(|known| ending == *known)) {
            return Ok(None);
        }
        let understood = understand(path, Options::default(), None).map_err(|why| {
            let advice = match why.has_options() {
                true => "; `troupe clip convert` has these options, and writes a file that needs none",
                false => "",
            };
            Failure::file(path, format!("{why}{advice}"))
        })?;
        note(path, &understood.report, term);
        note_short_bones(path, &understood, term);
        Ok(Some(Self(understood)))
    }

    /// The pack with this skeleton, for the frames of an answer.
    pub(super) fn on(&self, pack: &Pack) -> Pack {
        let skeleton = (*self.0.clip.skeleton).clone();
        Pack::with_skeleton(pack.description().clone(), skeleton)
    }

    /// The body as requests describe it.
    pub(super) fn message(&self) -> v1::BodySkeleton {
        let Understood { clip, report, .. } = &self.0;
        let skeleton = &clip.skeleton;
        let vec3 = |v: Vec3| v1::Vec3 {
            x: v.x,
            y: v.y,
            z: v.z,
        };
        let joints = skeleton.joints.iter().map(|joint| v1::BodyJoint {
            name: joint.name.clone(),
            parent: joint
                .parent
                .map_or_else(String::new, |parent| skeleton.joints[parent].name.clone()),
            offset: Some(vec3(match joint.offset_m.length() < MIN_BONE_M {
                true => Vec3::Y * MIN_BONE_M,
                false => joint.offset_m,
            })),
        });
        let neutral = self.0.neutral_pose().unwrap_or_default();
        v1::BodySkeleton {
            joints: joints.collect(),
            left_axis: Some(vec3(skeleton.left_axis)),
            contact_joints: report.contacts.value.clone(),
            neutral: neutral
                .iter()
                .map(|q| v1::Quat {
                    w: q.w,
                    x: q.x,
                    y: q.y,
                    z: q.z,
                })
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_bodies_are_no_files() {
        let term = Term::new(true);
        for name in ["", "g1", "human.v2"] {
            assert!(OwnBody::read(name, &term).unwrap().is_none());
        }
        let failure = OwnBody::read("no/such.FBX#Walk", &term)
            .err()
            .unwrap()
            .to_string();
        assert!(failure.contains("no/such.FBX#Walk"), "{failure}");
    }

    #[test]
    fn a_files_skeleton_is_described_with_its_neutral_pose() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/walk.bvh");
        let own = OwnBody::read(file.to_str().unwrap(), &Term::new(true))
            .unwrap()
            .unwrap();
        let message = own.message();
        assert_eq!(message.neutral.len(), message.joints.len());
        assert_eq!(message.joints[0].parent, "");
        assert!(message.contact_joints.contains(&"Foot_L".to_owned()));
    }
}
