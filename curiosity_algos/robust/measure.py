"""Does a policy hold? The share of unseen starts from which it succeeds."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import torch as th
from gymnasium.vector import AutoresetMode
from scipy.stats import binomtest

from curiosity_algos.common.arrays import Array, Float64Array, Mask
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.evaluation.environments import MakeEnv
from curiosity_algos.evaluation.episode import actor, check_spaces, steps
from curiosity_algos.evaluation.found import is_success
from curiosity_algos.robust.demonstrations import Demonstration, follow, is_same
from curiosity_algos.sb3.gymnasium_vec_env import native_batch
from curiosity_gym import RecordEpisode
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.validation import check_at_least_one, check_bool, check_seed

N_STARTS = 100
"""Starts that a policy is tested from, unless a user says another number."""
N_COMPARED, N_WHOLE = 20, 6
"""Episodes, and steps of each, that are compared to see whether chance has a part in them; episodes
that take the actions of a demonstration."""
N_DIGITS = 6
"""Decimals of a return."""
UNSEEN = 10_000
"""The first seed of starts that no search has played, unless a user says another."""


@dataclass(frozen=True)
class Starts:
    """Episodes from starts that a policy had not seen.

    Attributes:
        success: (n,) whether each succeeded.
        returns: (n,) their returns.
    """

    success: Mask
    returns: Float64Array

    @property
    def share(self) -> float:
        """The share that succeeded."""
        return float(self.success.mean())

    @property
    def mean_return(self) -> float:
        """The mean of the returns, rounded as `best_return` and SB3's Monitor round."""
        return round(float(self.returns.mean()), N_DIGITS)

    @property
    def interval(self) -> tuple[float, float]:
        """Its 95 % confidence interval (Wilson 1927)."""
        return wilson(int(self.success.sum()), len(self.success))

    @property
    def counts(self) -> dict[str, int]:
        """The number of starts, and of those that succeeded, for a file."""
        return {"n": len(self.success), "success": int(self.success.sum())}

    def __str__(self) -> str:
        """In words."""
        return in_words(int(self.success.sum()), len(self.success))


def wilson(k: int, n: int) -> tuple[float, float]:
    """The 95 % confidence interval of a share, k of n (Wilson 1927)."""
    low, high = binomtest(k, n).proportion_ci(method="wilson")
    return float(low), float(high)


def in_words(k: int, n: int) -> str:
    """The number of starts from which a policy succeeded, and the interval of their share."""
    if n == 1:
        return f"{k} of 1 start"
    low, high = wilson(k, n)
    return f"{k} of {n} starts (95 % interval {low:.0%} to {high:.0%})"


def is_drawn(env: gym.Env[Any, Any], demonstrations: Sequence[Demonstration] = ()) -> bool:
    """Whether episodes of the same actions differ by the seeds of their resets.

    The actions are twenty random ones, and those of demonstrations: chance may come later.
    """
    actions = copy.deepcopy(env.action_space)
    actions.seed(UNSEEN)
    taken = np.array([actions.sample() for _ in range(N_COMPARED)])
    recorded = RecordEpisode(env)
    longer = (_differ(recorded, each.actions, N_WHOLE) for each in demonstrations)
    return _differ(recorded, taken, N_COMPARED) or any(longer)


def _differ(env: RecordEpisode, actions: Array, n: int) -> bool:
    first, *others = (follow(env, UNSEEN + i, actions) for i in range(n))
    return not all(
        each.total == first.total and is_same(each.observations, first.observations)
        for each in others
    )


def n_different(env: gym.Env[Any, Any], demonstrations: Sequence[Demonstration] = ()) -> int:
    """How many episodes to play: one if all are the same, see `is_drawn`."""
    return N_STARTS if is_drawn(env, demonstrations) else 1


