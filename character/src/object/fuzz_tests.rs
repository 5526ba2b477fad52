//! Random texts never panic: they give an error with its place, or a definition that can be used.

use proptest::prelude::*;
use troupe_motion::Vec3;

use super::testing::{CUP, definition};
use super::*;
use crate::document::testing::{any_changes, changed};
use crate::scene::{Scene, Transform};
use crate::style::testing::walker_rig;

/// Uses everything in a definition. Every result is finite.
fn use_it(thing: &Definition, seed: u64) -> Result<(), TestCaseError> {
    let mut scene = Scene::new(0.0).unwrap();
    let at = Transform::upright(Vec3::new(1.0, 0.5, 2.0), 0.7);
    scene.add("it", &thing.name, thing.body.clone(), at).unwrap();
    let choice = thing.approach_from(thing.side_of(at, Vec3::new(3.0, 0.0, -1.0)));
    prop_assert!(choice.side.is_finite() && choice.off.is_finite());
    let variant = &thing.variants[thing.variant_for(seed)];
    prop_assert!(!variant.entry.is_empty());
    let anchor = thing.anchor(at, choice.side, 0.0);
    for &set in variant.entry.iter().chain(&variant.exit) {
        for key in &thing.sets[set].keyframes {
            let world = anchor.keyframe(key);
            prop_assert!(
                world
                    .place
                    .iter()
                    .flatten()
                    .chain(&world.heading)
                    .chain(&world.height)
                    .all(|v| v.is_finite())
            );
            prop_assert!(world.points.iter().all(|point| point.position.is_finite()));
            let unit = |q: &Quat| (q.length() - 1.0).abs() < 1e-3;
            prop_assert!(world.rotations.iter().flatten().all(unit));
        }
    }
    if let Ok(placed) = thing.place(&scene, "it", at) {
        prop_assert!(placed.transform.checked("it").is_ok());
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn mutated_definitions_never_panic(changes in any_changes(), seed: u64) {
        let text = changed(CUP, &changes);
        match Definition::from_toml(&text, &walker_rig()) {
            Ok(thing) => use_it(&thing, seed)?,
            Err(error) => prop_assert!(!error.message.is_empty() && !error.to_string().is_empty()),
        }
    }

    #[test]
    fn mutated_json_never_panics(changes in any_changes(), seed: u64) {
        let text = serde_json::to_string_pretty(&*definition().doc).unwrap();
        let text = changed(&text, &changes);
        match Definition::from_json(&text, &walker_rig()) {
            Ok(thing) => use_it(&thing, seed)?,
            Err(error) => prop_assert!(!error.message.is_empty() && !error.to_string().is_empty()),
        }
    }

    #[test]
    fn anything_is_read_without_panic(text in ".{0,200}") {
        let _ = Definition::from_toml(&text, &walker_rig());
        let _ = Definition::from_json(&text, &walker_rig());
    }

    /// Random chains of sets: those with a circle are refused, and all others end.
    #[test]
    fn chains_end_or_are_refused(next in prop::collection::vec(prop::option::of(0_usize..8), 8), entry in 0_usize..8) {
        let mut doc = (*definition().doc).clone();
        doc.sets = (next.iter().enumerate())
            .map(|(index, next)| SetDoc {
                name: index.to_string(),
                next: next.map(|next| next.to_string()),
                events: Vec::new(),
                ..doc.sets[3].clone()
            })
            .collect();
        // Every set belongs to a variant, so that none is refused as unreachable.
        doc.variants = (0..8)
            .map(|index| VariantDoc {
                name: index.to_string(),
                weight: 1.0,
                entry: ((entry + index) % 8).to_string(),
                exit: None,
            })
            .collect();
        let comes_back = (0..8).any(|start| {
            let mut at = start;
            (0..8).all(|_| match next[at] {
                Some(following) => {
                    at = following;
                    true
                }
                None => false,
            })
        });
        match Definition::from_doc(doc, &walker_rig()) {
            Ok(thing) => {
                prop_assert!(!comes_back);
                for variant in &thing.variants {
                    let mut sorted = variant.entry.clone();
                    sorted.sort_unstable();
                    sorted.dedup();
                    prop_assert_eq!(sorted.len(), variant.entry.len());
                }
            }
            Err(error) => {
                prop_assert!(comes_back, "{}", error);
                prop_assert!(error.message.contains("goes round"));
            }
        }
    }
}
