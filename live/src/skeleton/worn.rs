//! The way from a pack's skeleton to a user's, and back.

use std::sync::Arc;

use troupe_character::Size;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::clip::Clip;
use troupe_motion::fk::local_from_world_rotations;
use troupe_motion::model::Rig;
use troupe_motion::retarget::{Certificate, Figure, RetargetError, Retargeter};
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use super::difference::{self, Difference};
use super::dress::Dress;
use crate::packs::{LoadedPack, PackTable};

/// Offsets of the same joints differ by less, metres.
const SAME_M: f32 = 1e-3;

/// A skeleton of a user's own on a body of a pack.
#[derive(Debug)]
pub struct Worn {
    name: Arc<str>,
    /// From the pack's skeleton, and back. Each user takes a copy, because they remember the pose
    /// before.
    onto: Retargeter,
    back: Retargeter,
    /// The place of the skeleton's joint 0 in the neutral pose, less that of the pack's in the
    /// skeleton's size, metres.
    root_m: Vec3,
    certificate: Certificate,
    /// Each session that wears the skeleton has a clone until it ends.
    wearers: Arc<()>,
}

impl Worn {
    /// The skeleton called `name`, whose figure is `own`, on the body with index `place` of a pack.
    ///
    /// # Errors
    /// [`RetargetError`] if no motion can be carried over.
    pub(super) fn new(
        name: &str,
        own: &Figure,
        (loaded, place): (&LoadedPack, usize),
        table: &PackTable,
    ) -> Result<Self, RetargetError> {
        Self::between(name, own, figure_of(loaded, place, table)?)
    }

    /// The skeleton called `name`, whose figure is `own`, on that of a pack.
    ///
    /// # Errors
    /// [`RetargetError`] if no motion can be carried over.
    pub fn between(name: &str, own: &Figure, pack: Figure) -> Result<Self, RetargetError> {
        let onto = Retargeter::new(pack.clone(), own.clone())?;
        let root_m = own.root() - onto.scale() * pack.root();
        Ok(Self {
            name: Arc::from(name),
            back: Retargeter::new(own.clone(), pack)?,
            root_m,
            certificate: Certificate::of(&onto),
            wearers: Arc::default(),
            onto,
        })
    }

    /// The name of the skeleton.
    pub fn name(&self) -> &Arc<str> {
        &self.name
    }

    /// The skeleton of poses and frames.
    pub fn skeleton(&self) -> &Arc<Skeleton> {
        self.onto.figures()[1].skeleton()
    }

    /// Length of the skeleton's legs by that of the pack's: metres of the user for a metre of the
    /// pack's character.
    pub fn scale(&self) -> f32 {
        self.onto.scale()
    }

    /// The size of the user's body, for errors about values of the pack's.
    pub fn size(&self) -> Size {
        Size::new(self.scale(), self.root_m.y)
    }

    /// What motions of the pack keep on the skeleton.
    pub fn certificate(&self) -> &Certificate {
        &self.certificate
    }

    /// From the pack's skeleton.
    pub fn onto(&self) -> &Retargeter {
        &self.onto
    }

    /// The user's joints for the pack's contact joints, by name: toes for toes, ankles for the rest
    /// of a foot. Empty names for contacts that are on no leg.
    pub(super) fn contact_joints(&self) -> Vec<String> {
        let joints = &self.skeleton().joints;
        let contacts = self.onto.contacts().into_iter();
        let name = |own: Option<(usize, usize)>| own.map_or("", |(_, joint)| joints[joint].name.as_str());
        contacts.map(|own| name(own).to_owned()).collect()
    }

    /// Number of sessions that wear the skeleton.
    pub(crate) fn wearers(&self) -> usize {
        Arc::strong_count(&self.wearers) - 1
    }

    /// The root of the user's skeleton while the pack's stands with this root.
    pub fn root_out(&self, root: GlobalRoot) -> GlobalRoot {
        let GlobalRoot { position, heading } = root;
        let position = self.scale() * position + yaw(heading) * self.root_m;
        GlobalRoot::new(position, heading)
    }

    /// The root of the pack's skeleton while the user's stands with this root.
    pub fn root_in(&self, root: GlobalRoot) -> GlobalRoot {
        let GlobalRoot { position, heading } = root;
        let position = (position - yaw(heading) * self.root_m) / self.scale();
        GlobalRoot::new(position, heading)
    }

    /// The place of the pack's root for one of the user's, metres, without regard to where the body
    /// heads.
    pub fn place_in(&self, place: Vec3) -> Vec3 {
        (place - Vec3::Y * self.root_m.y) / self.scale()
    }