def evaluate_starts(
    model: Any,
    env: gym.Env[Any, Any] | str | MakeEnv,
    n: int = N_STARTS,
    *,
    seed: int = UNSEEN,
    deterministic: bool = True,
) -> Starts:
    """Play one episode from each of `n` starts.

    Args:
        model: Anything with SB3's `predict`.
        env: A seeded environment, an id, or a function that makes an environment.
        n: Number of starts.
        seed: Of the first start; the others count up from there. Of drawn actions, too.
        deterministic: Whether the policy takes its best actions, or draws them as in training:
            of a policy that draws them the two may succeed from quite different shares.

    Raises:
        ValueError: If an argument is out of its range, `env` has other spaces than the model, or
            the model has a VecNormalize, without which it acts otherwise.

    Warns:
        UserWarning: If several episodes were asked for, and all seem to be the same.
    """
    check_at_least_one(n=n)
    check_seed(seed)
    check_bool(deterministic=deterministic)
    seed = int(seed)  # numpy's, too
    if not callable(getattr(model, "predict", None)):
        raise ValueError(f"`model` must have `predict`, got {type(model).__name__}.")
    if getattr(model, "get_vec_normalize_env", lambda: None)() is not None:
        raise ValueError(
            "`model` must see observations as `env` gives them, and a VecNormalize standardizes "
            "them: use Stable-Baselines3's evaluate_policy."
        )
    opened = _open(env)
    closed = nullcontext() if opened is env else closing(opened)
    device = th.device(getattr(model, "device", "cpu"))
    on_gpu = [device] if device.type == "cuda" else []
    # Small networks are slower on several threads.
    with closed, single_torch_thread(), th.random.fork_rng(devices=on_gpu):
        check_spaces(model, opened)
        if not deterministic:  # `torch.manual_seed` would seed GPUs that others use, too
            th.default_generator.manual_seed(seed)
            if on_gpu:
                th.cuda.manual_seed(seed)
        starts = _play(model, opened, n, seed, deterministic)
        if n > 1 and np.ptp(starts.returns) == 0.0 and not is_drawn(opened):
            warnings.warn(
                f"`env` seems to have one start: the {n} episodes gave the same return, and so did "
                f"{N_COMPARED} random steps from {N_COMPARED} starts. `start_radius` gives a "
                "CuriosityMaze others.",
                stacklevel=2,
            )
    return starts


def _open(env: Any) -> gym.Env[Any, Any]:
    opened = gym.make(env) if isinstance(env, str) else env
    opened = opened() if callable(opened) else opened
    if not isinstance(opened, gym.Env):
        raise ValueError(
            "`env` must be an id, an environment or a function that makes one, got "
            f"{type(env).__name__}."
        )
    return opened


def _play(model: Any, env: gym.Env[Any, Any], n: int, seed: int, deterministic: bool) -> Starts:
    if (envs := native_batch(env, n, AutoresetMode.NEXT_STEP)) is not None:
        with closing(envs):
            return _play_batch(model, envs, seed, deterministic)
    return play_each(model, env, n, seed, deterministic=deterministic)


def play_each(
    model: Any, env: gym.Env[Any, Any], n: int, seed: int, *, deterministic: bool = True
) -> Starts:
    """One episode after another, whose seeds count up; nothing that they observe is kept."""
    success, returns = np.zeros(n, dtype=np.bool_), np.zeros(n)
    for i in range(n):
        observation, _ = env.reset(seed=seed + i)
        act = actor(model, deterministic=deterministic)
        for reward, info in steps(env, observation, act):
            returns[i] += reward
            success[i] = is_success(info, float(returns[i]))
    return Starts(success, returns)


def _play_batch(model: Any, envs: EpisodicVectorEnv, seed: int, deterministic: bool) -> Starts:
    """One episode of each env, all at once."""
    is_open = np.ones(envs.num_envs, dtype=np.bool_)
    returns, success = np.zeros(envs.num_envs), ~is_open
    observations, _ = envs.reset(seed=seed)
    act = actor(model, envs.num_envs, deterministic=deterministic)
    while is_open.any():
        observations, rewards, terminated, truncated, infos = envs.step(act(observations))
        returns += rewards * is_open
        success |= is_open & infos["is_success"]
        is_open &= ~(terminated | truncated)
    return Starts(success, returns)
