"""Means with 95 % confidence intervals by the bootstrap over clips.

Windows of one clip overlap and are alike, so whole clips are drawn with replacement, not windows; of long clips pieces
of ten seconds (`cut.windows`).
"""

import numpy as np

SEED = 20260122
RESAMPLES = 1000
# Fréchet distances take an eigendecomposition each.
COSTLY_RESAMPLES = 100


class Bootstrap:
    """Draws of the pieces that ``pieces`` ``[W]`` names (a number for each window); the same draws every time."""

    def __init__(self, pieces: np.ndarray, resamples: int = RESAMPLES):
        names, place = np.unique(pieces, return_inverse=True)
        rng = np.random.default_rng(SEED)
        draws = rng.integers(len(names), size=(resamples, len(names)))
        times = np.stack([np.bincount(d, minlength=len(names)) for d in draws])
        self.counts = times[:, place].astype(np.float64)  # [resamples, W]: how often each window was drawn

    def ratio(self, above: np.ndarray, below: np.ndarray | None = None) -> dict[str, float]:
        """Sum of ``above`` over sum of ``below`` (1 for each window: the mean), with its interval."""
        below = np.ones(len(above)) if below is None else below
        drawn = (self.counts @ above) / np.maximum(self.counts @ below, 1e-12)
        low, high = np.percentile(drawn, [2.5, 97.5])
        return {"mean": float(above.sum() / max(below.sum(), 1e-12)), "low": float(low), "high": float(high)}

    def draws(self, most: int) -> list[np.ndarray]:
        """Every window once, and then ``most`` draws: how often each window counts, ``[W]``."""
        return [np.ones(self.counts.shape[1]), *self.counts[:most]]

    @staticmethod
    def statistic(values: list[float]) -> dict[str, float]:
        """A figure that is not negative, from its values on `draws`; those that are not finite are left out.

        A drawn set has fewer distinct windows than the whole, by which distances between sets grow; the interval is
        moved back by as much as the draws lie off in the mean.
        """
        whole, drawn = values[0], np.array([v for v in values[1:] if np.isfinite(v)])
        if not len(drawn):
            return {"mean": whole, "low": whole, "high": whole}
        low, high = np.percentile(drawn, [2.5, 97.5]) - (drawn.mean() - whole)
        return {"mean": whole, "low": max(float(low), 0.0), "high": float(high)}
