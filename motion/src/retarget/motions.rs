//! The motions of a certificate, made on a doll by footfalls and inverse kinematics.

use std::f32::consts::{PI, TAU};

use glam::{Quat, Vec3};

use super::figure::Figure;
use crate::clip::{Clip, ClipError};
use crate::ik::place_end;
use crate::interpolate::smoothstep;
use crate::rotation::yaw;

/// Frames of a motion: a little more than a cycle of a walk.
const FRAMES: usize = 32;
const FPS: f32 = 30.0;
/// A heel leaves the ground in this last share of a step's stand.
const HEEL_SHARE: f32 = 0.3;

/// A motion: where the body goes, how it steps, and how it holds itself, by the time in seconds.
pub(super) struct Motion {
    pub(super) name: &'static str,
    /// Place of the hips on the ground, metres, and heading, radians.
    way: fn(f32) -> (Vec3, f32),
    gait: Gait,
    posture: fn(f32) -> Posture,
}

/// When the feet step.
#[derive(Clone, Copy)]
struct Gait {
    period_s: f32,
    /// Share of the period in which a foot stands.
    stand: f32,
    lift_m: f32,
    /// Largest pitch of a foot as its heel leaves the ground, radians.
    pitch: f32,
    /// Phases of left and right foot, and of the fore feet, 0 to 1.
    phases: [f32; 4],
}

/// How the body holds itself. Angles in radians.
#[derive(Clone, Copy, Default)]
struct Posture {
    /// How far the hips are below their height at rest, metres.
    drop_m: f32,
    /// Trunk forward, and to the left.
    lean: f32,
    twist: f32,
    arms: [Arm; 2],
}

#[derive(Clone, Copy, Default)]
struct Arm {
    forward: f32,
    outward: f32,
    bend: f32,
}

/// Feet that stand all the time.
const STILL: Gait = Gait {
    period_s: 1e3,
    stand: 1.0,
    lift_m: 0.0,
    pitch: 0.0,
    phases: [0.0; 4],
};
const WALK: Gait = Gait {
    period_s: 1.05,
    stand: 0.62,
    lift_m: 0.06,
    pitch: 0.4,
    phases: [0.0, 0.5, 0.0, 0.0],
};
const FAST: Gait = Gait {
    period_s: 0.8,
    stand: 0.58,
    lift_m: 0.09,
    ..WALK
};
/// Steps with flat feet.
const STEP: Gait = Gait {
    period_s: 0.8,
    pitch: 0.0,
    ..WALK
};
const FOUR_BEATS: Gait = Gait {
    period_s: 1.05,
    stand: 0.65,
    lift_m: 0.08,
    pitch: 0.0,
    phases: [0.0, 0.5, 0.25, 0.75],
};
const TROT: Gait = Gait {
    period_s: 0.7,
    stand: 0.52,
    phases: [0.0, 0.5, 0.5, 0.0],
    ..FOUR_BEATS
};

