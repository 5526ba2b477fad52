use super::*;

fn goal(words: &[&str]) -> v1::PathGoal {
    v1::PathGoal {
        body: "h1".to_owned(),
        style: (words.iter())
            .map(|word| v1::StyleWord {
                word: (*word).to_owned(),
                weight: Some(0.5),
            })
            .collect(),
        planner: v1::PathPlanner::Carried.into(),
        ..v1::PathGoal::default()
    }
}

#[test]
fn the_planner_is_one_of_three() {
    let of = |number| {
        planner(&v1::PathGoal {
            planner: number,
            ..v1::PathGoal::default()
        })
    };
    assert_eq!(of(0), Ok(v1::PathPlanner::Auto));
    assert_eq!(of(2), Ok(v1::PathPlanner::Carried));
    assert_eq!(
        of(3).unwrap_err().to_string(),
        "path.planner: is 3; allowed: PATH_PLANNER_AUTO (0), PATH_PLANNER_OWN (1) or PATH_PLANNER_CARRIED (2)"
    );
}

#[test]
fn another_pack_gets_its_own_style_and_no_body() {
    let made = for_carrier(&goal(&["walk", "old"]), "normal");
    assert_eq!((made.body.as_str(), made.planner), ("", 0));
    let styles: Vec<_> = made
        .style
        .iter()
        .map(|style| (&*style.word, style.weight))
        .collect();
    assert_eq!(styles, [("normal", Some(0.5)), ("old", Some(0.5))]);
    let usual = for_carrier(&goal(&[]), "normal");
    assert!(usual.style.is_empty(), "the default style needs no name");
}

#[test]
fn refusals_say_how_to_go_on() {
    let no_style = NoCarrier::NoStyle {
        word: "dance".to_owned(),
        pack: "g1".to_owned(),
        styles: vec!["crawl".to_owned(), "march".to_owned()],
    };
    for (error, said) in [
        (
            no_style,
            "path.style[0].word: is \"dance\", and no pack that walks has this style; allowed: a style of g1: crawl, march; or planner PATH_PLANNER_OWN",
        ),
        (
            NoCarrier::NoPack,
            "path.planner: is PATH_PLANNER_CARRIED, and no pack is loaded that walks along paths; allowed: PATH_PLANNER_OWN; or a server with a pack that walks, such as human",
        ),
    ] {
        assert_eq!(refused(&error).to_string(), said);
    }
    let field = FieldError {
        field: "path.steps".to_owned(),
        message: "is given".to_owned(),
        allowed: "none: the pack human has no sampler".to_owned(),
    };
    assert_eq!(
        with_way_on(field).to_string(),
        "path.steps: is given; allowed: none: the pack human has no sampler; or planner PATH_PLANNER_OWN"
    );
}
