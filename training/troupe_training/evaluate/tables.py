"""Measures as text: headings and units, Markdown tables for model cards, plain lines for a terminal."""

from dataclasses import dataclass
from typing import Any

Figure = dict[str, float]  # "mean", and with an interval "low" and "high"
Methods = dict[str, dict[str, Figure]]  # figures by the names of method and measure


@dataclass(frozen=True)
class Measure:
    """A measure: its name in reports, its heading, and how its figures are written."""

    name: str
    heading: str
    factor: float = 1.0
    decimals: int = 2

    def text(self, value: float) -> str:
        """A value in the unit of the heading."""
        return f"{value * self.factor:.{self.decimals}f}"

    def cell(self, figure: Figure | None) -> str:
        """A figure and the ends of its interval, as far as there are any, or a dash."""
        if figure is None:
            return "–"
        mean = self.text(figure["mean"])
        if figure.get("low") is None:
            return mean
        low, high = self.text(figure["low"]), self.text(figure["high"])
        return mean if low == high else f"{mean} ({low}–{high})"


MEASURES = (
    Measure("mmd", "MMD ↓", 1, 4),
    Measure("fid", "FID ↓", 1, 4),
    Measure("joint_diversity_m", "joint diversity (mm)", 1e3, 1),
    Measure("diversity_ratio", "diversity ÷ distance to captured, 1 is best", 1, 2),
    Measure(
        "best_of_seeds_nearer", "windows where the best take has a lower L2P than the likeliest answer (%)", 100, 0
    ),
    Measure("best_of_seeds_l2p_ratio", "L2P of the best take ÷ that of the likeliest answer", 1, 2),
    Measure("latent_diversity", "latent diversity", 1, 3),
    Measure("joint_jitter_mps2", "joint jitter (m/s²) ≈"),
    Measure("root_jitter_mps2", "root jitter (m/s²) ≈"),
    Measure("foot_skate_m_per_frame", "foot skate (mm/frame) ↓", 1e3),
    Measure("penetration_m", "penetration (mm) ↓", 1e3),
    Measure("contact_accuracy", "contacts right (%) ↑", 100, 1),
    Measure("contact_prediction_accuracy", "predicted contacts right (%) ↑", 100, 1),
    Measure("context_keyframe_error_m", "context joints (mm) ↓", 1e3, 1),
    Measure("target_keyframe_error_m", "target joints (mm) ↓", 1e3, 1),
    Measure("context_root_error_m", "context root (mm) ↓", 1e3, 1),
    Measure("target_root_error_m", "target root (mm) ↓", 1e3, 1),
    Measure("reached", "target reached (%) ↑", 100, 1),
    Measure("l2p_m", "L2P (m) ↓", 1, 3),
    Measure("nearer_than_pack", "windows with a lower L2P than the pack (%)", 100, 1),
    Measure("l2q", "L2Q ↓", 1, 3),
    Measure("npss", "NPSS ↓", 1, 4),
    Measure("hinge_residual_mean_deg", "off the hinges, mean (°) ↓", 1, 2),
    Measure("hinge_residual_max_deg", "off the hinges, largest (°) ↓", 1, 2),
    Measure("hinge_clamped_share", "angles at their limits (%) ↓", 100, 2),
)


@dataclass(frozen=True)
class Reference:
    """Somebody else's figures for a column of their own; what does not compare is put into brackets, with a note."""

    name: str
    figures: dict[str, float]
    not_comparable: tuple[str, ...]
    note: str

    def cell(self, measure: Measure) -> str:
        """The figure, or a dash."""
        if measure.name not in self.figures:
            return "–"
        text = measure.text(self.figures[measure.name])
        return f"({text})" if measure.name in self.not_comparable else text


def measures_of(methods: Methods) -> list[Measure]:
    """The measures that any method has."""
    return [m for m in MEASURES if any(m.name in figures for figures in methods.values())]


def table(methods: Methods, reference: Reference | None = None) -> str:
    """A Markdown table: a row for each measure, a column for each method and one for the reference."""
    names = [*methods, *([reference.name] if reference else [])]
    lines = ["| measure | " + " | ".join(names) + " |", "|---|" + "---:|" * len(names)]
    for measure in measures_of(methods):
        cells = [measure.cell(figures.get(measure.name)) for figures in methods.values()]
        cells += [reference.cell(measure)] if reference else []
        lines.append(f"| {measure.heading} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _introduction(report: dict[str, Any]) -> str:
    pinned = "pinned to their keyframes as the server does" if report["pinned"] else "as the networks give them"
    steps = report["pose_steps"]
    text = (
        f"With `troupe-train evaluate` on the {report['split']} split: {report['clips']} clips, a window every "
        f"{report['stride_frames']} frames, four context frames and one target keyframe (pose and root, no velocity), "
        f"temperature {report['temperature']:g}, {steps} pose step{'s' if steps > 1 else ''}, answers {pinned}. In "
        "brackets the 95 % interval (bootstrap over clips). ↓ lower is better, ↑ higher is better, ≈ nearer to ground "
        "truth is better."
    )
    diversity = report["diversity"]
    if diversity["seeds"] > 1:
        text += (
            f" Diversity: {diversity['seeds']} seeds at temperature {diversity['temperature']:g} on "
            f"{diversity['windows']} windows."
        )
    if report["robot"]:
        text += (
            f" Every motion is put onto the hinges of {report['robot']}, within their limits, before it is measured."
        )
    return text


def _blocks(report: dict[str, Any]) -> list[tuple[str, Methods]]:
    """Each gap's figures under a title, and those of all gaps together."""
    blocks = [(f"Gap of {g['gap_frames']} frames, {g['windows']} windows", g["methods"]) for g in report["gaps"]]
    if every := report.get("all_gaps"):
        blocks.append((f"All gaps, {every['windows']} windows", every["methods"]))
    return blocks


def markdown(report: dict[str, Any], reference: Reference | None = None) -> str:
    """The whole report for a model card."""
    parts = [_introduction(report)] + ([reference.note] if reference else [])
    for title, methods in _blocks(report):
        parts += [f"### {title}", table(methods, reference)]
    return "\n\n".join(parts) + "\n"


def print_report(report: dict[str, Any]) -> None:
    """A plain table for each gap, means only."""
    for title, methods in _blocks(report):
        print(f"\n{title}")
        print(" " * 44 + "".join(f"{name[:16]:>17}" for name in methods))
        for measure in measures_of(methods):
            cells = [
                measure.cell({"mean": f[measure.name]["mean"]} if measure.name in f else None) for f in methods.values()
            ]
            print(f"{measure.heading:44}" + "".join(f"{text:>17}" for text in cells))
