"""Episodes that came to a reward, as their starts and their actions."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm

from curiosity_algos.algorithms.go_explore import GoExplore
from curiosity_algos.common.arrays import Array, Int64Array
from curiosity_algos.evaluation.episode import actor, check_spaces, steps
from curiosity_algos.evaluation.flat_spaces import stack
from curiosity_algos.evaluation.found import N_FOUND, is_success
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.sb3.callbacks import bonus_wrapper
from curiosity_algos.state import file
from curiosity_gym import RecordEpisode

Start = int | Mapping[str, Any]
"""The seed of a reset, or the state of the environment's generator before it."""
KIND = "demonstrations 2"


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

    def first(self, n: int) -> Demonstration:
        """The first n steps."""
        seen = self.observations
        is_dict = isinstance(seen, dict)
        first = {key: part[:n] for key, part in seen.items()} if is_dict else seen[:n]
        return replace(self, actions=self.actions[:n], observations=first)


def demonstrate(policy: Any, env: gym.Env[Any, Any], seed: int) -> Demonstration:
    """Play an episode by the best actions of anything that has `predict`."""
    observation, info = env.reset(seed=seed)
    return _play(env, seed, observation, info, actor(policy))


def follow(env: RecordEpisode, start: Start, actions: Array) -> Demonstration:
    """Play the episode of a start and its actions again."""
    steps = iter(actions)
    return _play(env, start, *env.begin(start), lambda _: next(steps, None))


def _play(
    env: gym.Env[Any, Any],
    start: Start,
    observation: Any,
    info: dict[str, Any],
    act: Callable[[Any], Any],
) -> Demonstration:
    actions, observations, total, success = [], [], 0.0, False

    def see_and_act(observation: Any) -> Any:
        action = act(observation)
        if action is not None:  # copied: some environments write into what they give or take
            observations.append(copy.deepcopy(observation))
            actions.append(copy.deepcopy(action))
        return action

    for reward, info in steps(env, observation, see_and_act):
        total += reward
        success = is_success(info, total)
    in_a_row = stack(env.observation_space, observations)
    return Demonstration(start, np.array(actions), in_a_row, total, success)


def demonstrations_of(source: Any, env: gym.Env[Any, Any]) -> list[Demonstration]:
    """Episodes that succeeded, played again: up to ten from different starts, the best first.

    Args:
        source: A population algorithm: its best policy plays, and policies that succeeded in other
            generations. A `GoExplore`. An algorithm of Stable-Baselines3 whose
            `BonusVecEnvWrapper` saw episodes succeed, or the wrapper's `found.episodes`. Or a
            Minari dataset: of its seeded episodes the best one is taken, and others of all returns.
        env: Environment like that of the source.

    Raises:
        ValueError: If there is none, or the source is of another kind.
    """
    recorded = env if isinstance(env, RecordEpisode) else RecordEpisode(env)
    different = _of_each_start(successful(list(_episodes(source, recorded))))
    # Where starts are drawn, the best ten would be those that began nearest to the goal.
    different.sort(key=lambda episode: -episode.total)
    return [different[i] for i in _from_first_to_last(len(different))]


def successful(episodes: Sequence[Demonstration]) -> list[Demonstration]:
    """Those that succeeded; ValueError if there is none."""
    found = [episode for episode in episodes if episode.success]
    if not found:
        raise ValueError(
            f"`model` must have found an episode that succeeds: {len(episodes)} were played again, "
            "and none did. An episode succeeds if its last info says `is_success`, or else if its "
            "return is above 0: `learn` for longer where one can. An environment that draws from "
            "elsewhere than its `np_random` plays no episode again, and a bonus remembers none but "
            "those of single environments in a DummyVecEnv."
        )
    return found


