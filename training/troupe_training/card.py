"""``card``: the pack's README from its manifest and from what ``troupe eval --json`` measured through the server."""

import json
from pathlib import Path

import tomllib

COLUMNS = [  # figure, heading, factor, decimals
    ("l2p_m", "L2P (m) ↓", 1, 3),
    ("l2q", "L2Q ↓", 1, 3),
    ("npss", "NPSS ↓", 1, 4),
    ("foot_skate_m_per_frame", "foot skate (mm/frame) ↓", 1e3, 2),
    ("penetration_m", "penetration (mm) ↓", 1e3, 2),
    ("contact_accuracy", "contacts right (%) ↑", 100, 1),
    ("joint_jitter_mps2", "joint jitter (m/s²) ≈", 1, 2),
    ("root_jitter_mps2", "root jitter (m/s²) ≈", 1, 2),
    ("context_keyframe_error_m", "context joints (mm) ↓", 1e3, 1),
    ("target_keyframe_error_m", "target joints (mm) ↓", 1e3, 1),
    ("context_root_error_m", "context root (mm) ↓", 1e3, 1),
    ("target_root_error_m", "target root (mm) ↓", 1e3, 1),
    ("reaching_success", "target reached (%) ↑", 100, 1),
]
# Those that only reports with intervals have, and of them not all.
FURTHER = [
    ("fid", "FID ↓", 1, 3),
    ("mmd", "MMD ↓", 1, 3),
    ("joint_diversity_m", "joint diversity (mm)", 1e3, 1),
    ("latent_diversity", "latent diversity", 1, 3),
    ("contact_prediction_accuracy", "contacts said right (%) ↑", 100, 1),
]
METHODS = [("ground_truth", "ground truth"), ("interpolation", "linear/slerp"), ("pack", "this pack")]


def _cell(gap: dict, method: str, figure: str, factor: float, decimals: int) -> str:
    """A figure of a method with its 95 % interval as far as the report has them, or a dash."""
    name = "reached" if figure == "reaching_success" else figure
    found = gap.get("metrics", {}).get(method, {}).get(name) or {"mean": gap[method].get(figure)}
    if found["mean"] is None:
        return "–"
    mean, low, high = (
        None if found.get(end) is None else f"{found[end] * factor:.{decimals}f}"
        for end in ("mean", "low", "high")
    )
    return mean if low is None or low == high else f"{mean} ({low} to {high})"


def _table(gap: dict) -> str:
    lines = [
        "| measure | " + " | ".join(name for _, name in METHODS) + " |",
        "|---|" + "---:|" * len(METHODS),
    ]
    for figure, heading, factor, decimals in FURTHER + COLUMNS:
        cells = [_cell(gap, method, figure, factor, decimals) for method, _ in METHODS]
        if set(cells) != {"–"}:
            lines.append(f"| {heading} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _hinges(manifest: dict) -> str:
    robot = manifest.get("robot")
    return f" of the robot {robot['name']}, {len(robot['hinges'])} of which are hinges" if robot else ""


def _training_rows(training: dict) -> str:
    stages = ("tokenizer", "root", "pose", "refine")
    rows = ["| stage | updates | minutes | final loss |", "|---|---:|---:|---:|"]
    for stage in stages:
        if f"{stage}_steps" in training:
            steps, minutes, loss = (
                training.get(f"{stage}_{k}", "") for k in ("steps", "minutes", "final_loss")
            )
            rows.append(f"| {stage} | {steps} | {minutes} | {loss} |")
    return "\n".join(rows)


def write_card(pack: Path, evaluation: Path, notes: Path | None) -> None:
    """Writes ``README.md`` into the pack folder and the main figures into ``pack.toml``.

    ``notes`` is Markdown about the data and limits, put in as it stands.
    """
    manifest_path = Path(pack) / "pack.toml"
    manifest = tomllib.loads(manifest_path.read_text())
    report = json.loads(Path(evaluation).read_text())
    if report["content_hash"] != manifest["content_hash"]:
        raise SystemExit("the evaluation is of another pack: its content hash differs")
    training = manifest["training"]
    size = sum(f.stat().st_size for f in Path(pack).glob("*.onnx")) / 1e6
    parts = [
        f"# {manifest['name']} {manifest['version']}",
        (
            f"{manifest['parameters'] / 1e6:.1f} million parameters, {size:.0f} MB in 16-bit weights, "
            f"{len(manifest['skeleton']['joints'])} joints{_hinges(manifest)}, {manifest['fps']:.0f} Hz, segments of 12 to 64 frames, "
            f"{manifest['heads']} heads of {manifest['codes']} codes."
        ),
        f"Licence of the weights: {manifest['licence']}. Credits: {'; '.join(manifest['credits'])}.",
        notes.read_text().strip() if notes else "",
        "## Training",
        (
            f"{training['clips']} clips, {training['frames']} frames ({training['frames'] / 30 / 3600:.2f} hours)"
            f"{', and each as seen in a mirror' if training.get('mirrored') else ''}."
        ),
        _training_rows(training),
        "![Loss curves](curves.png)" if (Path(pack) / "curves.png").exists() else "",
        "## Evaluation",
        (
            f"Through the server with `troupe eval`: {report['clips']} test clips, a window every {report['stride_frames']} "
            f"frames, four context frames and one target keyframe (pose and root, no velocity), temperature "
            f"{report['temperature']:g}, {report['pose_steps']} pose step. ↓ lower is better, ↑ higher is better, ≈ nearer to "
            "ground truth is better. L2P is in metres, not normalised. In brackets: 95 % intervals, where the report has them."
        ),
    ]
    for gap in report["gaps"]:
        parts += [f"### Gap of {gap['gap_frames']} frames, {gap['windows']} windows", _table(gap)]
    verdicts = {True: "holds", False: "does not hold", None: "not measured"}
    parts.append("\n".join(f"- {claim['claim']}: {verdicts[claim['holds']]}" for claim in report["claims"]))
    (Path(pack) / "README.md").write_text("\n\n".join(p for p in parts if p) + "\n")
    _write_figures(manifest_path, report)


def _write_figures(manifest_path: Path, report: dict) -> None:
    """Replaces the ``[evaluation]`` table."""
    lines, keep = [], True
    for line in manifest_path.read_text().splitlines():
        if line.startswith("["):
            keep = line != "[evaluation]"
        if keep:
            lines.append(line)
    lines += ["", "[evaluation]", f"clips = {report['clips']}"]
    for gap in report["gaps"]:
        for method, _ in METHODS:
            values = ", ".join(f"{figure} = {gap[method][figure]:.6g}" for figure, *_ in COLUMNS)
            lines.append(f"gap_{gap['gap_frames']}_{method} = {{ {values} }}")
    text = "\n".join(lines).replace("\n\n\n", "\n\n") + "\n"
    tomllib.loads(text)
    manifest_path.write_text(text)