pub(super) const ON_TWO: [Motion; 10] = [
    Motion {
        name: "stand",
        way: still,
        gait: STILL,
        posture: |t| Posture {
            drop_m: 0.02,
            twist: 0.1 * wave(t, 1.0),
            ..Posture::default()
        },
    },
    Motion {
        name: "walk",
        way: |t| (Vec3::Z * 0.95 * t, 0.0),
        gait: WALK,
        posture: |t| stride(t, WALK.period_s, 0.5, 0.08),
    },
    Motion {
        name: "walk fast",
        way: |t| (Vec3::Z * 1.5 * t, 0.0),
        gait: FAST,
        posture: |t| stride(t, FAST.period_s, 0.8, 0.1),
    },
    Motion {
        name: "walk in a curve",
        way: |t| arc(t, 0.95, 1.0),
        gait: WALK,
        posture: |t| stride(t, WALK.period_s, 0.5, 0.08),
    },
    Motion {
        name: "turn on the spot",
        way: |t| (Vec3::ZERO, 1.6 * t),
        gait: STEP,
        posture: |t| stride(t, STEP.period_s, 0.2, 0.04),
    },
    Motion {
        name: "step aside",
        way: |t| (Vec3::X * 0.5 * t, 0.0),
        gait: STEP,
        posture: |t| stride(t, STEP.period_s, 0.1, 0.05),
    },
    Motion {
        name: "crouch",
        way: still,
        gait: STILL,
        posture: |t| Posture {
            drop_m: 0.02 + 0.2 * hump(t),
            lean: 0.4 * hump(t),
            arms: [Arm {
                forward: 0.5 * hump(t),
                outward: 0.1,
                bend: 0.6 * hump(t),
            }; 2],
            ..Posture::default()
        },
    },
    Motion {
        name: "reach with the left hand",
        way: still,
        gait: STILL,
        posture: |t| reach(t, 0),
    },
    Motion {
        name: "reach with the right hand",
        way: still,
        gait: STILL,
        posture: |t| reach(t, 1),
    },
    Motion {
        name: "reach to the sides",
        way: still,
        gait: STILL,
        posture: |t| Posture {
            drop_m: 0.02,
            arms: [Arm {
                forward: 0.1,
                outward: 1.4 * hump(t),
                bend: 0.3,
            }; 2],
            ..Posture::default()
        },
    },
];

pub(super) const ON_FOUR: [Motion; 4] = [
    Motion {
        name: "stand",
        way: still,
        gait: STILL,
        posture: |t| Posture {
            drop_m: 0.03 + 0.03 * hump(t),
            ..Posture::default()
        },
    },
    Motion {
        name: "walk",
        way: |t| (Vec3::Z * 0.8 * t, 0.0),
        gait: FOUR_BEATS,
        posture: four,
    },
    Motion {
        name: "trot",
        way: |t| (Vec3::Z * 1.4 * t, 0.0),
        gait: TROT,
        posture: four,
    },
    Motion {
        name: "walk in a curve",
        way: |t| arc(t, 0.7, 0.4),
        gait: FOUR_BEATS,
        posture: four,
    },
];

fn still(_: f32) -> (Vec3, f32) {
    (Vec3::ZERO, 0.0)
}

/// A circle to the left at a speed in m/s and rad/s.
fn arc(t: f32, mps: f32, radps: f32) -> (Vec3, f32) {
    let (sin, cos) = (radps * t).sin_cos();
    (Vec3::new(1.0 - cos, 0.0, sin) * (mps / radps), radps * t)
}

/// From 1 to -1 and back over a period.
fn wave(t: f32, period_s: f32) -> f32 {
    (TAU * t / period_s).cos()
}

/// From 0 to 1 and back over a motion.
fn hump(t: f32) -> f32 {
    0.5 - 0.5 * (TAU * t * FPS / FRAMES as f32).cos()
}

/// Arms swing against the legs, of which the left one is ahead at first. The hips are lowest with
/// both feet on the ground.
fn stride(t: f32, period_s: f32, swing: f32, drop_m: f32) -> Posture {
    let arm = |sign: f32| Arm {
        forward: sign * swing * wave(t, period_s),
        outward: 0.1,
        bend: 0.3 + 0.3 * swing,
    };
    Posture {
        drop_m: drop_m + 0.012 * wave(t, 0.5 * period_s),
        lean: 0.06,
        twist: 0.1 * wave(t, period_s),
        arms: [arm(-1.0), arm(1.0)],
    }
}

/// A hand forward at the height of the shoulder.
fn reach(t: f32, side: usize) -> Posture {
    let mut posture = Posture {
        drop_m: 0.02 + 0.03 * hump(t),
        lean: 0.15 * hump(t),
        arms: [Arm {
            outward: 0.1,
            bend: 0.2,
            ..Arm::default()
        }; 2],
        ..Posture::default()
    };
    posture.arms[side] = Arm {
        forward: 1.4 * hump(t),
        outward: 0.1,
        bend: 0.2,
    };
    posture
}

fn four(t: f32) -> Posture {
    Posture {
        drop_m: 0.05 + 0.01 * wave(t, 0.5),
        ..Posture::default()
    }
}

