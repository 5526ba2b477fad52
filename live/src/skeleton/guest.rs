//! A skeleton that comes with a request, and goes with it.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use troupe_base::echo::{MAX_MESSAGE, cut};
use troupe_character::FieldError;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::retarget::Figure;
use troupe_motion::{Joint, Quat, Skeleton, Vec3};

use super::doc::{BodyDoc, JointsDoc, MAX_JOINTS, SkeletonDoc};
use super::error::SkeletonError;
use super::store::{Own, Skeletons};
use super::worn::{Worn, figure_of};
use crate::packs::{LoadedPack, PackTable};

/// What errors call it.
const NAME: &str = "of the request";

/// Most skeletons of requests that are kept.
const MOST: usize = 8;

/// The skeleton of a request: its joints, and its rest pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Guest {
    /// Parents before children.
    pub joints: Vec<Joint>,
    /// Rotations at rest: joint 0 in the world, others relative to their parents.
    pub rest: Vec<Quat>,
    /// Height of joint 0 at rest, metres.
    pub height_m: f32,
}

/// The skeletons of the newest requests: whoever asks again is not certified again.
#[derive(Debug, Default)]
pub(super) struct Guests(Mutex<VecDeque<(Guest, Arc<Own>)>>);

impl Skeletons {
    /// The skeleton of a request on the body with index `place` of a pack. `field` is the
    /// request's. The first call for a body takes milliseconds.
    ///
    /// # Errors
    /// [`SkeletonError::Field`] if no body is found, and [`SkeletonError::Unfit`] if motion of the
    /// pack cannot be carried over, or is below the bar.
    pub fn guest(
        &self,
        field: &str,
        guest: Guest,
        of: (&LoadedPack, usize),
        table: &PackTable,
    ) -> Result<Arc<Worn>, SkeletonError> {
        let known = self.guests.take(&guest);
        let own = match known {
            Some(own) => own,
            None => Arc::new(own(&guest).map_err(|why| wrong(field, &why))?),
        };
        self.guests.keep(guest, own.clone());
        own.fit(of, table, field)
    }
}

impl Guests {
    fn all(&self) -> MutexGuard<'_, VecDeque<(Guest, Arc<Own>)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self, guest: &Guest) -> Option<Arc<Own>> {
        let mut all = self.all();
        let at = all.iter().position(|(known, _)| known == guest)?;
        all.remove(at).map(|(_, own)| own)
    }

    fn keep(&self, guest: Guest, own: Arc<Own>) {
        let mut all = self.all();
        all.push_front((guest, own));
        all.truncate(MOST);
    }
}

/// Whether motion of a body of a pack can be carried over to other bodies.
pub fn can_wear((loaded, place): (&LoadedPack, usize), table: &PackTable) -> bool {
    figure_of(loaded, place, table).is_ok()
}

fn wrong(field: &str, why: &str) -> FieldError {
    // An error that says what is allowed says it best.
    let (message, allowed) = why
        .split_once("; allowed: ")
        .unwrap_or((why, "a body on two legs or four"));
    FieldError {
        field: field.to_owned(),
        message: cut(message, MAX_MESSAGE),
        allowed: allowed.to_owned(),
    }
}

fn own(guest: &Guest) -> Result<Own, String> {
    let count = guest.joints.len();
    if count > MAX_JOINTS {
        return Err(format!("has {count} joints; allowed: 1 to {MAX_JOINTS}"));
    }
    Own::new(SkeletonDoc {
        name: NAME.to_owned(),
        forced: false,
        notes: Vec::new(),
        body: BodyDoc::Joints(JointsDoc::of(&figure(guest)?)),
    })
}

