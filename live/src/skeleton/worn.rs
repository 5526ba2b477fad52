//! The way from a pack's skeleton to a user's, and back.

use std::sync::Arc;

use troupe_character::Size;
use troupe_character::live::{Character, FrameOut};
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::clip::Clip;
use troupe_motion::fk::local_from_world_rotations;
use troupe_motion::interpolate::smoothstep;
use troupe_motion::model::Rig;
use troupe_motion::retarget::{Certificate, Figure, RetargetError, Retargeter};
use troupe_motion::rotation::{slerp, yaw};
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use crate::packs::{LoadedPack, PackTable};

/// Offsets of the same joints differ by less, metres.
const SAME_M: f32 = 1e-3;
/// Frames over which a character goes from a pose that its client gave to the pose as it is carried
/// over.
const EASE_FRAMES: f32 = 8.0;

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
    /// Each character that wears the skeleton has a clone.
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
        let pack = figure_of(loaded, place, table)?;
        let onto = Retargeter::new(pack.clone(), own.clone())?;
        Ok(Self {
            name: Arc::from(name),
            back: Retargeter::new(own.clone(), pack.clone())?,
            root_m: own.root() - onto.scale() * pack.root(),
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

    /// The user's joints for the pack's contact joints, by name: toes for toes, ankles for the rest
    /// of a foot. Empty names for contacts that are on no leg.
    pub(super) fn contact_joints(&self) -> Vec<String> {
        let [pack, own] = self.onto.figures();
        let limbs = [pack, own].map(|figure| {
            let parts = figure.parts();
            parts
                .legs
                .iter()
                .chain(parts.arms.iter().flatten())
                .collect::<Vec<_>>()
        });
        let [of_pack, of_own] = limbs;
        let limbs: Vec<_> = of_pack.into_iter().zip(of_own).collect();
        let parents = &pack.skeleton().joints;
        let above = |joint: usize| std::iter::successors(Some(joint), |&joint| parents[joint].parent);
        let same = |&contact: &usize| {
            let limb = limbs
                .iter()
                .find(|(from, _)| above(contact).any(|joint| joint == from.upper[0]));
            let joint = limb.map(|(from, to)| match contact == from.end {
                true => to.end,
                false => to.toe.unwrap_or(to.end),
            });
            joint.map_or_else(String::new, |joint| own.skeleton().joints[joint].name.clone())
        };
        let contacts = pack.skeleton().contacts.iter();
        contacts.flat_map(|contacts| &contacts.joints).map(same).collect()
    }

    /// Number of characters that wear the skeleton.
    pub(super) fn wearers(&self) -> usize {
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

    /// What the character of a session wears. It counts as long as it exists.
    pub(super) fn dress_for_session(&self) -> Dress {
        Dress {
            _wearer: Some(self.wearers.clone()),
            ..self.dress()
        }
    }

    /// A copy of the way onto the user's skeleton.
    pub fn dress(&self) -> Dress {
        let mut onto = self.onto.clone();
        onto.reset();
        Dress {
            pose: vec![Quat::IDENTITY; self.skeleton().joint_count()],
            reaches: Vec::new(),
            shown: None,
            holds: [0.0; 2],
            frame: 0.0,
            onto,
            ease: None,
            _wearer: None,
        }
    }
}

/// The way of one character onto a user's skeleton. It remembers the pose before.
#[derive(Debug, Clone)]
pub struct Dress {
    onto: Retargeter,
    pose: Vec<Quat>,
    /// Joints of the pack that are held at places, reused.
    reaches: Vec<usize>,
    /// Root of the last frame that was shown, and its time.
    shown: Option<(f64, Vec3)>,
    /// How far each hand holds on, 0 to 1.
    holds: [f32; 2],
    /// The last frame, or a place between two frames.
    frame: f64,
    ease: Option<Ease>,
    _wearer: Option<Arc<()>>,
}

/// From the pose as it is carried over to one that the client gave.
#[derive(Debug, Clone)]
struct Ease {
    /// The frame of the given pose.
    frame: f64,
    root: Vec3,
    /// Turns of the joints, each in its parent's frame of reference.
    turns: Vec<Quat>,
}

impl Dress {
    /// Carries the frame at the cursor of `character` over. It replaces the frame. Hands that hold
    /// an object or on to a place of the scene are where the character's hands are, in the user's
    /// size.
    pub fn put_on(&mut self, character: &Character, out: &mut FrameOut) {
        character.reaches(&mut self.reaches);
        self.reaches.extend(character.held().map(|held| held.joint));
        // Feet stand on flat ground to the retargeter.
        let lift = Vec3::Y * character.lift().root_m;
        let time = character.time_frames();
        let root = self.carry_holding(time, out.root - lift, &out.rotations);
        out.root = root + self.onto.scale() * lift;
        self.show(time, out);
    }

    /// As [`Dress::put_on`], for a frame that is not at the cursor.
    pub fn put_on_later(&mut self, out: &mut FrameOut) {
        out.root = self.carry(out.root, &out.rotations);
        self.show(out.frame as f64, out);
    }

    /// Carries a pose over with hands that hold on. A hand takes [`EASE_FRAMES`] to get there and
    /// to let go.
    fn carry_holding(&mut self, frame: f64, root: Vec3, rotations: &[Quat]) -> Vec3 {
        let step = (frame - self.frame).max(0.0) as f32 / EASE_FRAMES;
        self.frame = frame;
        for (side, holds) in self.hands().into_iter().enumerate() {
            let hold = self.holds[side] + if holds { step } else { -step };
            self.holds[side] = hold.clamp(0.0, 1.0);
        }
        if self.holds == [0.0; 2] {
            return self.carry(root, rotations);
        }
        let free = self.carry(root, rotations);
        let [pack, own] = self.onto.figures();
        let (Some(arms), Some(of_own)) = (&pack.parts().arms, &own.parts().arms) else {
            return free;
        };
        let goals = [0, 1].map(|side| {
            let hold = self.holds[side];
            (hold > 0.0).then(|| {
                let there = place_of(pack.skeleton(), root, rotations, arms[side].end);
                let own = place_of(own.skeleton(), free, &self.pose, of_own[side].end);
                (own / self.onto.scale()).lerp(there, smoothstep(hold))
            })
        });
        self.onto.pose_holding(root, rotations, goals, &mut self.pose)
    }

    /// The root of the frame at the cursor of `character`, if that is the last one that was shown.
    pub(crate) fn root_at_cursor(&self, character: &Character) -> Option<Vec3> {
        let (time, root) = self.shown?;
        (time == character.time_frames()).then_some(root)
    }

    /// Whether each hand holds on.
    fn hands(&self) -> [bool; 2] {
        let pack = self.onto.figures()[0];
        let joints = &pack.skeleton().joints;
        let line = |joint: usize| std::iter::successors(Some(joint), |&joint| joints[joint].parent);
        let holds = |wrist: usize| {
            self.reaches
                .iter()
                .any(|&held| line(held).any(|joint| joint == wrist))
        };
        let arms = pack.parts().arms.as_ref().filter(|_| !self.reaches.is_empty());
        arms.map_or([false; 2], |arms| arms.each_ref().map(|arm| holds(arm.end)))
    }

    /// Makes the last pose the frame.
    fn show(&mut self, time: f64, out: &mut FrameOut) {
        out.rotations.clear();
        out.rotations.extend_from_slice(&self.pose);
        self.settle(time, out);
        self.shown = Some((time, out.root));
        if let Some(robot) = &self.onto.figures()[1].skeleton().robot {
            robot.fit(&mut out.rotations, &mut out.fitted);
        } else {
            out.fitted.clear();
        }
    }

    /// Carries the next pose over, and returns its root. [`Dress::pose`] has its rotations.
    pub fn carry(&mut self, root: Vec3, rotations: &[Quat]) -> Vec3 {
        self.onto.pose(root, rotations, &mut self.pose)
    }

    /// The rotations of the last pose.
    pub fn pose(&self) -> &[Quat] {
        &self.pose
    }

    /// Begins at the frame at the cursor of `character`, whose pose the client gave: root and
    /// rotations on its skeleton.
    pub fn begin(&mut self, given: (Vec3, &[Quat]), character: &Character) {
        let mut made = FrameOut::default();
        character.sample(&mut made);
        let lift = Vec3::Y * character.lift().root_m;
        let root = self.carry(made.root - lift, &made.rotations) + self.onto.scale() * lift;
        let turns = given.1.iter().zip(&self.pose);
        self.shown = Some((character.time_frames(), given.0));
        self.ease = Some(Ease {
            frame: character.time_frames(),
            root: given.0 - root,
            turns: turns.map(|(given, made)| *given * made.conjugate()).collect(),
        });
    }

    /// Adds what is left of the way from a given pose.
    fn settle(&mut self, time: f64, out: &mut FrameOut) {
        let Some(ease) = &self.ease else {
            return;
        };
        let away = (time - ease.frame).max(0.0) as f32 / EASE_FRAMES;
        let share = smoothstep((1.0 - away).max(0.0));
        if share <= 0.0 {
            self.ease = None;
            return;
        }
        out.root += share * ease.root;
        for (rotation, &turn) in out.rotations.iter_mut().zip(&ease.turns) {
            *rotation = slerp(Quat::IDENTITY, turn, share) * *rotation;
        }
    }
}

/// World position of a joint.
fn place_of(skeleton: &Skeleton, root: Vec3, rotations: &[Quat], joint: usize) -> Vec3 {
    let (mut place, mut at) = (Vec3::ZERO, joint);
    // From the joint up: each parent turns what is below it.
    while let Some(parent) = skeleton.joints[at].parent {
        place = rotations[parent] * (skeleton.joints[at].offset_m + place);
        at = parent;
    }
    root + place
}

/// The figure of a pack's body: a robot by its hinges, others by the poses of their styles or of a
/// pack with the same skeleton, and otherwise by the body's neutral pose.
fn figure_of(loaded: &LoadedPack, place: usize, table: &PackTable) -> Result<Figure, RetargetError> {
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
fn same(one: &Rig, other: &Rig) -> bool {
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
