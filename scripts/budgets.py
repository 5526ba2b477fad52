#!/usr/bin/env python3
"""Prints what budgets.toml limits, each figure beside its limit, and fails if one is exceeded.

Figures of the sources are counted. Those of a build and of the image come from `make image` (target/image/figures.json),
or from a release build with --timings; a figure that was not measured here is named, and does not fail.
"""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TIMINGS = [ROOT / "target/image/cargo-timing.html", ROOT / "target/cargo-timings/cargo-timing.html"]
BINARY = ROOT / "target/release/troupe-server"
IMAGE = ROOT / "target/image/figures.json"
# An option's line in a command's help: two to ten spaces, a short form perhaps, the long form.
OPTION = re.compile(r"^ {2,10}(?:-\w, )?(--[a-z][\w-]*)")


def read(name: str) -> str:
    """A file of the repository."""
    return (ROOT / name).read_text(encoding="utf-8")


def options_of(program: str) -> int:
    """Options of a program and of each of its commands, by their help."""
    commands: list[list[str]] = []
    inside = False
    for line in read("docs/references/commands.md").splitlines():
        if line.startswith("## "):
            inside = line == f"## {program}"
        elif inside and line.startswith("### "):
            commands.append([])
        elif inside and (match := OPTION.match(line)):
            commands[-1].append(match[1])
    # Options of the program itself stand in the help of each command.
    own = set(commands[0]) | {"--help", "--version"}
    return len(own) + sum(len(set(command) - own) for command in commands)


def crates() -> int:
    """Packages that `cargo build --package troupe-server` compiles on this system."""
    command = ["cargo", "tree", "--locked", "--package", "troupe-server", "--edges", "normal,build", "--prefix", "none"]
    listed = subprocess.run([*command, "--format", "{p}"], cwd=ROOT, capture_output=True, text=True, check=True)
    return len({" ".join(line.split()[:2]) for line in listed.stdout.splitlines() if line})


def lines_of(crate: str) -> int:
    """Lines of Rust in a crate's sources that are neither empty, comments nor tests."""
    count = 0
    for file in sorted((ROOT / crate / "src").rglob("*.rs")):
        if file.stem.endswith("tests") or "tests" in file.relative_to(ROOT / crate).parts:
            continue
        text = file.read_text(encoding="utf-8").split("\n#[cfg(test)]\nmod ")[0]
        count += sum(bool(line.strip()) and not line.strip().startswith("//") for line in text.splitlines())
    return count


def compile_ratio(reference: list[str]) -> float | None:
    """Seconds of all units of the last timed build, over those of the reference crates in it."""
    file = next((file for file in TIMINGS if file.is_file()), None)
    found = (
        re.search(r"const UNIT_DATA = (\[.*?\]);\s*\n", file.read_text(encoding="utf-8"), re.DOTALL) if file else None
    )
    units = json.loads(found[1]) if found else []
    beside = sum(unit["duration"] for unit in units if unit["name"] in reference)
    # A build that reused crates says nothing about a first one.
    whole = {unit["name"] for unit in units} >= {*reference, "troupe-server"}
    return sum(unit["duration"] for unit in units) / beside if whole and beside else None


def figures(limits: dict) -> list[tuple[str, float | None, float]]:
    """Every figure with its limit; None for one that was not measured here."""
    readme = read("README.md")
    highlights = re.search(r"^## Highlights\n(.*?)^## ", readme, re.DOTALL | re.MULTILINE)
    image = json.loads(IMAGE.read_text()) if IMAGE.is_file() else {}
    binary = image.get("binary_mb") or (BINARY.stat().st_size / 1e6 if BINARY.is_file() else None)
    found = {
        "readme.words": len(readme.split()),
        "readme.highlights": len(re.findall(r"^- ", highlights[1], re.MULTILINE)) if highlights else 0,
        "options.server": len(re.findall(r"^#?\w+ =", read("server/config.toml"), re.MULTILINE)),
        "first_build.crates": crates(),
        "first_build.compile_ratio": compile_ratio(limits["first_build"]["reference"]),
        "server.binary_mb": binary,
        "server.image_mb": image.get("image_mb"),
        "server.ready_rss_mib": image.get("ready_rss_mib"),
    }
    for program in ("troupe", "troupe-loadtest"):
        found[f"options.{program}"] = options_of(program)
    for crate in limits["lines"]:
        found[f"lines.{crate}"] = lines_of(crate)
    names = [f"{table}.{name}" for table, row in limits.items() for name in row if name != "reference"]
    if unknown := {*names} ^ {*found}:
        sys.exit(f"budgets.toml and scripts/budgets.py differ: {', '.join(sorted(unknown))}")
    return [(name, found[name], limits[name.split(".")[0]][name.split(".")[1]]) for name in names]


def main() -> None:
    """Prints the table."""
    over = []
    for name, figure, limit in figures(tomllib.loads(read("budgets.toml"))):
        shown = "not measured" if figure is None else f"{figure:,.1f}" if isinstance(figure, float) else f"{figure:,}"
        print(f"{name:28} {shown:>14}  of {limit:,}")
        if figure is not None and figure > limit:
            over.append(name)
    if over:
        sys.exit(
            f"over its limit: {', '.join(over)}. Make it smaller, or change budgets.toml and say why in the commit"
        )


if __name__ == "__main__":
    main()
