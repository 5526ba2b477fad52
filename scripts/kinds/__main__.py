"""Shows what Troupe makes of each kind of file that used to go wrong, on its four fronts, as a table in Markdown.

.venv/bin/python scripts/kinds [--program target/debug/troupe] [--page docs/kinds.md] [--errors]

Inputs are made of a motion that is known (`examples/walk.bvh`, and robots that swing their hinges), by code apart from the
reader. An answer is right if all joints are within 0.5 mm and 0.1° of it. A second table has the largest error of each
format, as it is read and as it comes back after Troupe wrote it. `make python-env` and `make python-client` build what is
needed, and `cargo build` the program. The exit code is 1 if any answer is wrong, or if `--page` has another row.
"""

import argparse
import re
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

import fronts
from fronts import FLAGS, Answer, Job
from inputs import ROOT, kinds
from motion import Array, Motion, angle_between, conjugate, multiply

MAX_ERROR_M = 0.0005
MAX_ERROR_DEG = 0.1
# How a front says that it assumed a rate, and an order.
ASSUMED_RATE = re.compile(r"assumed|no rate|says none", re.IGNORECASE)
ASSUMED_ORDER = re.compile("--quaternion decides")


def errors(truth: Motion, answer: Answer) -> tuple[float, float] | str:
    """Largest errors in metres and degrees, or what else is wrong."""
    wanted = truth if abs(answer.fps - truth.fps) < 5e-4 * truth.fps else truth.at(answer.fps)
    lost = [name for name in truth.names[1:] if name not in answer.names]
    if lost:
        return f"{len(lost)} of {len(truth.names)} joints are lost"
    if len(answer.places) != len(wanted.roots):
        return f"{len(answer.places)} frames of {len(wanted.roots)}"
    places, turns = wanted.world()
    # Roots have many names: they are first.
    at = [0, *(answer.names.index(name) for name in truth.names[1:])]

    def since_the_first(of: Array) -> Array:
        # Bones' own axes may differ, and then what turns them by does not.
        return multiply(of, np.broadcast_to(conjugate(of[:1]), of.shape))

    off_deg = np.degrees(angle_between(since_the_first(answer.turns[:, at]), since_the_first(turns)))
    return float(np.linalg.norm(answer.places[:, at] - places, axis=-1).max()), float(off_deg.max())


def wrong(job: Job, answer: Answer) -> str | None:
    """How an answer differs from the truth; none if it is right."""
    off = errors(job.kind.truth, answer)
    if isinstance(off, str):
        return off
    return None if off[0] <= MAX_ERROR_M and off[1] <= MAX_ERROR_DEG else f"{1e3 * off[0]:.1f} mm, {off[1]:.1f}° off"


def flags(job: Job) -> str:
    """The options of a kind as a command line has them."""

    def word(key: str, value: object) -> str:
        text = f"{value:g}" if isinstance(value, float) else value
        return FLAGS[key] if value is True else f"{FLAGS[key]} {text}"

    words = [word(key, value) for key, value in job.kind.options.items()]
    words += [f"--legs {','.join(job.kind.legs)}"] if job.kind.legs else []
    return " ".join(words)


def onto(job: Job) -> Job:
    """The job of a front that reads onto a skeleton."""
    kind = job.kind
    return replace(job, kind=replace(kind, options=kind.options_onto)) if kind.options_onto else job


def verdict(column: str, job: Job, plain: Answer, with_options: Answer | None) -> str:
    """One cell."""
    kind = job.kind
    if plain.not_taken:
        return "–"
    if plain.crashed:
        return f"**crash**: {(plain.error or '').splitlines()[-1][:60]}"
    last = (with_options or plain).error
    if kind.refusal and last:
        return "refused" if re.search(kind.refusal, last) else f"**refused** with other words: {last}"
    off_then = None if with_options is None or with_options.error else wrong(job, with_options)
    works = with_options is not None and with_options.error is None and off_then is None
    if plain.error is not None:
        if works:
            named = any(word in plain.error for word in re.findall(r"--[a-z-]+", flags(job)))
            if column == "viewer":
                # With one of them, the next error names the other.
                named = not set(kind.options).isdisjoint(plain.asks)
            return f"refused; right with `{flags(job)}`" + ("" if named else ", which is not named")
        if with_options is not None and with_options.error is None:
            return f"refused; **wrong** with `{flags(job)}`: {off_then}"
        asked = re.findall(r"--[a-z-]+", flags(job))
        if with_options is not None and any(word in plain.error for word in asked):
            return f"refused; `{flags(job)}` changes nothing"
        return "refused"
    off = wrong(job, plain)
    if off is None:
        return "right"
    is_open = kind.open_order or (kind.open_rate and "fps" in kind.options)
    assumed, noted = ("x y z w", ASSUMED_ORDER) if kind.open_order else ("30 Hz", ASSUMED_RATE)
    if is_open and works and noted.search(plain.notes):
        return f"{assumed} assumed and noted; right with `{flags(job)}`"
    if is_open and column == "Python alone":
        return f"{assumed}, as `from_csv` documents"
    return f"**wrong**: {off}"


