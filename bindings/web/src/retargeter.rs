//! Motion of one body on another: clips, and crowds frame by frame.

use glam::{Quat, Vec3};
use serde::Serialize;
use troupe_motion::retarget::{Certificate, Retargeter as Inner};
use wasm_bindgen::prelude::*;

use crate::body::{Body, quaternions, vectors};

/// Carries motion of one body over to another.
#[wasm_bindgen]
pub struct Retargeter {
    inner: Inner,
}

/// A certificate, as the viewer shows it.
#[derive(Serialize)]
struct Shown {
    #[serde(flatten)]
    certificate: Certificate,
    faults: Vec<String>,
}

/// A motion on the target's joints.
#[wasm_bindgen]
pub struct Carried {
    roots: Vec<f32>,
    rotations: Vec<f32>,
}

#[wasm_bindgen]
impl Carried {
    /// 3 a frame: world places of joint 0, metres in the target's size.
    #[wasm_bindgen(getter)]
    pub fn roots(&self) -> Vec<f32> {
        self.roots.clone()
    }

    /// 4 a joint and frame: joint 0 in the world, others relative to their parents.
    #[wasm_bindgen(getter)]
    pub fn rotations(&self) -> Vec<f32> {
        self.rotations.clone()
    }
}

#[wasm_bindgen]
impl Retargeter {
    /// A retargeter from one body to another.
    ///
    /// # Errors
    /// If only one of the bodies stands on four legs.
    #[wasm_bindgen(constructor)]
    pub fn new(source: &Body, target: &Body) -> Result<Retargeter, JsError> {
        let inner = Inner::new(source.figure.clone(), target.figure.clone())?;
        Ok(Self { inner })
    }

    /// Length of the target's legs by that of the source's.
    #[wasm_bindgen(getter)]
    pub fn scale(&self) -> f32 {
        self.inner.scale()
    }

    /// A motion of the source on the target, from its first frame on, with `fps` frames a second.
    ///
    /// # Errors
    /// If `fps` is not above 0, or if the numbers are not whole frames of the source's joints.
    pub fn carry(&mut self, fps: f32, roots: &[f32], rotations: &[f32]) -> Result<Carried, JsError> {
        // NaN is not above 0 either.
        if !(fps > 0.0 && fps.is_finite()) {
            return Err(JsError::new(&format!("fps is {fps}; allowed: above 0")));
        }
        let [from, to] = self.inner.figures().map(|figure| figure.skeleton().joint_count());
        let (roots, rotations) = (vectors(roots), quaternions(rotations));
        if rotations.len() != roots.len() * from {
            let found = rotations.len();
            let frames = roots.len();
            return Err(JsError::new(&format!(
                "{found} rotations for {frames} frames of {from} joints"
            )));
        }
        let mut pose = vec![Quat::IDENTITY; to];
        let mut carried = Carried {
            roots: Vec::with_capacity(3 * roots.len()),
            rotations: Vec::with_capacity(4 * to * roots.len()),
        };
        self.inner.reset();
        self.inner.set_step(fps.recip());
        for (&root, rotations) in roots.iter().zip(rotations.chunks_exact(from)) {
            let own = self.inner.pose(root, rotations, &mut pose);
            carried.roots.extend(own.to_array());
            let numbers = pose.iter().flat_map(|rotation| rotation.to_array());
            carried.rotations.extend(numbers);
        }
        Ok(carried)
    }

    /// What is kept of built-in motions, as JSON: `trials`, each with its name and figures, and
    /// `faults`, which are sentences. Without faults motion may be carried over.
    ///
    /// # Errors
    /// None that is known: figures are numbers.
    pub fn certificate(&self) -> Result<String, JsError> {
        let certificate = Certificate::of(&self.inner);
        let shown = Shown {
            faults: certificate.faults(),
            certificate,
        };
        Ok(serde_json::to_string(&shown)?)
    }

    /// A crowd without members that carries poses as this one does.
    pub fn crowd(&self) -> Crowd {
        let [from, to] = self.inner.figures().map(|figure| figure.skeleton().joint_count());
        let mut first = self.inner.clone();
        first.reset();
        Crowd {
            first,
            members: Vec::new(),
            pose: vec![Quat::IDENTITY; from],
            joints: [from, to],
            due: Vec::new(),
            roots: Vec::new(),
            rotations: Vec::new(),
            own_roots: Vec::new(),
            own_rotations: Vec::new(),
        }
    }
}

