"""The fitness of a strategy with a motivation: returns and the motivation, weighted by phi.

phi is fixed, or adapted to what the search finds by the rule of NSRA-ES, with settings for runs of
tens to hundreds of generations: Conti et al. 2018, "Improving Exploration in Evolution Strategies
for Deep Reinforcement Learning via a Population of Novelty-Seeking Agents"
(https://arxiv.org/abs/1712.06560), algorithm 3.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Float64Array
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.state.check import check_like
from curiosity_gym.validation import check_share

ADAPTIVE = "adaptive"
HIGHEST = 0.8
"""The weight's first value, and its upper bound; 1 in the paper, where it can rank nobody: a
generation without reward would have no other fitness."""
STEP = 0.2
"""The step of an adaptation; .05 in the paper."""
PATIENCE = 3
"""Generations without a better return until the weight falls; 50 in the paper."""


def check_phi(phi: object) -> None:
    """Raise ValueError unless `phi` is a number from 0 to 1, or "adaptive"."""
    try:
        if not (isinstance(phi, str) and phi == ADAPTIVE):
            check_share(phi=phi)
    except ValueError:
        raise ValueError(f'`phi` must be from 0 to 1, or "{ADAPTIVE}", got {phi!r}.') from None


def standardize(values: Float64Array) -> Float64Array:
    """Values with mean 0 and deviation 1; all 0 where they do not differ."""
    deviation = values.std()
    # Equal values may leave a rounding in their deviation; dividing by it would invent a ranking.
    if deviation <= 1e-12 * max(1.0, float(np.abs(values).max())):
        return np.zeros_like(values)
    standardized: Float64Array = (values - values.mean()) / deviation
    return standardized


class Fitness:
    """`phi z(f_e) + (1 - phi) z(f_i)`, z standardizing within the generation (section 3).

    An adaptive phi rises by `STEP` with a better return, and falls by it after `PATIENCE`
    generations in a row without one.

    Args:
        phi: Weight of the extrinsic fitness, or "adaptive".
        no_reward: Stand-in for the extrinsic fitness while no individual of a generation has a
            reward: "ignore": none, the intrinsic fitness ranks alone; "random": noise, as in the
            paper.
        seed: Seed of the noise.
    """

    def __init__(self, phi: float | str, no_reward: str, seed: np.random.SeedSequence) -> None:
        self.phi = phi
        self.no_reward = no_reward
        self._rng = np.random.default_rng(seed)
        self._adapted = HIGHEST
        self._waited = 0
        self._best = -math.inf

    @property
    def weight(self) -> float:
        """Phi now."""
        return self._adapted if isinstance(self.phi, str) else self.phi

    def adapt(self, best_return: float) -> None:
        """Take in a generation's best return."""
        improved = best_return > self._best
        self._best = max(self._best, float(best_return))
        self._waited = 0 if improved else self._waited + 1
        if improved:
            self._move(STEP)
        elif self._waited >= PATIENCE:
            self._move(-STEP)
            self._waited = 0

    def forget(self) -> None:
        """Compare returns with none from here on: the next generation is a better one."""
        self._best = -math.inf

    def _move(self, step: float) -> None:
        if isinstance(self.phi, str):
            # Rounded, so that steps up and down meet at the same numbers, 0 among them.
            self._adapted = min(HIGHEST, max(0.0, round(self._adapted + step, 6)))

    def combine(self, extrinsic: Float64Array, intrinsic: Float64Array) -> Float64Array:
        """The fitness of each individual, shape (P,)."""
        if self.no_reward == "random" and not extrinsic.any():
            extrinsic = self._rng.standard_normal(len(extrinsic))
        return self.weight * standardize(extrinsic) + (1.0 - self.weight) * standardize(intrinsic)

    def state_dict(self) -> dict[str, Any]:
        """The adapted phi, the best return, the generations that it has waited, and the noise."""
        adapted = {"phi": self._adapted, "waited": self._waited, "best": self._best}
        return {**adapted, "rng": generator_state(self._rng)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; a number is the constructor's, whatever was saved."""
        check_like(state, self.state_dict() | {"best": -math.inf}, "fitness")
        check_share(phi=state["phi"])
        self._adapted, self._waited, self._best = state["phi"], state["waited"], state["best"]
        load_generator_state(self._rng, state["rng"])
