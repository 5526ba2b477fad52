"""``unimogen card``: the pack's README from its manifest, its bodies, and what ``unimogen evaluate --json`` measured."""

import json
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from troupe_training.data.conventions import CONTEXT_FRAMES, FPS
from troupe_training.evaluate.card import figure_row, training_rows, write_figures, write_readme
from troupe_training.evaluate.tables import Measure
from troupe_training.evaluate.unimogen.measure import Figures
from troupe_training.evaluate.unimogen.style import blend_table
from troupe_training.export.manifest import read_manifest
from troupe_training.export.unimogen.kinds import files_of
from troupe_training.export.unimogen.pack import FAMILY

MEASURES = (
    Measure("path_position_m", "off the path (mm) ↓", 1e3, 1),
    Measure("path_rotation_deg", "heading off the path (°) ↓"),
    Measure("fid", "FID ↓", 1, 4),
    Measure("l2p_m", "L2P (m) ↓", 1, 3),
    Measure("foot_skate_m_per_frame", "foot skate (mm/frame) ↓", 1e3),
    Measure("standing_foot_m_per_frame", "standing foot (mm/frame) ↓", 1e3),
    Measure("toe_highest_m", "highest toe (cm) ≈", 100, 1),
    Measure("foot_sliding_m", "toes slide, as the paper has it (m) ↓", 1, 3),
    Measure("foot_penetration_share", "frames with a toe in the ground (%) ↓", 100, 1),
    Measure("left_penetration_share", "with the left toe (%) ↓", 100, 1),
    Measure("right_penetration_share", "with the right toe (%) ↓", 100, 1),
    Measure("jitter_mps2", "joint acceleration (m/s²) ≈"),
    Measure("seam_mps2", "the same where the past ends (m/s²) ≈"),
    Measure("diversity_in_motion_m2", "diversity in a motion (m²) ≈", 1, 4),
    Measure("diversity_between_motions_m2", "diversity between motions (m²) ≈", 1, 4),
)
METHOD_NAMES = {"captured": "ground truth", "unimogen": "this pack"}
ABOUT_FIGURES = """\
Of the network's own motion, before anything is pinned. A window has {frames} frames, the first four are given; one starts every
{stride} frames. Its path is that of the captured root, its words are those of its clip. {steps} sampler steps, guidance
{guidance:g}. ↓ lower is better, ≈ nearer to ground truth is better. Only *interpolated* knows the window's last pose.

- **Toes** slide while they are less than 1 cm above the height at which they stand: metres in a window, mean of both. They are in
  the ground 1 cm below that height. The paper counts from the ground itself, which is easier.
- **FID** is between latents of the evaluator in the pack of that body. Ground truth's is between every other window and the rest:
  with few windows FID is too high, and that says how much.
- **Diversity** is the variance of joint positions, summed over x, y and z: over the frames of a motion relative to the root, and
  over motions relative to the root's point on the ground."""


ABOUT_PATHS = """\
Lines, arcs (30° a second) and S curves (30° a second to one side, then to the other) at an even speed. Each begins in the
last pose of a captured straight walk and goes on for {seconds:.1f} seconds. The network's own motion is measured, before
anything is pinned or held. Ground truth is captures of about the same speed and turn, if there are any.

- **Standing foot**: how far the slowest toe goes in a frame. In a walk one foot always stands, in a run none does at times.
- **Highest toe**: above the height at which it stands. A foot that drags is lower than a captured one, a foot that stamps
  is higher.
- **Seam**: joint acceleration where the past ends.
- **FID** to these captures, from at least 64 windows of both. It is too high with few windows."""


ABOUT_BLENDS = (
    "Answers without a past on the paths of held-out windows, with both styles by their weights. A linear classifier of the "
    "evaluator's latents, trained on captures of the two, says which style it sees."
)


def figures_table(methods: dict[str, Figures]) -> str:
    """The figures of one body and split: a row for each measure, a column for each method."""
    names = [METHOD_NAMES.get(name, name) for name in methods]
    lines = [f"| | {' | '.join(names)} |", "|---|" + "---:|" * len(names)]
    for measure in MEASURES:
        if any(measure.name in figures for figures in methods.values()):
            cells = (measure.text(f[measure.name]) if measure.name in f else "–" for f in methods.values())
            lines.append(f"| {measure.heading} | {' | '.join(cells)} |")
    return "\n".join(lines)


PATH_MEASURES = (
    Measure("standing_foot_m_per_frame", "standing foot (mm/frame) ↓", 1e3, 1),
    Measure("foot_skate_m_per_frame", "foot skate (mm/frame) ↓", 1e3, 1),
    Measure("foot_penetration_share", "a toe in the ground (%) ↓", 100, 0),
    Measure("toe_highest_m", "highest toe (cm) ≈", 100, 0),
    Measure("path_position_m", "off the path (cm) ↓", 100, 1),
    Measure("seam_mps2", "seam (m/s²) ≈", 1, 1),
    Measure("fid", "FID ↓", 1, 3),
)


def paths_table(report: dict[str, dict[str, Figures]]) -> str:
    """Figures of users' paths: a row for each body, path and method. Captures are those of the same speed and turn."""
    lines = [f"| path | method | windows | {' | '.join(m.heading for m in PATH_MEASURES)} |"]
    lines.append("|---|---|---:|" + "---:|" * len(PATH_MEASURES))
    for what, methods in report.items():
        for name, figures in methods.items():
            cells = [m.text(figures[m.name]) if m.name in figures else "–" for m in PATH_MEASURES]
            method = METHOD_NAMES.get(name, name)
            lines.append(f"| {what} | {method} | {figures['windows']:.0f} | {' | '.join(cells)} |")
    return "\n".join(lines)


