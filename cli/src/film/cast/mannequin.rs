//! A mannequin for a skeleton: limbs, trunk and head, shaded, with a shadow below.

use glam::Vec3;
use troupe_motion::skeleton::Skeleton;

use super::view::View;
use crate::graphics::canvas::{Canvas, Ink, Point};
use crate::graphics::theme::DARK;

/// Radius of the end of a limb, metres; its growth for each metre of limb below; and the most.
const TIP_M: f32 = 0.034;
const GROWTH: f32 = 0.052;
const THICKEST_M: f32 = 0.085;
/// Bones shorter than this belong to the next joint.
const SHORT_M: f32 = 0.075;
/// Radius of a head, and the distance of its middle above its joint.
const HEAD_M: f32 = 0.125;
const HEAD_LIFT_M: f32 = 0.08;
/// For a skeleton without a head: from between the shoulders to the middle of the head.
const ABOVE_SHOULDERS_M: f32 = 0.2;
/// Direction from the ground to the light.
const LIGHT: Vec3 = Vec3::new(-0.45, 1.0, 0.35);
/// Width of a shadow ÷ width of the mannequin.
const SHADOW_SHARE: f32 = 0.8;
const WHITE: Ink = Ink::hex(0xff_ff_ff);

/// Layers of a limb from the lowest on: share of its radius, shift to the light, and shade.
const LAYERS: [(f32, f32, Shade); 3] = [
    (1.0, 0.0, Shade::Dark(0.26)),
    (0.74, 0.2, Shade::Dark(0.0)),
    (0.3, 0.42, Shade::Light(0.3)),
];
/// Direction to the light on the picture.
const TO_LIGHT: Point = Point::new(-0.62, -0.78);
/// Width of the line around a limb, and around the mannequin.
const EDGE: f32 = 0.9;
const RIM: f32 = 1.6;

#[derive(Debug, Clone, Copy)]
enum Shade {
    Dark(f32),
    Light(f32),
}

/// A skeleton with radii and limbs.
#[derive(Debug)]
pub(super) struct Mannequin {
    /// Radius of each joint, metres.
    radii: Vec<f32>,
    limbs: Vec<Limb>,
    head: Head,
}

/// A limb from joint to joint, or the trunk.
#[derive(Debug, Clone, PartialEq)]
struct Limb {
    joints: Vec<usize>,
    /// Bones between them, as indices into `joints`.
    bones: Vec<[usize; 2]>,
    /// The first joints, this many, are the corners of an area.
    corners: usize,
}

/// A limb on the picture.
struct Piece<'a> {
    discs: Vec<(Point, f32)>,
    bones: &'a [[usize; 2]],
    corners: usize,
    depth: f32,
}

/// The extent in which a piece is drawn: a share of the radii of its discs, pixels added to them,
/// and a shift in radii.
#[derive(Debug, Clone, Copy)]
struct Extent {
    share: f32,
    wider: f32,
    lift: Point,
}

#[derive(Debug, Clone, PartialEq)]
enum Head {
    /// A joint, and the joint below it.
    Joint { head: usize, neck: usize },
    /// Between the shoulders and up, away from the hips.
    Above { shoulders: Vec<usize>, hips: usize },
}

impl Mannequin {
    pub(super) fn new(skeleton: &Skeleton) -> Self {
        let joints = &skeleton.joints;
        // Metres of limb below each joint, and ends of limbs.
        let (mut below, mut tips) = (vec![0.0_f32; joints.len()], vec![0_usize; joints.len()]);
        for (index, joint) in joints.iter().enumerate().rev() {
            tips[index] = tips[index].max(1);
            if let Some(parent) = joint.parent {
                below[parent] = below[parent].max(below[index] + joint.offset_m.length());
                tips[parent] += tips[index];
            }
        }
        let radius = |metres: &f32| (TIP_M + GROWTH * metres).min(THICKEST_M);
        let head = joints.iter().position(|j| j.name.to_lowercase().contains("head"));
        let is_trunk = |joint: usize| tips[joint] > 1;

        // A limb begins behind the short bones that lead from the trunk to it. The neck is no limb.
        let (mut limb_starts, mut chains) = (Vec::new(), Vec::new());
        for (index, joint) in joints.iter().enumerate() {
            let Some(parent) = joint.parent.filter(|parent| is_trunk(*parent)) else {
                continue;
            };
            if !is_trunk(index) && !leads_to(skeleton, index, head) {
                let chain = short_bones(skeleton, index);
                limb_starts.push((parent, chain[chain.len() - 1]));
                chains.push(chain);
            }
        }
        let (mut limbs, mut spine) = (Vec::new(), Vec::new());
        for (index, joint) in joints.iter().enumerate() {
            let Some(parent) = joint.parent else { continue };
            let is_inside = is_trunk(parent) || chains.iter().any(|chain| chain.contains(&index));
            if is_inside {
                spine.push([parent, index]);
            } else {
                limbs.push(Limb {
                    joints: vec![parent, index],
                    bones: vec![[0, 1]],
                    corners: 0,
                });
            }
        }
        let of = |hips: bool| {
            limb_starts
                .iter()
                .filter(move |start| (start.0 == 0) == hips)
                .map(|start| start.1)
        };
        let (shoulders, legs): (Vec<usize>, Vec<usize>) = (of(false).collect(), of(true).collect());
        limbs.push(trunk(&shoulders, &legs, &spine));
        Self {
            radii: below.iter().map(radius).collect(),
            limbs,
            head: match head.and_then(|head| Some((head, joints[head].parent?))) {
                Some((head, neck)) => Head::Joint { head, neck },
                None => Head::Above { shoulders, hips: 0 },
            },
        }
    }

