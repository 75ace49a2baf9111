"""Which evaluator fits an environment."""

from __future__ import annotations

from typing import Any, Protocol

import gymnasium as gym
from gymnasium import wrappers
from gymnasium.vector import VectorEnv, VectorWrapper
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecEnvWrapper, VecMonitor

from curiosity_algos.evaluation.control import ControlEvaluator
from curiosity_algos.evaluation.environments import GymnasiumView, describe
from curiosity_algos.evaluation.maze import MazeEvaluator
from curiosity_algos.evaluation.policies import DEFAULT_NET_ARCH, Float32Array, Mlp, build_mlp
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.evaluation.vector import VectorEvaluator
from curiosity_gym.control.control_env import ControlEnv
from curiosity_gym.control.vector_env import ControlVectorEnv
from curiosity_gym.maze.dynamics import same_maze
from curiosity_gym.maze.maze_env import MazeEnv
from curiosity_gym.maze.vector_env import MazeVectorEnv
from curiosity_gym.validation import check_at_least_one

MadeEnv = gym.Env[Any, Any] | VectorEnv[Any, Any, Any] | VecEnv
AnyEnv = MadeEnv | str

_TRANSPARENT = (wrappers.OrderEnforcing, wrappers.PassiveEnvChecker)
"""Wrappers that change neither dynamics nor rewards nor observations."""
_OPAQUE = (
    "`env` is wrapped in {}, which the evaluators cannot see through: "
    "wrap each environment before it is vectorized instead."
)


class Evaluator(Protocol):
    """Parameters in, rollouts out."""

    n_parameters: int

    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """One episode of each policy.

        Args:
            parameters: (P, n_parameters)
            seed: Every episode's reset gets it, so that individuals are compared on equal terms;
                environments that draw nothing ignore it.
        """
        ...


def make_evaluator(
    env: AnyEnv, policy_kwargs: dict[str, Any] | None = None, n_threads: int | None = None
) -> Evaluator:
    """The fastest evaluator that fits `env`.

    Args:
        env: An id, a Gymnasium env or VectorEnv, or an SB3 VecEnv without wrappers.
        policy_kwargs: `net_arch`, widths of the hidden layers (default 32, 16).
        n_threads: Threads of the compiled evaluators; None: as many as there are processors.

    Raises:
        ValueError: If the env's spaces or its VecEnv wrappers are not supported, or another
            argument is out of its range.
    """
    if n_threads is not None:
        check_at_least_one(n_threads=n_threads)
    env = gym.make(env) if isinstance(env, str) else env
    observation_space, action_space = describe(env)
    net_arch = check_policy_kwargs(policy_kwargs)
    mlp = build_mlp(observation_space, action_space, net_arch)
    return _fastest(env, mlp, n_threads)


def check_policy_kwargs(policy_kwargs: dict[str, Any] | None) -> list[int]:
    """The hidden layers' widths.

    Raises:
        ValueError: If a key other than `net_arch` is there, or `net_arch` is no list.
    """
    if not isinstance(policy_kwargs, dict | None):
        raise ValueError(f"`policy_kwargs` must be a dictionary or None, got {policy_kwargs!r}.")
    given = dict(policy_kwargs or {})
    net_arch = given.pop("net_arch", DEFAULT_NET_ARCH)
    if given:
        raise ValueError(f"`policy_kwargs` may hold `net_arch` alone, got {sorted(given)} too.")
    if not isinstance(net_arch, list | tuple):
        raise ValueError(f"`net_arch` must be a list of layer widths, got {net_arch!r}.")
    return list(net_arch)


def _fastest(env: MadeEnv, mlp: Mlp, n_threads: int | None) -> Evaluator:
    if isinstance(env, GymnasiumView):
        return _fastest(env.vector_env, mlp, n_threads)
    if isinstance(env, VecMonitor):
        return _fastest(env.venv, mlp, n_threads)
    if isinstance(env, VecEnvWrapper):
        raise ValueError(_OPAQUE.format(type(env).__name__))
    if isinstance(env, VectorWrapper):
        raise ValueError(_OPAQUE.format(type(env).__name__))
    if type(env) is DummyVecEnv and _are_alike(env.envs):
        return _fastest(env.envs[0], mlp, n_threads)
    if isinstance(env, Monitor):
        # A monitor's spec cannot make copies of it; what it records is SB3's, not ours.
        return _fastest(env.env, mlp, n_threads)
    # Exactly these types: a subclass may step or reward in another way.
    bare = _bare(env)
    if type(bare) in (MazeEnv, MazeVectorEnv):
        return MazeEvaluator(bare.maze, mlp, n_threads)
    if type(bare) in (ControlEnv, ControlVectorEnv):
        return ControlEvaluator(bare.task, bare.horizon, mlp, n_threads)
    return VectorEvaluator(env, mlp)


def _are_alike(envs: list[gym.Env[Any, Any]]) -> bool:
    """Whether one env can stand for all: it is alone, or they are the same maze or task."""
    first, *others = [_bare(env.env if isinstance(env, Monitor) else env) for env in envs]
    return all(_is_same(first, other) for other in others)


def _is_same(env: Any, other: Any) -> bool:
    if type(env) is not type(other):
        return False
    if type(env) is MazeEnv:
        return same_maze(env.maze, other.maze)
    return type(env) is ControlEnv and env.horizon == other.horizon and env.task == other.task


def _bare(env: Any) -> Any:
    """The env within wrappers that change nothing, or the first wrapper that does."""
    while isinstance(env, gym.Wrapper) and type(env) in _TRANSPARENT:
        env = env.env
    return env
