"""Callbacks: logs of exploration, where episodes end, and checkpoints with a bonus."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CheckpointCallback
from stable_baselines3.common.vec_env import unwrap_vec_wrapper

from curiosity_algos.common.arrays import Float64Array
from curiosity_algos.common.kept import Kept
from curiosity_algos.evaluation.coverage import Coverage, Firsts, coverage_grid
from curiosity_algos.evaluation.rollouts import as_behaviors, check_finite, final_behaviors
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper
from curiosity_gym.core import CoverageGrid


class ExplorationCallback(BaseCallback):
    """Logs what this package's algorithms log: coverage, and of who trains a bonus its values.

    With each rollout and each episode it logs `coverage/...`, the cells that episodes have ended in
    and those that they visited on their way (`coverage/visited`), where environments give
    `info["behavior"]` as those of `curiosity_gym` do; and once they are known
    `time/first_reward` and `time/first_success`. It logs `intrinsic/mean` and
    `intrinsic/max` of the steps since the last log, and the losses of the last training of a
    `BonusVecEnvWrapper`; of a `BonusReplayBuffer` all are those of its last training.
    It warns where a model that has trained goes on with a new wrapper.

    Attributes:
        coverage: Its `reachable` and `all` are the shares of cells in which episodes ended, its
            `visited` that of the cells in which any step ended.
        coverage_shares: Every share that is logged under `coverage/`, by its name there.
        first_reward_timesteps: Timesteps when an episode that a Monitor saw first ended with a
            return above 0, or None: what there is to measure where a task reports no success.
        first_success_timesteps: Timesteps when an episode first succeeded, or None.
        best_return: Highest return of an episode that a Monitor saw; -inf before the first.
    """

    coverage_shares = Kept("coverage", "shares")
    first_reward_timesteps = Kept("_firsts", "reward")
    first_success_timesteps = Kept("_firsts", "success")

    def __init__(self, verbose: int = 0) -> None:
        super().__init__(verbose)
        self._begin(None)

    def _begin(self, grid: CoverageGrid | None) -> None:
        self.coverage, self.best_return, self._firsts = Coverage(grid), -math.inf, Firsts()

    def _on_training_start(self) -> None:
        _warn_of_a_new_wrapper(self.model)
        grid = coverage_grid(self.training_env)
        if grid != self.coverage.grid:
            self._begin(grid)

    def _on_step(self) -> bool:
        infos = self.locals["infos"]
        self.coverage.add_steps([info["behavior"] for info in infos if "behavior" in info])
        ended = [info for info, done in zip(infos, self.locals["dones"], strict=True) if done]
        if ended:  # off-policy algorithms log before their rollout ends
            self._count(ended)
            self._log_found()
        bonuses = [info["reward_intrinsic"] for info in infos if "reward_intrinsic" in info]
        if bonuses:
            largest = self.logger.name_to_value.get("intrinsic/max", -math.inf)
            self.logger.record("intrinsic/max", max(largest, *bonuses))
            self.logger.record_mean("intrinsic/mean", sum(bonuses) / len(bonuses))
        return True

    def _count(self, ended: list[dict[str, Any]]) -> None:
        """Count the episodes that ended with these infos."""
        with_behavior = [info for info in ended if "behavior" in info]
        if with_behavior and self.coverage.grid is not None:
            self.coverage.add(final_behaviors(with_behavior))
        returns = [float(info["episode"]["r"]) for info in ended if "episode" in info]
        success = [bool(info.get("is_success")) for info in ended]
        self._firsts.add(self.num_timesteps, np.array(returns), np.array(success))
        self.best_return = max([self.best_return, *returns])

    def _on_rollout_end(self) -> None:
        self._log_found()
        buffer = getattr(self.model, "replay_buffer", None)
        for learner in (bonus_wrapper(self.model), buffer):
            for name, value in getattr(learner, "metrics", {}).items():
                self.logger.record(name, value)

    def _log_found(self) -> None:
        shares = {f"coverage/{name}": share for name, share in self.coverage_shares.items()}
        for name, value in (shares | self._firsts.metrics).items():
            self.logger.record(name, value)

    def state_dict(self) -> dict[str, Any]:
        """Everything found so far, for a checkpoint."""
        return {
            "coverage": self.coverage.state_dict(),
            "best_return": self.best_return,
            "firsts": self._firsts.state_dict(),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave, once `learn` has begun."""
        self.coverage.load_state_dict(state["coverage"])
        self.best_return = state["best_return"]
        self._firsts.load_state_dict(state["firsts"])


class FinalBehaviors(BaseCallback):
    """Keeps the behavior that each episode ends with, of any algorithm: in a maze, where.

    Attributes:
        behaviors: (n, B) float64, of the n episodes that ended with an `info["behavior"]`, in their
            order; (0, 0) before the first.

    Raises:
        ValueError: During `learn`, if a behavior is not finite, or not as long as the first.
    """

    def __init__(self, verbose: int = 0) -> None:
        super().__init__(verbose)
        self._ended: list[Float64Array] = []

    @property
    def behaviors(self) -> Float64Array:
        """(n, B)."""
        return np.concatenate(self._ended or [np.empty((0, 0))])

    def _on_step(self) -> bool:
        steps = zip(self.locals["infos"], self.locals["dones"], strict=True)
        ended = [info["behavior"] for info, is_last in steps if is_last and "behavior" in info]
        if ended:
            begun = [each[0] for each in self._ended[:1]]
            behaviors = as_behaviors([*begun, *ended])[len(begun) :]  # all of one shape
            check_finite(behaviors)
            self._ended.append(behaviors)
        return True


class BonusCheckpointCallback(CheckpointCallback):
    """SB3's `CheckpointCallback`, which also saves the `BonusVecEnvWrapper` of the model.

    Beside `{name_prefix}_{timesteps}_steps.zip` there is a file for `BonusVecEnvWrapper.load`,
    `{name_prefix}_bonus_{timesteps}_steps.npz`. All arguments are SB3's.

    Raises:
        ValueError: When `learn` begins, if the model's environment has no such wrapper.
    """

    def _init_callback(self) -> None:
        if bonus_wrapper(self.model) is None:
            raise ValueError("`env` must be wrapped in a BonusVecEnvWrapper, it is not.")
        super()._init_callback()

    def _on_training_start(self) -> None:
        _warn_of_a_new_wrapper(self.model)

    def _on_step(self) -> bool:
        wrapper = bonus_wrapper(self.model)
        # The model comes second, so that wherever there is one its wrapper is there too.
        if wrapper is not None and self.n_calls % self.save_freq == 0:
            wrapper.save(self._checkpoint_path("bonus_", extension="npz"))
        return super()._on_step()


def bonus_wrapper(model: BaseAlgorithm) -> BonusVecEnvWrapper | None:
    """The `BonusVecEnvWrapper` that a model learns with, or None."""
    venv = model.get_env()
    return None if venv is None else unwrap_vec_wrapper(venv, BonusVecEnvWrapper)


def _warn_of_a_new_wrapper(model: BaseAlgorithm) -> None:
    """Warn if a model that has trained goes on with a wrapper that has seen no step."""
    wrapper = bonus_wrapper(model)
    is_new = wrapper is not None and wrapper.training and not len(wrapper.buffer)
    if is_new and (model.num_timesteps or model._n_updates):
        warnings.warn(
            "The model has trained, and its BonusVecEnvWrapper is new: its bonus begins anew. Wrap "
            "the environment with BonusVecEnvWrapper.load to go on with what was saved.",
            stacklevel=2,
        )