    /// Where the middle of the head is in a pose.
    pub(super) fn head(&self, places: &[Vec3]) -> Vec3 {
        match &self.head {
            Head::Joint { head, neck } => {
                places[*head] + (places[*head] - places[*neck]).normalize_or_zero() * HEAD_LIFT_M
            }
            Head::Above { shoulders, hips } => {
                let sum: Vec3 = shoulders.iter().map(|&joint| places[joint]).sum();
                let between = sum / shoulders.len().max(1) as f32;
                between + (between - places[*hips]).normalize_or_zero() * ABOVE_SHOULDERS_M
            }
        }
    }

    /// Draws a pose, given as the positions of its joints.
    pub(super) fn draw(&self, canvas: &mut Canvas, view: &View, places: &[Vec3], ink: Ink, ground: Ink) {
        let scale = view.scale(places[0]);
        let mut pieces: Vec<Piece<'_>> = (self.limbs.iter())
            .map(|limb| self.piece(limb, places, scale, |place| view.pixel(place)))
            .collect();
        for (piece, limb) in pieces.iter_mut().zip(&self.limbs) {
            let depths = limb.joints.iter().map(|&joint| view.depth(places[joint]));
            piece.depth = depths.sum::<f32>() / limb.joints.len() as f32;
        }
        let head = self.head(places);
        let mut head_piece = Piece::disc(view.pixel(head), HEAD_M * scale);
        head_piece.depth = view.depth(head);
        pieces.push(head_piece);
        pieces.sort_by(|a, b| b.depth.total_cmp(&a.depth));
        for piece in &pieces {
            piece.draw(canvas, Extent::wider(RIM), ground);
        }
        let middle = view.depth(places[0]);
        for piece in &pieces {
            // A piece half a metre behind the hips is clearly darker. The shades come in steps, so
            // that there are few colours.
            let steps = (4.0 * (piece.depth - middle)).round().clamp(0.0, 2.0);
            let ink = ink.mix(DARK, steps * 0.12);
            piece.draw(canvas, Extent::wider(EDGE), ink.mix(DARK, 0.5));
            for (share, lift, shade) in LAYERS {
                let ink = match shade {
                    Shade::Dark(by) => ink.mix(DARK, by),
                    Shade::Light(by) => ink.mix(WHITE, by),
                };
                let extent = Extent {
                    share,
                    wider: 0.0,
                    lift: TO_LIGHT * lift,
                };
                piece.draw(canvas, extent, ink);
                // The trunk is flat, so it has no bright layer.
                if piece.corners > 0 && lift > 0.0 {
                    break;
                }
            }
        }
    }

    /// Draws the shadow of a pose on the ground. Shadows of one colour may overlap.
    pub(super) fn draw_shadow(&self, canvas: &mut Canvas, view: &View, places: &[Vec3], ink: Ink) {
        let fall = |place: Vec3| view.pixel((place - LIGHT * (place.y / LIGHT.y)).with_y(0.0));
        let scale = view.scale(places[0]) * SHADOW_SHARE;
        for limb in &self.limbs {
            self.piece(limb, places, scale, fall)
                .draw(canvas, Extent::wider(0.0), ink);
        }
        canvas.disc(fall(self.head(places)), HEAD_M * scale, ink);
    }

    fn piece<'a>(
        &self,
        limb: &'a Limb,
        places: &[Vec3],
        scale: f32,
        pixel: impl Fn(Vec3) -> Point,
    ) -> Piece<'a> {
        let disc = |&joint: &usize| (pixel(places[joint]), self.radii[joint] * scale);
        Piece {
            discs: limb.joints.iter().map(disc).collect(),
            bones: &limb.bones,
            corners: limb.corners,
            depth: 0.0,
        }
    }
}

impl Extent {
    fn wider(wider: f32) -> Self {
        Self {
            share: 1.0,
            wider,
            lift: Point::ZERO,
        }
    }
}

