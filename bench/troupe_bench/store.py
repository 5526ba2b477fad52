"""Results, one JSON file a part, written after every single measurement: a run that was stopped goes on from there."""

import json
import statistics
import time
from pathlib import Path
from typing import Any

Json = dict[str, Any]


class Store:
    """The results of one part: a list of runs, each with a key."""

    commit = ""
    """The code that is measured, noted with each run."""

    def __init__(self, folder: Path, part: str):
        self.path = folder / f"{part}.json"
        self.data: dict[str, Any] = {"runs": []}
        if self.path.exists():
            self.data = json.loads(self.path.read_text())

    def clear(self) -> None:
        """Forgets what was measured before."""
        self.path.unlink(missing_ok=True)
        self.data = {"runs": []}

    def note(self, name: str, value: Any) -> None:
        """Keeps a fact beside the runs."""
        self.data[name] = value
        self._save()

    def add(self, key: Json, result: Json) -> None:
        """Keeps one measurement."""
        code = {"commit": self.commit} if self.commit else {}
        self.data["runs"].append({"key": key, "at": round(time.time()), **code, "result": result})
        self._save()

    def of_pack(self, pack: str) -> bool:
        """Notes which pack is measured. Runs of another are forgotten: says whether there were any."""
        other = bool(self.data["runs"]) and self.data.get("pack") != pack
        if other:
            self.clear()
        self.note("pack", pack)
        return other

    def of(self, key: Json) -> list[Json]:
        """The results of every run whose key has all of ``key``."""
        return [run["result"] for run in self.data["runs"] if key.items() <= run["key"].items()]

    def every_key(self) -> list[Json]:
        """Every key once, in the order of their first runs."""
        seen: list[Json] = []
        for run in self.data["runs"]:
            if run["key"] not in seen:
                seen.append(run["key"])
        return seen

    def sittings(self, pause_s: float) -> list[list[Json]]:
        """All runs by time, apart wherever more than ``pause_s`` seconds lie between one and the next."""
        parts: list[list[Json]] = []
        for run in sorted(self.data["runs"], key=lambda run: run["at"]):
            if parts and run["at"] - parts[-1][-1]["at"] <= pause_s:
                parts[-1].append(run)
            else:
                parts.append([run])
        return parts

    def median(self, key: Json, *path: str) -> float | None:
        """The median over the runs of ``key`` of the number at ``path``; None if there is none."""
        values = [value for result in self.of(key) if (value := dig(result, *path)) is not None]
        return statistics.median(values) if values else None

    def turns(self, *sides: tuple[Any, ...]) -> list[tuple[float, ...]]:
        """Numbers of the same turn beside each other: each side is a key and the path of its number."""
        numbers = []
        for key, *path in sides:
            runs = [run for run in self.data["runs"] if key.items() <= run["key"].items()]
            found = {run["key"].get("repeat"): dig(run["result"], *path) for run in runs}
            numbers.append({turn: value for turn, value in found.items() if value is not None})
        return [tuple(side[turn] for side in numbers) for turn in numbers[0] if all(turn in side for side in numbers)]

    def _save(self) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        fresh = self.path.with_suffix(".new")
        fresh.write_text(json.dumps(self.data, indent=1) + "\n")
        fresh.replace(self.path)


def dig(value: Any, *path: str) -> Any:
    """The value at ``path`` in nested tables, or None."""
    for step in path:
        if not isinstance(value, dict):
            return None
        value = value.get(step)
    return value
