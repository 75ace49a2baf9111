"""Episodes that came to a reward, as their starts and their actions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from curiosity_algos.common.arrays import Array
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.evaluation.vector import most_steps
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm

N_ELITES = 9
"""Elites of an archive that demonstrate beside the best policy: others add little but time."""


@dataclass(frozen=True)
class Demonstration:
    """An episode, and what it came to.

    Attributes:
        seed: Of its reset.
        actions: (T, ...), as the environment takes them.
        observations: T, each what was observed before an action.
        total: Its return.
        success: Whether its last info said `is_success`, or its return was above 0 if none said it.
    """

    seed: int
    actions: Array
    observations: list[Any]
    total: float
    success: bool

    def __len__(self) -> int:
        """Steps of the episode."""
        return len(self.actions)


def is_success(info: dict[str, Any], total: float) -> bool:
    """Whether an episode succeeded, by its last info, or else by its return."""
    return bool(info.get("is_success", total > 0.0))


def demonstrate(policy: Any, env: gym.Env[Any, Any], seed: int) -> Demonstration:
    """Play an episode by the best actions of anything that has `predict`."""
    observation, info = env.reset(seed=seed)
    actions, observations, total = [], [], 0.0
    for _ in range(most_steps(env)):
        action, _ = policy.predict(observation, deterministic=True)
        actions.append(action)
        observations.append(observation)
        observation, reward, terminated, truncated, info = env.step(action)
        total += float(reward)
        if terminated or truncated:
            break
    return Demonstration(seed, np.array(actions), observations, total, is_success(info, total))


def demonstrations_of(model: EvolutionaryAlgorithm, env: gym.Env[Any, Any]) -> list[Demonstration]:
    """Episodes of a search that succeeded: of its best policy, and of elites in other niches.

    Raises:
        ValueError: If none did.
    """
    played = (demonstrate(policy, env, seed) for policy, seed in _policies(model))
    found = [demonstration for demonstration in played if demonstration.success]
    if not found:
        raise ValueError(
            "`model` must have found an episode that succeeds: `learn` for longer, until "
            "`best_return` is above 0."
        )
    return found


def _policies(model: EvolutionaryAlgorithm) -> Iterator[tuple[MlpPolicy, int]]:
    """The policies to play, the best first, with the seeds of their episodes."""
    if model.best_episode_seed is not None:
        yield model.policy, model.best_episode_seed
    archive = getattr(model, "archive", None)
    elites = {} if archive is None else archive.data()
    if "seed" not in elites:
        return
    ranked = np.argsort(-elites["objective"], kind="stable")[1 : N_ELITES + 1]
    for i in ranked[elites["objective"][ranked] > 0.0]:
        policy = MlpPolicy(**model.policy._get_constructor_parameters())
        policy.vector[:] = elites["solution"][i]
        yield policy, int(elites["seed"][i])
