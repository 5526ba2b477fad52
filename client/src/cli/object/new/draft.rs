//! From frames of a clip to a definition.

use troupe_motion::Skeleton;
use troupe_motion::clip::Clip;
use troupe_proto::docs::{
    ApproachDoc, BoxDoc, EventDoc, KeyframeDoc, Motion, ObjectDoc, Origin, ReleaseDoc, SetDoc, ShapeDoc,
    SocketDoc, TriggerDoc, VariantDoc,
};

use super::args::{New, Size};
use super::stage::{Pose, Stage, View, keyframe, rounded};

/// Hips lower than this over the ground are in no clip that the default pack knows, metres.
const LOW_HIPS_M: f32 = 0.70;
/// Sets that a definition may have.
const MAX_SETS: usize = 32;
/// Most frames by which a soft set may be left early.
const MAX_DROP_FRAMES: u32 = 64;
/// Most frames that a set may be held.
const MAX_HOLD_FRAMES: u32 = 9000;
/// A character whose root moves by less, metres, and turns by less, radians, stays where it is.
const STAYS: (f32, f32) = (0.15, 0.35);
/// Sizes where none is given.
const SIZE: Size = Size([0.4, 0.9, 0.4]);
const SIZE_IN_HAND: Size = Size([0.08, 0.12, 0.08]);
/// A trigger reaches so much farther than the keyframes are, metres.
const TRIGGER_SPARE_M: f32 = 0.4;

/// What cannot be made into a definition.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{option}: {message}; allowed: {allowed}")]
pub(super) struct Wrong {
    option: &'static str,
    message: String,
    allowed: String,
}

impl Wrong {
    pub(super) fn new(option: &'static str, message: impl Into<String>, allowed: impl Into<String>) -> Self {
        let (message, allowed) = (message.into(), allowed.into());
        Self {
            option,
            message,
            allowed,
        }
    }
}

/// A definition that was made from a clip.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Draft {
    pub(super) doc: ObjectDoc,
    /// What its maker may want to know.
    pub(super) notes: Vec<String>,
}

/// Frames that a set may take in the pack, from the last frame before it to its keyframe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    pub(super) least: u32,
    pub(super) most: u32,
}

/// Makes the definition that is asked for. `clip` is at the pack's rate, on its skeleton. `into`: the definition that it is added to;
/// then all that is made but sockets, variant and sets is of no account.
pub(super) fn draft(
    new: &New,
    clip: &Clip,
    limits: Limits,
    into: Option<&ObjectDoc>,
) -> Result<Draft, Wrong> {
    check_frames(new, clip)?;
    let poses: Vec<Pose> = new.frames.iter().map(|&frame| Pose::of(clip, frame)).collect();
    let wish = Wish::new(new, &clip.skeleton, limits)?;
    let shape = match into {
        Some(old) => old.shape.clone(),
        None => ShapeDoc::Box(standing_box(new.shape.unwrap_or(match wish.hand {
            Some(_) => SIZE_IN_HAND,
            None => SIZE,
        }))),
    };
    let subject = &poses[wish.object];
    let stage = match wish.hand {
        Some(joint) => Stage::in_hand(&clip.skeleton, subject, joint, new.grip, middle(&shape)),
        None => Stage::before(&clip.skeleton, subject, new.distance, new.height),
    };
    let mut notes = Vec::new();
    let sets: Vec<SetDoc> = (0..poses.len())
        .map(|nth| wish.set(nth, &poses, &stage, &mut notes))
        .collect();
    let name = new.name.clone().unwrap_or_default();
    let farthest = sets.iter().flat_map(|set| &set.keyframes).filter_map(from_object);
    let reach = farthest.fold(0.2, f32::max) + TRIGGER_SPARE_M;
    let doc = ObjectDoc {
        format: 1,
        name,
        description: new.description.clone(),
        solid: !new.not_solid,
        shared: new.shared,
        shape,
        trigger: TriggerDoc {
            reach_m: (reach * 10.0).ceil() / 10.0,
            shape: None,
        },
        anchor: Default::default(),
        release: ReleaseDoc::default(),
        approaches: if new.pivot { Vec::new() } else { vec![front(&sets)] },
        sockets: wish.socket(subject, &stage).into_iter().collect(),
        variants: vec![VariantDoc {
            name: wish.variant.clone(),
            weight: new.weight,
            entry: sets[0].name.clone(),
            exit: wish.exit().map(|first| sets[first].name.clone()),
        }],
        sets,
    };
    let doc = match into {
        Some(old) => beside(old, doc)?,
        None => doc,
    };
    Ok(Draft { doc, notes })
}

