//! The command line as its users see it.

use clap::{CommandFactory as _, Parser as _};

use super::args::{Arguments, Command};
use crate::arrivals::Process;
use crate::plan::{Load, Plan, Workload};

/// The long help of a command at a fixed width, whatever the environment says.
fn help(command: &[&str]) -> String {
    let mut root = Arguments::command().term_width(100);
    for name in ["run", "search", "overload"] {
        root = root.mut_subcommand(name, |c| c.mut_args(|arg| arg.hide_env_values(true)));
    }
    root.build();
    let found = command
        .iter()
        .try_fold(&mut root, |at, name| at.find_subcommand_mut(name));
    let found = found.expect("a command of that name");
    found.render_long_help().to_string()
}

#[test]
fn help_of_troupe_loadtest() {
    insta::assert_snapshot!(help(&[]));
}

#[test]
fn help_of_run() {
    insta::assert_snapshot!(help(&["run"]));
}

#[test]
fn help_of_search() {
    insta::assert_snapshot!(help(&["search"]));
}

#[test]
fn help_of_overload() {
    insta::assert_snapshot!(help(&["overload"]));
}

#[test]
fn help_of_compare() {
    insta::assert_snapshot!(help(&["compare"]));
}

#[test]
fn help_of_report() {
    insta::assert_snapshot!(help(&["report"]));
}

#[test]
fn every_command_gets_a_manual_page() {
    let folder = std::env::temp_dir().join(format!("troupe-loadtest-man-{}", std::process::id()));
    super::write_manual(&folder).unwrap();
    let page =
        |name: &str| std::fs::read_to_string(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    for name in Arguments::command()
        .get_subcommands()
        .map(clap::Command::get_name)
    {
        assert!(
            page(&format!("troupe-loadtest-{name}.1")).contains(".TH"),
            "{name}"
        );
    }
    assert!(page("troupe-loadtest.1").contains("Exit codes"));
    std::fs::remove_dir_all(folder).unwrap();
}

fn run(options: &str) -> Result<Plan, String> {
    let words = ["troupe-loadtest", "run"]
        .into_iter()
        .chain(options.split_whitespace());
    let arguments = Arguments::try_parse_from(words).map_err(|e| e.to_string())?;
    let Command::Run(run) = arguments.command else {
        panic!("{options}")
    };
    run.plan().map_err(|e| e.to_string())
}

fn load(options: &str) -> Load {
    match run(options).unwrap().workload {
        Workload::Calls { load, .. } => load,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_kind_of_loop_follows_from_what_is_said() {
    assert!(matches!(load(""), Load::Closed { stages, .. } if stages.most() == 8.0));
    assert!(
        matches!(load("--clients 32 --think 50ms"), Load::Closed { stages, think_s } if stages.most() == 32.0 && think_s == 0.05)
    );
    assert!(
        matches!(load("--rate 20"), Load::Open { process: Process::Poisson, stages, .. } if stages.seconds() == 15.0)
    );
    assert!(
        matches!(load("--stages 5:2,5-9:8 --arrivals constant"), Load::Open { process: Process::Constant, stages, .. } if stages.count() == 2)
    );
    assert!(matches!(
        load("--rate 20 --arrivals bursty --burst-size 4"),
        Load::Open {
            process: Process::Bursts { size: 4 },
            ..
        }
    ));
    let periodic = load("--rate 20 --arrivals bursty --burst-period 1.5s");
    assert!(
        matches!(periodic, Load::Open { process: Process::Periodic { period_s }, .. } if period_s == 1.5)
    );
    assert_eq!(run("--stages 5:2,5-9:8").unwrap().measured_s, 10.0);
    assert_eq!(run("--duration 1m --warmup 2.5").unwrap().warmup_s, 2.5);
}

#[test]
fn errors_of_options_name_what_is_allowed() {
    for (options, wanted) in [
        ("--clients 4 --rate 5", "cannot be used with"),
        ("--stages 5", "LEVEL:SECONDS"),
        ("--duration 0", "above 0"),
        ("--duration soon", "90s"),
        ("--hz 31", "30, 50 or 60"),
        ("--rate 0", "--rate is 0; allowed: 0.001 to 1000000"),
        ("--burst-size 4 --rate 5", "--arrivals bursty"),
        ("--workload drive --rate 5", "--characters"),
        ("--temperature 3", "--temperature is 3; allowed: 0 to 2"),
        ("--header nonsense", "NAME:VALUE"),
    ] {
        let error = run(options).unwrap_err();
        assert!(error.contains(wanted), "{options}: {error}");
    }
}
