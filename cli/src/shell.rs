//! `troupe completions` and `troupe man`.

use std::path::PathBuf;

use clap::{Args, CommandFactory as _};
use clap_complete::Shell;

use crate::args::Arguments;
use crate::context::Context;
use crate::failure::Failure;
use crate::output::print;

/// Name of the command.
const NAME: &str = "troupe";

/// Print the completion script of a shell.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe completions bash > ~/.local/share/bash-completion/completions/troupe
  troupe completions zsh > ~/.zfunc/_troupe
  troupe completions fish > ~/.config/fish/completions/troupe.fish")]
pub(crate) struct Completions {
    /// Shell to write the script for.
    pub(crate) shell: Shell,
}

/// Write manual pages: troupe.1, and one for each command.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe man --out ~/.local/share/man/man1
  troupe man --out man && man man/troupe-inbetween.1")]
pub(crate) struct Man {
    /// Folder to write them to. It is created if needed.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: PathBuf,
}

pub(super) fn completions(command: &Completions) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(command.shell, &mut Arguments::command(), NAME, &mut script);
    print(String::from_utf8_lossy(&script).trim_end())
}

pub(super) fn man(context: &Context, command: &Man) -> Result<(), Failure> {
    let folder = &command.out;
    std::fs::create_dir_all(folder).map_err(|e| Failure::output(folder, e))?;
    clap_mangen::generate_to(Arguments::command(), folder).map_err(|e| Failure::output(folder, e))?;
    context
        .term
        .note(format_args!("manual pages written to {}", folder.display()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum as _;

    use super::*;
    use crate::term::Term;

    #[test]
    fn every_shell_gets_every_command() {
        for shell in Shell::value_variants() {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Arguments::command(), NAME, &mut script);
            let script = String::from_utf8(script).unwrap();
            for command in Arguments::command().get_subcommands() {
                assert!(
                    script.contains(command.get_name()),
                    "{shell}: {}",
                    command.get_name()
                );
            }
            assert!(script.contains("only-gap"), "{shell}: options of a command");
        }
    }

    #[test]
    fn every_command_gets_a_page() {
        let folder = std::env::temp_dir().join(format!("troupe-man-{}", std::process::id()));
        let context = Context {
            url: String::new(),
            options: troupe_client::ConnectOptions::default(),
            term: Term::new(true),
        };
        let command = Man {
            out: folder.join("deeper"),
        };
        man(&context, &command).unwrap();
        let page = |name: &str| {
            std::fs::read_to_string(command.out.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
        };
        for name in Arguments::command()
            .get_subcommands()
            .map(clap::Command::get_name)
        {
            assert!(page(&format!("troupe-{name}.1")).contains(".TH"), "{name}");
        }
        assert!(
            page("troupe-style-add.1").contains("key poses")
                || page("troupe-style-add.1").contains("Key poses")
        );
        assert!(page("troupe.1").contains("Exit codes"));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