/// A motion on a doll, whose neutral pose has all rotations at zero.
///
/// # Errors
/// [`ClipError`] if a value is not finite.
pub(super) fn clip(doll: &Figure, motion: &Motion) -> Result<Clip, ClipError> {
    let joints = doll.skeleton.joint_count();
    let mut roots = Vec::with_capacity(FRAMES);
    let mut rotations = Vec::with_capacity(FRAMES * joints);
    let mut pose = vec![Quat::IDENTITY; joints];
    for frame in 0..FRAMES {
        roots.push(hold(doll, motion, frame as f32 / FPS, &mut pose));
        rotations.extend_from_slice(&pose);
    }
    Clip::new(doll.skeleton.clone(), FPS, roots, rotations)
}

/// Poses the doll at a time. Returns its root.
fn hold(doll: &Figure, motion: &Motion, t: f32, pose: &mut [Quat]) -> Vec3 {
    let (place, heading) = (motion.way)(t);
    let posture = (motion.posture)(t);
    let parts = &doll.parts;
    pose.fill(Quat::IDENTITY);
    pose[0] = yaw(heading);
    let bow = Quat::from_rotation_y(0.5 * posture.twist) * Quat::from_rotation_x(0.5 * posture.lean);
    parts.trunk[1..].iter().for_each(|&joint| pose[joint] = bow);
    if let (Some(arms), false) = (&parts.arms, parts.on_fours) {
        // Arms turn with the body's heading, and do not lean with the trunk.
        let trunk = bow * bow;
        for ((limb, arm), out) in arms.iter().zip(posture.arms).zip([1.0, -1.0]) {
            let turn = Quat::from_rotation_z(out * arm.outward) * Quat::from_rotation_x(-arm.forward);
            pose[limb.top] = trunk.conjugate() * turn;
            pose[limb.lower[0]] = Quat::from_rotation_x(-arm.bend);
        }
    }
    let root = place + Vec3::Y * (doll.places[0].y - posture.drop_m);
    let hind = parts.legs.iter();
    let fore = parts.arms.iter().flatten().filter(|_| parts.on_fours);
    for (nth, leg) in hind.chain(fore).enumerate() {
        let toe = leg.toe.unwrap_or(leg.end);
        let foot = step(motion, nth, t, doll.places[toe]);
        let rotation = yaw(foot.heading) * Quat::from_rotation_x(foot.pitch);
        let ankle = foot.toe - rotation * doll.between(leg.end, toe);
        let ahead = yaw(heading) * Vec3::Z;
        place_end(
            &doll.skeleton,
            root,
            pose,
            leg.chain(),
            (ankle, 0.0),
            ahead,
            rotation,
        );
    }
    root
}

/// Place of a toe in the world, and how its foot is turned.
struct Footing {
    toe: Vec3,
    heading: f32,
    pitch: f32,
}

/// A foot stands where it stands at rest beside the hips, at the middle of its stand.
fn step(motion: &Motion, nth: usize, t: f32, toe: Vec3) -> Footing {
    let gait = motion.gait;
    let phase = t / gait.period_s + gait.phases[nth];
    let count = phase.floor();
    let share = phase - count;
    let stand = |count: f32| {
        let (place, heading) = (motion.way)((count + 0.5 * gait.stand - gait.phases[nth]) * gait.period_s);
        (place + yaw(heading) * toe, heading)
    };
    let (from, heading) = stand(count);
    if share <= gait.stand {
        let left = (gait.stand - share) / (HEEL_SHARE * gait.stand);
        return Footing {
            toe: from,
            heading,
            pitch: gait.pitch * smoothstep((1.0 - left).max(0.0)),
        };
    }
    let swung = (share - gait.stand) / (1.0 - gait.stand);
    let (to, next) = stand(count + 1.0);
    let way = smoothstep(swung);
    Footing {
        toe: from.lerp(to, way) + Vec3::Y * (gait.lift_m * (PI * swung).sin()),
        heading: heading + way * (next - heading),
        pitch: gait.pitch * (1.0 - way),
    }
}
