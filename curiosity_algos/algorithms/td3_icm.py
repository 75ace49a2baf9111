"""TD3-ICM: Stable-Baselines3's TD3, rewarded by what an Intrinsic Curiosity Module cannot predict.

Fujimoto et al. 2018, "Addressing Function Approximation Error in Actor-Critic Methods"; Pathak et
al. 2017, "Curiosity-driven Exploration by Self-supervised Prediction"; the paper's section 4.4.
"""

from __future__ import annotations

import io
import pathlib
from contextlib import suppress
from typing import Any, TypedDict, Unpack

import numpy as np
import torch as th
from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.td3.policies import TD3Policy

from curiosity_algos.bonuses.base import Bonus, record_bonus, train
from curiosity_algos.bonuses.make import check_bonus_choice, make_bonus
from curiosity_algos.bonuses.views import View
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer
from curiosity_algos.sb3.resumable_td3 import ResumableTD3
from curiosity_gym.validation import (
    check_at_least_one,
    check_bool,
    check_keywords,
    check_not_negative,
)

NET_ARCH = [32, 32]
BONUS_LEARNING_RATE = 6e-6
"""With faster ones the module outruns the policy, and nothing is left to be curious of (4.4)."""


class _Keywords(TypedDict, total=False):
    tau: float
    gamma: float
    action_noise: ActionNoise | None
    policy_delay: int
    target_policy_noise: float
    target_noise_clip: float
    seed: int | None
    device: th.device | str
    verbose: int
    tensorboard_log: str | None
    stats_window_size: int
    _init_setup_model: bool


