//! The picture, without a server.

use glam::{Quat, Vec2, Vec3};
use std::f32::consts::PI;
use troupe_motion::clip::Clip;
use troupe_proto::v1;
use troupe_proto::v1::session_event::Kind;

use super::picture::{PathPicture, WIDTH};
use crate::scenery::{Scenery, Solid};
use crate::take::{Event, Moved, Order, Take};
use crate::testing::doll;

/// A figure that walks half a circle.
fn take(frames: usize, styles: &[&str]) -> Take {
    let skeleton = doll();
    let angle = |f: usize| PI * f as f32 / frames.max(2) as f32;
    let roots = (0..frames).map(|f| Vec3::new(2.0 - 2.0 * angle(f).cos(), 0.9, 2.0 * angle(f).sin()));
    let turns = (0..frames).flat_map(|f| {
        let turn = Quat::from_rotation_y(angle(f));
        [
            turn,
            Quat::IDENTITY,
            Quat::IDENTITY,
            Quat::IDENTITY,
            Quat::IDENTITY,
        ]
    });
    let orders = styles.iter().enumerate().map(|(nth, style)| Order {
        frame: nth * frames / styles.len(),
        style: (*style).to_owned(),
        velocity: Vec2::Y,
    });
    Take {
        orders: orders.collect(),
        commanded: vec![
            Vec2::ZERO,
            Vec2::new(0.0, 2.0),
            Vec2::new(4.0, 2.0),
            Vec2::new(4.0, 0.0),
        ],
        goal: None,
        scene: None,
        events: Vec::new(),
        moved: Vec::new(),
        commands: 1,
        stats: v1::SessionStats::default(),
        clip: Clip::new(skeleton, 30.0, roots.collect(), turns.collect()).unwrap(),
    }
}

fn draw(take: &Take, poses: usize, zoom: f32) -> tiny_skia::Pixmap {
    let cup = |_: &str| Solid::cuboid(Vec3::Y * 0.1, Vec3::splat(0.1));
    let picture = PathPicture {
        title: "Half a circle".to_owned(),
        subtitle: super::subtitle(take),
        take,
        scenery: take
            .scene
            .as_ref()
            .map(|scene| Scenery::new(scene, &take.events, &take.moved, cup)),
        range: 0..=take.clip.frames() - 1,
        poses,
        zoom,
    };
    tiny_skia::Pixmap::decode_png(&picture.to_png().unwrap()).unwrap()
}

/// Pixels near a colour.
fn count(pixels: &tiny_skia::Pixmap, [r, g, b]: [u8; 3]) -> usize {
    let near = |p: &&tiny_skia::PremultipliedColorU8| {
        p.red().abs_diff(r) < 12 && p.green().abs_diff(g) < 12 && p.blue().abs_diff(b) < 12
    };
    pixels.pixels().iter().filter(near).count()
}

const BLUE: [u8; 3] = [0x1b, 0x6f, 0xd8];
const PINK: [u8; 3] = [0xd8, 0x43, 0x8c];
const ORANGE: [u8; 3] = [0xf0, 0x8c, 0x00];

#[test]
fn one_style_is_coloured_by_time() {
    let pixels = draw(&take(90, &["walk"]), 8, 1.0);
    assert_eq!(pixels.width() as f32, WIDTH);
    for ink in [BLUE, PINK] {
        assert!(count(&pixels, ink) > 500, "{ink:?}");
    }
    assert_eq!(count(&pixels, ORANGE), 0);
}

#[test]
fn styles_have_colours_of_their_own() {
    let pixels = draw(&take(90, &["walk", "old", "young"]), 12, 0.5);
    assert_eq!(pixels.width() as f32, WIDTH / 2.0);
    for ink in [BLUE, PINK, ORANGE] {
        assert!(count(&pixels, ink) > 200, "{ink:?}");
    }
}

#[test]
fn more_poses_take_more_rows() {
    let (one, two) = (
        draw(&take(90, &["walk"]), 20, 0.4),
        draw(&take(90, &["walk"]), 24, 0.4),
    );
    assert!(two.height() > one.height());
}

#[test]
fn the_shortest_take_is_drawn() {
    for frames in [1, 2, 5] {
        draw(&take(frames, &["walk"]), 40, 0.4);
    }
}

/// The figure comes by a cup on a step, and takes it along for a while.
fn take_with_a_cup() -> Take {
    let mut take = take(90, &["walk"]);
    let cup = || "cup".to_owned();
    take.scene = Some(v1::Scene {
        colliders: vec![v1::Collider {
            shape: Some(v1::ColliderShape {
                r#box: Some(v1::BoxShape {
                    center: Some(vector(Vec3::new(2.0, 0.1, 2.0))),
                    half_extents: Some(vector(Vec3::new(0.5, 0.1, 0.5))),
                }),
                ..v1::ColliderShape::default()
            }),
            ..v1::Collider::default()
        }],
        objects: vec![v1::SceneObject {
            id: cup(),
            position: Some(vector(Vec3::new(2.0, 0.2, 2.0))),
            ..v1::SceneObject::default()
        }],
        ..v1::Scene::default()
    });
    let moved = |frame, x, in_hand| Moved {
        frame,
        instance: cup(),
        position: Vec3::new(x, 1.0, 2.0),
        rotation: Quat::IDENTITY,
        in_hand,
    };
    take.moved = vec![moved(45, 2.5, true), moved(46, 3.0, true), moved(60, 4.0, false)];
    let started = v1::InteractionStarted {
        instance: cup(),
        ..v1::InteractionStarted::default()
    };
    take.events = vec![Event {
        frame: 10,
        time_s: 1.0 / 3.0,
        kind: Kind::Started(started),
    }];
    take
}

fn vector(v: Vec3) -> v1::Vec3 {
    let Vec3 { x, y, z } = v;
    v1::Vec3 { x, y, z }
}

#[test]
fn objects_are_where_they_were_at_the_time() {
    let take = take_with_a_cup();
    let scenery = Scenery::new(take.scene.as_ref().unwrap(), &take.events, &take.moved, |_| {
        Solid::cuboid(Vec3::ZERO, Vec3::splat(0.1))
    });
    let at = |frame| {
        let things = scenery.things(frame).collect::<Vec<_>>();
        let cup = things.iter().find(|thing| thing.id == Some("cup")).unwrap();
        assert!(cup.is_used && things.len() == 2);
        let (least, most) = cup.solid.bounds();
        ((least.x + most.x) / 2.0, cup.in_hand)
    };
    assert_eq!(
        [0, 44, 45, 50, 60, 89].map(at),
        [
            (2.0, false),
            (2.0, false),
            (2.5, true),
            (3.0, true),
            (4.0, false),
            (4.0, false)
        ]
    );
    // On the step, over it, beside it and below it.
    let level = |x, y| scenery.level(Vec3::new(x, y, 2.0));
    assert_eq!(
        [level(2.0, 0.2), level(2.0, 3.0), level(4.0, 0.2), level(2.0, 0.0)],
        [0.2, 0.2, 0.0, 0.0]
    );
}

#[test]
fn a_scene_is_drawn_with_its_objects() {
    let (with, without) = (
        draw(&take_with_a_cup(), 8, 1.0),
        draw(&take(90, &["walk"]), 8, 1.0),
    );
    for ink in [[0xfc, 0xd9, 0x94], [0xe6, 0xea, 0xef]] {
        let (with, without) = (count(&with, ink), count(&without, ink));
        assert!(with > 500 + without, "{ink:x?}: {with}, {without}");
    }
}
