"""The command line: one command a step, and `pack`, which does all in one go."""

import argparse
import shlex
import sys
from typing import Any

from troupe_training.cli import evaluate, official, train, unimogen, unimogen_ablate, vermo, vermo_ablate  # noqa: F401 - their commands register themselves
from troupe_training.cli.options import COMMANDS


def main(argv: list[str] | None = None) -> int:
    """Runs one command; 0 on success, 130 if training was stopped before its budget was spent."""
    defaults = argparse.ArgumentDefaultsHelpFormatter
    parser = argparse.ArgumentParser(prog="troupe-train", description=__doc__, formatter_class=defaults)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    groups: dict[str, Any] = {"": commands}
    for name, (run, add_options) in COMMANDS.items():
        about = run.__doc__
        group, _, own = name.rpartition(" ")
        if group not in groups:
            family = commands.add_parser(group, help=f"commands of the family {group}", formatter_class=defaults)
            groups[group] = family.add_subparsers(required=True, metavar="COMMAND")
        parser_of = groups[group].add_parser(own, help=about, description=about, formatter_class=defaults)
        add_options(parser_of)
        parser_of.set_defaults(command=run)
    args = parser.parse_args(argv)
    args.command_line = shlex.join(["troupe-train", *(sys.argv[1:] if argv is None else argv)])  # for reports
    status: int = args.command(args)
    return status
