"""Episodes of a trained policy, step by step."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.evaluation.environments import step_limit
from curiosity_algos.evaluation.vector import MAX_EPISODE_STEPS
from curiosity_algos.experiments.description import vec_wrappers
from curiosity_algos.experiments.run_folder import write_arrays
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper


class Step(NamedTuple):
    """The outcome of an action; the first is the reset's, which has none."""

    observation: Any
    action: Any
    reward: float
    info: dict[str, Any]


def episode(policy: BasePolicy, env: gym.Env[Any, Any], seed: int) -> Iterator[Step]:
    """One episode of a policy; of an environment without a limit, its first 10,000 steps."""
    observation, info = env.reset(seed=seed)
    yield Step(observation, None, 0.0, info)
    for _ in range(max(MAX_EPISODE_STEPS, step_limit(env) or 0)):
        action, _ = policy.predict(observation, deterministic=True)
        observation, reward, terminated, truncated, info = env.step(action)
        yield Step(observation, action, float(reward), info)
        if terminated or truncated:
            return


def can_be_played(env: VecEnv | None, spec: EnvSpec) -> bool:
    """Whether an environment can be made again in which the policy sees what it saw."""
    # A wrapper that keeps no record of its arguments cannot be made again.
    is_known = all(each.kwargs is not None for each in spec.additional_wrappers)
    sees_the_same = env is None or all(
        isinstance(each, BonusVecEnvWrapper) for each in vec_wrappers(env)
    )
    return is_known and sees_the_same


def write_trajectory(model: BaseAlgorithm, spec: EnvSpec, path: Path, seed: int = 0) -> None:
    """Play one episode of the best policy, and write it down.

    The file has `observations` (T + 1, O), `actions` (T, A), `rewards` (T,), and where the
    environment gives one in each step `behaviors` (T + 1, B).

    Args:
        model: Model whose policy acts.
        spec: How the environment is made.
        path: Place of the file.
        seed: Seed of the environment.
    """
    env = gym.make(spec)
    steps = list(episode(model.policy, env, seed))
    env.close()
    columns = {
        "observations": [step.observation for step in steps],
        "actions": [step.action for step in steps[1:]],
        "rewards": [step.reward for step in steps[1:]],
    }
    if all("behavior" in step.info for step in steps):
        columns["behaviors"] = [step.info["behavior"] for step in steps]
    write_arrays(path, {name: np.array(values) for name, values in columns.items()})
