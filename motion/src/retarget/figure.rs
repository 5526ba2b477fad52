//! A body as the retargeter sees it: its parts in a neutral pose, and its proportions.

use std::sync::Arc;

use glam::{DVec3, Quat, Vec3};

use super::{RetargetError, feet, hinges};
use crate::anatomy::{Biped, Parts, PartsDoc, RestPose, Tree, hang, neutral_of_motion, places, world_of};
use crate::clip::Clip;
use crate::root::heading_of;
use crate::rotation::yaw;
use crate::skeleton::Skeleton;

/// Least cosine between up and the direction from the feet to the head of a body on two legs.
const UPRIGHT: f32 = 0.9;
/// How far the ground is below the toes, by the ankles' height over them, if nothing says it.
const SOLE_SHARE: f32 = 0.25;

/// Toes of a clip that stand higher than this share of the legs' length do not show the ground.
const MOST_TOE_SHARE: f32 = 0.12;

/// A rest pose stands on the ground of its file if its root is this near to where its toes say that
/// it is, by the length of its legs.
const STANDS_SHARE: f32 = 0.15;
/// Farthest that two joints of a body are apart along an axis, metres.
const MOST_M: f32 = 1e4;

/// A body with its neutral pose: upright, heading along +Z, limbs hanging down.
#[derive(Clone, Debug)]
pub struct Figure {
    pub(super) skeleton: Arc<Skeleton>,
    pub(super) parts: Parts,
    /// World rotations of the neutral pose, one a joint.
    pub(super) neutral: Vec<Quat>,
    /// Places of the joints in the neutral pose. The middle of the hips is above the origin, and
    /// the ground at height 0.
    pub(super) places: Vec<Vec3>,
    /// From the middle of the hips to the middle of the ankles in the neutral pose, metres.
    pub(super) leg_m: f32,
}

impl Figure {
    /// The figure of a skeleton. `rest` is its rest pose: joint 0 in the world, others relative to
    /// their parents. `root_y_m` is the height of joint 0 in it over the ground, if it is known to
    /// stand there; otherwise feet are taken to be as high as contact joints or toes say.
    /// `doc` corrects the parts that are found.
    ///
    /// # Errors
    /// [`RetargetError`] if the parts of a body are not found, or if the rest pose is no stance.
    pub fn new(
        skeleton: Arc<Skeleton>,
        rest: &[Quat],
        root_y_m: Option<f32>,
        doc: &PartsDoc,
    ) -> Result<Self, RetargetError> {
        let pose = world_of(&skeleton, rest);
        let parts = Parts::with(&skeleton, &pose, doc).map_err(RetargetError::Parts)?;
        let turn = turn_ahead(&skeleton, &parts, &pose);
        let turned = pose.into_iter().map(|rotation| (turn * rotation).normalize());
        let pose: Vec<Quat> = turned.collect();
        let at = places(&skeleton, &pose);
        if let Some(robot) = &skeleton.robot {
            let neutral = match parts.on_fours {
                true => pose,
                false => hinges::hang(robot, &parts, &pose, &at),
            };
            return Self::of_places(skeleton, parts, neutral, at, None);
        }
        if parts.on_fours {
            return Self::of_parts(skeleton, parts, pose, root_y_m);
        }
        let mut neutral = neutral(&skeleton, &parts, pose)?;
        feet::level(&skeleton, &parts, &mut neutral);
        // Straightened legs lift the root.
        let ankles = |places: &[Vec3]| parts.legs.iter().map(|leg| places[leg.end].y).sum::<f32>() / 2.0;
        let lift = ankles(&at) - ankles(&places(&skeleton, &neutral));
        let root_y_m = root_y_m.map(|root_y_m| root_y_m + lift);
        Self::of_parts(skeleton, parts, neutral, root_y_m)
    }

    /// As [`Figure::new`], by the height of joint 0 over the ground of the rest pose's file. Many
    /// files have their origin elsewhere: then the toes say where the ground is.
    ///
    /// # Errors
    /// As [`Figure::new`].
    pub fn resting(
        skeleton: Arc<Skeleton>,
        rest: &[Quat],
        root_y_m: Option<f32>,
        doc: &PartsDoc,
    ) -> Result<Self, RetargetError> {
        let found = Self::new(Arc::clone(&skeleton), rest, None, doc)?;
        let near_m = STANDS_SHARE * found.leg_m;
        match root_y_m.filter(|root_y_m| (root_y_m - found.root().y).abs() <= near_m) {
            Some(root_y_m) => Self::new(skeleton, rest, Some(root_y_m), doc),
            None => Ok(found),
        }
    }

