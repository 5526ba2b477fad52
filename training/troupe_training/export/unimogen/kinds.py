"""``unimogen add``: a network for the bodies of one kind, in a file of its own beside a pack's network for all bodies."""

import hashlib
from pathlib import Path
from typing import Any

from troupe_training.data.bodies import Body
from troupe_training.export.manifest import read_manifest, set_values
from troupe_training.export.unimogen.pack import FAMILY, FILE, write_checked
from troupe_training.train.unimogen.stage import load

KINDS = ("people", "robots", "animals")  # the order in which the content hash reads their files
RANGE_TOLERANCE = 1e-5  # a manifest rounds the range of roots


def file_of(kind: str) -> str:
    """The network of a kind in a pack's folder."""
    return f"denoiser-{kind}.onnx"


def files_of(unimogen: dict[str, Any]) -> dict[str, list[str]]:
    """Files of a pack's networks, in the order of the content hash, with the bodies of a kind's; ``unimogen`` is the table."""
    kinds: dict[str, list[str]] = unimogen.get("kinds", {})
    return {FILE: []} | {file_of(kind): kinds[kind] for kind in KINDS if kinds.get(kind)}


def add(pack: Path, kind: str, run: Path, cache: Path, version: str | None = None) -> None:
    """Puts a run's network into a pack, for the bodies that it was trained on; replaces one of that kind that is there.

    The pack keeps its version if none is given. Ends the command, and
    leaves the pack as it was, if the run has other words, another range of roots or unknown bodies, or if the file differs by
    more than is allowed.
    """
    manifest, trained = read_manifest(pack), load(run)
    if manifest.get("family") != FAMILY.name:
        raise SystemExit(f"{pack} is a pack of the family {manifest.get('family')}, not {FAMILY.name}")
    table = manifest["unimogen"]
    _check(table, kind, trained.bodies, trained.words, run)
    for key, values in (("root_low", trained.limits.low), ("root_high", trained.limits.high)):
        if max(abs(float(v) - w) for v, w in zip(values, table[key], strict=True)) > RANGE_TOLERANCE:
            raise SystemExit(f"{key} of {run} is not the pack's: begin the run with `unimogen adopt --pack {pack}`")
    bodies = [Body.load(cache / name / "body.json") for name in trained.bodies]
    fresh = pack / f"{file_of(kind)}.new"
    _, difference = write_checked(trained.model, fresh, bodies)
    fresh.replace(pack / file_of(kind))
    table["kinds"] = table.get("kinds", {}) | {kind: trained.bodies}
    path, state = pack / "pack.toml", trained.state
    lines = path.read_text(encoding="utf-8").splitlines()
    set_values(lines, "", {"version": version or manifest["version"], "content_hash": content_hash(pack, table)})
    facts: dict[str, Any] = {f"{kind}_steps": state["step"], f"{kind}_minutes": round(state["seconds"] / 60, 1)}
    if state["history"]:
        facts[f"{kind}_final_loss"] = state["history"][-1]["total"]
    set_values(lines, "training", facts)
    set_values(lines, "training.onnx_check", {kind: float(f"{difference:.2e}")})
    set_values(lines, "unimogen.kinds", {kind: trained.bodies})
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def content_hash(pack: Path, unimogen: dict[str, Any]) -> str:
    """The hash of a pack's networks as they are in its folder; ``unimogen`` is the manifest's table."""
    digest = hashlib.sha256()
    for file in files_of(unimogen):
        digest.update((pack / file).read_bytes())
    return f"sha256:{digest.hexdigest()}"


def _check(table: dict[str, Any], kind: str, bodies: list[str], words: list[str], run: Path) -> None:
    """Ends the command if a pack cannot take a run's network for this kind."""
    if words != table["words"]:
        raise SystemExit(f"{run} has other words than the pack: begin it with `unimogen adopt`")
    unknown = [name for name in bodies if name not in table["bodies"]]
    if unknown:
        raise SystemExit(f"{run} has the bodies {', '.join(unknown)}, the pack only {', '.join(table['bodies'])}")
    for other, names in table.get("kinds", {}).items():
        twice = [name for name in bodies if name in names]
        if twice and other != kind:
            raise SystemExit(f"{', '.join(twice)}: {other} of the pack already, so not {kind}")