impl Piece<'_> {
    fn disc(at: Point, radius: f32) -> Self {
        Self {
            discs: vec![(at, radius)],
            bones: &[],
            corners: 0,
            depth: 0.0,
        }
    }

    fn draw(&self, canvas: &mut Canvas, extent: Extent, ink: Ink) {
        let disc = |&(at, radius): &(Point, f32)| {
            let lifted = at + extent.lift * radius;
            (lifted, radius * extent.share + extent.wider)
        };
        let discs: Vec<(Point, f32)> = self.discs.iter().map(disc).collect();
        let corners: Vec<Point> = discs[..self.corners].iter().map(|disc| disc.0).collect();
        canvas.shape(&corners, ink);
        for &[one, other] in self.bones {
            let ((from, from_radius), (to, to_radius)) = (discs[one], discs[other]);
            let across = (to - from).normalize_or_zero().perp();
            let corners = [
                from + across * from_radius,
                to + across * to_radius,
                to - across * to_radius,
                from - across * from_radius,
            ];
            canvas.shape(&corners, ink);
        }
        for &(at, radius) in &discs {
            canvas.disc(at, radius, ink);
        }
    }
}

/// The trunk. Shoulders and hips are its corners, and it contains the spine.
fn trunk(shoulders: &[usize], hips: &[usize], spine: &[[usize; 2]]) -> Limb {
    let mut joints: Vec<usize> = shoulders.iter().chain(hips.iter().rev()).copied().collect();
    let corners = joints.len();
    let mut bones: Vec<[usize; 2]> = (0..corners).map(|at| [at, (at + 1) % corners]).collect();
    for ends in spine {
        bones.push([joints.len(), joints.len() + 1]);
        joints.extend(ends);
    }
    Limb {
        joints,
        bones,
        corners,
    }
}

/// Whether a joint is another one or above it in the tree.
fn leads_to(skeleton: &Skeleton, from: usize, to: Option<usize>) -> bool {
    let ancestors = std::iter::successors(to, |&joint| skeleton.joints[joint].parent);
    ancestors.into_iter().any(|joint| joint == from)
}

/// The first joint of a limb, and the joints behind it at the ends of short bones.
fn short_bones(skeleton: &Skeleton, first: usize) -> Vec<usize> {
    let next = |&joint: &usize| {
        let mut children = (skeleton.joints.iter().enumerate()).filter(|(_, j)| j.parent == Some(joint));
        let (index, child) = children.next()?;
        (child.offset_m.length() < SHORT_M).then_some(index)
    };
    std::iter::successors(Some(first), next).collect()
}

#[cfg(test)]
mod tests {
    use troupe_motion::skeleton::Joint;

    use super::*;

    fn skeleton(with_head: bool) -> Skeleton {
        let joint = |name: &str, parent, offset_m| Joint {
            name: name.to_owned(),
            parent,
            offset_m,
        };
        let mut joints = vec![
            joint("Hips", None, Vec3::ZERO),
            joint("Chest", Some(0), Vec3::Y * 0.4),
            joint("Shoulder_L", Some(1), Vec3::new(0.1, 0.1, 0.0)),
            joint("Arm_L", Some(2), Vec3::X * 0.05),
            joint("Hand_L", Some(3), Vec3::X * 0.5),
            joint("Arm_R", Some(1), Vec3::new(-0.15, 0.1, 0.0)),
            joint("Hand_R", Some(5), Vec3::X * -0.5),
            joint("Leg_L", Some(0), Vec3::X * 0.1),
            joint("Foot_L", Some(7), Vec3::Y * -0.9),
            joint("Leg_R", Some(0), Vec3::X * -0.1),
            joint("Foot_R", Some(9), Vec3::Y * -0.9),
        ];
        if with_head {
            joints.push(joint("Neck", Some(1), Vec3::Y * 0.15));
            joints.push(joint("Head", Some(11), Vec3::Y * 0.1));
        }
        Skeleton::new(joints, Vec3::X, 0.0, None).unwrap()
    }

    /// The joints' places in the pose without rotations.
    fn places(skeleton: &Skeleton) -> Vec<Vec3> {
        let mut places: Vec<Vec3> = Vec::new();
        for joint in &skeleton.joints {
            let parent = joint.parent.map_or(Vec3::Y, |parent| places[parent]);
            places.push(parent + joint.offset_m);
        }
        places
    }

    #[test]
    fn limbs_hang_on_a_trunk_between_shoulders_and_hips() {
        let mannequin = Mannequin::new(&skeleton(true));
        let (trunk, limbs): (Vec<&Limb>, Vec<&Limb>) =
            mannequin.limbs.iter().partition(|limb| limb.corners > 0);
        assert_eq!(trunk.len(), 1);
        // Arms and legs stand around it in order. The short bone of the left shoulder is inside.
        assert_eq!(trunk[0].joints[..trunk[0].corners], [3, 5, 9, 7]);
        let ends: Vec<&[usize]> = limbs.iter().map(|limb| limb.joints.as_slice()).collect();
        assert_eq!(ends, [[3, 4], [5, 6], [7, 8], [9, 10], [11, 12]]);
        assert!(mannequin.radii[7] > mannequin.radii[8] && mannequin.radii[7] > mannequin.radii[3]);
    }

    #[test]
    fn a_robot_without_a_head_gets_one() {
        for with_head in [true, false] {
            let skeleton = skeleton(with_head);
            let head = Mannequin::new(&skeleton).head(&places(&skeleton));
            assert!(head.x.abs() < 0.01 && (1.6..1.8).contains(&head.y), "{head}");
        }
    }
}