fn figure(guest: &Guest) -> Result<Figure, String> {
    let skeleton = Skeleton::new(guest.joints.clone(), Vec3::X, 0.0, None);
    let skeleton = Arc::new(skeleton.map_err(|error| error.to_string())?);
    let found = Figure::resting(skeleton, &guest.rest, Some(guest.height_m), &PartsDoc::default());
    found.map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A person in a size, whose root is at a height.
    fn guest(size: f32, height_m: f32) -> Guest {
        let rows = [
            ("hips", "", [0.0; 3]),
            ("spine", "hips", [0.0, 0.2, 0.0]),
            ("neck", "spine", [0.0, 0.3, 0.0]),
            ("head", "neck", [0.0, 0.1, 0.0]),
            ("left_arm", "spine", [0.2, 0.25, 0.0]),
            ("left_forearm", "left_arm", [0.28, 0.0, 0.0]),
            ("left_hand", "left_forearm", [0.25, 0.0, 0.0]),
            ("right_arm", "spine", [-0.2, 0.25, 0.0]),
            ("right_forearm", "right_arm", [-0.28, 0.0, 0.0]),
            ("right_hand", "right_forearm", [-0.25, 0.0, 0.0]),
            ("left_thigh", "hips", [0.1, -0.05, 0.0]),
            ("left_shin", "left_thigh", [0.0, -0.42, 0.0]),
            ("left_foot", "left_shin", [0.0, -0.4, 0.0]),
            ("right_thigh", "hips", [-0.1, -0.05, 0.0]),
            ("right_shin", "right_thigh", [0.0, -0.42, 0.0]),
            ("right_foot", "right_shin", [0.0, -0.4, 0.0]),
        ];
        let joint = |(name, parent, offset): &(&str, &str, [f32; 3])| Joint {
            name: (*name).to_owned(),
            parent: rows.iter().position(|row| row.0 == *parent),
            offset_m: size * Vec3::from_array(*offset),
        };
        Guest {
            joints: rows.iter().map(joint).collect(),
            rest: vec![Quat::IDENTITY; rows.len()],
            height_m,
        }
    }

    #[test]
    fn a_rest_pose_on_the_ground_says_where_soles_are() {
        // Ankles are 0.87 m below the root; without toes nothing else says where the ground is.
        assert!((figure(&guest(1.0, 0.95)).unwrap().root().y - 0.95).abs() < 1e-4);
        for elsewhere in [0.0, 2.5] {
            let root = figure(&guest(1.0, elsewhere)).unwrap().root();
            assert!((root.y - 0.87).abs() < 1e-4, "{elsewhere}: {root}");
        }
    }

    #[test]
    fn the_newest_skeletons_are_kept() {
        let guests = Guests::default();
        let all: Vec<Guest> = (0..MOST + 2).map(|nth| guest(1.0 + nth as f32, 0.0)).collect();
        let first = Arc::new(own(&all[0]).unwrap());
        guests.keep(all[0].clone(), first.clone());
        for (nth, guest) in all.iter().enumerate().skip(1) {
            // The first one is asked for again and again.
            let again = guests.take(&all[0]).unwrap();
            assert!(Arc::ptr_eq(&again, &first), "{nth}");
            guests.keep(all[0].clone(), again);
            guests.keep(guest.clone(), Arc::new(own(guest).unwrap()));
        }
        assert_eq!(guests.all().len(), MOST);
        assert!(guests.take(&all[1]).is_none() && guests.take(&all[MOST + 1]).is_some());
    }

    #[test]
    fn what_is_no_body_says_what_is_allowed() {
        let mut lying = guest(1.0, 0.95);
        lying.rest[0] = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
        let error = wrong("skeleton", &own(&lying).unwrap_err());
        assert!(error.message.starts_with("the rest pose is no stance"), "{error}");
        assert_eq!(error.allowed, "upright, arms hanging or to the sides");
        let mut many = guest(1.0, 0.95);
        let tip = |nth| Joint {
            name: format!("tip_{nth}"),
            parent: Some(3),
            offset_m: Vec3::Y,
        };
        many.joints.extend((0..MAX_JOINTS).map(tip));
        assert_eq!(own(&many).unwrap_err(), "has 272 joints; allowed: 1 to 256");
        let error = wrong(
            "skeleton",
            &own(&Guest {
                joints: many.joints[..4].to_vec(),
                ..many
            })
            .unwrap_err(),
        );
        assert_eq!(error.allowed, "a body on two legs or four");
    }
}
