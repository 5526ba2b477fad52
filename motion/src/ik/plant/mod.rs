//! Makes feet stand that a network lets glide.
//!
//! [`lock_feet`](super::lock_feet) holds a foot that hardly moves. Here a foot stands because the
//! other one steps: of a pair of feet, the one that moves less over the ground carries a body that
//! goes. It stays at the mean of its places. So the network's steps become as long as the body's
//! way, and the feet are carried from one place to the next.

mod schedule;
mod way;

use std::ops::Range;

use glam::{Quat, Vec3};

use crate::interpolate::smoothstep;
use crate::skeleton::Skeleton;

use super::lock::excess_height;
use super::two_bone::STRAIGHTEST;
use super::{Leg, LegTrack, cover, forward, place_end, two_bone_soft};
use schedule::{Walker, flat, schedule, way_m};
use way::{Foot, Knot};

/// Share of a leg's length over which it eases towards full reach.
const SOFT_SHARE: f32 = 0.02;
/// Farthest that the root is lowered for a leg that would be too short, leg lengths.
const MOST_DROP: f32 = 0.09;
/// Half of the window over which the lowering of the root is smoothed, frames.
const DROP_HALF_WINDOW: usize = 8;
/// Frames over which the lowering of the root leaves that of the frame before.
const DROP_FADE_FRAMES: usize = 8;
/// Farthest that a foot rolls over its toes, so that a leg behind the body reaches it, radians.
const MOST_ROLL: f32 = 0.7;
/// A foot longer than this does not roll, leg lengths.
const SHORT_FOOT: f32 = 0.35;
/// Halvings of the search for that angle.
const ROLL_STEPS: usize = 12;
/// Smaller offsets count as none, metres.
const NO_OFFSET_M: f32 = 1e-5;
/// An ankle lower than this over where it stands is in contact too, leg lengths.
const ANKLE_LOW: f32 = 0.04;

/// Options of [`plant_feet`].
#[derive(Clone, Debug, PartialEq)]
pub struct FootPlant {
    /// Frames a second.
    pub fps: f32,
    /// The frames that may change. Those around them are read: a foot that stands there fixes its
    /// place.
    pub range: Range<usize>,
    /// Height of the ground, metres.
    pub floor_m: f32,
    /// Height of the root over the ground where the body stands, metres; infinite if it stands on
    /// straight legs. Legs that are spread, as a spider's, are longer than that.
    pub height_m: f32,
}

/// What [`plant_feet`] made of the feet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Planted {
    legs: Vec<PlantedLeg>,
    drops_m: Vec<f32>,
    /// The first frame that was free.
    first: usize,
}

#[derive(Clone, Debug, Default, PartialEq)]
struct PlantedLeg {
    offsets: Vec<Vec3>,
    toes: Vec<Vec3>,
    hips: Vec<Vec3>,
    stands: Vec<Range<usize>>,
    gone_m: f32,
}

/// What feet bring along from a frame that is final to those that follow. Then the frames before
/// [`FootPlant::range`] are the network's, without any change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Carried {
    legs: Vec<CarriedLeg>,
    drop_m: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct CarriedLeg {
    knot: Knot,
    held: Option<Vec3>,
    gone_m: f32,
    /// Frames since a foot in the air left the ground, if that is known.
    aloft: Option<usize>,
}

impl CarriedLeg {
    /// Of frames that stay as they are, with a byte of contacts each.
    fn as_shown(leg: &Leg, track: &LegTrack, contacts: &[u8]) -> Self {
        let Some((&bits, last)) = contacts.last().zip(contacts.len().checked_sub(1)) else {
            return Self::default();
        };
        let stands = leg.stands(bits);
        let same = |&&bits: &&u8| leg.stands(bits) == stands;
        let since = contacts.len() - contacts.iter().rev().take_while(same).count();
        match stands {
            true => Self {
                held: Some(track.toes[last]),
                gone_m: way_m(&track.hips[since..=last]),
                ..Self::default()
            },
            false => Self {
                // One that never stood may do so at once.
                aloft: (since > 0).then_some(contacts.len() - since),
                ..Self::default()
            },
        }
    }
}

