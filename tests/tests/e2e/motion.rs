//! Requests for other tests, and comparisons of answers.

use troupe_client::{InBetween, Pack};
use troupe_motion::clip::Clip;
use troupe_motion::{Quat, Vec3};
use troupe_proto::v1;

use crate::walk::Walk;

/// Ten seconds of walking in a wide curve on the pack's skeleton.
pub fn walk(pack: &Pack) -> Clip {
    Walk {
        frames: 300,
        turn_rps: 0.3,
        ..Walk::default()
    }
    .on(pack.skeleton())
}

/// The walk's gap of 25 frames from frame 40 to 66, as a message.
pub fn character(pack: &Pack) -> v1::Character {
    message(pack, &InBetween::from_clip(&walk(pack), 40, 66).unwrap())
}

/// The protobuf message of a task.
pub fn message(pack: &Pack, gap: &InBetween) -> v1::Character {
    gap.to_message(pack).unwrap()
}

/// A request of these characters to the default pack.
pub fn request(characters: impl IntoIterator<Item = v1::Character>) -> v1::InBetweenRequest {
    v1::InBetweenRequest {
        pack: String::new(),
        characters: characters.into_iter().collect(),
        skeleton: String::new(),
    }
}

/// Turns a clip about the world's +Y axis through the origin, then moves it.
pub fn turn_and_move(clip: &Clip, heading: f32, by: Vec3) -> Clip {
    let turn = Quat::from_rotation_y(heading);
    let mut clip = clip.clone();
    clip.root_positions.iter_mut().for_each(|p| *p = turn * *p + by);
    for frame in 0..clip.frames() {
        let pelvis = &mut clip.rotations_at_mut(frame)[0];
        *pelvis = turn * *pelvis;
    }
    clip
}

/// The largest difference between two clips: of root positions in metres, of rotations between
/// quaternions without regard to their sign.
pub fn difference(a: &Clip, b: &Clip) -> f32 {
    assert_eq!(a.frames(), b.frames());
    let places = a
        .root_positions
        .iter()
        .zip(&b.root_positions)
        .map(|(p, q)| p.distance(*q));
    let turns = a
        .rotations
        .iter()
        .zip(&b.rotations)
        .map(|(p, q)| (*p - *q).length().min((*p + *q).length()));
    places.chain(turns).fold(0.0, largest)
}

/// The largest difference between the numbers of two answers.
pub fn frames_difference(a: &v1::Frames, b: &v1::Frames) -> f32 {
    assert_eq!(a.frame_count, b.frame_count);
    let columns = [
        (&a.root_positions, &b.root_positions),
        (&a.rotations, &b.rotations),
        (&a.contacts, &b.contacts),
        (&a.positions, &b.positions),
    ];
    let pairs = columns.into_iter().flat_map(|(x, y)| {
        assert_eq!(x.len(), y.len());
        x.iter().zip(y)
    });
    pairs.map(|(x, y)| (x - y).abs()).fold(0.0, largest)
}

/// The larger number, or NaN if either is NaN, so that NaN cannot pass for equal.
fn largest(a: f32, b: f32) -> f32 {
    if a.is_nan() || a > b { a } else { b }
}
