//! The camera and the stick figure.

use glam::{Vec2, Vec3};
use troupe_motion::skeleton::Skeleton;

use super::canvas::{Canvas, Ink, Point};

/// Radius of a head, metres.
const HEAD_M: f32 = 0.105;
/// How far above its joint a head's middle lies, along the neck, metres.
const HEAD_LIFT_M: f32 = 0.06;

/// A camera without perspective: it looks down a little and shows the way ahead to the right.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Camera {
    right: Vec3,
    up: Vec3,
    toward: Vec3,
    /// Towards the viewer along the ground.
    near: Vec3,
}

impl Camera {
    /// A camera in which whoever faces `heading` faces right, turned towards the viewer by `turn`;
    /// it looks down by `pitch`. All in radians.
    pub(crate) fn new(heading: f32, turn: f32, pitch: f32) -> Self {
        let ahead = Vec3::new(heading.sin(), 0.0, heading.cos());
        let side = ahead.cross(Vec3::Y);
        let right = turn.cos() * ahead - turn.sin() * side;
        let near = right.cross(Vec3::Y);
        let (sin, cos) = pitch.sin_cos();
        Self {
            right,
            up: cos * Vec3::Y - sin * near,
            toward: sin * Vec3::Y + cos * near,
            near,
        }
    }

    /// Where a place relative to the figure's own origin is on the picture, in metres: x to the
    /// right, y down.
    pub(crate) fn project(&self, place: Vec3) -> Vec2 {
        Vec2::new(self.right.dot(place), -self.up.dot(place))
    }

    /// How near a place is: greater is nearer.
    pub(crate) fn nearness(&self, place: Vec3) -> f32 {
        self.toward.dot(place)
    }

    /// The same place seen from straight above, in metres: x to the right, y down.
    pub(crate) fn plan(&self, place: Vec3) -> Vec2 {
        Vec2::new(self.right.dot(place), self.near.dot(place))
    }
}

/// One bone of a figure.
struct Bone {
    from: usize,
    to: usize,
    width_m: f32,
}

/// How to draw a skeleton: its bones with their widths, and its head.
pub(crate) struct Figure {
    bones: Vec<Bone>,
    head: Option<(usize, usize)>,
}

impl Figure {
    pub(crate) fn new(skeleton: &Skeleton) -> Self {
        let joints = &skeleton.joints;
        // How many joints hang below each one: the more, the thicker the bone.
        let mut below = vec![0_u8; joints.len()];
        for (index, joint) in joints.iter().enumerate().rev() {
            if let Some(parent) = joint.parent {
                below[parent] = below[parent].max(below[index] + 1);
            }
        }
        let bones = joints.iter().enumerate().filter_map(|(to, joint)| {
            let width_m = 0.034 + 0.011 * f32::from(below[to].min(3));
            joint.parent.map(|from| Bone { from, to, width_m })
        });
        let head = joints.iter().position(|j| j.name.to_lowercase().contains("head"));
        Self {
            bones: bones.collect(),
            head: head.and_then(|h| joints[h].parent.map(|neck| (neck, h))),
        }
    }

    /// Draws a pose given by its joints' places (metres, relative to the figure's own origin on the
    /// ground), which comes to stand at `at`; `scale` pixels make a metre.
    pub(crate) fn draw(
        &self,
        canvas: &mut Canvas,
        camera: &Camera,
        places: &[Vec3],
        at: Point,
        scale: f32,
        ink: Ink,
    ) {
        let pixel = |place: Vec3| at + camera.project(place) * scale;
        let head = self.head.map(|(neck, head)| {
            let lift = (places[head] - places[neck]).normalize_or_zero() * HEAD_LIFT_M;
            places[head] + lift
        });
        let mut bones = self.bones.iter().collect::<Vec<_>>();
        let middle = |bone: &Bone| camera.nearness(places[bone.from] + places[bone.to]) / 2.0;
        bones.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
        let (far, near) = (
            bones.first().map_or(0.0, |b| middle(b)),
            bones.last().map_or(0.0, |b| middle(b)),
        );

        // A white rim separates neighbours that overlap.
        for bone in &bones {
            let ends = [pixel(places[bone.from]), pixel(places[bone.to])];
            canvas.line(&ends, bone.width_m * scale + 3.0, WHITE.alpha(ink.opacity()));
        }
        for bone in &bones {
            let depth = (near - middle(bone)) / (near - far).max(0.2);
            let ends = [pixel(places[bone.from]), pixel(places[bone.to])];
            canvas.line(
                &ends,
                bone.width_m * scale,
                ink.mix(WHITE.alpha(ink.opacity()), 0.38 * depth),
            );
        }
        if let Some(head) = head {
            canvas.disc(pixel(head), HEAD_M * scale + 1.5, WHITE.alpha(ink.opacity()));
            canvas.disc(pixel(head), HEAD_M * scale, ink);
        }
    }

    /// Draws the shadow that a light straight above throws.
    pub(crate) fn draw_shadow(
        &self,
        canvas: &mut Canvas,
        camera: &Camera,
        places: &[Vec3],
        at: Point,
        scale: f32,
    ) {
        let pixel = |place: Vec3| at + camera.project(Vec3::new(place.x, 0.0, place.z)) * scale;
        for bone in &self.bones {
            let ends = [pixel(places[bone.from]), pixel(places[bone.to])];
            canvas.line(&ends, (bone.width_m + 0.03) * scale, SHADOW);
        }
    }
}

const WHITE: Ink = Ink::hex(0xff_ff_ff);
const SHADOW: Ink = Ink::hex(0xe9_ed_f2);

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn the_way_ahead_is_to_the_right_and_up_is_up() {
        for heading in [0.0, 1.0, -2.5] {
            let camera = Camera::new(heading, 0.0, 0.0);
            let ahead = Vec3::new(f32::sin(heading), 0.0, f32::cos(heading));
            assert!(camera.project(ahead).abs_diff_eq(Vec2::X, 1e-5));
            assert!(camera.project(Vec3::Y).abs_diff_eq(Vec2::NEG_Y, 1e-5));
            // Turned towards the viewer, whoever faces the heading comes nearer.
            let turned = Camera::new(heading, 0.5, 0.2);
            assert!(turned.project(ahead).x > 0.8 && turned.nearness(ahead) > 0.4);
            assert!(turned.plan(ahead).y > 0.4, "nearer is further down on the plan");
        }
    }

    #[test]
    fn the_left_hand_of_one_who_walks_right_is_far() {
        // Facing +Z, left is +X; walking to the right of the picture, the left side is away from
        // the viewer.
        let camera = Camera::new(0.0, 0.0, 0.0);
        assert!(camera.nearness(Vec3::X) < 0.0);
        assert!(Camera::new(FRAC_PI_2, 0.0, 0.0).nearness(Vec3::NEG_Z) < 0.0);
    }
}