def bodies_table(pack: Path, names: list[str]) -> str:
    """The pack's bodies: size and what their clips show."""
    lines = ["| body | joints | of which hinges | root's height (m) | words |", "|---|---:|---:|---:|---|"]
    for name in names:
        family_table = tomllib.loads((pack / "bodies" / f"{name}.toml").read_text())
        hinges = len(family_table.get("robot", {}).get("hinges", []))
        joints, words = len(family_table["skeleton"]["joints"]), ", ".join(family_table["words"])
        lines.append(f"| {name} | {joints} | {hinges or '–'} | {family_table['height_m']:.2f} | {words} |")
    return "\n".join(lines)


def _check_source(measured: dict[str, Any], manifest: dict[str, Any]) -> None:
    """Ends the command if figures are of another network than the pack's."""
    step = manifest["training"]["unimogen_steps"]
    if measured["step"] != step:
        raise SystemExit(f"the figures are of update {measured['step']}, the pack is of update {step}")
    if measured.get("content_hash", manifest["content_hash"]) != manifest["content_hash"]:
        raise SystemExit("the figures are of another pack: its content hash differs")


def _figure_parts(report: dict[str, Any]) -> list[str]:
    """Command and tables of one report, each table with why it has no FID."""
    parts = [f"    {report['command']}"] if "command" in report else []
    for what, methods in report["figures"].items():
        parts += [f"### {what}, {methods['captured']['windows']:.0f} windows", figures_table(methods)]
        parts.append(report.get("notes", {}).get(what, ""))
    return parts


def write_card(
    pack: Path,
    evaluations: Sequence[Path],
    notes: Path | None,
    blends: Sequence[Path] = (),
    sweeps: Sequence[Path] = (),
    user_paths: Sequence[Path] = (),
) -> None:
    """Writes ``README.md`` into the pack folder and the main figures into ``pack.toml``.

    ``evaluations`` are what ``unimogen evaluate --json`` wrote with one setting, ``sweeps`` those of other settings, ``blends``
    what ``unimogen blend --json`` wrote, ``user_paths`` what ``unimogen paths --json`` wrote. ``notes`` is Markdown about the
    data and limits, put in as it stands.
    """
    manifest = read_manifest(pack)
    if manifest["family"] != FAMILY.name:
        raise SystemExit(f"{pack} is a pack of the family {manifest['family']}")
    training, family_table = manifest["training"], manifest["unimogen"]
    reports, swept, blended, walked = (
        [json.loads(path.read_text()) for path in paths] for paths in (evaluations, sweeps, blends, user_paths)
    )
    for measured in (*reports, *swept, *blended, *walked):
        _check_source(measured, manifest)
    # How many windows there are stands at each table.
    several = [report["setting"] | {"most": None} for report in reports]
    if any(setting != several[0] for setting in several):
        raise SystemExit("the evaluations were made with several settings: one card has one")
    size = sum(f.stat().st_size for f in pack.glob("*.onnx")) / 1e6
    hours = training["frames"] / FPS / 3600
    count = len(files_of(family_table))
    networks = f"{count} networks of " if count > 1 else ""
    shortest, longest = (manifest["frames_per_token"] * manifest[key] for key in ("min_tokens", "max_tokens"))
    parts = [
        f"# {manifest['name']} {manifest['version']}",
        (
            f"{networks}{manifest['parameters'] / 1e6:.2f} million parameters, {size:.1f} MB in 16-bit weights, "
            f"{len(family_table['bodies'])} bodies, {len(family_table['words'])} words, {manifest['fps']:.0f} Hz, "
            f"windows of {shortest} to {longest} frames."
        ),
        f"Licence of the weights: {manifest['licence']}. Credits: {'; '.join(manifest['credits'])}.",
        "![One path on several bodies](film.png)" if (pack / "film.png").exists() else "",
        notes.read_text().strip() if notes else "",
        "## Bodies",
        bodies_table(pack, family_table["bodies"]),
        "## Training",
        f"{training['clips']} clips, {training['frames']} frames ({hours:.2f} hours).",
        training_rows(training),
        "![Loss curves](curves.png)" if (pack / "curves.png").exists() else "",
        "## Evaluation",
        ABOUT_FIGURES.format(**reports[0]["setting"]),
    ]
    for report in reports:
        parts += _figure_parts(report)
    if walked:
        seconds = (walked[0]["setting"]["frames"] - CONTEXT_FRAMES) / FPS
        parts += ["## Paths as users give them", ABOUT_PATHS.format(seconds=seconds)]
    for one in walked:
        parts += [f"    {one['command']}", paths_table(one["figures"])]
    if swept:
        parts.append("## Steps and guidance")
    for one in swept:
        parts += _figure_parts(one)
    if blended:
        parts += ["## Blends of two styles", ABOUT_BLENDS]
    for one in blended:
        parts += _blend_parts(one)
    write_readme(pack, parts)
    write_figures(
        pack / "pack.toml", _figure_rows({what: made for report in reports for what, made in report["figures"].items()})
    )


def _blend_parts(blend: dict[str, Any]) -> list[str]:
    """Command and tables of one pair of styles."""
    first, second = blend["styles"]
    tables = [f"{part}:\n\n{blend_table((first, second), shares)}".strip() for part, shares in blend["shares"].items()]
    return [f"    {blend['command']}", *tables] if "command" in blend else tables


def _figure_rows(report: dict[str, dict[str, Figures]]) -> list[str]:
    """Lines of TOML: an inline table for each body, split and method."""
    rows = []
    for what, methods in report.items():
        for method, figures in methods.items():
            key = f"{what}, {method}".replace(", ", "_").replace(" ", "_")
            rows.append(figure_row(key, figures))
    return rows
