"""Episodes of a trained policy, step by step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from stable_baselines3.common.base_class import BaseAlgorithm

from curiosity_algos.experiments.run_folder import write_arrays


def play(model: BaseAlgorithm, spec: EnvSpec, path: Path, seed: int = 0) -> None:
    """Play one episode of the best policy, and write it down.

    The file has `observations` (T + 1, O), `actions` (T, A), `rewards` (T,), and where the
    environment gives one in each step `behaviors` (T + 1, B).

    Args:
        model: Whose `predict` acts.
        spec: Of the environment.
        path: Of the file.
        seed: Of the environment.
    """
    env = gym.make(spec)
    observation, info = env.reset(seed=seed)
    steps: dict[str, list[Any]] = {"observations": [observation], "actions": [], "rewards": []}
    behaviors, is_over = [info.get("behavior")], False
    while not is_over:
        action, _ = model.predict(observation, deterministic=True)
        observation, reward, terminated, truncated, info = env.step(action)
        is_over = terminated or truncated
        steps["observations"].append(observation)
        steps["actions"].append(action)
        steps["rewards"].append(reward)
        behaviors.append(info.get("behavior"))
    env.close()
    if all(behavior is not None for behavior in behaviors):
        steps["behaviors"] = behaviors
    write_arrays(path, {name: np.array(values) for name, values in steps.items()})
