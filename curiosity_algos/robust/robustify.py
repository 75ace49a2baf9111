"""From found episodes to a policy that works from any start."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback, ConvertCallback
from stable_baselines3.common.type_aliases import MaybeCallback
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.common.networks import single_torch_thread, torch_device
from curiosity_algos.evaluation.environments import FactoryVecEnv, MakeEnv
from curiosity_algos.evaluation.evaluator import check_constant
from curiosity_algos.evaluation.flat_spaces import is_vector
from curiosity_algos.robust.demonstrations import Demonstration, demonstrations_of, successful
from curiosity_algos.robust.imitation import Standardized, imitate, standardize
from curiosity_algos.robust.starts import DemonstrationStarts, FreshMonitor
from curiosity_algos.robust.watch import LOG_STD, SETTINGS, FrontBar, Watch, gamma_of
from curiosity_algos.sb3.gymnasium_vec_env import open_batch
from curiosity_gym import RecordEpisode
from curiosity_gym.validation import check_positive, check_seed, check_share

N_ENVS = 32
N_STEPS = 3_000
"""Gradient steps that imitate to begin with."""
POLICY_KWARGS: dict[str, Any] = {
    "net_arch": [128, 128],
    "log_std_init": LOG_STD,
    "features_extractor_class": Standardized,
}
"""Of observations that are vectors; others are not standardized."""
RETURN = 6.0
"""Of demonstrations, as PPO is rewarded: much below one is lost in the noise of its values."""
LARGEST_SCALE = 100.0


def robustify(
    model: Any,
    env: str | MakeEnv | None = None,
    *,
    total_timesteps: float = 1e7,
    success: float = 0.95,
    seed: int | None = None,
    device: th.device | str = "auto",
    callback: MaybeCallback = None,
    progress_bar: bool = False,
    tensorboard_log: str | None = None,
    verbose: int = 0,
) -> PPO:
    """Train a policy that succeeds from any start, by episodes that succeeded from one.

    The second phase of Go-Explore (Ecoffet et al. 2021): PPO begins by imitating the episodes.
    Its own begin near their ends first, see `DemonstrationStarts`, and further back as they
    succeed. Once some of the fresh episodes do, its steps shrink and it is tested, until it
    succeeds as often as was asked for. A success pays it at least what a demonstration's last step
    does, however late it comes.

    `curiosity robustify` keeps the training in a folder, and continues it there.

    Args:
        model: What has found episodes, see `demonstrations_of`; or demonstrations, of which those
            that succeeded count.
        env: Id of the environment, or a function that makes it; None: that of the model.
        total_timesteps: Environment steps at most.
        success: Share of unseen starts that ends the training, in (0, 1].
        seed: Of all draws; None: fresh entropy.
        device: Where the networks are, as in SB3.
        callback: SB3 callbacks.
        progress_bar: Show a bar of timesteps, with the front and the success of fresh starts.
        tensorboard_log: As in SB3.
        verbose: As in SB3.

    Returns:
        The model of Stable-Baselines3. Its policy takes observations as they are. Its learning
        rate, clip range and discount are those of its last step.

    Raises:
        ValueError: If no episode succeeded, one does not come to the same again, or an argument is
            out of its range.

    Warns:
        UserWarning: If no front has come further back in two million steps: that ends the training.
    """
    check_training(success, seed, device, total_timesteps=total_timesteps)
    callbacks = as_list(callback)
    make = maker_of(model, env)
    training = Training(
        make,
        _demonstrations(model, make),
        success=success,
        seed=seed,
        device=device,
        tensorboard_log=tensorboard_log,
        verbose=verbose,
    )
    with ExitStack() as stack:
        stack.callback(training.env.close)
        training.begin()
        training.learn(total_timesteps, callbacks, progress_bar=progress_bar)
        stack.pop_all()  # the model steps them further
    return training.model


def check_training(
    success: float, seed: int | None, device: th.device | str, **timesteps: float
) -> None:
    """Raise ValueError unless a training can have these."""
    torch_device(device)
    check_positive(**timesteps, success=success)
    check_share(success=success)
    check_seed(seed)


def _demonstrations(model: Any, make: MakeEnv) -> Sequence[Demonstration]:
    given = [model] if isinstance(model, Demonstration) else model
    if isinstance(given, Sequence) and all(isinstance(each, Demonstration) for each in given):
        return successful(given)
    with closing(make()) as env:
        return demonstrations_of(model, env)


def maker_of(model: Any, env: str | MakeEnv | None) -> MakeEnv:
    """A function that makes the environment of a model, or the one that is given."""
    if isinstance(env, str):
        return partial(gym.make, env)
    if callable(env):
        return env
    source = model if env is None else None
    own: VecEnv | None = getattr(source, "env", None)
    if isinstance(own, FactoryVecEnv):
        make: MakeEnv = own.make
        return make
    spec = getattr(source, "env_spec", None) if own is None else own.get_attr("spec")[0]
    if spec is None:
        raise ValueError("`env` must be an id, or a function that makes the environment.")
    wrappers = tuple(wrapper for wrapper in spec.additional_wrappers if wrapper.name != "Monitor")
    if unknown := [wrapper.name for wrapper in wrappers if wrapper.kwargs is None]:
        raise ValueError(
            "`env` must be a function that makes the environment: Gymnasium cannot make a "
            f"{unknown[0]} again, which does not inherit from RecordConstructorArgs."
        )
    return partial(gym.make, replace(spec, additional_wrappers=wrappers))


class Training:
    """PPO that starts along demonstrations.

    All that it remembers from rollout to rollout is in the model and in `starts`: a callback that
    saves both when a rollout begins saves all of it.

    Args:
        make: Makes the environment.
        demonstrations: At least one.
        success: Share of unseen starts that ends the training.
        seed: Of all draws.
        device: As in SB3.
        tensorboard_log: As in SB3.
        verbose: As in SB3.

    Attributes:
        model: The PPO; replace it by one that was saved to continue.
        starts: The environments, in `env` with a `FreshMonitor`.
    """

    def __init__(
        self,
        make: MakeEnv,
        demonstrations: Sequence[Demonstration],
        *,
        success: float,
        seed: int | None,
        **learner: Any,
    ) -> None:
        self._make, self._success = make, success
        seeds = np.random.SeedSequence(seed).generate_state(4) >> 1
        ppo_seed, starts_seed, self._imitation_seed, self._test_seed = (int(s) for s in seeds)
        with ExitStack() as stack:
            venv = open_batch(make, N_ENVS)
            stack.callback(venv.close)
            check_constant(venv)
            if np.any(np.asarray(getattr(venv.action_space, "start", 0))):
                raise ValueError(f"`env` must take actions from 0 on, got {venv.action_space}.")
            self.starts = DemonstrationStarts(venv, demonstrations, seed=starts_seed)
            # Where a success is known by `is_success` alone, it is paid.
            is_paid = any(each.total for each in demonstrations)
            last = self.starts.last_reward if is_paid else 1.0
            scale = _scale(demonstrations) if is_paid else RETURN
            self.env = FreshMonitor(self.starts, last, scale=scale)
            gamma = gamma_of(demonstrations)
            with single_torch_thread():  # orthogonal weights, too, differ in last bits with more
                self.model = _make_ppo(self.env, gamma, seed=ppo_seed, **learner)
            stack.pop_all()

    def begin(self) -> None:
        """Imitate the demonstrations."""
        with single_torch_thread():
            demonstrations = self.starts.demonstrations
            standardize(self.model, demonstrations)
            imitate(self.model, demonstrations, n_steps=N_STEPS, seed=self._imitation_seed)

    def learn(
        self, total_timesteps: float, callback: MaybeCallback = None, *, progress_bar: bool = False
    ) -> None:
        """Train until the model has taken so many steps, or works."""
        rest = max(0, int(total_timesteps) - self.model.num_timesteps)
        with closing(RecordEpisode(self._make())) as env, single_torch_thread():
            watch = Watch(self.starts, env, success=self._success, seed=self._test_seed)
            bars: list[BaseCallback] = [FrontBar(self.starts)] if progress_bar else []
            callbacks = [*as_list(callback), watch, *bars]
            self.model.learn(rest, callbacks, reset_num_timesteps=False)


def as_list(callback: MaybeCallback) -> list[BaseCallback]:
    """Callbacks as a list; ValueError if it is none."""
    if callback is None or isinstance(callback, list):
        return callback or []
    if not callable(callback) and not isinstance(callback, BaseCallback):
        raise ValueError(
            f"`callback` must be one of SB3's, a list or a function, got {callback!r}."
        )
    return [callback if isinstance(callback, BaseCallback) else ConvertCallback(callback)]


def _make_ppo(venv: VecEnv, gamma: float, **learner: Any) -> PPO:
    space = venv.observation_space
    policy_kwargs = dict(POLICY_KWARGS)
    if not (is_vector(space) and np.issubdtype(space.dtype, np.floating)):
        del policy_kwargs["features_extractor_class"]
    name = "MultiInputPolicy" if isinstance(space, spaces.Dict) else "MlpPolicy"
    return PPO(name, venv, policy_kwargs=policy_kwargs, gamma=gamma, **SETTINGS, **learner)


def _scale(demonstrations: Sequence[Demonstration]) -> float:
    """What rewards are multiplied by, so that returns are of the size of `RETURN` on average."""
    mean = float(np.mean([abs(each.total) for each in demonstrations]))
    return min(RETURN / mean, LARGEST_SCALE) if mean > 0.0 else 1.0
