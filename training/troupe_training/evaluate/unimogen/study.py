"""The table of a study: the whole method, what leaves something out, single bodies, unseen ones, and baselines."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from troupe_training.data.bodies_store import BodyStore, Corpus
from troupe_training.evaluate.tables import Figure
from troupe_training.evaluate.unimogen.card import MEASURES, METHOD_NAMES
from troupe_training.evaluate.unimogen.encoders import encoder_of
from troupe_training.evaluate.unimogen.measure import Figures, measure, why_no_fid
from troupe_training.evaluate.unimogen.methods import Method, Setting, copied, frozen, interpolated, of_network
from troupe_training.evaluate.unimogen.networks import Network
from troupe_training.train.unimogen.study import WHOLE, Planned

Report = dict[str, dict[str, Figures]]


def donors_of(store: BodyStore, corpus: Corpus) -> dict[str, BodyStore]:
    """Other bodies whose clips are of the same takes."""
    takes = {clip.get("take") for clip in store.clips}
    return {
        name: other
        for name, other in corpus.stores.items()
        if other is not store and any(clip.get("take") in takes for clip in other.clips)
    }


def measure_study(
    corpus: Corpus,
    runs: Sequence[Planned],
    networks: Mapping[str, Network],
    setting: Setting,
    packs: Path,
    threads: int,
) -> tuple[Report, dict[str, str]]:
    """Figures of every body that has clips in ``corpus`` and is trained on or left out by some run, and why FID is missing.

    ``networks`` are those of the runs by name. Bodies that a run left out are also measured with other bodies' motion of the same
    takes, on the moments that all of them have.
    """
    unseen = {run.unseen for run in runs}
    report, notes = Report(), dict[str, str]()
    for name, store in corpus.stores.items():
        shown = [run for run in runs if run.shown_on(name)]
        if not shown:
            continue
        limits = networks[shown[0].name].limits
        donors = donors_of(store, corpus) if name in unseen else {}
        methods: dict[str, Method] = {
            "frozen pose": frozen(store.body, limits),
            "interpolated": interpolated(store.body, limits),
        }
        methods |= {f"copied from {n}": copied(store, donor, limits) for n, donor in donors.items()}
        for run in shown:
            methods[run.name] = of_network(store.body, networks[run.name], corpus.words, setting)
        encoder, without_encoder = encoder_of(packs, store.body, threads)
        report[name] = measure(store, methods, setting, encoder, list(donors.values()))
        notes[name] = why_no_fid(report[name], without_encoder)
    return report, notes


def with_seeds_as_one(methods: dict[str, Figures]) -> dict[str, dict[str, Figure]]:
    """Figures by method; the runs of the whole method as one, with their mean, lowest and highest."""
    found: dict[str, dict[str, Figure]] = {}
    for method, figures in methods.items():
        if not method.startswith(WHOLE):
            found[METHOD_NAMES.get(method, method)] = {name: {"mean": value} for name, value in figures.items()}
            continue
        seeds = [other for key, other in methods.items() if key.startswith(WHOLE)]
        title = f"whole, {len(seeds)} seeds" if len(seeds) > 1 else "whole, one seed"
        values = {name: [one[name] for one in seeds if name in one] for name in figures}
        found[title] = {n: {"mean": sum(v) / len(v), "low": min(v), "high": max(v)} for n, v in values.items()}
    return found


def study_table(report: Report, notes: dict[str, str], updates: dict[str, int]) -> str:
    """Markdown: a row for each body and method, the seeds of the whole method in one with the ends of their range."""
    measures = [m for m in MEASURES if any(m.name in f for methods in report.values() for f in methods.values())]
    lines = [f"| body | method | updates | {' | '.join(m.heading for m in measures)} | windows |"]
    lines.append("|---|---|---:|" + "---:|" * (len(measures) + 1))
    whole = [steps for name, steps in updates.items() if name.startswith(WHOLE)]
    for body, methods in report.items():
        missing = "not measured" if notes.get(body) else "–"
        for method, figures in with_seeds_as_one(methods).items():
            steps = min(whole, default=0) if method.startswith("whole, ") else updates.get(method)
            cells = [m.cell(figures.get(m.name)) for m in measures]
            cells = [
                missing if m.name == "fid" and "fid" not in figures else c for m, c in zip(measures, cells, strict=True)
            ]
            windows = f"{figures['windows']['mean']:.0f}"
            lines.append(f"| {body} | {method} | {steps or ''} | {' | '.join(cells)} | {windows} |")
    reasons = [f"- {body}: {note}" for body, note in notes.items() if note]
    return "\n".join([*lines, *([""] if reasons else []), *reasons]) + "\n"


def about_runs(runs: Sequence[Planned], networks: Mapping[str, Network]) -> dict[str, Any]:
    """A report's entry of each run."""
    return {
        run.name: {"seed": run.seed, "bodies": run.bodies, "without": run.without} | networks[run.name].source
        for run in runs
    }
