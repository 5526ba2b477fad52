"""Shared by studies of all families: several trainings in one folder, with terms that stay once a study has begun."""

import json
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar


class Named(Protocol):
    """A run of a study."""

    @property
    def name(self) -> str:
        """Its folder's name."""


R = TypeVar("R", bound=Named)


def keep_terms(folder: Path, terms: dict[str, Any]) -> None:
    """Notes what all runs of a study share; ends the command if the study was begun with other terms."""
    path = folder / "study.json"
    if path.exists():
        begun = json.loads(path.read_text())
        changed = [key for key, value in terms.items() if begun.get(key) != value]
        if changed:
            terms_text = ", ".join(f"{key} {begun.get(key)}" for key in changed)
            raise SystemExit(f"{folder} was begun with {terms_text}: give the same, or another --run")
        return
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(terms, indent=1) + "\n")


def picked(runs: Sequence[R], only: Collection[str] | None) -> list[R]:
    """The runs of these names, or all; ends the command at an unknown name."""
    unknown = set(only or ()) - {run.name for run in runs}
    if unknown:
        raise SystemExit(f"no run {', '.join(sorted(unknown))}; there are {', '.join(run.name for run in runs)}")
    return [run for run in runs if not only or run.name in only]
