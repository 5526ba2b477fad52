use proptest::prelude::*;

use super::*;

const JOINTS: usize = 2;
const SUB: i64 = SUB_FRAMES as i64;

/// Columns of a straight walk with a turning second joint.
struct Walk {
    roots: Vec<Vec3>,
    rotations: Vec<Quat>,
    contacts: Vec<u8>,
}

impl Walk {
    /// `frames` frames from `start` on with `speed` metres and `turn` radians a frame.
    fn new(frames: usize, start: f32, speed: f32, turn: f32) -> Self {
        let angle = |frame: usize| start + turn * frame as f32;
        Self {
            roots: (0..frames)
                .map(|frame| Vec3::new(0.0, 0.9, start + speed * frame as f32))
                .collect(),
            rotations: (0..frames)
                .flat_map(|frame| [Quat::IDENTITY, Quat::from_rotation_x(angle(frame))])
                .collect(),
            contacts: vec![speed.to_bits() as u8; frames],
        }
    }

    fn frames(&self) -> Frames<'_> {
        Frames {
            roots: &self.roots,
            rotations: &self.rotations,
            contacts: &self.contacts,
        }
    }
}

fn buffer(frames: usize) -> MotionBuffer {
    MotionBuffer::new(JOINTS, -3, Walk::new(frames, 0.0, 0.1, 0.02).frames())
}

fn angle(buffer: &MotionBuffer, frame: i64) -> f32 {
    let rotation = buffer.pose(frame)[1];
    2.0 * rotation.x.atan2(rotation.w)
}

#[test]
fn frames_are_found_by_number() {
    let mut buffer = buffer(10);
    assert_eq!((buffer.first(), buffer.last()), (-3, 6));
    assert_eq!(buffer.root(0).z, 0.3);
    buffer.trim(2);
    assert_eq!((buffer.first(), buffer.last()), (2, 6));
    assert_eq!(buffer.root(3).z, 0.6);
    assert!((angle(&buffer, 4) - 0.14).abs() < 1e-5);
    buffer.trim(-5);
    assert_eq!(buffer.first(), 2, "nothing comes back");
    let range = buffer.range(1, 4);
    assert_eq!((range.roots.len(), range.rotations.len()), (3, 6));
    assert!(buffer.range(7, 9).roots.is_empty() && buffer.range(5, 4).roots.is_empty());
}

#[test]
fn between_frames_the_motion_is_interpolated() {
    let buffer = buffer(10);
    let mut pose = Vec::new();
    let (root, _) = buffer.sample(SUB + 75, &mut pose);
    assert!((root.z - 0.425).abs() < 1e-6);
    assert!((2.0 * pose[1].x.atan2(pose[1].w) - 0.085).abs() < 1e-5);
    let (root, _) = buffer.sample(-SUB, &mut pose);
    assert_eq!((root, pose.as_slice()), (buffer.root(-1), buffer.pose(-1)));
    let (root, _) = buffer.sample(1000 * SUB + 1, &mut pose);
    assert_eq!(root, buffer.root(6), "after the end comes the last frame");
}

/// A joint that is far away arrives smoothly, whichever way it turns, and the others fade as usual.
#[test]
fn a_joint_that_is_far_away_takes_longer() {
    for away in [2.0, 2.8, 3.1, 3.2, 4.0] {
        let mut buffer = buffer(40);
        // Old and new turn against each other, past half a turn apart.
        let plan = Walk::new(40, away, 0.1, -0.04);
        buffer.splice(4, plan.frames(), Fade::USUAL);
        let turned = |frame: i64| angle_between(buffer.pose(frame)[1], buffer.pose(frame - 1)[1]);
        let most = (4..30).map(turned).fold(0.0, f32::max);
        assert!(most < 0.32, "{away}: {most} rad in a frame");
        let there = |frame: i64| {
            angle_between(
                buffer.pose(frame)[1],
                plan.rotations[(frame - 5) as usize * JOINTS + 1],
            )
        };
        assert!(there(13) > 0.1 && there(29) < 1e-3, "{away}: {}", there(29));
        assert_eq!(
            buffer.pose(13)[0],
            plan.rotations[8 * JOINTS],
            "a joint at its place"
        );
        assert_eq!(buffer.root(13), plan.roots[8]);
        assert_eq!(buffer.last(), 44);
    }
    // A short plan holds completely at its end.
    let mut buffer = buffer(40);
    let plan = Walk::new(12, 3.0, 0.1, 0.0);
    buffer.splice(4, plan.frames(), Fade::USUAL);
    assert!(angle_between(buffer.pose(16)[1], plan.rotations[11 * JOINTS + 1]) < 1e-3);
}

