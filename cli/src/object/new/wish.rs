//! The arguments worked out: sets, keyframes and sockets.

use troupe_motion::Skeleton;
use troupe_motion::clip::Clip;
use troupe_motion::stance::low_hips_m;
use troupe_proto::docs::{EventDoc, KeyframeDoc, Motion, Origin, SetDoc, SocketDoc};

use super::args::New;
use super::placement::{Placement, Pose, View, keyframe};
use super::seat::{HEIGHTS_M, seated};
use super::wrong::Wrong;

/// Most frames by which a soft set may be left early.
const MAX_DROP_FRAMES: u32 = 64;
/// Most frames that a set may be held.
const MAX_HOLD_FRAMES: u32 = 9000;
/// A character whose root moves by less, metres, and turns by less, radians, counts as standing.
const STAYS: (f32, f32) = (0.15, 0.35);

/// Frames that a set may take in the pack, from the last frame before it to its keyframe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    pub(super) least: u32,
    pub(super) most: u32,
}

/// The arguments, with frames as indices into --frames and joints as indices into the skeleton.
pub(super) struct Wish<'a> {
    new: &'a New,
    skeleton: &'a Skeleton,
    limits: Limits,
    pub(super) variant: String,
    /// The frame at which the object is placed, or taken.
    pub(super) object: usize,
    /// Joint that takes it.
    pub(super) hand: Option<usize>,
    release: Option<usize>,
    /// The frame of sitting, and the height of the seat, metres.
    pub(super) seat: Option<(usize, f32)>,
    points: Vec<usize>,
    /// The frame that is held until the interaction is ended.
    held: Option<usize>,
    /// Frames for which each keyframe is held.
    holds: Vec<u32>,
    drops: Vec<u32>,
}

impl<'a> Wish<'a> {
    pub(super) fn new(new: &'a New, skeleton: &'a Skeleton, limits: Limits) -> Result<Self, Wrong> {
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
        let seat = new
            .seat
            .map(|seat| Ok((index("--seat", seat.frame, new)?, check_seat(seat.value)?)));
        let points = new.points.iter().map(|name| joint("--points", name, skeleton));
        let mut wish = Self {
            new,
            skeleton,
            limits,
            variant: new.variant.clone().or(new.name.clone()).unwrap_or_default(),
            object,
            hand,
            release,
            seat: seat.transpose()?,
            points: points.collect::<Result<_, _>>()?,
            held: None,
            holds: vec![0; new.frames.len()],
            drops: vec![0; new.frames.len()],
        };
        wish.take_holds()?;
        wish.take_drops()?;
        Ok(wish)
    }

    /// The poses of all sets.
    pub(super) fn poses(&self, clip: &Clip) -> Result<Vec<Pose>, Wrong> {
        let frames = self.new.frames.iter();
        let mut poses: Vec<Pose> = frames.map(|&frame| Pose::of(clip, frame)).collect();
        if let Some((nth, height)) = self.seat {
            poses[nth] = seated(self.skeleton, &poses[nth], height).ok_or_else(|| {
                let message = "the pack's skeleton has no legs that can be bent";
                Wrong::new("--seat", message, "a pack whose contact joints are feet")
            })?;
        }
        Ok(poses)
    }

    /// Whether the motion to a set differs from the clip, which does not sit.
    fn is_from_or_to_seat(&self, nth: usize) -> bool {
        self.seat.is_some_and(|(seat, _)| nth == seat || nth == seat + 1)
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
        let before = match nth.checked_sub(1) {
            None => self.new.start?,
            Some(_) if self.is_from_or_to_seat(nth) => return None,
            Some(before) => self.new.frames[before],
        };
        u32::try_from(self.new.frames[nth].abs_diff(before)).ok()
    }

    /// The same, if a segment may have that many frames.
    fn timing(&self, nth: usize) -> Option<u32> {
        let Limits { least, most } = self.limits;
        self.clip_frames(nth)
            .filter(|frames| (least..=most).contains(frames))
    }

    fn name(&self, nth: usize) -> String {
        let given = self.new.sets.get(nth).cloned();
        given.unwrap_or_else(|| format!("{}-{}", self.variant, nth + 1))
    }

    /// The first set of the way out of a held keyframe.
    pub(super) fn exit(&self) -> Option<usize> {
        self.held
            .map(|held| held + 1)
            .filter(|&first| first < self.new.frames.len())
    }

    /// Whether the object is, or has been, in the hand when a set begins.
    fn is_taken(&self, nth: usize) -> bool {
        self.hand.is_some() && nth > self.object
    }

    /// The set of a pose. A skill begins at `start`.
    pub(super) fn set(
        &self,
        nth: usize,
        poses: &[Pose],
        start: Option<&Pose>,
        placement: &Placement,
        notes: &mut Vec<String>,
    ) -> SetDoc {
        let pose = &poses[nth];
        let before = nth.checked_sub(1).map_or(start, |before| Some(&poses[before]));
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
            keyframes: vec![self.keyframe(pose, (before, nth + 1 == poses.len()), taken, placement)],
        }
    }

    fn motion(&self, pose: &Pose, before: Option<&Pose>) -> Option<Motion> {
        if self.new.skill {
            // The networks make it.
            return None;
        }
        let low_m = low_hips_m(self.skeleton);
        let low = |pose: &Pose| pose.root.position.y - self.skeleton.ground_y_m < low_m;
        let low = self.points.is_empty() && (low(pose) || before.is_some_and(low));
        low.then_some(Motion::Stance)
    }

    fn keyframe(
        &self,
        pose: &Pose,
        (before, is_last): (Option<&Pose>, bool),
        taken: bool,
        placement: &Placement,
    ) -> KeyframeDoc {
        let ground = self.skeleton.ground_y_m;
        if self.new.skill {
            let view = View::of_character(before.unwrap_or(pose), ground);
            let key = keyframe(pose, &view, false);
            return match is_last && self.new.stand {
                true => KeyframeDoc {
                    height_m: None,
                    from_ground: false,
                    rotations: None,
                    ..key
                },
                false => key,
            };
        }
        let view = match before {
            Some(before) if taken => View::of_character(before, ground),
            _ => View::of_object(placement, ground),
        };
        if self.points.is_empty() {
            return keyframe(pose, &view, self.new.pivot && !taken);
        }
        let stays = before.is_some_and(|before| pose.stays_at(before, STAYS));
        // A thing that stands on something may be higher or lower in a scene, and hands follow it.
        let raised = !taken && placement.origin.y > ground;
        let heights = if raised { placement.origin.y } else { ground };
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

    /// The place of the object in the hand, as it is when the hand takes it.
    pub(super) fn socket(&self, pose: &Pose, placement: &Placement) -> Option<SocketDoc> {
        let joint = self.hand?;
        let (position_m, rotation) = placement.in_joint(pose, joint);
        Some(SocketDoc {
            name: self.socket_name(),
            joint: self.skeleton.joints[joint].name.clone(),
            position_m,
            rotation: Some(rotation),
            blend_frames: 4,
            swings: false,
            upright: false,
        })
    }
}

fn check_seat(height: f32) -> Result<f32, Wrong> {
    let (low, high) = HEIGHTS_M;
    match (low..=high).contains(&height) {
        true => Ok(height),
        false => {
            let message = format!("a seat of {height} m");
            Err(Wrong::new("--seat", message, format!("{low} to {high} m")))
        }
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
