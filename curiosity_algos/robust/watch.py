"""What happens between the rollouts of a training along demonstrations."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import torch as th
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from curiosity_algos.robust.demonstrations import Demonstration
from curiosity_algos.robust.imitation import Standardized, imitate
from curiosity_algos.robust.measure import N_STARTS, evaluate_starts, n_different
from curiosity_algos.robust.starts import GOOD, DemonstrationStarts
from curiosity_algos.sb3.settle import SMALLEST_LOG_STD, shrink_steps

SETTINGS: dict[str, Any] = {
    "n_steps": 256,
    "batch_size": 1024,
    "n_epochs": 6,
    "learning_rate": 3e-4,
    "clip_range": 0.2,
}
"""Of PPO."""
N_MORE, MORE_RATE = 10, 1e-4
"""Gradient steps between two rollouts, and their learning rate, which imitate further."""
SHRINKING = 1_200_000
"""Good timesteps in which steps shrink by 1 / e: a constant rate forgets, and one that shrinks
before learns no more."""
FARTHER = 4.0
"""Times as far as before the discount sees, at most, while steps shrink: near ones favor speed."""
LOG_STD = -0.5
"""Most of actions' draws, which shrink as steps do."""
TEST_INTERVAL, SHORT_INTERVAL = 250_000, 30_000
"""Good timesteps between two tests of whether the policy works; all of them, where one episode
tells it."""
NEARLY = 0.5
"""Timesteps are good if drawn actions succeed from fresh starts so much less than is asked for."""
STUCK = 2_000_000
"""Timesteps without a front further back than ever, which end the training."""


class Watch(BaseCallback):
    """Standardizes observations, imitates, shrinks steps and discounting, logs, ends the training.

    It remembers nothing from rollout to rollout that the model and `DemonstrationStarts` do not
    know, and changes them when a rollout begins: callbacks that save come before it.

    Args:
        starts: Of the episodes.
        env: To test the policy in.
        success: Share of starts that is enough.
        seed: Of the starts of the first test, and of what is imitated.
    """

    model: PPO

    def __init__(
        self,
        starts: DemonstrationStarts,
        env: gym.Env[Any, Any],
        *,
        success: float,
        seed: int,
    ) -> None:
        super().__init__()
        self.starts, self.env = starts, env
        self.success, self.seed = success, seed
        self.n = n_different(env, starts.demonstrations)
        self._is_over = False

    def _on_rollout_start(self) -> None:
        extractor = self.model.policy.features_extractor
        if isinstance(extractor, Standardized):
            extractor.settle()
        self._imitate()
        is_time = self._count()
        self._shrink()
        self._is_over = self._is_stuck() or (is_time and self._works())

    def _imitate(self) -> None:
        """Go on with what is ahead of the fronts: what PPO learns behind them unlearns it."""
        starts = self.starts
        ahead = [
            each.first(int(front))
            for each, front in zip(starts.demonstrations, starts.fronts, strict=True)
            if front > 0
        ]
        if ahead:
            seed = self.seed + self.model.num_timesteps
            imitate(self.model, ahead, n_steps=N_MORE, learning_rate=MORE_RATE, seed=seed)

    def _count(self) -> bool:
        """Count the steps of a good rollout; whether it is time to test the policy."""
        starts, rollout = self.starts, SETTINGS["n_steps"] * self.starts.num_envs
        timesteps = self.model.num_timesteps
        is_good = bool(timesteps) and starts.fresh_rate >= max(GOOD, self.success - NEARLY)
        starts.good_steps += rollout * is_good
        if self.n == 1:  # best actions come to the goal long before drawn ones do often
            return starts.fresh_rate > 0.0 and timesteps % SHORT_INTERVAL < rollout
        return is_good and starts.good_steps % TEST_INTERVAL < rollout

    def _shrink(self) -> None:
        share = math.exp(-self.starts.good_steps / SHRINKING)
        sizes = {name: SETTINGS[name] for name in ("learning_rate", "clip_range")}
        shrink_steps(self.model, share, **sizes)
        nearness = (1.0 - gamma_of(self.starts.demonstrations)) * max(share, 1.0 / FARTHER)
        self.model.gamma = self.model.rollout_buffer.gamma = 1.0 - nearness
        deviation = getattr(self.model.policy, "log_std", None)
        if isinstance(deviation, th.Tensor) and self.starts.good_steps:
            log_std = LOG_STD - self.starts.good_steps / SHRINKING
            with th.no_grad():  # what is drawn comes near to the best actions, which are tested
                deviation.clamp_(max=max(log_std, SMALLEST_LOG_STD))

    def _is_stuck(self) -> bool:
        if not is_stuck(self.starts):
            return False
        ahead = ", ".join(map(str, self.starts.fronts))
        warnings.warn(
            f"The front has not come further back in {STUCK:,} steps, {ahead} steps of the "
            "demonstrations are ahead of it: training ends with what there is. Longer actions, as "
            "of gymnasium.wrappers.RepeatAction, shorten demonstrations.",
            stacklevel=2,
        )
        return True

    def _works(self) -> bool:
        """Whether the policy succeeds as often as was asked for."""
        seed = self.seed + self.model.num_timesteps  # others than at the last test
        share = self._test(seed)
        if share >= self.success and self.n > 1:  # once may be luck
            share = min(share, self._test(seed + N_STARTS))
        self.logger.record("robust/tested", share)
        return share >= self.success

    def _test(self, seed: int) -> float:
        return evaluate_starts(self.model, self.env, self.n, seed=seed).share

    def _on_rollout_end(self) -> None:
        extractor = self.model.policy.features_extractor
        if isinstance(extractor, Standardized):
            seen = th.as_tensor(self.locals["rollout_buffer"].observations)
            extractor.observe(seen.flatten(0, 1).to(self.model.device))
        for name, value in progress_of(self.starts).items():
            self.logger.record(f"robust/{name}", value)

    def _on_step(self) -> bool:
        return not self._is_over


