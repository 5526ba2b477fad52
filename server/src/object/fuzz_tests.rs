//! Nonsense never panics: a definition or an error that says where, and what passes can be used.

use proptest::prelude::*;
use troupe_motion::Vec3;

use super::testing::{CUP, definition};
use super::*;
use crate::scene::{Scene, Transform};
use crate::style::testing::walker_pack;

/// Values and pieces that do not belong where they are put.
const PIECES: &[&str] = &[
    "nan",
    "-inf",
    "inf",
    "0",
    "-1",
    "1e39",
    "-0.0",
    "4294967296",
    "9223372036854775807",
    "\"\"",
    "\"lift\"",
    "\"reach\"",
    "true",
    "[]",
    "{}",
    "[[]]",
    "[nan, nan, nan]",
    "[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]",
    "1979-05-27T07:32:00Z",
    "'''",
    "\"\u{0}\"",
    "é",
    "\n[[sets]]\n",
    "\n[sets]\n",
    "[",
    "]",
    "}",
    "#",
    "=",
    ".",
    "a.b.c.d = 1\n",
];

/// A word of the text: what is between blanks, commas, brackets and signs.
fn words(text: &str) -> Vec<(usize, usize)> {
    let mut words = Vec::new();
    let mut start = None;
    for (at, c) in text.char_indices() {
        let inside = !c.is_whitespace() && !",[]{}=".contains(c);
        match (inside, start) {
            (true, None) => start = Some(at),
            (false, Some(from)) => {
                words.push((from, at));
                start = None;
            }
            _ => {}
        }
    }
    words
}

#[derive(Debug, Clone)]
enum Change {
    /// A word becomes a piece.
    Replace(prop::sample::Index, prop::sample::Index),
    /// A word becomes another word.
    Swap(prop::sample::Index, prop::sample::Index),
    /// A line goes.
    Drop(prop::sample::Index),
    /// A line comes twice, the second time elsewhere.
    Copy(prop::sample::Index, prop::sample::Index),
    /// A piece at any place.
    Insert(prop::sample::Index, prop::sample::Index),
}

impl Change {
    fn apply(&self, text: &str) -> String {
        let words = words(text);
        let lines: Vec<&str> = text.lines().collect();
        if words.is_empty() || lines.is_empty() {
            return text.to_owned();
        }
        let put = |(from, to): (usize, usize), new: &str| format!("{}{new}{}", &text[..from], &text[to..]);
        match self {
            Self::Replace(word, piece) => {
                put(words[word.index(words.len())], PIECES[piece.index(PIECES.len())])
            }
            Self::Swap(word, other) => {
                let (from, to) = words[other.index(words.len())];
                put(words[word.index(words.len())], &text[from..to])
            }
            Self::Drop(line) => {
                let mut lines = lines;
                lines.remove(line.index(lines.len()));
                lines.join("\n")
            }
            Self::Copy(line, to) => {
                let mut lines = lines;
                let line = lines[line.index(lines.len())];
                lines.insert(to.index(lines.len()), line);
                lines.join("\n")
            }
            Self::Insert(at, piece) => {
                let places: Vec<usize> = text.char_indices().map(|(at, _)| at).collect();
                let at = places[at.index(places.len())];
                put((at, at), PIECES[piece.index(PIECES.len())])
            }
        }
    }
}

fn any_change() -> impl Strategy<Value = Change> {
    let index = any::<prop::sample::Index>;
    prop_oneof![
        4 => (index(), index()).prop_map(|(a, b)| Change::Replace(a, b)),
        3 => (index(), index()).prop_map(|(a, b)| Change::Swap(a, b)),
        1 => index().prop_map(Change::Drop),
        1 => (index(), index()).prop_map(|(a, b)| Change::Copy(a, b)),
        2 => (index(), index()).prop_map(|(a, b)| Change::Insert(a, b)),
    ]
}

/// Uses all that a definition has; every answer is finite.
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
    fn mutated_definitions_never_panic(changes in prop::collection::vec(any_change(), 1..5), seed: u64) {
        let text = changes.iter().fold(CUP.to_owned(), |text, change| change.apply(&text));
        match Definition::from_toml(&text, &walker_pack()) {
            Ok(thing) => use_it(&thing, seed)?,
            Err(error) => prop_assert!(!error.message.is_empty() && !error.to_string().is_empty()),
        }
    }

    #[test]
    fn mutated_json_never_panics(changes in prop::collection::vec(any_change(), 1..5), seed: u64) {
        let text = serde_json::to_string_pretty(&*definition().doc).unwrap();
        let text = changes.iter().fold(text, |text, change| change.apply(&text));
        match Definition::from_json(&text, &walker_pack()) {
            Ok(thing) => use_it(&thing, seed)?,
            Err(error) => prop_assert!(!error.message.is_empty() && !error.to_string().is_empty()),
        }
    }

    #[test]
    fn anything_is_read_without_panic(text in ".{0,200}") {
        let _ = Definition::from_toml(&text, &walker_pack());
        let _ = Definition::from_json(&text, &walker_pack());
    }

    /// Chains of sets at random: those that come back are refused, all others end.
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
        // Every set is some variant's, so that none is refused for being left out.
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
        match Definition::from_doc(doc, &walker_pack()) {
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
