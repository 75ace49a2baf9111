"""phi, the weight of the return beside a motivation: fixed, or adapted to what the search finds.

The rule is that of NSRA-ES, with settings for runs of tens to hundreds of generations:
Conti et al. 2018, "Improving Exploration in Evolution Strategies for Deep Reinforcement Learning
via a Population of Novelty-Seeking Agents" (https://arxiv.org/abs/1712.06560), algorithm 3.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

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


class Phi:
    """The weight of the return: a number, or one that rises while the best return does.

    "adaptive": a better return adds `STEP`; `PATIENCE` generations in a row without one take it
    away.
    """

    def __init__(self, phi: float | str) -> None:
        self.setting = phi
        self._adapted = HIGHEST
        self._waited = 0
        self._best = -math.inf

    @property
    def value(self) -> float:
        """The weight now."""
        return self._adapted if isinstance(self.setting, str) else self.setting

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
        if isinstance(self.setting, str):
            # Rounded, so that steps up and down meet at the same numbers, 0 among them.
            self._adapted = min(HIGHEST, max(0.0, round(self._adapted + step, 6)))

    def state_dict(self) -> dict[str, Any]:
        """The adapted weight, the best return, and for how many generations it has waited."""
        return {"phi": self._adapted, "waited": self._waited, "best": self._best}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; a number is the constructor's, whatever was saved."""
        check_like({name: state[name] for name in self.state_dict()}, Phi(0.0).state_dict(), "phi")
        check_share(phi=state["phi"])
        if math.isnan(state["best"]):
            raise ValueError("`best` must be a number.")
        self._adapted, self._waited, self._best = state["phi"], state["waited"], state["best"]
