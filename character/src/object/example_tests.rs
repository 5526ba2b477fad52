//! The objects that ship as examples.

use std::path::Path as FilePath;

use troupe_motion::GlobalRoot;
use troupe_motion::ik::{Posed, ReachOptions, legs, reach_pose};

use super::*;
use crate::style::StyleTable;

#[test]
fn the_examples_are_definitions_of_the_default_pack() {
    let root = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let rig = troupe_engine::pack::Pack::load(&root.join("models/human"))
        .unwrap()
        .rig;
    let objects = load_folder(&root.join("examples/objects"), &rig).unwrap();
    let names: Vec<_> = objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["cup", "greeter", "seat", "shrine", "sign"]);
    let object = |name: &str| objects.iter().find(|object| object.name == name).unwrap();
    assert!(object("sign").body.shared && object("shrine").body.shared && !object("greeter").body.solid);
    let sets = |object: &Definition, list: &[usize]| {
        list.iter()
            .map(|&index| object.sets[index].name.clone())
            .collect::<Vec<_>>()
    };
    let cup = object("cup");
    assert_eq!(sets(cup, &cup.variants[0].exit), ["put-down"]);
    for variant in &cup.variants {
        let event = |list: &[usize], action: fn(&Action) -> bool| {
            let mut events = list.iter().flat_map(|&set| &cup.sets[set].events);
            events.any(|event| action(&event.action))
        };
        assert!(event(&variant.entry, |action| matches!(
            action,
            Action::Attach(_)
        )));
        assert!(event(&variant.exit, |action| *action == Action::Release));
        // Whatever holds the cup moves with the character, so the way out is relative to the
        // character.
        assert!(
            variant
                .exit
                .iter()
                .all(|&set| cup.sets[set].origin == Origin::Character)
        );
    }
    let seat = object("seat");
    for variant in &seat.variants {
        let (&turn, &sit) = (variant.entry.first().unwrap(), variant.entry.last().unwrap());
        let (sit, rise) = (&seat.sets[sit], &seat.sets[variant.exit[0]]);
        assert!(seat.sets[turn].from_stand && seat.sets[turn].motion.is_none());
        assert_eq!(
            (sit.motion, rise.motion),
            (Some(Motion::Stance), Some(Motion::Stance))
        );
        assert_eq!(sit.hold, Hold::UntilEnded);
        assert!(sit.keyframes[0].height_m.unwrap() < 0.7);
    }
    for name in ["greeter", "shrine", "cup"] {
        assert!(
            object(name)
                .variants
                .iter()
                .filter(|variant| variant.weight > 0.0)
                .count()
                > 2
        );
        assert!(object(name).approaches.is_empty(), "any side is allowed");
    }
}

/// For every variant that is chosen by weight, the hand reaches the cup, and then the place where
/// it takes the cup, at any table height.
#[test]
fn the_cup_is_in_reach_on_tables_of_70_to_100_cm() {
    let root = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let pack = troupe_engine::pack::Pack::load(&root.join("models/human")).unwrap();
    let rig = &pack.rig;
    let cup = load_file(&root.join("examples/objects/cup.toml"), rig).unwrap();
    let skeleton = &rig.skeleton;
    let legs = legs(skeleton);
    let style = StyleTable::load(rig, &pack.folder, None)
        .unwrap()
        .default_style()
        .unwrap();
    let standing = style.idle();
    let base = Posed {
        root: Vec3::Y * standing.height_m,
        rotations: &standing.rotations,
    };
    for variant in cup.variants.iter().filter(|variant| variant.weight > 0.0) {
        for (table, &set) in [0.7, 0.85, 1.0].into_iter().flat_map(|table| {
            variant
                .entry
                .iter()
                .chain(&variant.exit)
                .map(move |set| (table, set))
        }) {
            let set = &cup.sets[set];
            let key = &set.keyframes[0];
            // As seen from the character, which stands at the origin and faces ahead.
            let anchor = match (set.origin, key.place_m) {
                (Origin::Object, Some([x, z])) => Anchor {
                    pivot: Vec3::new(x, table, z),
                    local_pivot_m: Vec3::ZERO,
                    heading: std::f32::consts::PI,
                    side: 0.0,
                    ground_y: 0.0,
                },
                _ => Anchor::of_character(GlobalRoot::new(base.root, 0.0), 0.0),
            };
            let points: Vec<_> = (anchor.keyframe(key).points.iter())
                .map(|point| (point.joint, point.position))
                .collect();
            let reached = reach_pose(skeleton, &legs, base, &points, &ReachOptions::default());
            let off = reached.errors_m.iter().copied().fold(0.0, f32::max);
            assert!(
                off < 0.02 && reached.short_m < 0.01,
                "{}, table of {table} m: {off} m off, bow {}, crouch {}, {points:?}",
                set.name,
                reached.bow,
                reached.crouch_m
            );
            // No clip has a deeper bow.
            assert!(
                reached.bow < 1.5 && reached.crouch_m < 0.25,
                "{}: {} {}",
                set.name,
                reached.bow,
                reached.crouch_m
            );
        }
    }
}
