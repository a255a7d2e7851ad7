"""Augmented random search with numpy alone (Mania, Guy and Recht 2018, arXiv:1803.07055), for the examples that train.

A linear policy of whitened figures is tried with small random changes and with their opposites, all at once, and moves
towards the better ones.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


class Policy:
    """A linear policy.

    Attributes:
        weights: (outputs, figures + 1), the last column is that of a constant.
        mean, variance: (figures,) of what was observed.
    """

    def __init__(self, num_outputs: int, num_figures: int) -> None:
        self.weights: Array = np.zeros((num_outputs, num_figures + 1))
        self.mean: Array = np.zeros(num_figures)
        self.variance: Array = np.ones(num_figures)
        self._num = 1e-4

    def apply(self, weights: Array, figures: Array) -> Array:
        """Return the outputs (n, outputs) of policies with weights (n, outputs, figures + 1), or all with one."""
        white = np.clip((figures - self.mean) / np.sqrt(self.variance + 1e-8), -5.0, 5.0)
        white = np.concatenate([white, np.ones((len(white), 1))], axis=1)
        return np.asarray(np.einsum("nij,nj->ni", np.broadcast_to(weights, (len(white), *self.weights.shape)), white))

    def whiten(self, figures: Array) -> None:
        """Take figures (n, figures) into mean and variance."""
        num, away = self._num + len(figures), figures.mean(axis=0) - self.mean
        both = self.variance * self._num + figures.var(axis=0) * len(figures)
        self.variance = (both + away * away * self._num * len(figures) / num) / num
        self.mean, self._num = self.mean + away * len(figures) / num, num

    def save(self, path: Path) -> None:
        """Write weights, mean and variance into an .npz file."""
        np.savez(path, weights=self.weights, mean=self.mean, variance=self.variance)

    def load(self, path: Path) -> None:
        """Read what `save` wrote."""
        saved = np.load(path)
        self.weights, self.mean, self.variance = saved["weights"], saved["mean"], saved["variance"]


def improve(
    policy: Policy,
    drive: Callable[[Array], tuple[Array, Array]],
    rng: np.random.Generator,
    *,
    directions: int,
    best: int,
    step: float,
    noise: float,
) -> float:
    """Move a policy one step; return the mean reward of the best changes.

    Args:
        policy: written in place.
        drive: takes weights (2 * directions, outputs, figures + 1); returns the rewards of these policies
            (2 * directions,), and all figures that they observed (m, figures).
        rng: chance.
        directions: changes that are tried.
        best: so many of them count.
        step: length of the step.
        noise: length of the changes.
    """
    changes = rng.normal(size=(directions, *policy.weights.shape))
    total, seen = drive(np.concatenate([policy.weights + noise * changes, policy.weights - noise * changes]))
    plus, minus = total[:directions], total[directions:]
    chosen = np.argsort(-np.maximum(plus, minus))[:best]
    spread = np.concatenate([plus[chosen], minus[chosen]]).std() + 1e-6
    policy.weights += step / (best * spread) * np.einsum("k,kij->ij", plus[chosen] - minus[chosen], changes[chosen])
    policy.whiten(seen)
    return float(np.maximum(plus, minus)[chosen].mean())
