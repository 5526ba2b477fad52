"""``card``: the pack's README from its manifest and from what ``troupe-eval gaps --json`` measured through the server."""

import json
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from troupe_training.evaluate.nearest import NEAREST
from troupe_training.evaluate.tables import MEASURES, Figure, table
from troupe_training.export.manifest import read_manifest

# Reports of `troupe-eval gaps` have no "nearest": a server holds no training clips. `add_nearest`
# takes it from `evaluate`.
METHODS = {"ground_truth": "ground truth", "interpolation": "linear/slerp", "nearest": NEAREST, "pack": "this pack"}
# Measures in a part's table, in the order of `MEASURES`.
PART_MEASURES = ("mmd", "joint_jitter_mps2", "foot_skate_m_per_frame", "l2p_m", "npss")
PACK = "pack"
PARTS_HEAD = """### By what the clips show

The same windows, filled without a server by `troupe-train evaluate --pinned`: answers are pinned to the keyframes, but feet
are not held."""
SERVER_NAMES = {"reached": "reaching_success"}  # of measures that are called otherwise among a gap's plain means


def _plain_means(gap: dict[str, Any], method: str) -> dict[str, float]:
    """Means by the names of measures, which every report has."""
    found = gap.get(method, {})
    names = {m.name: SERVER_NAMES.get(m.name, m.name) for m in MEASURES}
    return {measure: found[name] for measure, name in names.items() if name in found}


def _figures(gap: dict[str, Any], method: str) -> dict[str, Figure]:
    """Figures with their intervals where the report has them, else plain means."""
    plain = {name: {"mean": value} for name, value in _plain_means(gap, method).items()}
    found = plain | gap.get("metrics", {}).get(method, {})
    return {name: figure for name, figure in found.items() if figure["mean"] is not None}


def card_table(gap: dict[str, Any]) -> str:
    """The figures of one gap; a column for each method that it has."""
    found = {title: _figures(gap, method) for method, title in METHODS.items()}
    return table({title: figures for title, figures in found.items() if figures})


def add_nearest(report: dict[str, Any], baselines: dict[str, Any]) -> None:
    """Puts the nearest training window out of ``evaluate --json`` beside a report of `troupe-eval gaps`.

    Both must be of the same windows and evaluator. Raises `ValueError` if they are not.
    """
    served = report.get("evaluator") or {}
    digests = {served.get("sha256"), baselines["evaluator"]} - {None}
    if len(digests) > 1:
        raise ValueError("the two reports are of different evaluators")
    by_gap = {gap["gap_frames"]: gap for gap in baselines["gaps"]}
    for gap in report["gaps"]:
        frames, windows = gap["gap_frames"], gap["windows"]
        other = by_gap.get(frames)
        if other is None or other["windows"] != windows or baselines["stride_frames"] != report["stride_frames"]:
            raise ValueError(f"gap of {frames} frames: the {windows} windows are not those of the other report")
        figures = other["methods"].get(NEAREST)
        if figures is None:
            raise ValueError(f"gap of {frames} frames: the other report has no {NEAREST}")
        # Of hinges a server's report has nothing to stand beside.
        figures = {name: figure for name, figure in figures.items() if not name.startswith("hinge_")}
        gap["nearest"] = {SERVER_NAMES.get(name, name): figure["mean"] for name, figure in figures.items()}
        gap.setdefault("metrics", {})["nearest"] = figures


def part_tables(report: dict[str, Any], before: dict[str, Any] | None = None) -> list[str]:
    """For each part of the clips in ``evaluate --by --json`` a heading and a table of all gaps together.

    ``before`` is the same of another pack, which gets a column of its own, called as its folder. Both must be of the same windows
    and evaluator. Raises `ValueError` if they are not.
    """
    texts: list[str] = []
    for by, parts in report.get("parts", {}).items():
        others = {part["name"]: part for part in (before or {}).get("parts", {}).get(by, [])}
        for part in parts:
            block = part["gaps"][-1]
            found = {titled: block["methods"][name] for name, titled in _titles(block).items()}
            if before is not None:
                other = _same_windows(report, before, part, others.get(part["name"]))
                found[before["source"]] = other["methods"][PACK]
            shown = {
                title: {name: figure for name, figure in figures.items() if name in PART_MEASURES}
                for title, figures in found.items()
            }
            texts += [f"#### {by.capitalize()} `{part['name']}`, {block['windows']} windows of all gaps", table(shown)]
    return texts


def _titles(block: dict[str, Any]) -> dict[str, str]:
    """The headings of a report's methods, as the other tables of a card have them."""
    return {
        name: {PACK: METHODS[PACK], "interpolation": METHODS["interpolation"]}.get(name, name)
        for name in block["methods"]
    }


def _same_windows(
    report: dict[str, Any], before: dict[str, Any], part: dict[str, Any], other: dict[str, Any] | None
) -> dict[str, Any]:
    """The last block of the same part in another report."""
    for key in ("evaluator", "stride_frames", "uncut", "pinned", "split"):
        if report.get(key) != before.get(key):
            raise ValueError(f"{key} is {report.get(key)} in one report and {before.get(key)} in the other")
    windows = [(block["gap_frames"], block["windows"]) for block in part["gaps"]]
    if other is None or windows != [(block["gap_frames"], block["windows"]) for block in other["gaps"]]:
        raise ValueError(f"{part['name']}: the windows are not those of the other report")
    block: dict[str, Any] = other["gaps"][-1]
    return block