    /// The figure of a clip's skeleton: by the average pose of a body that is found by names, with
    /// trunk and limbs straightened and the feet as they stand flat on the ground. Others have it
    /// by their rest pose (joint 0 in the world, others relative to their parents), or without one
    /// by all rotations at zero. A robot has it with its hinges at 0.
    ///
    /// # Errors
    /// [`RetargetError`] if the parts of a body are not found, or if it does not stand.
    pub fn of_clip(clip: &Clip, rest: Option<&[Quat]>, doc: &PartsDoc) -> Result<Self, RetargetError> {
        let skeleton = Arc::clone(&clip.skeleton);
        if skeleton.robot.is_some() {
            return Self::of_robot(skeleton, doc);
        }
        let Some(body) = Biped::find(&Tree::of(&skeleton)) else {
            let still = vec![Quat::IDENTITY; skeleton.joint_count()];
            return Self::new(skeleton, rest.unwrap_or(&still), None, doc);
        };
        let mut neutral = neutral_of_motion(clip, &body);
        let parts = Parts::with(&skeleton, &neutral, doc).map_err(RetargetError::Parts)?;
        let toes_m = feet::stand(clip, &parts, &mut neutral);
        let at = places(&skeleton, &neutral);
        let toes = parts.legs.each_ref().map(|leg| at[leg.toe.unwrap_or(leg.end)].y);
        let lowest = 0.5 * (toes[0] + toes[1]);
        let tall = at[parts.legs[0].top].y - lowest;
        // Higher feet stand on something.
        let root_y_m = toes_m.filter(|toes_m| *toes_m <= MOST_TOE_SHARE * tall);
        let root_y_m = root_y_m.map(|toes_m| toes_m - lowest);
        Self::of_parts(skeleton, parts, neutral, root_y_m)
    }

    /// The figure of a robot's skeleton, with its hinges at 0.
    ///
    /// # Errors
    /// As [`Figure::new`].
    pub fn of_robot(skeleton: Arc<Skeleton>, doc: &PartsDoc) -> Result<Self, RetargetError> {
        let mut pose = vec![Quat::IDENTITY; skeleton.joint_count()];
        if let Some(robot) = &skeleton.robot {
            robot.pose(Quat::IDENTITY, &vec![0.0; robot.hinges().len()], &mut pose);
        }
        Self::new(skeleton, &pose, None, doc)
    }

    /// The figure of a body that stands in its neutral pose: world rotations, one a joint, with
    /// joint 0 at height `root_y_m` over the ground. `doc` has all of its parts.
    ///
    /// # Errors
    /// As [`Figure::new`].
    pub fn standing(
        skeleton: Arc<Skeleton>,
        neutral: Vec<Quat>,
        root_y_m: f32,
        doc: &PartsDoc,
    ) -> Result<Self, RetargetError> {
        let parts = Parts::with(&skeleton, &neutral, doc).map_err(RetargetError::Parts)?;
        Self::of_parts(skeleton, parts, neutral, Some(root_y_m))
    }

    fn of_parts(
        skeleton: Arc<Skeleton>,
        parts: Parts,
        neutral: Vec<Quat>,
        root_y_m: Option<f32>,
    ) -> Result<Self, RetargetError> {
        let at = places(&skeleton, &neutral);
        Self::of_places(skeleton, parts, neutral, at, root_y_m)
    }

    /// `at` are the joints' places in the neutral pose, with joint 0 in the origin.
    fn of_places(
        skeleton: Arc<Skeleton>,
        parts: Parts,
        neutral: Vec<Quat>,
        at: Vec<Vec3>,
        root_y_m: Option<f32>,
    ) -> Result<Self, RetargetError> {
        let is_near = |place: &Vec3| (*place - at[0]).abs().max_element() <= MOST_M;
        if let Some(joint) = at.iter().position(|place| !is_near(place) || place.is_nan()) {
            return Err(RetargetError::NoStance(format!(
                "{} is more than {MOST_M} m away from the root",
                skeleton.joints[joint].name
            )));
        }
        let at = grounded(&skeleton, &parts, at, root_y_m);
        let middle = |joints: [usize; 2]| 0.5 * (at[joints[0]] + at[joints[1]]);
        let hips = middle([0, 1].map(|side| parts.legs[side].top));
        let feet = middle([0, 1].map(|side| parts.legs[side].end));
        let leg_m = hips.y - feet.y;
        if leg_m.is_nan() || leg_m <= 0.0 {
            return Err(RetargetError::NoStance(
                "its hips are not above its feet".to_owned(),
            ));
        }
        Ok(Self {
            skeleton,
            parts,
            neutral,
            places: at,
            leg_m,
        })
    }

    /// Length of the legs of a skeleton from the hips to the ankles, metres, as of its figures.
    /// None if its body is not found by names and it is no robot.
    pub fn legs_m(skeleton: &Skeleton) -> Option<f32> {
        if skeleton.robot.is_some() {
            let figure = Self::of_robot(Arc::new(skeleton.clone()), &PartsDoc::default());
            return figure.ok().map(|figure| figure.leg_m);
        }
        Biped::find(&Tree::of(skeleton))?;
        let zero = vec![Quat::IDENTITY; skeleton.joint_count()];
        let parts = Parts::find(skeleton, &zero)?;
        let at = places(skeleton, &zero);
        // The bones of legs hang in the neutral pose.
        let legs = parts.legs.iter().map(|leg| {
            let [hip, knee, ankle] = leg.chain().map(|joint| at[joint]);
            hip.distance(knee) + knee.distance(ankle)
        });
        Some(0.5 * legs.sum::<f32>())
    }