def is_same(one: Any, other: Any) -> bool:
    """Whether observations, or stacks of them, are the same in every bit."""
    if isinstance(one, dict):
        return all(is_same(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return all(map(is_same, one, other))
    return np.array_equal(one, other)


def _of_each_start(episodes: list[Demonstration]) -> list[Demonstration]:
    """The first of those that begin alike: others lead the same way, and each has a front."""
    kept: list[Demonstration] = []
    for episode in episodes:
        begins = episode.first(1).observations
        if not any(is_same(begins, other.first(1).observations) for other in kept):
            kept.append(episode)
    return kept


def _from_first_to_last(n: int) -> Int64Array:
    """Ten of n places, among them the first and the last."""
    return np.linspace(0, n - 1, min(n, N_FOUND)).round().astype(np.int64)


def _episodes(source: Any, env: RecordEpisode) -> Iterator[Demonstration]:
    if isinstance(source, GoExplore):
        source = source.episodes[:1]  # of one start
    if isinstance(source, EvolutionaryAlgorithm):
        check_spaces(source, env)
        return (demonstrate(policy, env, seed) for policy, seed in _policies(source))
    if hasattr(source, "iterate_episodes"):
        return (follow(env, *episode) for episode in _of_dataset(source))
    is_kept = isinstance(source, list) and all(isinstance(each, dict) for each in source)
    best = source if is_kept else _seen_by(source)
    return (follow(env, episode["start"], episode["actions"]) for episode in best)


def _seen_by(model: Any) -> list[dict[str, Any]]:
    wrapper = bonus_wrapper(model) if isinstance(model, BaseAlgorithm) else None
    if wrapper is None:
        raise ValueError(
            "`model` must be a population algorithm, an algorithm with a BonusVecEnvWrapper, a "
            f"list of demonstrations or a Minari dataset, got {type(model).__name__}."
        )
    return wrapper.found.episodes


def _policies(model: EvolutionaryAlgorithm) -> Iterator[tuple[MlpPolicy, int]]:
    """The policies to play, the best first, with the seeds of their episodes."""
    if model.best_episode_seed is not None:
        yield model.policy, model.best_episode_seed
    for parameters, seed in model._best.found.kept:
        policy = MlpPolicy(**model.policy._get_constructor_parameters())
        policy.vector[:] = parameters
        yield policy, seed


def _of_dataset(dataset: Any) -> list[tuple[int, Array]]:
    """The seeds and the actions of a Minari dataset's best episodes."""
    ids = range(dataset.total_episodes)
    seeds = [each.get("seed") for each in dataset.storage.get_episode_metadata(ids)]
    episodes = list(zip(seeds, dataset.iterate_episodes(ids), strict=True))
    seeded = [(seed, each) for seed, each in episodes if isinstance(seed, int | np.integer)]
    if not seeded:
        raise ValueError("`model` must be a dataset of episodes whose resets were seeded.")
    returns = np.array([np.sum(each.rewards) for _, each in seeded])
    ranked = np.argsort(-returns, kind="stable")
    ranked = ranked[returns[ranked] > 0.0] if returns.max() > 0.0 else ranked
    chosen = ranked[_from_first_to_last(len(ranked))]
    return [(int(seeded[i][0]), np.asarray(seeded[i][1].actions)) for i in chosen]


# -- the file -------------------------------------------------------------------------------------


def save_demonstrations(
    path: str | os.PathLike[str],
    demonstrations: Sequence[Demonstration],
    run: Mapping[str, Any] | None = None,
) -> None:
    """Write demonstrations, for `load_demonstrations`, and what describes the run of them."""
    state = {"episodes": [vars(each) for each in demonstrations]}
    file.save(path, KIND, dict(run or {}), state)


def load_demonstrations(
    path: str | os.PathLike[str],
) -> tuple[list[Demonstration], dict[str, Any]]:
    """Read demonstrations, and what describes the run of them.

    Raises:
        FileNotFoundError: If there is no such file.
        ValueError: If it is damaged.
    """
    run, state = file.read(path, KIND)
    return [Demonstration(**each) for each in state["episodes"]], run