/// Fits what was made to a definition that it is added to: names that are different, and sockets that it has not.
fn beside(old: &ObjectDoc, mut made: ObjectDoc) -> Result<ObjectDoc, Wrong> {
    let variant = made.variants[0].name.clone();
    if old.variants.iter().any(|other| other.name == variant) {
        let message = format!("{variant:?} is a variant that the definition has");
        return Err(Wrong::new("--variant", message, "another name"));
    }
    let is_old = |set: &&SetDoc| old.sets.iter().any(|other| other.name == set.name);
    if let Some(set) = made.sets.iter().find(is_old) {
        let message = format!("{:?} is a set that the definition has", set.name);
        return Err(Wrong::new("--sets", message, "other names"));
    }
    let count = old.sets.len() + made.sets.len();
    if count > MAX_SETS {
        let message = format!("they make {count} sets with those of the definition");
        return Err(Wrong::new(
            "--frames",
            message,
            format!("{MAX_SETS} sets together"),
        ));
    }
    for mut socket in std::mem::take(&mut made.sockets) {
        match old.sockets.iter().find(|other| other.name == socket.name) {
            Some(same) if *same == socket => continue,
            Some(_) => socket.name = format!("{}-{variant}", socket.name),
            None => {}
        }
        let events = made.sets.iter_mut().flat_map(|set| &mut set.events);
        for attach in events.filter_map(|event| event.attach.as_mut()) {
            attach.clone_from(&socket.name);
        }
        made.sockets.push(socket);
    }
    Ok(made)
}

/// Height of a shape's middle over its origin, metres.
fn middle(shape: &ShapeDoc) -> f32 {
    match shape {
        ShapeDoc::Box(shape) => shape.center_m[1],
        ShapeDoc::Convex(shape) => {
            let heights = shape.points_m.iter().map(|point| point[1]);
            let (low, high) = heights.fold((f32::MAX, f32::MIN), |(low, high), y| (low.min(y), high.max(y)));
            (low + high) / 2.0
        }
    }
}

/// A box that stands on the origin.
fn standing_box(Size([width, height, depth]): Size) -> BoxDoc {
    BoxDoc {
        center_m: [0.0, height / 2.0, 0.0],
        half_extents_m: [width / 2.0, height / 2.0, depth / 2.0],
    }
}

/// How far a keyframe's root is from the object, metres.
fn from_object(key: &KeyframeDoc) -> Option<f32> {
    key.place_m.map(|[x, z]| x.hypot(z))
}

/// The side that a character comes from where keyframes do not turn: about the object's front.
fn front(sets: &[SetDoc]) -> ApproachDoc {
    const SIDE_DEG: f32 = 60.0;
    /// A character that has to turn round first gets so much more room, metres.
    const ROOM_M: f32 = 0.4;
    let first = &sets[0].keyframes[0];
    let turns_round = first.heading_deg.is_some_and(|heading| heading.abs() < 90.0);
    let distance = from_object(first).unwrap_or(0.0) + if turns_round { ROOM_M } else { 0.0 };
    ApproachDoc {
        name: "front".to_owned(),
        directions_deg: [-SIDE_DEG, SIDE_DEG],
        distance_m: Some(rounded(distance, 2)),
    }
}

fn check_frames(new: &New, clip: &Clip) -> Result<(), Wrong> {
    let last = clip.frames() - 1;
    if let Some(frame) = new.frames.iter().find(|&&frame| frame > last) {
        let message = format!("{frame} is not in the clip");
        return Err(Wrong::new("--frames", message, format!("0 to {last}")));
    }
    let count = new.frames.len();
    if count > MAX_SETS {
        let message = format!("{count} frames");
        return Err(Wrong::new(
            "--frames",
            message,
            format!("1 to {MAX_SETS} of them"),
        ));
    }
    if !new.sets.is_empty() && new.sets.len() != count {
        let message = format!("{} names for {count} frames", new.sets.len());
        return Err(Wrong::new("--sets", message, "as many as --frames, or none"));
    }
    if let Some(twice) =
        (new.sets.iter().enumerate()).find_map(|(nth, name)| new.sets[..nth].contains(name).then_some(name))
    {
        let message = format!("{twice:?} is given twice");
        return Err(Wrong::new("--sets", message, "names that are all different"));
    }
    if !(0.0..=1000.0).contains(&new.weight) {
        return Err(Wrong::new("--weight", new.weight.to_string(), "0 to 1000"));
    }
    Ok(())
}

