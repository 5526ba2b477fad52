//! The command line as its users see it.

use clap::CommandFactory as _;

use crate::args::Arguments;

/// The long help of every command. docs/references/commands.md is made of these snapshots.
#[test]
fn help_is_as_documented() {
    // At a fixed width, without the environment of whoever runs the tests.
    let mut root = Arguments::command()
        .term_width(100)
        .mut_args(|arg| arg.hide_env_values(true));
    root.build();
    insta::assert_snapshot!("help_of_troupe-eval", root.clone().render_long_help().to_string());
    for command in root
        .get_subcommands_mut()
        .filter(|command| command.get_name() != "help")
    {
        let name = format!("help_of_{}", command.get_name());
        insta::assert_snapshot!(name, command.render_long_help().to_string());
    }
}

#[test]
fn arguments_are_consistent() {
    Arguments::command().debug_assert();
}