    /// Height of the user's root for a height of the pack's, metres.
    pub fn height_out(&self, height_m: f32) -> f32 {
        height_m * self.scale() + self.root_m.y
    }

    /// Height of the pack's root for a height of the user's, metres.
    pub fn height_in(&self, height_m: f32) -> f32 {
        (height_m - self.root_m.y) / self.scale()
    }

    /// Carries consecutive poses on the user's skeleton over to the pack's: roots, and rotations of
    /// all joints.
    pub fn back(&self, frames: &[(Vec3, &[Quat])]) -> Vec<(Vec3, Vec<Quat>)> {
        let mut back = self.back.clone();
        back.reset();
        let joints = back.figures()[1].skeleton().joint_count();
        let mut pose = vec![Quat::IDENTITY; joints];
        let carry = |&(root, rotations): &(Vec3, &[Quat])| {
            let root = back.pose(root, rotations, &mut pose);
            (root, pose.clone())
        };
        frames.iter().map(carry).collect()
    }

    /// From a pose on the user's skeleton that was made to a given one.
    pub fn difference(&self, made: (Vec3, &[Quat]), given: (Vec3, &[Quat])) -> Difference {
        Difference::between(self.onto.figures()[1], made, given)
    }

    /// Adds shares of differences, 0 to 1, to a pose on the user's skeleton.
    pub fn add(&self, shares: &[(f32, &Difference)], root: &mut Vec3, rotations: &mut [Quat]) {
        difference::add(self.onto.figures()[1], shares, root, rotations);
    }

    /// What the character of a session wears. It counts until it is taken off or dropped.
    pub(crate) fn dress_for_session(&self) -> Dress {
        Dress::new(self.onto.clone(), Some(self.wearers.clone()))
    }

    /// A copy of the way onto the user's skeleton.
    pub fn dress(&self) -> Dress {
        Dress::new(self.onto.clone(), None)
    }
}

/// The figure of a pack's body: a robot by its hinges, others by the poses of their styles or of a
/// pack with the same skeleton, and otherwise by the body's neutral pose.
pub(super) fn figure_of(
    loaded: &LoadedPack,
    place: usize,
    table: &PackTable,
) -> Result<Figure, RetargetError> {
    let doc = PartsDoc::default();
    let skeleton = &loaded.rig(place).skeleton;
    if skeleton.robot.is_some() {
        return Figure::of_robot(skeleton.clone(), &doc);
    }
    let is_same =
        |other: &&Arc<LoadedPack>| other.pack.bodies.is_empty() && same(other.rig(0), loaded.rig(place));
    let others = table.all().filter(is_same).map(|other| &**other);
    // Poses of a walk show how feet stand, which a neutral pose alone does not.
    let own = std::iter::once(loaded).filter(|pack| pack.pack.bodies.is_empty());
    let mut clips = own.chain(others).filter_map(|pack| poses(pack, skeleton));
    if let Some(clip) = clips.next() {
        return Figure::of_clip(&clip, None, &doc);
    }
    if let Some(body) = loaded.pack.bodies.get(place) {
        let mut local = vec![Quat::IDENTITY; body.joints()];
        local_from_world_rotations(skeleton, &body.neutral, &mut local);
        return Figure::new(skeleton.clone(), &local, Some(body.height_m), &doc);
    }
    let still = vec![Quat::IDENTITY; skeleton.joint_count()];
    Figure::new(skeleton.clone(), &still, None, &doc)
}

/// Whether two rigs have the same joints.
pub(super) fn same(one: &Rig, other: &Rig) -> bool {
    let (one, other) = (&one.skeleton.joints, &other.skeleton.joints);
    let pairs = || one.iter().zip(other);
    one.len() == other.len()
        && pairs().all(|(a, b)| (&a.name, a.parent) == (&b.name, b.parent))
        // The root's offset has no meaning.
        && pairs().skip(1).all(|(a, b)| a.offset_m.distance(b.offset_m) < SAME_M)
}

/// All poses of a pack's default style.
fn poses(loaded: &LoadedPack, skeleton: &Arc<Skeleton>) -> Option<Clip> {
    let style = loaded.styles.first()?.default_style()?;
    let keys = || style.gaits.iter().flat_map(|gait| &gait.keys);
    let roots = keys().map(|key| Vec3::Y * key.height_m).collect();
    let rotations = keys().flat_map(|key| key.rotations.iter().copied()).collect();
    Clip::new(skeleton.clone(), loaded.rig(0).fps, roots, rotations).ok()
}