/// What is asked for, with frames as indices into --frames and joints as indices into the skeleton.
struct Wish<'a> {
    new: &'a New,
    skeleton: &'a Skeleton,
    limits: Limits,
    variant: String,
    /// Where the object is, and is taken.
    object: usize,
    /// Joint that takes it.
    hand: Option<usize>,
    release: Option<usize>,
    points: Vec<usize>,
    /// Held until ended.
    held: Option<usize>,
    /// For how many frames each is held.
    holds: Vec<u32>,
    drops: Vec<u32>,
}

impl<'a> Wish<'a> {
    fn new(new: &'a New, skeleton: &'a Skeleton, limits: Limits) -> Result<Self, Wrong> {
        let object = match new.object_frame {
            Some(frame) => index("--object-frame", frame, new)?,
            None => 0,
        };
        let hand = new
            .hand
            .as_ref()
            .map(|name| joint("--hand", name, skeleton))
            .transpose()?;
        let release = new
            .release
            .map(|frame| last_index("--release", frame, new))
            .transpose()?;
        if release.is_some_and(|release| release <= object) {
            let message = "the object is put down before it is taken";
            return Err(Wrong::new(
                "--release",
                message,
                "a frame that comes after --object-frame",
            ));
        }
        let points = new.points.iter().map(|name| joint("--points", name, skeleton));
        let mut wish = Self {
            new,
            skeleton,
            limits,
            variant: new.variant.clone().or(new.name.clone()).unwrap_or_default(),
            object,
            hand,
            release,
            points: points.collect::<Result<_, _>>()?,
            held: None,
            holds: vec![0; new.frames.len()],
            drops: vec![0; new.frames.len()],
        };
        wish.take_holds()?;
        wish.take_drops()?;
        Ok(wish)
    }

    fn take_holds(&mut self) -> Result<(), Wrong> {
        for hold in &self.new.hold {
            let nth = index("--hold", hold.frame, self.new)?;
            match hold.value {
                Some(frames @ 0..=MAX_HOLD_FRAMES) => self.holds[nth] = frames,
                Some(frames) => {
                    let message = format!("{}={frames}", hold.frame);
                    return Err(Wrong::new(
                        "--hold",
                        message,
                        format!("0 to {MAX_HOLD_FRAMES} frames"),
                    ));
                }
                None if self.held.is_some_and(|held| held != nth) => {
                    let message = "two frames are held until the interaction is ended";
                    return Err(Wrong::new(
                        "--hold",
                        message,
                        "one of them; FRAME=COUNT for others",
                    ));
                }
                None => self.held = Some(nth),
            }
        }
        Ok(())
    }

    fn take_drops(&mut self) -> Result<(), Wrong> {
        for soft in &self.new.soft {
            let nth = index("--soft", soft.frame, self.new)?;
            let most = self
                .timing(nth)
                .map_or(MAX_DROP_FRAMES, |frames| frames.min(MAX_DROP_FRAMES));
            if !(0..=most).contains(&soft.value) {
                let message = format!("{}={}", soft.frame, soft.value);
                return Err(Wrong::new(
                    "--soft",
                    message,
                    format!("a TAU of 0 to {most} frames there"),
                ));
            }
            self.drops[nth] = soft.value;
        }
        Ok(())
    }

    /// Frames that the clip takes to a pose from the one before.
    fn clip_frames(&self, nth: usize) -> Option<u32> {
        let before = self.new.frames[nth.checked_sub(1)?];
        u32::try_from(self.new.frames[nth].abs_diff(before)).ok()
    }

    /// The same, where a segment may take as long.
    fn timing(&self, nth: usize) -> Option<u32> {
        let Limits { least, most } = self.limits;
        self.clip_frames(nth)
            .filter(|frames| (least..=most).contains(frames))
    }

    fn name(&self, nth: usize) -> String {
        let given = self.new.sets.get(nth).cloned();
        given.unwrap_or_else(|| format!("{}-{}", self.variant, nth + 1))
    }

    /// The first set with which what is held is left.
    fn exit(&self) -> Option<usize> {
        self.held
            .map(|held| held + 1)
            .filter(|&first| first < self.new.frames.len())
    }

    /// Whether the object is, or has been, in the hand when a set begins.
    fn is_taken(&self, nth: usize) -> bool {
        self.hand.is_some() && nth > self.object
    }