    /// The skeleton whose joints the parts are.
    pub fn skeleton(&self) -> &Arc<Skeleton> {
        &self.skeleton
    }

    /// The parts of the body.
    pub fn parts(&self) -> &Parts {
        &self.parts
    }

    /// World rotations of the neutral pose, one a joint.
    pub fn neutral(&self) -> &[Quat] {
        &self.neutral
    }

    /// Place of joint 0 in the neutral pose. The middle of the hips is above the origin, and the
    /// ground at height 0.
    pub fn root(&self) -> Vec3 {
        self.places[0]
    }

    /// Length of the legs from the hips to the ankles, metres.
    pub fn leg_m(&self) -> f32 {
        self.leg_m
    }

    /// Hips, the middle between them.
    pub(super) fn hips(&self) -> [usize; 2] {
        [0, 1].map(|side| self.parts.legs[side].top)
    }

    /// The vector from one joint to another in the neutral pose.
    pub(super) fn between(&self, from: usize, to: usize) -> Vec3 {
        self.places[to] - self.places[from]
    }
}

/// The turn about the vertical axis that makes a body head along +Z: by its hips.
fn turn_ahead(skeleton: &Skeleton, parts: &Parts, pose: &[Quat]) -> Quat {
    let places = places(skeleton, pose);
    let [left, right] = [0, 1].map(|side| places[parts.legs[side].top]);
    let across = (left - right).with_y(0.0);
    match across.try_normalize() {
        Some(left) => yaw(-heading_of(Quat::IDENTITY, left)),
        None => yaw(-heading_of(pose[0], skeleton.left_axis)),
    }
}

/// The neutral pose of a body on two legs that stands at rest.
fn neutral(skeleton: &Skeleton, parts: &Parts, pose: Vec<Quat>) -> Result<Vec<Quat>, RetargetError> {
    let at: Vec<Vec3> = places(skeleton, &pose);
    let feet = 0.5 * (at[parts.legs[0].end] + at[parts.legs[1].end]);
    let top = parts.neck.last().or(parts.trunk.last()).copied().unwrap_or(0);
    let upward = (at[top] - feet).normalize_or_zero();
    if upward.y < UPRIGHT {
        let [away, most] = [upward.y, UPRIGHT].map(|cosine| cosine.acos().to_degrees());
        return Err(RetargetError::NoStance(format!(
            "from its feet to its head is {away:.0}° away from upwards, and {most:.0}° are allowed"
        )));
    }
    let at: Vec<DVec3> = at.into_iter().map(Vec3::as_dvec3).collect();
    match RestPose::of(&parts.body(), &at, DVec3::Y) {
        (RestPose::None, evidence) => Err(RetargetError::NoStance(evidence)),
        _ => Ok(hang(skeleton, parts, &pose)),
    }
}

/// The places with the ground at height 0 and the middle of the hips above the origin.
fn grounded(skeleton: &Skeleton, parts: &Parts, mut places: Vec<Vec3>, root_y_m: Option<f32>) -> Vec<Vec3> {
    let lowest = match (&skeleton.contacts, root_y_m) {
        (Some(contacts), _) => {
            let heights = contacts.joints.iter().zip(&contacts.clearance_m);
            let grounds = heights.map(|(&joint, clearance)| places[joint].y - clearance);
            grounds.fold(f32::INFINITY, f32::min)
        }
        (None, Some(root_y_m)) => -root_y_m,
        (None, None) => ground(parts, &places),
    };
    let hips = [0, 1].map(|side| places[parts.legs[side].top]);
    let middle = (0.5 * (hips[0] + hips[1])).with_y(lowest);
    places.iter_mut().for_each(|place| *place -= middle);
    places
}

/// Height of the ground: below the toes by a share of the ankles' height over them, because joints
/// lie inside of the foot.
fn ground(parts: &Parts, places: &[Vec3]) -> f32 {
    let lowest = places.iter().map(|place| place.y).fold(f32::INFINITY, f32::min);
    let ankles = parts
        .legs
        .iter()
        .map(|leg| places[leg.end].y)
        .fold(f32::INFINITY, f32::min);
    let toes = parts.legs.iter().filter_map(|leg| Some(places[leg.toe?].y));
    let toes = toes.fold(f32::INFINITY, f32::min);
    match toes.is_finite() && toes < ankles {
        true => lowest.min(toes - SOLE_SHARE * (ankles - toes)),
        false => lowest,
    }
}
