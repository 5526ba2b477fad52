"""Reports of `evaluate` as text: Markdown for model cards, plain lines for a terminal."""

from dataclasses import dataclass

TRUTH = "ground truth"


@dataclass(frozen=True)
class Row:
    """A measure: its name in the report, its heading, and how its figures are written."""

    name: str
    heading: str
    factor: float = 1.0
    decimals: int = 2


ROWS = (
    Row("mmd", "MMD ↓", 1, 4),
    Row("fid", "FID ↓", 1, 4),
    Row("joint_diversity_m", "joint diversity (mm)", 1e3, 1),
    Row("latent_diversity", "latent diversity", 1, 3),
    Row("joint_jitter_mps2", "joint jitter (m/s²) ≈"),
    Row("root_jitter_mps2", "root jitter (m/s²) ≈"),
    Row("foot_skate_m_per_frame", "foot skate (mm/frame) ↓", 1e3),
    Row("penetration_m", "penetration (mm) ↓", 1e3),
    Row("contact_accuracy", "contacts right (%) ↑", 100, 1),
    Row("contact_prediction_accuracy", "predicted contacts right (%) ↑", 100, 1),
    Row("context_keyframe_error_m", "context joints (mm) ↓", 1e3, 1),
    Row("target_keyframe_error_m", "target joints (mm) ↓", 1e3, 1),
    Row("context_root_error_m", "context root (mm) ↓", 1e3, 1),
    Row("target_root_error_m", "target root (mm) ↓", 1e3, 1),
    Row("reached", "target reached (%) ↑", 100, 1),
    Row("l2p_m", "L2P (m) ↓", 1, 3),
    Row("l2q", "L2Q ↓", 1, 3),
    Row("npss", "NPSS ↓", 1, 4),
    Row("hinge_residual_mean_deg", "off the hinges, mean (°) ↓", 1, 2),
    Row("hinge_residual_max_deg", "off the hinges, largest (°) ↓", 1, 2),
    Row("hinge_clamped_share", "angles at their limits (%) ↓", 100, 2),
)

# The paper's Table 4, LaFAN1-G1, its own method. Distribution and diversity are in its own feature network's space, and its
# joint diversity is not defined as ours: they do not compare.
PAPER_G1 = {
    "mmd": 0.2835,
    "fid": 0.891,
    "joint_jitter_mps2": 4.53,
    "root_jitter_mps2": 2.53,
    "foot_skate_m_per_frame": 0.003,
    "penetration_m": 0.003,
    # Of the contacts that the network gives, or of those that its motion makes: the text leaves it open.
    "contact_accuracy": 0.889,
    "contact_prediction_accuracy": 0.889,
    "context_keyframe_error_m": 0.053,
    "target_keyframe_error_m": 0.179,
    "context_root_error_m": 0.006,
    "target_root_error_m": 0.100,
    "reached": 0.611,
}
NOT_COMPARABLE = ("mmd", "fid")


def number(row: Row, value: float) -> str:
    """A figure in the unit of its heading."""
    return f"{value * row.factor:.{row.decimals}f}"


def cell(row: Row, figure: dict | None) -> str:
    """A figure and the ends of its interval, or a dash."""
    if figure is None:
        return "–"
    ends = [number(row, figure[end]) for end in ("low", "high")]
    mean = number(row, figure["mean"])
    return mean if ends[0] == ends[1] else f"{mean} ({ends[0]}–{ends[1]})"


def _paper_cell(row: Row) -> str:
    if row.name not in PAPER_G1:
        return "–"
    text = number(row, PAPER_G1[row.name])
    return f"({text})" if row.name in NOT_COMPARABLE else text


def rows_of(methods: dict[str, dict]) -> list[Row]:
    """The measures that any method has."""
    return [row for row in ROWS if any(row.name in figures for figures in methods.values())]


def table(methods: dict[str, dict], paper: bool = False) -> str:
    """A Markdown table: a row for each measure, a column for each method and, if asked for, the paper's."""
    names = list(methods) + (["MotionBricks, table 4"] if paper else [])
    lines = ["| measure | " + " | ".join(names) + " |", "|---|" + "---:|" * len(names)]
    for row in rows_of(methods):
        cells = [cell(row, figures.get(row.name)) for figures in methods.values()]
        lines.append(f"| {row.heading} | " + " | ".join(cells + ([_paper_cell(row)] if paper else [])) + " |")
    return "\n".join(lines)


def _introduction(report: dict) -> str:
    pinned = (
        "pinned to their keyframes as the server does" if report["pinned"] else "as the networks give them"
    )
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
        text += f" Every motion is put onto the hinges of {report['robot']}, within their limits, before it is measured."
    return text


def is_g1(report: dict) -> bool:
    """Whether the paper has figures for this robot."""
    return (report["robot"] or "").lower().startswith("g1")


def markdown(report: dict) -> str:
    """The whole report for a model card."""
    paper = is_g1(report)
    parts = [_introduction(report)]
    if paper:
        parts.append(
            "The paper's figures are of its own windows, drawn at random; those in brackets are in the space of its own "
            "feature network and do not compare."
        )
    for gap in report["gaps"]:
        parts += [
            f"### Gap of {gap['gap_frames']} frames, {gap['windows']} windows",
            table(gap["methods"], paper),
        ]
    if "all_gaps" in report:
        every = report["all_gaps"]
        parts += [f"### All gaps, {every['windows']} windows", table(every["methods"], paper)]
    return "\n\n".join(parts) + "\n"


def print_report(report: dict) -> None:
    """A plain table for each gap, means only."""
    blocks = [(f"gap {g['gap_frames']} frames, {g['windows']} windows", g["methods"]) for g in report["gaps"]]
    if "all_gaps" in report:
        blocks.append((f"all gaps, {report['all_gaps']['windows']} windows", report["all_gaps"]["methods"]))
    for title, methods in blocks:
        print(f"\n{title}")
        print(" " * 34 + "".join(f"{name[:16]:>17}" for name in methods))
        for row in rows_of(methods):
            means = [figures.get(row.name, {}).get("mean") for figures in methods.values()]
            cells = ["–" if mean is None else number(row, mean) for mean in means]
            print(f"{row.heading:34}" + "".join(f"{text:>17}" for text in cells))