class FrontBar(BaseCallback):
    """A bar of timesteps, with the front and how often episodes succeed.

    It names no time that is left: most trainings end long before their budget.

    Args:
        starts: Of the episodes.
    """

    def __init__(self, starts: DemonstrationStarts) -> None:
        super().__init__()
        self.starts = starts

    def _on_training_start(self) -> None:
        self._bar = tqdm(
            total=self.locals["total_timesteps"],
            initial=self.model.num_timesteps,
            bar_format="{n_fmt} of {total_fmt} steps at most [{elapsed}, {rate_fmt}{postfix}]",
            unit=" steps",
            unit_scale=True,
        )

    def _on_step(self) -> bool:
        assert self._bar.total is not None  # the last rollout goes over it
        self._bar.update(min(self.model.num_timesteps, self._bar.total) - self._bar.n)
        return True

    def _on_rollout_end(self) -> None:
        progress = {name: f"{share:.0%}" for name, share in progress_of(self.starts).items()}
        self._bar.set_postfix(progress)

    def _on_training_end(self) -> None:
        self._bar.close()


def is_stuck(starts: DemonstrationStarts) -> bool:
    """Whether no front has come further back for so long that a training ends."""
    return starts.idle_steps >= STUCK


def gamma_of(demonstrations: Sequence[Demonstration]) -> float:
    """A discount that sees a third beyond the end of the longest demonstration, up to 2,000."""
    longest = max(len(each) for each in demonstrations)
    return float(np.clip(1.0 - 0.75 / longest, 0.99, 0.9995))


def progress_of(starts: DemonstrationStarts) -> dict[str, float]:
    """The share of demonstrations ahead of the front, and of episodes that succeed."""
    lengths = np.array([len(each) for each in starts.demonstrations])
    return {
        "front": float(np.mean(starts.fronts / lengths)),
        "near": float(starts.near.mean()),
        "fresh": starts.fresh_rate,
    }
