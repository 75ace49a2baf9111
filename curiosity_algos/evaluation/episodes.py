"""What episodes have found: first reward, first success, best return and coverage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Array, Float64Array, Int64Array, Mask
from curiosity_algos.evaluation.coverage import Coverage
from curiosity_algos.evaluation.rollouts import final_behaviors
from curiosity_gym.core import CoverageGrid


class Firsts:
    """When an episode first had a reward, and when one first was a success.

    Attributes:
        reward: Timesteps when an episode first ended with a return above 0, or None. This says
            something of sparse rewards: CartPole pays for every step, Pendulum for none.
        success: Timesteps when an episode first ended with `info["is_success"]`, or None.
    """

    def __init__(self) -> None:
        self.reward: int | None = None
        self.success: int | None = None

    def add(self, ends: int | Int64Array, returns: Float64Array, success: Mask) -> None:
        """Count episodes: returns (n,) and successes (m,), and the timesteps at their ends."""
        for name, is_first in {"reward": returns > 0.0, "success": success}.items():
            if getattr(self, name) is None and is_first.any():
                at = np.broadcast_to(ends, is_first.shape)[np.argmax(is_first)]
                setattr(self, name, int(at))

    @property
    def metrics(self) -> dict[str, int]:
        """The known ones by their names in a log."""
        return {f"time/first_{name}": at for name, at in vars(self).items() if at is not None}

    def state_dict(self) -> dict[str, int | None]:
        """Both numbers, for a checkpoint."""
        return dict(vars(self))

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave."""
        firsts = state["reward"], state["success"]
        if not all(isinstance(first, int | None) for first in firsts):
            raise ValueError("`reward` and `success` must be timesteps, or None.")
        self.reward, self.success = firsts


class EpisodeRecord:
    """Counts what episodes find, from the steps of a VecEnv.

    Args:
        grid: The grid of coverage; None: it counts nothing.

    Attributes:
        coverage: The cells of the behaviors in infos, at the ends of episodes and after each step.
        best_return: Highest return of an episode that a Monitor saw; -inf before the first.
        firsts: First reward, of an episode that a Monitor saw, and first success.
    """

    def __init__(self, grid: CoverageGrid | None) -> None:
        self.coverage = Coverage(grid)
        self.best_return = -np.inf
        self.firsts = Firsts()

    def add(self, infos: Sequence[Mapping[str, Any]], dones: Array, num_timesteps: int) -> None:
        """Count one step of a VecEnv, `num_timesteps` of the run, and the episodes that ended."""
        ended = [info for info, done in zip(infos, dones, strict=True) if done]
        self.coverage.add_steps([info["behavior"] for info in infos if "behavior" in info])
        with_behavior = [info for info in ended if "behavior" in info]
        if with_behavior and self.coverage.grid is not None:
            self.coverage.add(final_behaviors(with_behavior))
        if not ended:
            return
        returns = [float(info["episode"]["r"]) for info in ended if "episode" in info]
        success = [bool(info.get("is_success")) for info in ended]
        self.firsts.add(num_timesteps, np.array(returns), np.array(success))
        self.best_return = max([self.best_return, *returns])

    def state_dict(self) -> dict[str, Any]:
        """All attributes, for a checkpoint."""
        return {
            "coverage": self.coverage.state_dict(),
            "best_return": self.best_return,
            "firsts": self.firsts.state_dict(),
        }

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave."""
        self.coverage.load_state_dict(state["coverage"])
        self.best_return = state["best_return"]
        self.firsts.load_state_dict(state["firsts"])
