"""Shows what Troupe makes of each kind of file that used to go wrong, on its four fronts, as a table in Markdown.

.venv/bin/python scripts/kinds [--program target/debug/troupe] [--errors]

Inputs are made of a motion that is known (`examples/walk.bvh`, and robots that swing their hinges), by code apart from the
reader. An answer is right if all joints are within 0.5 mm and 0.1° of it. `make python-env` and `make python-client` build
what is needed, and `cargo build` the program. The exit code is 1 if any answer is wrong.
"""

import argparse
import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import fronts
from fronts import Answer, Job
from inputs import ROOT, kinds
from motion import angle_between, conjugate, multiply

MAX_ERROR_M = 0.0005
MAX_ERROR_DEG = 0.1
COLUMNS = ("CLI", "training", "Python with reader", "Python alone", "viewer")
# How a front says that it assumed a rate.
ASSUMED = re.compile(r"assumed|no rate|says none", re.IGNORECASE)


def errors(job: Job, answer: Answer) -> str | None:
    """How an answer differs from the truth; none if it is right."""
    truth = job.kind.truth
    if not truth.offsets.any():
        # AMASS: bones of the mean body, which the reader has.
        at = [answer.names.index(name) for name in truth.names]
        truth = replace(truth, offsets=answer.offsets[at])
    wanted = truth if abs(answer.fps - truth.fps) < 0.01 * truth.fps else truth.at(answer.fps)
    lost = [name for name in truth.names[1:] if name not in answer.names]
    if lost:
        return f"{len(lost)} of {len(truth.names)} joints are lost"
    if len(answer.places) != len(wanted.roots):
        return f"{len(answer.places)} frames of {len(wanted.roots)}"
    places, turns = wanted.world()
    # Roots have many names: they are first.
    at = [0, *(answer.names.index(name) for name in truth.names[1:])]
    off_m = np.linalg.norm(answer.places[:, at] - places, axis=-1).max()

    def since_the_first(of: np.ndarray) -> np.ndarray:
        # Bones' own axes may differ, and then what turns them by does not.
        return multiply(of, np.broadcast_to(conjugate(of[:1]), of.shape))

    off_deg = np.degrees(angle_between(since_the_first(answer.turns[:, at]), since_the_first(turns)).max())
    if off_m <= MAX_ERROR_M and off_deg <= MAX_ERROR_DEG:
        return None
    return f"{1e3 * off_m:.1f} mm, {off_deg:.1f}° off"


def flags(job: Job) -> str:
    """The options of a kind as a command line has them."""
    names = {"fps": "--fps", "max_slide_m": "--max-slide", "other_bones": "--other-bones"}
    words = [names[key] if value is True else f"{names[key]} {value:g}" for key, value in job.kind.options.items()]
    words += [f"--legs {','.join(job.kind.legs)}"] if job.kind.legs else []
    return " ".join(words)


def verdict(job: Job, plain: Answer, with_options: Answer | None) -> str:
    """One cell."""
    if plain.not_taken:
        return "–"
    second = None if with_options is None or with_options.error else errors(job, with_options)
    works = with_options is not None and with_options.error is None and second is None
    if plain.error is None:
        off = errors(job, plain)
        if off is None:
            return "right"
        if works and job.kind.open_rate and ASSUMED.search(plain.notes):
            return f"30 Hz assumed and noted; right with `{flags(job)}`"
        return f"**wrong**: {off}"
    if plain.crashed:
        return f"**crash**: {plain.error.splitlines()[-1][:60]}"
    if works:
        named = any(word in plain.error for word in re.findall(r"--[a-z-]+", flags(job)))
        return f"refused; right with `{flags(job)}`" + ("" if named else " (not named)")
    if with_options is not None and with_options.error is None:
        return f"refused; **wrong** with `{flags(job)}`: {second}"
    return "refused"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, default=ROOT / "target" / "debug" / "troupe", help="the command line")
    parser.add_argument("--errors", action="store_true", help="also print the words of each refusal")
    given = parser.parse_args()
    asked: list[Callable[[list[Job]], list[Answer]]] = [
        lambda jobs: fronts.command_line(given.program, jobs),
        fronts.training,
        lambda jobs: fronts.client(jobs, extension=True),
        lambda jobs: fronts.client(jobs, extension=False),
        fronts.viewer,
    ]
    with tempfile.TemporaryDirectory() as folder:
        jobs = fronts.jobs_of(list(kinds()), Path(folder))
        again = [replace(job, with_options=True) for job in jobs if job.kind.options or job.kind.legs]
        cells: dict[str, list[str]] = {str(job.path): [] for job in jobs}
        said: list[str] = []
        for column, front in zip(COLUMNS, asked, strict=True):
            plain = dict(zip(cells, front(jobs), strict=True))
            # The page has no options.
            second = {} if column == "viewer" else {str(job.path): a for job, a in zip(again, front(again), strict=True)}
            for job in jobs:
                key = str(job.path)
                cells[key].append(verdict(job, plain[key], second.get(key)))
                for answer in (plain[key], second.get(key)):
                    if answer is not None and answer.error is not None:
                        said.append(f"{column}, {job.kind.group}, {job.kind.name}: {answer.error}")
    print("| input | before |", " | ".join(COLUMNS), "|\n|" + "---|" * (2 + len(COLUMNS)))
    for job in jobs:
        name = ", ".join(filter(None, (job.kind.group, job.kind.name)))
        print(f"| {name} | {job.kind.before} |", " | ".join(cells[str(job.path)]), "|")
    if given.errors:
        print("\n" + "\n".join(said))
    sys.exit(any("**" in cell for row in cells.values() for cell in row))


main()
