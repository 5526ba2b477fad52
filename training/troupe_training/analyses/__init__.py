"""The paper's analyses that this hardware can carry: one module each, one command each (`troupe-train analyse NAME`).

Each writes ``NAME.json`` and ``NAME.png`` into its output folder. Those that train keep a run folder for each variant and
seed there and go on from it.
"""

from collections.abc import Callable

from troupe_training.analyses import captured, diversity, fsq_vq, heads_codes, pose_steps, replan, root_interpolation
from troupe_training.analyses.common import Setting

ANALYSES: dict[str, Callable[[Setting], bool]] = {
    "heads-codes": heads_codes.run,
    "fsq-vq": fsq_vq.run,
    "root-interpolation": root_interpolation.run,
    "replan": replan.run,
    "pose-steps": pose_steps.run,
    "captured": captured.run,
    "diversity": diversity.run,
}
