"""Coverage, best return and first success of algorithms that step a VecEnv themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Array
from curiosity_algos.evaluation.coverage import Coverage
from curiosity_algos.evaluation.rollouts import as_behaviors
from curiosity_gym.core import CoverageGrid


class EpisodeRecord:
    """Counts coverage, the best return and the first success over the steps of a VecEnv.

    Args:
        grid: Cells that coverage counts; None: nothing.

    Attributes:
        coverage: Of the behaviors that episodes ended with and those after each step, where infos
            have a "behavior".
        best_return: Highest return of an episode that a Monitor saw; -inf before the first.
        first_success_timesteps: Timesteps when an episode first succeeded, or None.
    """

    def __init__(self, grid: CoverageGrid | None) -> None:
        self.coverage = Coverage(grid)
        self.best_return = -np.inf
        self.first_success_timesteps: int | None = None

    def add(self, infos: Sequence[Mapping[str, Any]], dones: Array, num_timesteps: int) -> None:
        """Count one step of a VecEnv, `num_timesteps` of the run, and the episodes that ended."""
        ended = [info for info, done in zip(infos, dones, strict=True) if done]
        self.coverage.add_steps(_behaviors(infos))
        behaviors = _behaviors(ended)
        if behaviors and self.coverage.grid is not None:
            self.coverage.add(as_behaviors(behaviors))
        if self.first_success_timesteps is None and any(info.get("is_success") for info in ended):
            self.first_success_timesteps = num_timesteps
        returns = [float(info["episode"]["r"]) for info in ended if "episode" in info]
        self.best_return = max([self.best_return, *returns])

    def state_dict(self) -> dict[str, Any]:
        """All attributes, for a checkpoint."""
        return {
            "coverage": self.coverage.state_dict(),
            "best_return": self.best_return,
            "first_success_timesteps": self.first_success_timesteps,
        }

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave."""
        self.coverage.load_state_dict(state["coverage"])
        self.best_return = state["best_return"]
        self.first_success_timesteps = state["first_success_timesteps"]


def _behaviors(infos: Sequence[Mapping[str, Any]]) -> list[Any]:
    """Those of the infos that have one."""
    return [info["behavior"] for info in infos if "behavior" in info]
