//! The command line as its users see it.

use clap::{CommandFactory as _, Parser as _};

use crate::args::Arguments;

/// The long help of a command, at a fixed width and without the environment of whoever runs the
/// tests.
fn help(command: &[&str]) -> String {
    let mut root = Arguments::command()
        .term_width(100)
        .mut_args(|arg| arg.hide_env_values(true));
    root.build();
    let found = command
        .iter()
        .try_fold(&mut root, |at, name| at.find_subcommand_mut(name));
    found
        .expect("a command of that name")
        .render_long_help()
        .to_string()
}

#[test]
fn help_of_troupe() {
    insta::assert_snapshot!(help(&[]));
}

#[test]
fn help_of_inbetween() {
    insta::assert_snapshot!(help(&["inbetween"]));
}

#[test]
fn help_of_animate() {
    insta::assert_snapshot!(help(&["animate"]));
}

#[test]
fn help_of_say() {
    insta::assert_snapshot!(help(&["say"]));
}

#[test]
fn help_of_describe() {
    insta::assert_snapshot!(help(&["describe"]));
}

#[test]
fn help_of_packs() {
    insta::assert_snapshot!(help(&["packs"]));
}

#[test]
fn help_of_eval() {
    insta::assert_snapshot!(help(&["eval"]));
}

#[test]
fn help_of_eval_live() {
    insta::assert_snapshot!(help(&["eval", "live"]));
}

#[test]
fn help_of_eval_feasibility() {
    insta::assert_snapshot!(help(&["eval", "feasibility"]));
}

#[test]
fn help_of_eval_wander() {
    insta::assert_snapshot!(help(&["eval", "wander"]));
}

#[test]
fn help_of_style() {
    insta::assert_snapshot!(help(&["style"]));
}

#[test]
fn help_of_style_add() {
    insta::assert_snapshot!(help(&["style", "add"]));
}

#[test]
fn help_of_scene() {
    insta::assert_snapshot!(help(&["scene"]));
}

#[test]
fn help_of_object() {
    insta::assert_snapshot!(help(&["object"]));
}

#[test]
fn help_of_object_put() {
    insta::assert_snapshot!(help(&["object", "put"]));
}

#[test]
fn help_of_style_list() {
    insta::assert_snapshot!(help(&["style", "list"]));
}

#[test]
fn help_of_style_show() {
    insta::assert_snapshot!(help(&["style", "show"]));
}

#[test]
fn help_of_style_build() {
    insta::assert_snapshot!(help(&["style", "build"]));
}

#[test]
fn help_of_draw() {
    insta::assert_snapshot!(help(&["draw"]));
}

#[test]
fn help_of_drive() {
    insta::assert_snapshot!(help(&["drive"]));
}

#[test]
fn help_of_film() {
    insta::assert_snapshot!(help(&["film"]));
}

#[test]
fn help_of_sessions() {
    insta::assert_snapshot!(help(&["sessions"]));
}

#[test]
fn help_of_sessions_close() {
    insta::assert_snapshot!(help(&["sessions", "close"]));
}

#[test]
fn help_of_object_new() {
    insta::assert_snapshot!(help(&["object", "new"]));
}

#[test]
fn help_of_top() {
    insta::assert_snapshot!(help(&["top"]));
}

#[test]
fn help_of_completions() {
    insta::assert_snapshot!(help(&["completions"]));
}

#[test]
fn help_of_man() {
    insta::assert_snapshot!(help(&["man"]));
}

#[test]
fn arguments_are_consistent() {
    Arguments::command().debug_assert();
}

#[test]
fn wrong_arguments_are_named() {
    let gap = [
        "troupe",
        "inbetween",
        "--clip",
        "a.bvh",
        "--from",
        "4",
        "--to",
        "40",
        "--out",
        "b.bvh",
    ];
    assert!(Arguments::try_parse_from(gap).is_ok());
    for (more, told) in [
        (&["--frame-count", "20", "--free-timing"][..], "--free-timing"),
        (&["--target-frames", "5"], "1..=4"),
        (&["--timeout", "0"], "above 0"),
        (&["--unit", "yard"], "mm, cm, m, in"),
        (&["--from", "-1"], "-1"),
    ] {
        let error = Arguments::try_parse_from(gap.iter().chain(more))
            .unwrap_err()
            .to_string();
        assert!(error.contains(told), "{more:?}: {error}");
    }
}
