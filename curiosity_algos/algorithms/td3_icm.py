"""TD3-ICM: Stable-Baselines3's TD3, rewarded by what an Intrinsic Curiosity Module cannot predict.

Fujimoto et al. 2018, "Addressing Function Approximation Error in Actor-Critic Methods"; Pathak et
al. 2017, "Curiosity-driven Exploration by Self-supervised Prediction"; the paper's section 4.4.
"""

from __future__ import annotations

import inspect
from typing import Any, Self

import numpy as np
from gymnasium import spaces
from stable_baselines3 import TD3
from stable_baselines3.common.callbacks import BaseCallback, ConvertCallback
from stable_baselines3.common.noise import ActionNoise, NormalActionNoise
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.type_aliases import MaybeCallback, Schedule
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.td3.policies import TD3Policy

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.common.kept import Kept
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.common.presets import preset_settings
from curiosity_algos.evaluation.arguments import check_keywords_known, check_order
from curiosity_algos.evaluation.environments import describe, env_id, open_env
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_algos.evaluation.flat_spaces import is_range
from curiosity_algos.loops.declared import whole_signature
from curiosity_algos.sb3.callbacks import ExplorationCallback
from curiosity_algos.sb3.observations import check_sb3_takes
from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer
from curiosity_algos.state.settings import HasSettings
from curiosity_gym.validation import check_at_least_one, check_keywords, check_not_negative

NET_ARCH = [32, 32]
NOISE = 0.1
"""Standard deviation of the action noise, in halves of the action space."""
BONUS_LEARNING_RATE = 6e-6
"""A faster module outruns the policy, and nothing is left to be curious of (4.4)."""


