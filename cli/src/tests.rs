//! The command line as its users see it.

use clap::{CommandFactory as _, Parser as _};

use crate::args::Arguments;

/// Holds the long help of a command and of all below it to snapshots. docs/references/commands.md
/// is made of them. Options that every command has are in the help of `troupe` alone.
fn check_help(command: &clap::Command, name: &str) {
    let all_have = |arg: clap::Arg| {
        let hidden = name != "troupe" && arg.is_global_set();
        if hidden { arg.hide(true) } else { arg }
    };
    let mut shown = command.clone().mut_args(all_have);
    let help = shown.render_long_help().to_string();
    insta::assert_snapshot!(format!("help_of_{name}"), help);
    let before = name.strip_prefix("troupe").unwrap_or(name);
    for inner in command
        .get_subcommands()
        .filter(|inner| inner.get_name() != "help")
    {
        let name = format!("{before}_{}", inner.get_name());
        check_help(inner, name.trim_start_matches('_'));
    }
}

#[test]
fn help_is_as_documented() {
    // At a fixed width, without the environment of whoever runs the tests.
    let mut root = Arguments::command()
        .term_width(100)
        .mut_args(|arg| arg.hide_env_values(true));
    root.build();
    check_help(&root, "troupe");
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
    for (more, wanted) in [
        (&["--frame-count", "20", "--free-timing"][..], "--free-timing"),
        (&["--target-frames", "5"], "1..=4"),
        (&["--timeout", "0"], "above 0"),
        (&["--unit", "yard"], "in, cm, mm"),
        (&["--from", "-1"], "-1"),
    ] {
        let error = Arguments::try_parse_from(gap.iter().chain(more))
            .unwrap_err()
            .to_string();
        assert!(error.contains(wanted), "{more:?}: {error}");
    }
}