def _size(manifest: dict[str, Any]) -> str:
    robot = manifest.get("robot")
    hinges = f" of the robot {robot['name']}, {len(robot['hinges'])} of which are hinges" if robot else ""
    tokens = f", {manifest['heads']} heads of {manifest['codes']} codes" if "heads" in manifest else ""
    joints = f"{len(manifest['skeleton']['joints'])} joints{hinges}"
    return f"{joints}, {manifest['fps']:.0f} Hz, segments of 12 to 64 frames{tokens}."


def training_rows(training: dict[str, Any]) -> str:
    """A row for each stage that was trained, in the manifest's order."""
    rows = ["| stage | updates | minutes | final loss |", "|---|---:|---:|---:|"]
    for stage in [key.removesuffix("_steps") for key in training if key.endswith("_steps")]:
        figures = [str(training.get(f"{stage}_{key}", "")) for key in ("steps", "minutes", "final_loss")]
        rows.append("| " + " | ".join([stage, *figures]) + " |")
    return "\n".join(rows)


def write_card(
    pack: Path, evaluation: Path, notes: Path | None, baselines: Path | None = None, before: Path | None = None
) -> None:
    """Writes ``README.md`` into the pack folder and the main figures into ``pack.toml``.

    ``notes`` is Markdown about the data and limits, put in as it stands; ``baselines`` is the JSON of ``evaluate`` on the same
    windows, for the nearest training window and the parts of the clips; ``before`` is that of another pack, to stand beside.
    """
    manifest = read_manifest(pack)
    report = json.loads(evaluation.read_text())
    if report["content_hash"] != manifest["content_hash"]:
        raise SystemExit("the evaluation is of another pack: its content hash differs")
    apart: list[str] = []
    if baselines is not None:
        found = json.loads(baselines.read_text())
        try:
            add_nearest(report, found)
            apart = part_tables(found, json.loads(before.read_text()) if before else None)
        except ValueError as error:
            raise SystemExit(f"{baselines}: {error}") from error
    training = manifest["training"]
    size = sum(f.stat().st_size for f in pack.glob("*.onnx")) / 1e6
    parts = [
        f"# {manifest['name']} {manifest['version']}",
        (f"{manifest['parameters'] / 1e6:.1f} million parameters, {size:.0f} MB in 16-bit weights, {_size(manifest)}"),
        f"Licence of the weights: {manifest['licence']}. Credits: {'; '.join(manifest['credits'])}.",
        notes.read_text().strip() if notes else "",
        "## Training",
        (
            f"{training['clips']} clips, {training['frames']} frames ({training['frames'] / 30 / 3600:.2f} hours)"
            f"{', and each as seen in a mirror' if training.get('mirrored') else ''}."
        ),
        training_rows(training),
        "![Loss curves](curves.png)" if (pack / "curves.png").exists() else "",
        "## Evaluation",
        (
            f"Through the server with `troupe-eval gaps`: {report['clips']} test clips, a window every {report['stride_frames']} "
            f"frames, four context frames and one target keyframe (pose and root, no velocity), temperature "
            f"{report['temperature']:g}, {report['pose_steps']} pose step. ↓ lower is better, ↑ higher is better, ≈ nearer to "
            "ground truth is better. L2P is in metres, not normalised. In brackets: 95 % intervals, where the report has them."
        ),
    ]
    for gap in report["gaps"]:
        parts += [f"### Gap of {gap['gap_frames']} frames, {gap['windows']} windows", card_table(gap)]
    verdicts = {True: "holds", False: "does not hold", None: "not measured"}
    parts.append("\n".join(f"- {claim['claim']}: {verdicts[claim['holds']]}" for claim in report["claims"]))
    if apart:
        parts += [PARTS_HEAD, *apart]
    write_readme(pack, parts)
    rows = [f"clips = {report['clips']}"]
    for gap in report["gaps"]:
        for method in METHODS:
            values = ", ".join(f"{name} = {value:.6g}" for name, value in _plain_means(gap, method).items())
            if values:
                rows.append(f"gap_{gap['gap_frames']}_{method} = {{ {values} }}")
    write_figures(pack / "pack.toml", rows)


def write_readme(pack: Path, parts: Sequence[str]) -> None:
    """Writes the card; empty parts are left out."""
    (pack / "README.md").write_text("\n\n".join(p for p in parts if p) + "\n")


def figure_row(key: str, figures: dict[str, float]) -> str:
    """A line of TOML: an inline table of figures."""
    values = ", ".join(f"{name} = {value:.6g}" for name, value in figures.items())
    return f"{json.dumps(key)} = {{ {values} }}"


def write_figures(manifest_path: Path, rows: Sequence[str]) -> None:
    """Replaces the manifest's ``[evaluation]`` table by one of these lines of TOML."""
    lines, keep = [], True
    for line in manifest_path.read_text().splitlines():
        if line.startswith("["):
            keep = line != "[evaluation]"
        if keep:
            lines.append(line)
    lines += ["", "[evaluation]", *rows]
    text = "\n".join(lines).replace("\n\n\n", "\n\n") + "\n"
    tomllib.loads(text)
    manifest_path.write_text(text)