class TD3ICM(HasSettings, TD3):
    """Trains a deterministic policy on `reward + weight * bonus`, after each whole episode.

    This is Stable-Baselines3's TD3 with a `BonusReplayBuffer`, and the paper's settings. The buffer
    computes the bonus each time it samples a transition. After each rollout from `learning_starts`
    on the bonus is trained for `n_updates` steps, and then actor and critics for `gradient_steps`.

    Callbacks may change what they may change of TD3 (of the learning rate `lr_schedule` alone is in
    force), and the `weight`, `extrinsic` and `n_updates` of `replay_buffer`, which alone keeps
    them.

    Args:
        env: An environment id, a function that makes an environment, a Gymnasium env, or an SB3
            VecEnv. Actions must be a bounded Box, and episodes must end.
        policy: As in SB3; None: "MultiInputPolicy" of a Dict of observations, else "MlpPolicy".
        bonus: "apt", "disagreement", "icm", "ramp", "rnd", or a `Bonus` made for the environment's
            spaces, which this then trains.
        bonus_kwargs: Keywords of a bonus that is named; the `learning_rate` is 6e-6 here, other
            defaults are those of `BonusReplayBuffer`.
        weight: Factor of the bonus, at least 0: the paper's eta / 2.
        extrinsic: Whether the reward of the task counts; False: curiosity alone.
        n_updates: p, the bonus' gradient steps a rollout, on batches of `batch_size`.
        action_noise: As in SB3; None: normal with standard deviation .1.
        policy_kwargs: As in SB3; `net_arch` is 32, 32 unless it is among them, and Adam is fused
            unless another optimizer, or keywords of it, are.

    Further keywords are those of `TD3`.

    Attributes:
        exploration: The `ExplorationCallback` that observes the episodes since the model was made
            or loaded.
        preset: Name of the preset that the model was made from, or None.
        coverage: Share of the reachable cells in which episodes ended; None where there are none.
        best_return: Highest return of an episode; -inf before the first.
        first_success_timesteps: Timesteps when an episode first succeeded, or None.

    Raises:
        ValueError: If an argument of the bonus, a learning rate or the batch size is out of range,
            or the bonus does not fit the environment's spaces.
    """

    _settled = frozenset({"bonus", "bonus_kwargs", "weight", "extrinsic", "n_updates"})
    replay_buffer: BonusReplayBuffer
    preset: str | None = None
    coverage = Kept("exploration.coverage", "reachable")
    best_return, first_success_timesteps = Kept("exploration"), Kept("exploration")

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
        learning_rate: float | Schedule = 5e-5,
        learning_starts: int = 10_000,
        batch_size: int = 128,
        train_freq: int | tuple[int, str] = (1, "episode"),
        gradient_steps: int = -1,
        action_noise: ActionNoise | None = None,
        policy_kwargs: dict[str, Any] | None = None,
        _init_setup_model: bool = True,
        **td3: Any,
    ) -> None:
        check_order(self, env, policy or "MlpPolicy")
        check_keywords_known(type(self), td3.keys() - inspect.signature(TD3ICM).parameters.keys())
        check_keywords(bonus_kwargs=bonus_kwargs, policy_kwargs=policy_kwargs)
        check_at_least_one(batch_size=batch_size)
        if not callable(learning_rate):
            check_not_negative(learning_rate=learning_rate)
        env = open_env(env)
        if env is not None or _init_setup_model:  # SB3's `load` has read both
            observation_space, action_space = describe(env)
            _check_spaces(observation_space, action_space)
            is_dict = isinstance(observation_space, spaces.Dict)
            policy = policy or ("MultiInputPolicy" if is_dict else "MlpPolicy")
            action_noise = action_noise or _noise(action_space)
        if isinstance(bonus, str):
            bonus_kwargs = {"learning_rate": BONUS_LEARNING_RATE, **(bonus_kwargs or {})}
        policy_kwargs = {"net_arch": NET_ARCH, **(policy_kwargs or {})}
        if not policy_kwargs.keys() & {"optimizer_class", "optimizer_kwargs"}:
            policy_kwargs["optimizer_kwargs"] = {"fused": True}  # a sixth less time
        self.exploration = ExplorationCallback()
        super().__init__(
            policy,  # type: ignore[arg-type]  # never None where `load` has read it
            env,  # type: ignore[arg-type]  # nor this where there is a model to be made
            learning_rate=learning_rate,
            learning_starts=learning_starts,
            batch_size=batch_size,
            train_freq=train_freq,
            gradient_steps=gradient_steps,
            action_noise=action_noise,
            replay_buffer_class=BonusReplayBuffer,
            replay_buffer_kwargs={
                "bonus": bonus,
                "bonus_kwargs": bonus_kwargs or {},
                "weight": weight,
                "extrinsic": extrinsic,
                "gamma": None,
                "train_interval": None,
                "n_updates": n_updates,
                "batch_size": batch_size,
            },
            policy_kwargs=policy_kwargs,
            _init_setup_model=_init_setup_model,
            **td3,
        )

    @classmethod
    def from_preset(cls, preset: str, env: AnyEnv, **overrides: Any) -> Self:
        """Make a model with the settings of a preset, see `preset_settings`."""
        model = cls(env, **preset_settings(preset, TD3ICM.__name__, env_id(env), overrides))
        model.preset = preset
        return model

    @classmethod
    def load(cls, path: Any, *args: Any, **kwargs: Any) -> Self:
        """Load a model as SB3 does; what the replay buffer keeps is as it was saved.

        Raises:
            ValueError: If a keyword is one of those.
        """
        for name in sorted(cls._settled & kwargs.keys()):
            raise ValueError(f"`{name}` must stay as it was saved: {cls._way_on(name)}.")
        return super().load(path, *args, **kwargs)

    @staticmethod
    def _way_on(name: str) -> str:
        is_of_bonus = name in ("bonus", "bonus_kwargs")
        return "make a new model" if is_of_bonus else f"set `model.replay_buffer.{name}`"

    def train(self, gradient_steps: int, batch_size: int = 100) -> None:
        """Train the bonus, then actor and critics as SB3 does, on one torch thread."""
        with single_torch_thread():
            self.replay_buffer.train_bonus()
            super().train(gradient_steps, batch_size)
        for name, value in self.replay_buffer.metrics.items():
            self.logger.record(name, value)

    def _init_callback(self, callback: MaybeCallback, progress_bar: bool = False) -> BaseCallback:
        """The callbacks of the user, after the one that observes episodes."""
        every = callback if isinstance(callback, list) else [callback] if callback else []
        own = [each if isinstance(each, BaseCallback) else ConvertCallback(each) for each in every]
        return super()._init_callback([self.exploration, *own], progress_bar)

    @staticmethod
    def _wrap_env(env: Any, verbose: int = 0, monitor_wrapper: bool = True) -> VecEnv:
        return TD3._wrap_env(open_env(env), verbose, monitor_wrapper)

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "exploration"]


_WHOLE = whole_signature(TD3ICM, OffPolicyAlgorithm)
_OF_ITS_BUFFER = {"replay_buffer_class", "replay_buffer_kwargs", "optimize_memory_usage", "n_steps"}
TD3ICM.__signature__ = _WHOLE.replace(  # type: ignore[attr-defined]
    parameters=[p for name, p in _WHOLE.parameters.items() if name not in _OF_ITS_BUFFER]
)


def _check_spaces(observation_space: spaces.Space[Any], action_space: spaces.Space[Any]) -> None:
    check_sb3_takes(observation_space)
    is_vector = len(action_space.shape or ()) == 1 and spaces.flatdim(action_space) > 0
    is_float = np.issubdtype(action_space.dtype, np.floating)
    is_bounded = isinstance(action_space, spaces.Box) and is_range(action_space)
    if not (is_vector and is_float and is_bounded):
        raise ValueError(
            "`env` must have a bounded one-dimensional Box of actions, of floats, with `low` below "
            f"`high`, got {action_space}."
        )


def _noise(action_space: spaces.Space[Any]) -> NormalActionNoise:
    shape = action_space.shape or ()
    return NormalActionNoise(np.zeros(shape), np.full(shape, NOISE))