    fn set(&self, nth: usize, poses: &[Pose], stage: &Stage, notes: &mut Vec<String>) -> SetDoc {
        let pose = &poses[nth];
        let before = nth.checked_sub(1).map(|before| &poses[before]);
        let frames = self.timing(nth);
        if let (None, Some(clip_frames)) = (frames, self.clip_frames(nth)) {
            let Limits { least, most } = self.limits;
            notes.push(format!(
                "set {}: the clip takes {clip_frames} frames there, a segment {least} to {most}; its timing is left to the pack",
                self.name(nth),
            ));
        }
        let taken = self.is_taken(nth);
        let last = nth + 1 == poses.len() || self.held == Some(nth);
        let attach = (self.hand.is_some() && nth == self.object).then(|| EventDoc {
            attach: Some(self.socket_name()),
            ..EventDoc::default()
        });
        let release = (self.release == Some(nth)).then(|| EventDoc {
            release: true,
            ..EventDoc::default()
        });
        SetDoc {
            name: self.name(nth),
            next: (!last).then(|| self.name(nth + 1)),
            origin: if taken { Origin::Character } else { Origin::Object },
            motion: self.motion(pose, before),
            from_stand: nth == 0 && self.new.from_stand,
            frames,
            drop_frames: self.drops[nth],
            hold_frames: if self.held == Some(nth) {
                0
            } else {
                self.holds[nth]
            },
            hold_until_ended: self.held == Some(nth),
            events: attach.into_iter().chain(release).collect(),
            keyframes: vec![self.keyframe(pose, before, taken, stage)],
        }
    }

    fn motion(&self, pose: &Pose, before: Option<&Pose>) -> Option<Motion> {
        let low = |pose: &Pose| pose.root.position.y - self.skeleton.ground_y_m < LOW_HIPS_M;
        let low = self.points.is_empty() && (low(pose) || before.is_some_and(low));
        self.new
            .motion
            .map(Motion::from)
            .or(low.then_some(Motion::Stance))
    }

    fn keyframe(&self, pose: &Pose, before: Option<&Pose>, taken: bool, stage: &Stage) -> KeyframeDoc {
        let ground = self.skeleton.ground_y_m;
        let view = match before {
            Some(before) if taken => View::of_character(before, ground),
            _ => View::of_object(stage, ground),
        };
        if self.points.is_empty() {
            return keyframe(pose, &view, self.new.pivot && !taken);
        }
        let stays = before.is_some_and(|before| pose.stays_at(before, STAYS));
        // A thing that stands on something may stand higher or lower in a scene: hands go where it is.
        let raised = !taken && stage.origin.y > ground;
        let heights = if raised { stage.origin.y } else { ground };
        KeyframeDoc {
            place_m: (!stays).then(|| view.place(pose.root.position)),
            heading_deg: (!stays).then(|| view.heading_deg(pose.root.heading)),
            from_ground: !raised,
            points: (self.points.iter())
                .map(|&joint| view.point(self.skeleton, pose, joint, heights))
                .collect(),
            pivot: self.new.pivot && !taken,
            ..KeyframeDoc::default()
        }
    }

    fn socket_name(&self) -> String {
        let joint = self.hand.map(|joint| self.skeleton.joints[joint].name.as_str());
        let fits = |c: char| {
            if c.is_ascii_alphanumeric() {
                c.to_ascii_lowercase()
            } else {
                '-'
            }
        };
        joint.unwrap_or_default().chars().map(fits).collect()
    }

    /// Where the hand holds the object: as it is there when it takes it.
    fn socket(&self, pose: &Pose, stage: &Stage) -> Option<SocketDoc> {
        let joint = self.hand?;
        let (position_m, rotation) = stage.in_joint(pose, joint);
        Some(SocketDoc {
            name: self.socket_name(),
            joint: self.skeleton.joints[joint].name.clone(),
            position_m,
            rotation,
            blend_frames: 4,
        })
    }
}

/// The first set of a frame.
fn index(option: &'static str, frame: usize, new: &New) -> Result<usize, Wrong> {
    let found = new.frames.iter().position(|&given| given == frame);
    found.ok_or_else(|| not_given(option, frame, new))
}

/// The last set of a frame.
fn last_index(option: &'static str, frame: usize, new: &New) -> Result<usize, Wrong> {
    let found = new.frames.iter().rposition(|&given| given == frame);
    found.ok_or_else(|| not_given(option, frame, new))
}

fn not_given(option: &'static str, frame: usize, new: &New) -> Wrong {
    let frames: Vec<_> = new.frames.iter().map(usize::to_string).collect();
    let message = format!("frame {frame} is none of --frames");
    Wrong::new(option, message, frames.join(", "))
}

fn joint(option: &'static str, name: &str, skeleton: &Skeleton) -> Result<usize, Wrong> {
    skeleton.joint_index(name).ok_or_else(|| {
        let names: Vec<_> = skeleton.joints.iter().map(|joint| joint.name.as_str()).collect();
        Wrong::new(
            option,
            format!("the pack has no joint {name:?}"),
            names.join(", "),
        )
    })
}
