"""``vermo card``: the pack's README from its manifest and what ``vermo evaluate --json`` measured."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from troupe_training.data.conventions import FPS
from troupe_training.evaluate.card import figure_row, training_rows, write_figures, write_readme
from troupe_training.evaluate.vermo.continuation import continuation_table
from troupe_training.evaluate.vermo.nearest import nearest_table
from troupe_training.evaluate.vermo.reconstruction import reconstruction_table
from troupe_training.evaluate.vermo.text import description_table, text_table
from troupe_training.export.manifest import read_manifest

# A part's title, the meaning of its figures, and its table.
PARTS: dict[str, tuple[str, str, Callable[[dict[str, Any]], str]]] = {
    "reconstruction": (
        "Reconstruction",
        """\
Captured motion to tokens and back, whole clips or their first 256 frames, from the same first root. Most of MPJPE is drift of
the place: tokens hold steps, not places. Codes in use are of the tokens of that split. The paper has 59 mm on its own data
(table 8).""",
        reconstruction_table,
    ),
    "continuation": (
        "Prediction and in-between",
        """\
Of 80 frames 40 % are given and 60 % made, or 20 % are given on either side of 60 %. Diversity is the distance between samples.
*Joined* spreads what is missing to the place behind the gap evenly over it.

*MotionBricks* is the pack of `--motionbricks`. It reads four frames before the gap and the first one behind it, and its answer is
pinned to them, as a server does it. *Drawn* draws its codes at temperature 1. VerMo reads 16 frames on either side. MotionBricks
needs a frame to lead to, so it has no answer to a prediction. `models/human` was trained on clips of the cells: its rows of
*cell* are of motion that it has seen.""",
        continuation_table,
    ),
    "text": (
        "Text to motion",
        """\
R@k: how often a clip's own caption is among the k nearest of a pool, by a judge that was trained on training clips. Content and
style: how often the judge sees what the caption says. The nearest seen caption answers with that training clip.""",
        text_table,
    ),
    "description": (
        "Motion to text",
        """\
How often the sentence names the clip's content and style. A known sentence is one that the caption templates can make.""",
        description_table,
    ),
    "nearest": (
        "Distance to training clips",
        """\
Windows of samples, and of captured clips, against all windows of training clips: a model that only remembers would be nearer than
captured clips are.""",
        nearest_table,
    ),
}


def _check_source(measured: dict[str, Any], manifest: dict[str, Any]) -> None:
    """Ends the command if figures are of other networks than the pack's."""
    for key, step in measured["steps"].items():
        # A pack may be without the flow decoder that was measured.
        left_out = key == "flow_steps" and not manifest["vermo"]["flow_steps"]
        if not left_out and manifest["training"].get(key) != step:
            raise SystemExit(f"the figures are of {key} {step}, the pack has {manifest['training'].get(key)}")


def write_card(pack: Path, evaluations: Sequence[Path], notes: Path | None) -> None:
    """Writes ``README.md`` into the pack folder and the figures into ``pack.toml``.

    ``evaluations`` are what ``vermo evaluate --json`` wrote.
    ``notes`` is Markdown about the data and limits, put in as it stands.
    """
    manifest = read_manifest(pack)
    if manifest["family"] != "vermo":
        raise SystemExit(f"{pack} is a pack of the family {manifest['family']}")
    reports = [json.loads(path.read_text()) for path in evaluations]
    for report in reports:
        _check_source(report, manifest)
    training, family_table = manifest["training"], manifest["vermo"]
    size = sum(f.stat().st_size for f in pack.glob("*.onnx")) / 1e6
    hours = training["frames"] / FPS / 3600
    words = len((pack / "words.txt").read_text(encoding="utf-8").split())
    parts = [
        f"# {manifest['name']} {manifest['version']}",
        (
            f"{manifest['parameters'] / 1e6:.1f} million parameters, {size:.1f} MB in 16-bit weights, "
            f"{family_table['motion_codes']} motion codes, {words} words, {manifest['fps']:.0f} Hz, "
            f"motion of up to {manifest['frames_per_token'] * manifest['max_tokens']} frames a reply."
        ),
        f"Licence of the weights: {manifest['licence']}. Credits: {'; '.join(manifest['credits'])}.",
        notes.read_text().strip() if notes else "",
        "## Training",
        f"{training['clips']} clips, {training['frames']} frames ({hours:.2f} hours), and each as seen in a mirror.",
        training_rows(training),
        "![Loss curves](curves.png)" if (pack / "curves.png").exists() else "",
        "## Evaluation",
        "*test*: clips that were kept from training. *cell*: combinations of content and style that were kept from training.",
    ]
    for report in reports:
        for part, figures in report["figures"].items():
            heading, meaning, table = PARTS[part]
            parts += [f"### {heading}", meaning, f"    {report['command']}", table(figures).strip()]
    write_readme(pack, parts)
    write_figures(pack / "pack.toml", [row for report in reports for row in _figure_rows(report["figures"])])


def _figure_rows(report: dict[str, dict[str, dict[str, float]]]) -> list[str]:
    """Lines of TOML: an inline table for each part and row."""
    rows = []
    for part, figures in report.items():
        for what, one in figures.items():
            key = f"{part} {what}".translate(str.maketrans(" ", "_", ",:"))
            rows.append(figure_row(key, one))
    return rows
