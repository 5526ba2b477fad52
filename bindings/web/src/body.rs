//! Bodies, as the retargeter sees them.

use glam::{Quat, Vec3};
use troupe_motion::Clip;
use troupe_motion::anatomy::{Biped, PartsDoc, Tree};
use troupe_motion::glb::{FileJoints, add_animation_at};
use troupe_motion::retarget::Figure;
use wasm_bindgen::prelude::*;

use crate::{Read, options};

/// A body that motion is carried from or to.
#[wasm_bindgen]
pub struct Body {
    pub(crate) figure: Figure,
    /// Where its joints are in its file. That of a pack's body is none.
    joints: Option<FileJoints>,
}

#[wasm_bindgen]
impl Read {
    /// The body of the file. `parts` (TOML) corrects what is found of it; it may be empty.
    ///
    /// # Errors
    /// If no body is found or if it does not stand, with the joint or the angle; or if `parts` is
    /// wrong, with the line.
    pub fn body(&self, parts: &str) -> Result<Body, JsError> {
        let doc: PartsDoc = toml::from_str(parts)?;
        let figure = self.understood.figure(&doc)?;
        let joints = Some(self.understood.file_joints());
        Ok(Body { figure, joints })
    }
}

/// The body of a pack. `tables` (JSON) has those of its manifest: `skeleton` and, of robots,
/// `robot`. A robot's body needs no motion. Others show theirs by a motion that begins standing:
/// `roots` has 3 numbers a frame, `rotations` 4 a joint and frame.
///
/// # Errors
/// If the tables or the motion are wrong, if no body is found, or if it does not stand.
#[wasm_bindgen]
pub fn body_of_pack(tables: &str, fps: f32, roots: &[f32], rotations: &[f32]) -> Result<Body, JsError> {
    let options = options::parse(tables).map_err(|error| JsError::new(&error))?;
    let Some(skeleton) = options.skeleton else {
        return Err(JsError::new("tables: have no skeleton"));
    };
    let doc = PartsDoc::default();
    if skeleton.robot.is_some() {
        let (figure, joints) = (Figure::of_robot(skeleton, &doc)?, None);
        return Ok(Body { figure, joints });
    }
    let clip = Clip::new(skeleton, fps, vectors(roots), quaternions(rotations))?;
    let skeleton = &clip.skeleton;
    let figure = match Biped::find(&Tree::of(skeleton)) {
        Some(_) => Figure::of_clip(&clip, None, &doc)?,
        // Bodies that are found by their shape have no neutral pose but the one in which they
        // stand.
        None => {
            let root_y_m = clip.root_positions[0].y - skeleton.ground_y_m;
            Figure::new(skeleton.clone(), clip.rotations_at(0), Some(root_y_m), &doc)?
        }
    };
    let joints = None;
    Ok(Body { figure, joints })
}

#[wasm_bindgen]
impl Body {
    /// The parts that were found, as TOML. A corrected text goes to [`Read::body`].
    ///
    /// # Errors
    /// None that is known: parts are names.
    pub fn parts(&self) -> Result<String, JsError> {
        let doc = PartsDoc::of(self.figure.parts(), self.figure.skeleton());
        Ok(toml::to_string(&doc)?)
    }

    /// The character's file (.glb, .vrm) with a motion on its skeleton as one animation more.
    ///
    /// # Errors
    /// If the motion does not fit the skeleton, or if the file cannot take it, with the joint.
    pub fn dress(
        &self,
        file: &[u8],
        name: &str,
        fps: f32,
        roots: &[f32],
        rotations: &[f32],
    ) -> Result<Vec<u8>, JsError> {
        let skeleton = self.figure.skeleton();
        let clip = Clip::new(skeleton.clone(), fps, vectors(roots), quaternions(rotations))?;
        let Some(joints) = &self.joints else {
            return Err(JsError::new("the body is not of a file"));
        };
        Ok(add_animation_at(file, joints, &clip, name)?)
    }
}

pub(crate) fn vectors(flat: &[f32]) -> Vec<Vec3> {
    flat.chunks_exact(3).map(Vec3::from_slice).collect()
}

pub(crate) fn quaternions(flat: &[f32]) -> Vec<Quat> {
    flat.chunks_exact(4).map(Quat::from_slice).collect()
}
