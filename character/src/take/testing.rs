//! A walking body, and a generator that meets every constraint exactly.

use std::sync::Arc;

use troupe_motion::fk::world_transforms;
use troupe_motion::model::{KeyframeTask, Motion, Output, Rig, Task};
use troupe_motion::rotation::{six_d, yaw};
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::{Clock, Knot, Look, Made, Making, Prompt, Subject, Take, TakeSegment, Wanted};
use crate::style::testing::{walker_rig, walker_style};

/// A take of `frames` frames for a walking body, whose pose at rest is its style's idle pose.
pub(super) fn take(frames: usize) -> Take {
    let style = Arc::new(walker_style());
    Take {
        subject: Subject {
            rig: Arc::new(walker_rig()),
            rest: style.idle().rotations.clone(),
            rest_height_m: style.idle().height_m,
            follower: None,
        },
        segments: vec![TakeSegment {
            end: frames,
            seed: None,
            prompt: Prompt::Free,
        }],
        wanted: Wanted::default(),
        seed: 5,
        frames,
        clock: Clock {
            native_fps: 30.0,
            fps: 30.0,
            frames,
        },
        hold_feet: true,
        transition: 5,
        is_loop: false,
        look: Look {
            style: Some(style),
            ..Look::default()
        },
        past: None,
        in_parts: false,
        onto: None,
    }
}

/// A knot without a heading.
pub(super) fn knot(frame: f32, x: f32, z: f32) -> Knot {
    Knot {
        frame,
        place: [x, z],
        heading: None,
    }
}

/// A motion whose root is on the task's guide, or else on the line to its last target; upright,
/// with feet in the air.
pub(super) fn made(task: &KeyframeTask, rig: &Rig) -> Motion {
    let frames = task.frames.unwrap_or(rig.dims.max_frames());
    let rooted =
        |root: Option<[f32; 5]>| root.map(|[x, y, z, cos, sin]| (Vec3::new(x, y, z), sin.atan2(cos)));
    let last = task.context.last().and_then(|key| rooted(key.global_root));
    let (from, facing) = last.unwrap_or((Vec3::Y, 0.0));
    let to = task.targets.last().and_then(|key| rooted(key.global_root));
    let (to, to_facing) = to.unwrap_or((from, facing));
    let now = task.context.len() - 1;
    let mut motion = Motion::default();
    for frame in 0..frames {
        let share = frame.saturating_sub(now) as f32 / (frames - 1 - now) as f32;
        let root = match &task.root_guide {
            Some(guide) => {
                let [x, y, z, heading] = guide.path[frame];
                GlobalRoot::new(Vec3::new(x, y, z), heading)
            }
            None => GlobalRoot::new(from.lerp(to, share), facing + (to_facing - facing) * share),
        };
        motion.root.extend(root.to_array());
        let mut local = vec![Quat::IDENTITY; rig.dims.joints];
        local[0] = yaw(root.heading);
        let (mut places, mut world) = (vec![Vec3::ZERO; local.len()], local.clone());
        world_transforms(&rig.skeleton, root.position, &local, &mut places, &mut world);
        motion.rotations.extend(world.into_iter().flat_map(six_d));
        motion.contacts.extend(vec![0.0; rig.dims.contacts]);
    }
    motion
}

/// Makes the whole take. Returns it with its number of windows.
pub(super) fn run(take: &Arc<Take>, sample: usize) -> (Made, usize) {
    let mut making = Making::new(take, sample);
    let mut windows = 0;
    while let Some(task) = making.next_task().unwrap() {
        let Task::Keyframes(task) = task else {
            panic!("{task:?}")
        };
        making
            .receive(&Output::Motion(made(&task, &take.subject.rig)))
            .unwrap();
        windows += 1;
    }
    (making.finish().unwrap(), windows)
}