def joined(verdicts: Iterable[str]) -> str:
    """The cell of a front: what its commands answer, apart from those that do not take the file."""
    return " or ".join(verdict for verdict in verdicts if verdict != "–") or "–"


def format_of(job: Job) -> str:
    """The row of a kind in the table of formats."""
    return job.kind.group if job.path.suffix == ".npz" else f"`{job.path.suffix}`"


def figures(jobs: list[Job], read: dict[str, Answer], program: Path, folder: Path) -> list[str]:
    """Largest errors of each format."""
    worst: dict[str, tuple[float, float]] = {}
    for job in jobs:
        answer = read[str(job.path)]
        if answer.error is None and wrong(job, answer) is None:
            off, before = errors(job.kind.truth, answer), worst.get(format_of(job), (0.0, 0.0))
            assert not isinstance(off, str)
            worst[format_of(job)] = max(off[0], before[0]), max(off[1], before[1])
    lines = [f"| {name} | others' files, read | {1e3 * m:.4f} mm | {deg:.5f}° |" for name, (m, deg) in worst.items()]
    for name, (truth, answer) in fronts.round_trips(program, folder).items():
        off = errors(truth, answer)
        figure = off if isinstance(off, str) else f"{1e3 * off[0]:.4f} mm | {off[1]:.5f}°"
        lines.append(f"| `{name}` | written and read | {figure} |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, default=ROOT / "target" / "debug" / "troupe", help="the command line")
    parser.add_argument("--page", type=Path, help="a page that must have the rows of the first table")
    parser.add_argument("--errors", action="store_true", help="also print the words of each refusal")
    given = parser.parse_args()
    asked: list[tuple[str, Callable[[list[Job]], list[Answer]]]] = [
        ("CLI", lambda jobs: fronts.command_line(given.program, jobs)),
        ("training", fronts.training),
        ("training", fronts.rigs),
        ("Python with reader", lambda jobs: fronts.client(jobs, extension=True)),
        ("Python alone", lambda jobs: fronts.client(jobs, extension=False)),
        ("viewer", fronts.viewer),
    ]
    columns = list(dict(asked))
    with tempfile.TemporaryDirectory() as folder:
        jobs = fronts.jobs_of(list(kinds()), Path(folder))
        # A front may be several commands, with a verdict each.
        cells = {str(job.path): {column: dict[str, None]() for column in columns} for job in jobs}
        said: list[str] = []
        read: dict[str, Answer] = {}
        for column, front in asked:
            of_front = [onto(job) for job in jobs] if column == "viewer" else jobs
            again = [replace(job, with_options=True) for job in of_front if job.kind.options or job.kind.legs]
            plain = dict(zip(cells, front(of_front), strict=True))
            second = {str(job.path): answer for job, answer in zip(again, front(again), strict=True)}
            for job in of_front:
                key = str(job.path)
                cells[key][column][verdict(column, job, plain[key], second.get(key))] = None
                for answer in (plain[key], second.get(key)):
                    if answer is not None and answer.error is not None:
                        said.append(f"{column}, {job.kind.group}, {job.kind.name}: {answer.error}")
            read = read or plain
        errors_of_formats = figures(jobs, read, given.program, Path(folder))
    print("| input | before |", " | ".join(columns), "|\n|" + "---|" * (2 + len(columns)))
    rows = []
    for job in jobs:
        name = ", ".join(filter(None, (job.kind.group, job.kind.name)))
        words = [joined(verdicts) for verdicts in cells[str(job.path)].values()]
        rows.append(f"| {' | '.join([name, job.kind.before, *words])} |")
    print(*rows, sep="\n")
    print("\n| format | | joints | turns |\n|---|---|---|---|", *errors_of_formats, sep="\n")
    if given.errors:
        print("", *said, sep="\n")
    lines = given.page.read_text().splitlines() if given.page else rows
    other = [row for row in rows if row not in lines]
    print(*(f"{given.page} lacks: {row}" for row in other), sep="\n", file=sys.stderr)
    sys.exit(bool(other) or any("**" in row for row in rows))


main()