class TD3ICM(ResumableTD3):
    """Trains a deterministic policy on `reward + weight * bonus`, a whole episode at a time.

    The bonus is computed when a transition is sampled from the replay buffer, by the module as it
    has been trained so far. After each episode from `learning_starts` on the module is trained
    for `n_updates` steps, and actor and critic for as many as the episode had (section 4.4).

    Further keywords are those of TD3, see `ResumableTD3`.

    Args:
        bonus: "apt", "disagreement", "icm", "ramp", "rnd", or a `Bonus` made for the environment's
            spaces, which this then trains.
        bonus_kwargs: Keywords of a bonus that is named, see its class; the `learning_rate` is 6e-6
            here.
        weight: Factor of the bonus, at least 0: the paper's eta / 2.
        extrinsic: Whether the reward of the task counts; False: curiosity alone.
        n_updates: p, the bonus' gradient steps a rollout, on batches of `batch_size`.
        policy_kwargs: Keywords of the policy, as in SB3; `net_arch` is 32, 32 where it is not said.

    Raises:
        ValueError: If an argument is out of its range, or the env's spaces are not supported.
    """

    replay_buffer: BonusReplayBuffer

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[TD3Policy] | None = None,
        *,
        bonus: str | Bonus = "icm",
        bonus_kwargs: dict[str, Any] | None = None,
        weight: float = 0.5,
        extrinsic: bool = True,
        n_updates: int = 64,
        learning_rate: float = 5e-5,
        buffer_size: int = 1_000_000,
        learning_starts: int = 10_000,
        batch_size: int = 128,
        train_freq: int | tuple[int, str] = (1, "episode"),
        gradient_steps: int = -1,
        policy_kwargs: dict[str, Any] | None = None,
        **kwargs: Unpack[_Keywords],
    ) -> None:
        check_keywords(bonus_kwargs=bonus_kwargs, policy_kwargs=policy_kwargs)
        self.bonus = bonus
        self.bonus_kwargs = dict(bonus_kwargs or {})
        self.weight = weight
        self.extrinsic = extrinsic
        self.n_updates = n_updates
        super().__init__(
            env,
            policy,
            learning_rate=learning_rate,
            buffer_size=buffer_size,
            learning_starts=learning_starts,
            batch_size=batch_size,
            train_freq=train_freq,
            gradient_steps=gradient_steps,
            policy_kwargs={"net_arch": NET_ARCH, **(policy_kwargs or {})},
            **kwargs,
        )

    @property
    def trained_bonus(self) -> Bonus:
        """The bonus as trained so far; `bonus` is the argument that it was made by."""
        return self._bonus

    def _settings_of_parts(self) -> set[str]:
        return super()._settings_of_parts() | {"bonus", "bonus_kwargs"}

    def _check_settings(self) -> None:
        super()._check_settings()
        check_not_negative(weight=self.weight)
        check_bool(extrinsic=self.extrinsic)
        check_at_least_one(n_updates=self.n_updates, buffer_size=self.buffer_size)
        check_bonus_choice(self.bonus, self.bonus_kwargs)

    def _setup_model(self) -> None:
        super()._setup_model()
        if self.policy_kwargs.keys() & {"optimizer_class", "optimizer_kwargs"}:
            return
        # One call for all weights: a sixth less time. As a keyword it would be a setting of runs.
        for optimizer in (self.actor.optimizer, self.critic.optimizer):
            if type(optimizer) is th.optim.Adam:
                for group in optimizer.param_groups:
                    group["fused"] = True

    def _make_parts(self, seed: np.random.SeedSequence) -> BonusReplayBuffer:
        networks_seed, buffer_seed = seed.spawn(2)
        kwargs = {"learning_rate": BONUS_LEARNING_RATE, **self.bonus_kwargs}
        both = View(self.observation_space).space, self.action_space
        self._bonus = make_bonus(self.bonus, kwargs, *both, seed=networks_seed, device=self.device)
        return BonusReplayBuffer(
            self.buffer_size,
            self.observation_space,
            self.action_space,
            self.device,
            bonus=self._bonus,
            weight=self.weight,
            extrinsic=self.extrinsic,
            gamma=None,
            train_interval=None,
            seed=buffer_seed,
        )

    def _see_rollout(self, n_steps: int) -> None:
        curiosity = self.weight * self._bonus.score(*self.replay_buffer.newest(n_steps))
        self.replay_buffer.show_newest(n_steps)
        record_bonus(self.logger, curiosity)

    def _train_parts(self, batch_size: int) -> None:
        draw, n_updates = self.replay_buffer.sample_transitions, self.n_updates
        losses = train(self._bonus, draw, n_updates=n_updates, batch_size=batch_size)
        for name, loss in losses.items():
            self.logger.record(name, loss)

    def train(self, gradient_steps: int, batch_size: int = 100) -> None:
        """Train as SB3 does, but not to be interrupted in the midst of it."""
        buffer = self.replay_buffer
        buffer.weight, buffer.extrinsic = self.weight, self.extrinsic
        with buffer.drawn_ahead(gradient_steps, batch_size):  # after `_train_parts`
            super().train(gradient_steps, batch_size)

    def load_replay_buffer(
        self, path: str | pathlib.Path | io.BufferedIOBase, truncate_last_traj: bool = True
    ) -> None:
        """Load as SB3 does; bonus and weight stay the model's own. Only for files that you trust.

        Raises:
            ValueError: If the file holds no replay buffer of this class, or of other spaces.
        """
        own = self.replay_buffer
        with suppress(AssertionError):  # SB3's, of what is no buffer
            super().load_replay_buffer(path, truncate_last_traj)
        loaded, self.replay_buffer = self.replay_buffer, own
        if not isinstance(loaded, BonusReplayBuffer) or loaded.train_interval is not None:
            raise ValueError("`path` must be a replay buffer that TD3ICM has saved.")
        one, other = ((each.observation_space, each.action_space) for each in (loaded, own))
        if one != other:
            raise ValueError(
                "`path` must be a replay buffer of the model's spaces, it is of others."
            )
        vars(loaded).update(bonus=own.bonus, weight=own.weight, extrinsic=own.extrinsic)
        self.replay_buffer = loaded