impl Planted {
    /// What the feet bring along from a frame.
    pub fn at(&self, frame: usize) -> Carried {
        let of = |leg: &PlantedLeg| {
            let at = |frame: usize| leg.offsets.get(frame).copied().unwrap_or_default();
            let (before, after) = (
                frame.saturating_sub(1),
                (frame + 1).min(leg.offsets.len().max(1) - 1),
            );
            let span = leg.stands.iter().find(|span| span.contains(&frame));
            let gone_m = |span: &Range<usize>| {
                let before_m = if span.start < self.first { leg.gone_m } else { 0.0 };
                before_m + way_m(&leg.hips[span.start..=frame])
            };
            CarriedLeg {
                knot: Knot {
                    offset: at(frame),
                    velocity: (at(after) - at(before)) / (after - before).max(1) as f32,
                },
                held: span.map(|_| leg.toes[frame] + at(frame)),
                gone_m: span.map_or(0.0, gone_m),
                aloft: None,
            }
        };
        Carried {
            legs: self.legs.iter().map(of).collect(),
            drop_m: self.drops_m.get(frame).copied().unwrap_or(0.0),
        }
    }
}

/// Makes feet stand while they carry the body, and brings their soles onto the ground. `contacts`
/// has a byte a frame, and gets the feet that stand.
///
/// Of two legs whose hips are nearest to each other, one stands in every frame in which the body
/// goes, upright, with a foot near the ground: the one whose foot moves less. Both stand if both
/// move little. A contact in which the body would go too far is shortened while the other foot
/// stands. A foot that stands stays at the mean of its places, or where it stood before
/// `options.range`. Between contacts its path is the network's, with an offset that leads from
/// contact to contact without jumps of speed; a foot that is carried farther is lifted. The root
/// keeps its path over the ground. It is lowered for legs that would be too short, and a foot
/// behind the body rolls over its toes.
///
/// Frames outside of the range stay as they are, and so do poses that are not finite.
pub fn plant_feet(
    skeleton: &Skeleton,
    legs: &[Leg],
    roots: &mut [Vec3],
    rotations: &mut [Quat],
    contacts: &mut [u8],
    (options, carried): (&FootPlant, Option<&Carried>),
) -> Planted {
    let joints = skeleton.joint_count();
    let frames = roots.len().min(rotations.len() / joints).min(contacts.len());
    let range = options.range.start..options.range.end.min(frames);
    let finite = roots.iter().all(|root| root.is_finite()) && rotations.iter().all(|q| q.is_finite());
    if range.is_empty() || legs.is_empty() || !finite {
        return Planted::default();
    }
    let window = 0..range.end.saturating_add(1).min(frames);
    let fixed = [range.start > 0, window.end > range.end];
    let max_step_m = skeleton
        .contacts
        .as_ref()
        .map_or(0.0, |contacts| contacts.max_speed_mps)
        / options.fps;
    let tracks: Vec<Track> = legs
        .iter()
        .enumerate()
        .map(|(nth, leg)| {
            let track = LegTrack::of(skeleton, leg, &window, roots, rotations);
            let before = range.start.checked_sub(1);
            let state = match (carried, before) {
                (Some(carried), Some(_)) => carried.legs.get(nth).copied().unwrap_or_default(),
                (_, Some(before)) => CarriedLeg::as_shown(leg, &track, &contacts[..=before]),
                (_, None) => CarriedLeg::default(),
            };
            let low_m = (track.feet.iter().zip(&track.toes))
                .map(|(foot, toe)| {
                    let toe_m = toe.y - leg.clearance_m[1];
                    let lowest_m = match (leg.toe, leg.contacts[0]) {
                        (None, _) => foot.y - leg.clearance_m[0],
                        (Some(_), None) => toe_m,
                        (Some(_), Some(_)) => toe_m.min(foot.y - leg.clearance_m[0]),
                    };
                    lowest_m - options.floor_m
                })
                .collect();
            Track {
                leg: track,
                low_m,
                length_m: leg.length_m(skeleton),
                state,
            }
        })
        .collect();
    let mut stands: Vec<Vec<Range<usize>>> = vec![Vec::new(); legs.len()];
    for pair in pairs(&tracks) {
        let walkers: Vec<Walker<'_>> = pair
            .iter()
            .map(|&nth| {
                let track = &tracks[nth];
                Walker {
                    hips: &track.leg.hips,
                    toes: &track.leg.toes,
                    low_m: &track.low_m,
                    length_m: track.length_m,
                    stood: track.state.held.is_some(),
                    gone_m: track.state.gone_m,
                    aloft: track.state.aloft,
                }
            })
            .collect();
        let found = schedule(&walkers, &roots[window.clone()], range.start, max_step_m, options);
        for (nth, spans) in pair.into_iter().zip(found) {
            stands[nth] = spans;
        }
    }
    let offsets: Vec<Vec<Vec3>> = tracks
        .iter()
        .zip(&stands)
        .map(|(track, stands)| {
            let before = fixed[0].then(|| (range.start - 1, track.state.knot));
            let behind = fixed[1].then(|| (range.end, Knot::default()));
            let foot = Foot {
                toes: &track.leg.toes,
                low_m: &track.low_m,
                stands,
                length_m: track.length_m,
                fixed: [before, behind],
                held: track.state.held,
            };
            foot.offsets()
        })
        .collect();
    let drops_m = drops(
        &tracks,
        &offsets,
        &range,
        carried.map_or(0.0, |carried| carried.drop_m),
        fixed,
    );
    for frame in range.clone() {
        roots[frame].y -= drops_m[frame];
        let pose = &mut rotations[frame * joints..][..joints];
        let pole = forward(skeleton, pose);
        for ((leg, track), (offsets, stands)) in legs.iter().zip(&tracks).zip(offsets.iter().zip(&stands)) {
            let is_standing = stands.iter().any(|span| span.contains(&frame));
            let low_m = track.leg.feet[frame].y + offsets[frame].y - leg.clearance_m[0] - options.floor_m;
            let bits = contacts[frame] & !leg.contact_bits();
            contacts[frame] = bits
                | if is_standing {
                    bits_of(leg, low_m < ANKLE_LOW * track.length_m)
                } else {
                    0
                };
            if offsets[frame].length() > NO_OFFSET_M || drops_m[frame] > 0.0 {
                let place = Place {
                    hip: track.leg.hips[frame] - Vec3::Y * drops_m[frame],
                    foot: track.leg.feet[frame] + offsets[frame],
                    toe: track.leg.toes[frame] + offsets[frame],
                };
                let reach_m = track.length_m * (STRAIGHTEST - SOFT_SHARE);
                place.put(skeleton, leg, (roots[frame], pose), pole, reach_m);
            }
        }
    }
    let planted = tracks.into_iter().zip(offsets.into_iter().zip(stands));
    Planted {
        legs: planted
            .map(|(track, (offsets, stands))| PlantedLeg {
                offsets,
                toes: track.leg.toes,
                hips: track.leg.hips,
                stands,
                gone_m: track.state.gone_m,
            })
            .collect(),
        drops_m,
        first: range.start,
    }
}

