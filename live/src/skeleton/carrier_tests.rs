use super::*;

fn candidate_of(name: &str, is_same_body: bool, is_robot: bool) -> Candidate<'_> {
    Candidate {
        name,
        is_same_body,
        is_robot,
    }
}

/// Names of candidates, the first to plan first.
fn order(all: &[Candidate<'_>], for_robot: bool) -> Vec<String> {
    let mut all = all.to_vec();
    all.sort_by_key(|candidate| candidate.rank(for_robot));
    all.iter().map(|candidate| candidate.name.to_owned()).collect()
}

#[test]
fn the_same_body_comes_first_then_robots_for_robots_then_human_then_names() {
    let packs = |same: &str| {
        let all = [("open", false), ("human", false), ("g1", true), ("atlas", true)];
        all.map(|(name, is_robot)| {
            candidate_of(if name == same { "same" } else { name }, name == same, is_robot)
        })
    };
    assert_eq!(order(&packs("g1"), true), ["same", "atlas", "human", "open"]);
    assert_eq!(order(&packs("human"), false), ["same", "atlas", "g1", "open"]);
    // An H1 is none of them.
    assert_eq!(order(&packs(""), true), ["atlas", "g1", "human", "open"]);
    assert_eq!(order(&packs(""), false), ["human", "atlas", "g1", "open"]);
    // The order of the table does not matter.
    let mut reversed = packs("");
    reversed.reverse();
    assert_eq!(order(&reversed, true), order(&packs(""), true));
}

#[test]
fn better_are_packs_of_robots_for_robots() {
    let [same, human, open, g1] = [
        ("same", true, false),
        ("human", false, false),
        ("open", false, false),
        ("g1", false, true),
    ]
    .map(|(name, is_same_body, is_robot)| candidate_of(name, is_same_body, is_robot));
    let better = |for_robot| {
        let is_better = |one: &Candidate<'_>| one.is(Among::Better, for_robot);
        let found = [same, human, open, g1].into_iter().filter(is_better);
        found.map(|one| one.name).collect::<Vec<_>>()
    };
    assert_eq!(better(false), [""; 0], "people plan themselves");
    assert_eq!(better(true), ["same", "g1"]);
    assert!(
        [same, human, open, g1]
            .iter()
            .all(|one| one.is(Among::All, false))
    );
}

mod packs {
    use std::path::Path;

    use troupe_engine::pack::Pack;
    use troupe_motion::model::Rig;

    use super::*;

    fn pack(name: &str) -> Pack {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models").join(name);
        Pack::load(&folder).unwrap()
    }

    fn body(unimogen: &Pack, name: &str) -> Arc<Rig> {
        unimogen.body(name).unwrap().rig.clone()
    }

    #[test]
    fn people_and_g1s_of_two_packs_are_the_same_bodies_and_others_are_not() {
        let (unimogen, human, g1) = (pack("unimogen"), pack("human"), pack("g1"));
        let same = |name: &str, other: &Pack| is_same_body(&body(&unimogen, name), &other.rig);
        assert!(same("human", &human) && same("g1", &g1));
        for (name, other) in [("human", &g1), ("g1", &human), ("h1", &g1), ("h1_2", &g1)] {
            assert!(!same(name, other), "{name}, {}", other.name());
        }
    }

    #[test]
    fn walk_is_the_default_style_of_a_pack_without_one_and_other_words_are_not() {
        let g1 = pack("g1");
        let styles = StyleTable::load(&g1.rig, &g1.folder, None).unwrap();
        let found = |word: Option<&str>| style(&styles, word).map(|style| style.name.clone());
        assert_eq!(found(None).as_deref(), Some("normal"));
        assert_eq!(found(Some("walk")).as_deref(), Some("normal"));
        assert_eq!(found(Some("march")).as_deref(), Some("march"));
        assert_eq!(found(Some("dance")), None);
        let human = pack("human");
        let styles = StyleTable::load(&human.rig, &human.folder, None).unwrap();
        let found = style(&styles, Some("walk")).unwrap();
        assert_eq!(found.name, "walk", "a style of this name comes first");
    }
}
