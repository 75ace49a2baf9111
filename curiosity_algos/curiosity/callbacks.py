"""A callback for Stable-Baselines3's own algorithms: what exploration has come to."""

from __future__ import annotations

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import unwrap_vec_wrapper

from curiosity_algos.curiosity.base import record_bonus
from curiosity_algos.curiosity.vec_env import BonusVecEnvWrapper
from curiosity_algos.evaluation.coverage import Coverage, coverage_grid
from curiosity_algos.evaluation.episodes import EpisodeRecord


class ExplorationCallback(BaseCallback):
    """Logs what this package's algorithms log: coverage, and of a `BonusVecEnvWrapper` the bonus.

    With each rollout it logs `coverage/...`, the cells that episodes have ended in, where
    environments give `info["behavior"]` as those of `curiosity_gym` do; `intrinsic/mean` and
    `intrinsic/max` of the steps since the last log; and the losses of the wrapper's last training.

    Args:
        verbose: As in SB3.

    Attributes:
        coverage: Its `reachable` and `all` are the shares of cells that were visited.
        first_success_timesteps: Timesteps when an episode first succeeded, or None.
        best_return: Highest return of an episode that a Monitor saw; -inf before the first.
    """

    def __init__(self, verbose: int = 0) -> None:
        super().__init__(verbose)
        self._episodes = EpisodeRecord(None)
        self._intrinsic: list[float] = []

    @property
    def coverage(self) -> Coverage:
        """See the class, as for the two below."""
        return self._episodes.coverage

    @property
    def first_success_timesteps(self) -> int | None:
        """Timesteps, or None."""
        return self._episodes.first_success_timesteps

    @property
    def best_return(self) -> float:
        """Highest return."""
        return self._episodes.best_return

    def _on_training_start(self) -> None:
        grid = coverage_grid(self.training_env)
        if grid != self.coverage.grid:
            self._episodes = EpisodeRecord(grid)

    def _on_step(self) -> bool:
        infos = self.locals["infos"]
        self._episodes.add(infos, self.locals["dones"], self.num_timesteps)
        self._intrinsic += [
            info["reward_intrinsic"] for info in infos if "reward_intrinsic" in info
        ]
        return True

    def _on_rollout_end(self) -> None:
        for name, share in self.coverage.shares.items():
            self.logger.record(f"coverage/{name}", share)
        if self._intrinsic:
            record_bonus(self.logger, np.array(self._intrinsic))
            self._intrinsic.clear()
        wrapper = unwrap_vec_wrapper(self.training_env, BonusVecEnvWrapper)
        for name, loss in ({} if wrapper is None else wrapper.metrics).items():
            self.logger.record(name, loss)