/// A leg in every frame of the window.
struct Track {
    leg: LegTrack,
    low_m: Vec<f32>,
    length_m: f32,
    state: CarriedLeg,
}

/// The contacts of a foot that stands by its toe, and perhaps by its ankle.
fn bits_of(leg: &Leg, by_ankle: bool) -> u8 {
    let [ankle, toe] = leg.contacts.map(|bit| bit.map_or(0, |bit| 1 << bit));
    match leg.toe {
        Some(_) if !by_ankle && toe != 0 => toe,
        _ => ankle | toe,
    }
}

/// The legs in pairs, by the nearest hip; one that is left over is alone.
fn pairs(tracks: &[Track]) -> Vec<Vec<usize>> {
    let mut left: Vec<usize> = (0..tracks.len()).collect();
    let mut pairs = Vec::new();
    while !left.is_empty() {
        let leg = left.remove(0);
        let hip = |leg: usize| tracks[leg].leg.hips[0];
        let apart = |&other: &usize| hip(leg).distance_squared(hip(other));
        let nearest = (0..left.len()).min_by(|&a, &b| apart(&left[a]).total_cmp(&apart(&left[b])));
        pairs.push(match nearest {
            Some(nearest) => vec![leg, left.remove(nearest)],
            None => vec![leg],
        });
    }
    pairs
}