#[test]
fn a_new_plan_fades_in_and_then_stands_alone() {
    let mut buffer = buffer(40);
    let plan = Walk::new(30, 1.1, 0.3, -0.05);
    let old: Vec<Vec3> = (0..40).map(|frame| buffer.root(frame - 3)).collect();
    buffer.splice(5, plan.frames(), Fade::USUAL);
    assert_eq!(buffer.last(), 35);
    for frame in -3..=5 {
        assert_eq!(
            buffer.root(frame),
            old[(frame + 3) as usize],
            "earlier frames stay"
        );
    }
    for step in 0..8 {
        let weight = smoothstep((step + 1) as f32 / 9.0);
        let want = old[step + 9].lerp(plan.roots[step], weight);
        assert!(buffer.root(6 + step as i64).abs_diff_eq(want, 1e-6));
    }
    for step in 8..30 {
        assert_eq!(buffer.root(6 + step as i64), plan.roots[step]);
        assert!((angle(&buffer, 6 + step as i64) - (1.1 - 0.05 * step as f32)).abs() < 1e-4);
    }
    let contact = |frame| buffer.range(frame, frame).contacts[0];
    assert_eq!(contact(6), 0.1f32.to_bits() as u8);
    assert_eq!(contact(10), 0.3f32.to_bits() as u8);
}

#[test]
fn a_plan_for_a_command_moves_the_root_at_once() {
    let mut buffer = buffer(40);
    // Begins where the old plan is in frame 5, with another velocity.
    let plan = Walk::new(30, 0.8, 0.0, 0.0);
    buffer.splice(5, plan.frames(), Fade::COMMAND);
    let places: Vec<f32> = (4..9).map(|frame| buffer.root(frame).z).collect();
    assert!((places[0] - 0.7).abs() < 1e-6 && (places[1] - 0.8).abs() < 1e-6);
    assert_eq!(places[2..], [0.8; 3], "no frame of the old velocity");
    // Poses still fade.
    assert!(angle(&buffer, 6) < 0.3 && (angle(&buffer, 11) - 0.8).abs() < 1e-4);
}

#[test]
fn a_short_motion_comes_to_rest() {
    let mut buffer = buffer(4);
    buffer.draw_out(12);
    assert_eq!(buffer.last(), 12);
    let steps: Vec<f32> = (0..12)
        .map(|frame| buffer.root(frame + 1).z - buffer.root(frame).z)
        .collect();
    assert!((steps[0] - 0.07).abs() < 1e-6);
    assert!(steps.windows(2).all(|pair| pair[1] < pair[0]) && steps[11] < 0.002);
    let mut still = MotionBuffer::new(JOINTS, 0, Walk::new(1, 0.5, 0.1, 0.1).frames());
    still.draw_out(3);
    assert_eq!((still.root(3), still.pose(3)), (still.root(0), still.pose(0)));
}

#[test]
fn nothing_is_allocated_once_the_buffer_is_warm() {
    let mut buffer = buffer(30);
    let plan = Walk::new(60, 0.0, 0.1, 0.0);
    for at in 20..40 {
        buffer.trim(at - 12);
        buffer.splice(at, plan.frames(), Fade::USUAL);
    }
    let capacity = |b: &MotionBuffer| (b.roots.capacity(), b.rotations.capacity(), b.contacts.capacity());
    let before = capacity(&buffer);
    for at in 40..400 {
        buffer.trim(at - 12);
        buffer.splice(at, plan.frames(), Fade::USUAL);
    }
    assert_eq!(capacity(&buffer), before);
    let mut pose = Vec::with_capacity(JOINTS);
    let room = pose.capacity();
    for cursor in 400 * SUB..410 * SUB {
        buffer.sample(cursor, &mut pose);
    }
    assert_eq!(pose.capacity(), room);
}

proptest! {
    /// However far the new plan is from the old, and however little is left of the old, a step is
    /// never larger than those of both motions plus the share of the fade.
    #[test]
    fn seams_have_no_jump(
        left in 0usize..20, used in 9usize..40, gap in -2.0f32..2.0, speed in -0.2f32..0.2, turn in -0.1f32..0.1,
    ) {
        let mut buffer = buffer(9 + left);
        let start = buffer.root(5).z;
        let plan = Walk::new(used, start + gap, speed, turn);
        buffer.splice(5, plan.frames(), Fade::USUAL);
        // Motions that diverge by `speed` a frame are at most this far apart over the fade.
        let apart = gap.abs() + 9.0 * (speed.abs() + 0.1);
        let bound = speed.abs().max(0.1) + apart / 6.0 + 1e-3;
        for frame in 0..buffer.last() {
            let step = buffer.root(frame + 1).distance(buffer.root(frame));
            prop_assert!(step <= bound, "{step} m at frame {frame}, bound {bound}");
            for (a, b) in buffer.pose(frame).iter().zip(buffer.pose(frame + 1)) {
                prop_assert!(a.dot(*b) > 0.0, "a joint changes its hemisphere at frame {frame}");
            }
        }
    }
}
