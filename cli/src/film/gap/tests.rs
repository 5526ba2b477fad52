//! The picture, without a server.

use std::f32::consts::TAU;
use std::sync::Arc;

use glam::{Quat, Vec3};
use troupe_motion::clip::Clip;
use troupe_motion::skeleton::{Joint, Skeleton};

use super::picture::{GapPicture, HEIGHT, Segment, WIDTH};

fn dancer(frames: usize) -> Clip {
    let joint = |name: &str, parent, offset_m| Joint {
        name: name.to_owned(),
        parent,
        offset_m,
    };
    let joints = vec![
        joint("Hips", None, Vec3::ZERO),
        joint("Spine", Some(0), Vec3::Y * 0.5),
        joint("Head", Some(1), Vec3::Y * 0.3),
        joint("Hand_L", Some(1), Vec3::X * 0.6),
        joint("Hand_R", Some(1), Vec3::X * -0.6),
        joint("Foot_L", Some(0), Vec3::new(0.1, -0.9, 0.0)),
        joint("Foot_R", Some(0), Vec3::new(-0.1, -0.9, 0.0)),
    ];
    let skeleton = Arc::new(Skeleton::new(joints, Vec3::X, 0.0, None).unwrap());
    let turn = |f: usize| Quat::from_rotation_y(f as f32 * TAU / 90.0);
    let rotations = (0..frames)
        .flat_map(|f| [turn(f); 1].into_iter().chain([Quat::IDENTITY; 6]))
        .collect();
    let roots = (0..frames)
        .map(|f| Vec3::new(0.02 * f as f32, 0.9, 0.04 * f as f32))
        .collect();
    Clip::new(skeleton, 30.0, roots, rotations).unwrap()
}

#[test]
fn a_picture_of_any_width_holds_all_colours() {
    let truth = dancer(30);
    let generated = dancer(26);
    for zoom in [0.5, 1.0] {
        let segment = |clip| Segment {
            clip,
            context_frames: 4,
            target_frames: 1,
            first_frame: 10,
        };
        let picture = GapPicture {
            title: "a dance".to_owned(),
            subtitle: "25 frames".to_owned(),
            caption: "generated".to_owned(),
            generated: segment(&generated),
            truth: segment(&truth),
            poses: 5,
            zoom,
        };
        let png = picture.to_png().unwrap();
        let pixels = tiny_skia::Pixmap::decode_png(&png).unwrap();
        assert_eq!(
            (pixels.width() as f32, pixels.height() as f32),
            (WIDTH * zoom, HEIGHT * zoom)
        );
        let has = |close: fn(u8, u8, u8) -> bool| {
            pixels
                .pixels()
                .iter()
                .filter(|p| close(p.red(), p.green(), p.blue()))
                .count()
                > 50
        };
        assert!(
            has(|r, g, b| r > 220 && (110..170).contains(&g) && b < 40),
            "target"
        );
        assert!(
            has(|r, g, b| r < 60 && (90..130).contains(&g) && b > 190),
            "start of the gap"
        );
        assert!(
            has(|r, g, b| (170..190).contains(&r) && (180..200).contains(&g) && b > 190),
            "ground truth"
        );
    }
}
