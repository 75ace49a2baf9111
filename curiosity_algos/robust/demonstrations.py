"""Episodes that came to a reward, as their starts and their actions."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm

from curiosity_algos.algorithms.go_explore import GoExplore
from curiosity_algos.common.arrays import Array
from curiosity_algos.evaluation.flat_spaces import stack
from curiosity_algos.evaluation.found import N_FOUND, is_success
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.evaluation.vector import most_steps
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.sb3.callbacks import bonus_wrapper
from curiosity_algos.state import file
from curiosity_gym import RecordEpisode

Start = int | Mapping[str, Any]
"""The seed of a reset, or the state of the environment's generator before it."""
KIND = "demonstrations 1"


@dataclass(frozen=True)
class Demonstration:
    """An episode, and what it came to.

    Attributes:
        start: The seed of its reset, or the state of the environment's generator before it.
        actions: (T, ...), as the environment takes them.
        observations: (T, ...), what was observed before each action; of a Dict one for each key.
        total: Its return.
        success: Whether its last info said `is_success`, or its return was above 0 if none said it.
    """

    start: Start
    actions: Array
    observations: Any
    total: float
    success: bool

    def __len__(self) -> int:
        """Steps of the episode."""
        return len(self.actions)


def demonstrate(policy: Any, env: gym.Env[Any, Any], seed: int) -> Demonstration:
    """Play an episode by the best actions of anything that has `predict`."""
    observation, info = env.reset(seed=seed)
    return _play(env, seed, observation, info, actor(policy))


def follow(env: RecordEpisode, start: Start, actions: Array) -> Demonstration:
    """Play the episode of a start and its actions again."""
    steps = iter(actions)
    return _play(env, start, *env.begin(start), lambda _: next(steps, None))


def actor(policy: Any, n: int = 1) -> Callable[[Any], Any]:
    """The best actions of a policy in n episodes from their beginnings on, whose state it keeps."""
    memory: dict[str, Any] = {}

    def act(observations: Any) -> Any:
        actions, state = policy.predict(observations, deterministic=True, **memory)
        if state is not None:
            memory.update(state=state, episode_start=np.zeros(n, dtype=np.bool_))
        return actions

    return act


def _play(
    env: gym.Env[Any, Any],
    start: Start,
    observation: Any,
    info: dict[str, Any],
    act: Callable[[Any], Any],
) -> Demonstration:
    actions, observations, total = [], [], 0.0
    for _ in range(most_steps(env)):
        action = act(observation)
        if action is None:
            break
        actions.append(action)
        observations.append(observation)
        observation, reward, terminated, truncated, info = env.step(action)
        total += float(reward)
        if terminated or truncated:
            break
    success = is_success(info, total)
    in_a_row = stack(env.observation_space, observations)
    return Demonstration(start, np.array(actions), in_a_row, total, success)


def demonstrations_of(source: Any, env: gym.Env[Any, Any]) -> list[Demonstration]:
    """Episodes that succeeded, played again.

    Args:
        source: A population algorithm: its best policy and elites in other niches play. A
            `GoExplore`: its best episode. An algorithm of Stable-Baselines3 whose
            `BonusVecEnvWrapper` saw episodes succeed, or the wrapper's `found.episodes`. Or a
            Minari dataset: its best seeded episodes are taken.
        env: Environment like that of the source.

    Raises:
        ValueError: If there is none, or the source is of another kind.
    """
    recorded = env if isinstance(env, RecordEpisode) else RecordEpisode(env)
    played = list(_episodes(source, recorded))
    found = [episode for episode in played if episode.success]
    if not found:
        raise ValueError(
            f"`model` must have found an episode that succeeds: {len(played)} were played again, "
            "and none did. `learn` for longer. An environment that draws from elsewhere than its "
            "`np_random` plays no episode again, and a bonus remembers none but those of single "
            "environments in a DummyVecEnv."
        )
    return found


def _episodes(source: Any, env: RecordEpisode) -> Iterator[Demonstration]:
    if isinstance(source, GoExplore):
        source = source.episodes[:1]  # others lead the same way, and each has a front to move
    if isinstance(source, EvolutionaryAlgorithm):
        return (demonstrate(policy, env, seed) for policy, seed in _policies(source))
    if hasattr(source, "iterate_episodes"):
        return (follow(env, *episode) for episode in _of_dataset(source))
    best = source if isinstance(source, list) else _seen_by(source)
    return (follow(env, episode["start"], episode["actions"]) for episode in best)


def _seen_by(model: Any) -> list[dict[str, Any]]:
    wrapper = bonus_wrapper(model) if isinstance(model, BaseAlgorithm) else None
    if wrapper is None:
        raise ValueError(
            "`model` must be a population algorithm, an algorithm with a BonusVecEnvWrapper, "
            f"demonstrations or a Minari dataset, got {type(model).__name__}."
        )
    return wrapper.found.episodes


def _policies(model: EvolutionaryAlgorithm) -> Iterator[tuple[MlpPolicy, int]]:
    """The policies to play, the best first, with the seeds of their episodes."""
    if model.best_episode_seed is not None:
        yield model.policy, model.best_episode_seed
    archive = getattr(model, "archive", None)
    elites = {} if archive is None else archive.data()
    if "seed" not in elites:
        return
    ranked = np.argsort(-elites["objective"], kind="stable")[1:N_FOUND]
    for i in ranked[elites["objective"][ranked] > 0.0]:
        policy = MlpPolicy(**model.policy._get_constructor_parameters())
        policy.vector[:] = elites["solution"][i]
        yield policy, int(elites["seed"][i])


def _of_dataset(dataset: Any) -> list[tuple[int, Array]]:
    """The seeds and the actions of a Minari dataset's best episodes."""
    ids = range(dataset.total_episodes)
    seeds = [each.get("seed") for each in dataset.storage.get_episode_metadata(ids)]
    episodes = list(zip(seeds, dataset.iterate_episodes(ids), strict=True))
    seeded = [(seed, each) for seed, each in episodes if isinstance(seed, int | np.integer)]
    if not seeded:
        raise ValueError("`model` must be a dataset of episodes whose resets were seeded.")
    seeded.sort(key=lambda episode: -float(np.sum(episode[1].rewards)))
    return [(int(seed), np.asarray(each.actions)) for seed, each in seeded[:N_FOUND]]


# -- the file -------------------------------------------------------------------------------------


def save_demonstrations(
    path: str | os.PathLike[str], demonstrations: Sequence[Demonstration]
) -> None:
    """Write demonstrations, for `load_demonstrations`."""
    file.save(path, KIND, {}, {"episodes": [vars(each) for each in demonstrations]})


def load_demonstrations(path: str | os.PathLike[str]) -> list[Demonstration]:
    """Read demonstrations.

    Raises:
        FileNotFoundError: If there is no such file.
        ValueError: If it is damaged.
    """
    return [Demonstration(**each) for each in file.read(path, KIND)[1]["episodes"]]
