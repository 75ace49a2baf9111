"""A callback that shrinks the steps of an algorithm while it succeeds."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
import torch as th
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import ConstantSchedule, FloatSchedule

from curiosity_algos.evaluation.found import is_success
from curiosity_gym.validation import check_positive, check_share

SMALLEST_CLIP, SMALLEST_LOG_STD = 0.05, -3.0
"""Bounds of the clip range, and of the logarithm of the deviation of actions."""


class SettleCallback(BaseCallback):
    """Shrinks the steps of training while the policy succeeds, so that it keeps what it learned.

    A policy that has found the way to a sparse reward often loses it again: with steps of a
    constant size a bonus, or chance, can lead it away. While at least half of the last episodes
    succeed, every rollout shrinks the learning rate; of PPO also the clip range, towards 0.05; and
    of A2C and PPO the deviation of Gaussian actions, towards exp(-3). While fewer succeed, they
    stay as they are. What a policy does by then it will hardly do better later.

    The three belong to the model. They are therefore saved with it, and training that continues
    from a file goes on with them, and with what it knows of the last episodes: 100 unless
    `stats_window_size` says otherwise. An episode succeeds if its last info says so (`is_success`).
    In a task that reports no success it does if a Monitor below the bonus saw a return above 0: do
    not use this callback where every return is above 0.

    Args:
        timesteps: Steps of all environments in which the learning rate shrinks to 1 / e, above 0:
            about a fifth of the budget.
        success: Share of the last episodes from which on it shrinks, from 0 to 1.

    Raises:
        ValueError: If an argument is out of its range; when `learn` begins, if the learning rate or
            the clip range of the model is a schedule.
    """

    def __init__(self, timesteps: float = 60_000, *, success: float = 0.5) -> None:
        super().__init__()
        check_positive(timesteps=timesteps)
        check_share(success=success)
        self.timesteps = timesteps
        self.success = success

    def _init_callback(self) -> None:
        vars(self.model)["settle"] = self.timesteps  # for the description of a run
        # The model's, so that its file has it. Stable-Baselines3's own holds no failures of a task
        # whose infos name successes alone.
        ended: deque[bool] = deque(maxlen=self.model._stats_window_size)
        self._ended: deque[bool] = vars(self.model).setdefault("settle_ended", ended)

    def _on_training_start(self) -> None:
        clip_range = getattr(self.model, "clip_range", FloatSchedule(1.0)).value_schedule
        if callable(self.model.learning_rate):
            raise ValueError("`learning_rate` must be a number for SettleCallback, no schedule.")
        if not isinstance(clip_range, ConstantSchedule):
            raise ValueError("`clip_range` must be a number for SettleCallback, no schedule.")
        self._counted = self.model.num_timesteps
        if not self._counted:  # begun anew, as Stable-Baselines3's own statistics are
            self._ended.clear()

    def _on_rollout_start(self) -> None:  # what was collected has been learned from by now
        self._settle()

    def _on_training_end(self) -> None:
        self._settle()

    def _settle(self) -> None:
        n_steps = self.model.num_timesteps - self._counted
        self._counted += n_steps
        if self._succeeds():
            self._shrink(math.exp(-n_steps / self.timesteps))

    def _succeeds(self) -> bool:
        ended = self._ended
        return len(ended) == ended.maxlen and float(np.mean(ended)) >= self.success

    def _shrink(self, factor: float) -> None:
        learner: Any = self.model
        clip_range = learner.clip_range(1.0) if hasattr(learner, "clip_range") else None
        shrink_steps(learner, factor, learning_rate=learner.learning_rate, clip_range=clip_range)
        deviation = getattr(learner.policy, "log_std", None)
        if isinstance(deviation, th.Tensor):
            with th.no_grad():
                least = deviation.clamp(max=SMALLEST_LOG_STD)  # what is less already, stays
                deviation.copy_((deviation + math.log(factor)).maximum(least))

    def _on_step(self) -> bool:
        for info, done in zip(self.locals["infos"], self.locals["dones"], strict=True):
            if done and ("is_success" in info or "episode" in info):
                self._ended.append(is_success(info, info.get("episode", {"r": 0.0})["r"]))
        return True


def shrink_steps(
    model: Any, factor: float, *, learning_rate: float, clip_range: float | None
) -> None:
    """Put a factor of a learning rate in force, and a smaller clip range where there is one."""
    model.learning_rate = learning_rate * factor
    model._setup_lr_schedule()
    if clip_range is not None:
        shrunk = SMALLEST_CLIP + (clip_range - SMALLEST_CLIP) * factor
        model.clip_range = FloatSchedule(min(clip_range, shrunk))  # what is less already, stays
