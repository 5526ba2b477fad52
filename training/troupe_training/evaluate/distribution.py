"""Measures between sets of motions in the evaluator's latent space, and the diversity of repeated answers.

Latents are what `evaluator.onnx` gives: of length one in the root mean square over the train split.
"""

from functools import cached_property

import numpy as np
import torch
from torch import Tensor

# Kernel width and scale of CMMD (Jayasumana et al. 2024), whose vectors are of about that length
# too.
MMD_SIGMA = 10.0
MMD_SCALE = 1000.0


class Gaussian:
    """Mean ``[D]`` and covariance ``[D, D]`` (n - 1 below) of latents ``[W, D]``, each row taken ``counts`` times."""

    def __init__(self, latents: np.ndarray, counts: np.ndarray | None = None):
        x = torch.from_numpy(latents.astype(np.float64))
        times = torch.ones(len(x), dtype=torch.float64) if counts is None else torch.from_numpy(counts)
        self.mean = times @ x / times.sum()
        centred = (x - self.mean) * times.sqrt()[:, None]
        self.covariance = centred.T @ centred / (times.sum() - 1.0).clamp_min(1.0)

    @cached_property
    def root(self) -> Tensor:
        """The symmetric square root of the covariance."""
        values, vectors = torch.linalg.eigh(self.covariance)
        return (vectors * values.clamp_min(0.0).sqrt()) @ vectors.T


def frechet(a: Gaussian, b: Gaussian) -> float:
    """Fréchet distance of two Gaussians (Heusel et al. 2017): ``|m - m'|² + tr(C + C' - 2 (C C')^½)``.

    The trace of the root is the sum of the roots of the eigenvalues of ``C'^½ C C'^½``, which is symmetric. The root is
    kept in ``b``, which many may be compared with.
    """
    shared = torch.linalg.eigvalsh(b.root @ a.covariance @ b.root).clamp_min(0.0).sqrt().sum()
    apart = ((a.mean - b.mean) ** 2).sum()
    return max(float(apart + a.covariance.trace() + b.covariance.trace() - 2.0 * shared), 0.0)


def kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Gaussian kernel ``[W, V]`` between latents ``[W, D]`` and ``[V, D]``."""
    a, b = a.astype(np.float64), b.astype(np.float64)
    squared = (a**2).sum(1)[:, None] + (b**2).sum(1) - 2.0 * a @ b.T
    return np.exp(-squared.clip(0.0) / (2.0 * MMD_SIGMA**2))


class Mmd:
    """Squared maximum mean discrepancy of two sets as CMMD computes it: the biased estimate, times 1000.

    Kernels are computed once, so that resampling costs little.
    """

    def __init__(self, generated: np.ndarray, truth: np.ndarray):
        self.kernels = kernel(generated, generated), kernel(truth, truth), kernel(generated, truth)

    def value(self, generated: np.ndarray | None = None, truth: np.ndarray | None = None) -> float:
        """With each row taken so many times (``[W]`` and ``[V]``); once each without."""
        xx, yy, xy = self.kernels
        a = np.ones(len(xx)) if generated is None else generated
        b = np.ones(len(yy)) if truth is None else truth
        a, b = a / a.sum(), b / b.sum()
        return MMD_SCALE * float(a @ xx @ a + b @ yy @ b - 2.0 * a @ xy @ b)


def pairwise_distance(answers: Tensor) -> Tensor:
    """Mean distance between the S answers to each of B requests ``[S, B, ..., D]``, over all pairs: ``[B]``.

    Distances are Euclidean over the last axis; axes between (frames, joints) are averaged.
    """
    count, requests = answers.shape[:2]
    total = torch.zeros(requests, dtype=torch.float64)
    for first in range(count - 1):
        distance = (answers[first + 1 :] - answers[first]).norm(dim=-1).double()
        total += distance.reshape(count - 1 - first, requests, -1).mean(-1).sum(0)
    return (total / max(count * (count - 1) / 2, 1)).float()