/// How far the root is lowered in each frame so that every leg reaches its foot.
fn drops(
    tracks: &[Track],
    offsets: &[Vec<Vec3>],
    range: &Range<usize>,
    before_m: f32,
    fixed: [bool; 2],
) -> Vec<f32> {
    let frames = offsets.first().map_or(0, Vec::len);
    let mut needs = vec![0.0_f32; frames];
    for (track, offsets) in tracks.iter().zip(offsets) {
        let leg_m = track.length_m * (STRAIGHTEST - SOFT_SHARE);
        for (frame, need) in needs.iter_mut().enumerate() {
            let (hip, foot) = (track.leg.hips[frame], track.leg.feet[frame]);
            let excess = excess_height(hip, foot + offsets[frame], leg_m.max(hip.distance(foot)));
            *need = need.max(excess.min(MOST_DROP * track.length_m));
        }
    }
    let mut drops = cover(&needs, DROP_HALF_WINDOW);
    let lacking = range
        .start
        .checked_sub(1)
        .map_or(0.0, |before| before_m - drops[before]);
    for frame in range.clone() {
        let from = (frame + 1 - range.start) as f32 / (DROP_FADE_FRAMES + 1) as f32;
        drops[frame] += lacking * (1.0 - smoothstep(from.min(1.0)));
        if fixed[1] {
            let to = (range.end - frame) as f32 / (DROP_FADE_FRAMES + 1) as f32;
            drops[frame] *= smoothstep(to.min(1.0));
        }
        drops[frame] = drops[frame].max(0.0);
    }
    drops
}

/// Where a leg should be.
struct Place {
    hip: Vec3,
    foot: Vec3,
    toe: Vec3,
}

impl Place {
    /// Bends a leg to its place. A foot that stands farther from its hip than `reach_m` rolls over
    /// its toes, if that helps.
    fn put(
        &self,
        skeleton: &Skeleton,
        leg: &Leg,
        (root, pose): (Vec3, &mut [Quat]),
        pole: Vec3,
        reach_m: f32,
    ) {
        let roll = match leg.toe {
            // The lower leg of an animal is no foot.
            Some(_) if self.foot.distance(self.toe) < SHORT_FOOT * reach_m => self.roll(reach_m),
            _ => None,
        };
        let chain = leg.chain();
        match roll {
            None => {
                let foot = self.within(reach_m);
                two_bone_soft(skeleton, root, pose, chain, (foot, SOFT_SHARE), pole, true);
            }
            Some(roll) => {
                let turned = crate::fk::joint_transform(skeleton, root, pose, leg.foot).1;
                let foot = self.toe + roll * (self.foot - self.toe);
                let rotation = (roll * turned).normalize();
                place_end(skeleton, root, pose, chain, (foot, SOFT_SHARE), pole, rotation);
            }
        }
    }

    /// The place of the ankle. One above the hip and out of reach, as of a spider, comes nearer at
    /// its own height: straight towards the hip its toe would go into the ground.
    fn within(&self, reach_m: f32) -> Vec3 {
        let way = self.foot - self.hip;
        let over_ground_m = (reach_m * reach_m - way.y * way.y).max(0.0).sqrt();
        match way.y > 0.0 && way.length() > reach_m {
            true => self.hip + flat(way).clamp_length_max(over_ground_m) + Vec3::Y * way.y,
            false => self.foot,
        }
    }

    /// The turn about the toes that brings the ankle within reach of the hip, or as near as it may.
    fn roll(&self, reach_m: f32) -> Option<Quat> {
        let bone = self.foot - self.toe;
        let away = |roll: Quat| (self.toe + roll * bone).distance(self.hip);
        if away(Quat::IDENTITY) <= reach_m {
            return None;
        }
        let axis = bone.cross(self.hip - self.foot).try_normalize()?;
        let turn = |angle: f32| Quat::from_axis_angle(axis, angle);
        // The angle at which the ankle is nearest to the hip.
        let to_hip = self.hip - self.toe;
        let most = bone.angle_between(to_hip).min(MOST_ROLL);
        let (mut low, mut high) = (0.0, most);
        if away(turn(most)) <= reach_m {
            for _ in 0..ROLL_STEPS {
                let middle = (low + high) / 2.0;
                match away(turn(middle)) <= reach_m {
                    true => high = middle,
                    false => low = middle,
                }
            }
        }
        Some(turn(high))
    }
}

#[cfg(test)]
mod tests;