/// A member of a crowd: its state, its last pose, and the time since then.
struct Member {
    retargeter: Inner,
    pose: Vec<Quat>,
    passed_s: f32,
}

/// Retargeters of many characters, each with its own state. Poses go in and out through memory that
/// JavaScript sees: it writes the poses and marks the members that have a new one, and [`pose`]
/// carries those over. Nothing is allocated for a frame.
///
/// [`pose`]: Crowd::pose
#[wasm_bindgen]
pub struct Crowd {
    first: Inner,
    members: Vec<Member>,
    /// The source's pose of the member whose turn it is.
    pose: Vec<Quat>,
    /// Joints of source and target.
    joints: [usize; 2],
    /// 1 for each member with a new pose.
    due: Vec<u8>,
    roots: Vec<f32>,
    rotations: Vec<f32>,
    own_roots: Vec<f32>,
    own_rotations: Vec<f32>,
}

#[wasm_bindgen]
impl Crowd {
    /// Makes room for `count` members. Addresses change.
    pub fn grow(&mut self, count: usize) {
        let [from, to] = self.joints;
        let first = &self.first;
        self.members.resize_with(count, || Member {
            retargeter: first.clone(),
            pose: vec![Quat::IDENTITY; to],
            passed_s: 0.0,
        });
        self.due.resize(count, 0);
        self.roots.resize(3 * count, 0.0);
        self.rotations.resize(4 * from * count, 0.0);
        self.own_roots.resize(3 * count, 0.0);
        self.own_rotations.resize(4 * to * count, 0.0);
    }

    /// Lets a member begin a motion.
    pub fn reset(&mut self, member: usize) {
        if let Some(member) = self.members.get_mut(member) {
            member.retargeter.reset();
        }
    }

    /// Carries over the poses of the members that are marked, and takes the marks away. `passed_s`
    /// is the time since the last call, seconds. It also counts for members without a new pose.
    pub fn pose(&mut self, passed_s: f32) {
        let [from, to] = self.joints;
        let sources = self
            .roots
            .chunks_exact(3)
            .zip(self.rotations.chunks_exact(4 * from));
        let owns = self
            .own_roots
            .chunks_exact_mut(3)
            .zip(self.own_rotations.chunks_exact_mut(4 * to));
        let members = self.members.iter_mut().zip(&mut self.due);
        for ((member, due), (source, own)) in members.zip(sources.zip(owns)) {
            member.passed_s += passed_s;
            if std::mem::take(due) == 0 {
                continue;
            }
            let step_s = std::mem::take(&mut member.passed_s);
            member.retargeter.set_step(step_s);
            for (rotation, numbers) in self.pose.iter_mut().zip(source.1.chunks_exact(4)) {
                *rotation = Quat::from_slice(numbers);
            }
            let root = Vec3::from_slice(source.0);
            let root = member.retargeter.pose(root, &self.pose, &mut member.pose);
            root.write_to_slice(own.0);
            for (rotation, numbers) in member.pose.iter().zip(own.1.chunks_exact_mut(4)) {
                rotation.write_to_slice(numbers);
            }
        }
    }

    /// Address of the marks: a byte a member, 1 if it has a new pose.
    pub fn due(&mut self) -> *mut u8 {
        self.due.as_mut_ptr()
    }

    /// Address of the source's roots: 3 floats a member.
    pub fn roots(&mut self) -> *mut f32 {
        self.roots.as_mut_ptr()
    }

    /// Address of the source's rotations: 4 floats a joint and member.
    pub fn rotations(&mut self) -> *mut f32 {
        self.rotations.as_mut_ptr()
    }

    /// Address of the target's roots: 3 floats a member.
    pub fn own_roots(&self) -> *const f32 {
        self.own_roots.as_ptr()
    }

    /// Address of the target's rotations: 4 floats a joint and member.
    pub fn own_rotations(&self) -> *const f32 {
        self.own_rotations.as_ptr()
    }
}
