//! The moving picture, without a server.

use glam::{Quat, Vec3};
use troupe_motion::clip::Clip;

use super::picture::CastPicture;
use crate::scenery::{Scenery, Solid};
use crate::take::{CrowdTake, Recorded};
use crate::testing::doll;

/// A character that walks ahead from a place.
fn walker(from: Vec3, frames: usize) -> Recorded {
    let skeleton = doll();
    let roots = (0..frames).map(|frame| from + Vec3::new(0.0, 0.9, 0.02 * frame as f32));
    let rotations = vec![Quat::IDENTITY; 5 * frames];
    Recorded {
        clip: Clip::new(skeleton, 60.0, roots.collect(), rotations).unwrap(),
        pack: "human".to_owned(),
        labels: vec![(0, "proud".to_owned()), (80, "sad".to_owned())],
    }
}

fn picture(take: &CrowdTake) -> CastPicture<'_> {
    CastPicture {
        title: "Two".to_owned(),
        take,
        scenery: None,
        from_s: 0.5,
        seconds: 1.0,
        fps: 10,
        zoom: 0.4,
    }
}

/// The number of frames of a file, and the seconds that they take.
fn frames(png: &[u8]) -> (u32, f32) {
    let reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let count = reader.info().animation_control().unwrap().num_frames;
    let control = reader.info().frame_control().unwrap();
    let each_s = f32::from(control.delay_num) / f32::from(control.delay_den);
    (count, count as f32 * each_s)
}

#[test]
fn a_picture_moves_for_its_length() {
    let take = CrowdTake {
        members: vec![walker(Vec3::X, 90), walker(Vec3::ZERO, 90)],
        scene: None,
        events: Vec::new(),
        plans: 7,
    };
    let drawn = std::cell::Cell::new(0);
    let png = picture(&take).to_png(|| drawn.set(drawn.get() + 1)).unwrap();
    let (count, length_s) = frames(&png);
    assert_eq!((count, drawn.get()), (10, 10));
    assert!((length_s - 1.0).abs() < 1e-3);
}

#[test]
fn things_of_the_scene_are_drawn() {
    let scene = troupe_proto::v1::Scene {
        objects: vec![troupe_proto::v1::SceneObject {
            id: "stool".to_owned(),
            ..troupe_proto::v1::SceneObject::default()
        }],
        ..troupe_proto::v1::Scene::default()
    };
    let take = CrowdTake {
        members: vec![walker(Vec3::ZERO, 90)],
        scene: None,
        events: Vec::new(),
        plans: 7,
    };
    let without = picture(&take);
    let cube = |_: &str| Solid::cuboid(Vec3::ZERO, Vec3::ONE);
    let with = CastPicture {
        scenery: Some(Scenery::new(&scene, &[], &[], cube)),
        ..picture(&take)
    };
    assert_ne!(with.to_png(|| ()).unwrap(), without.to_png(|| ()).unwrap());
}
