"""Copies of a single environment, if they can be trusted."""

from __future__ import annotations

import copy
import random
import warnings
import weakref
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import zip_longest
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import torch as th

from curiosity_algos.evaluation.policies import Mlp
from curiosity_algos.evaluation.rollouts import Rollouts

N_COPIES = 16
"""Envs side by side, so that one call of the policy serves many of them."""
N_TRIAL_STEPS = 10
"""Steps of each of the four episodes in which two copies are tried out."""

Env = gym.Env[Any, Any]
Float64Array = npt.NDArray[np.float64]


def env_and_copies(env: Env, mlp: Mlp) -> tuple[list[Env], bool]:
    """The env beside copies of it; or the env alone, which is always right and only slower.

    It stays alone, without a word, where it renders, where it cannot be copied, and where a copy
    raises when it is reset and stepped. It also stays alone where two copies that take turns do not
    do what each does alone: their state is behind one handle (a physics server, a simulator, a
    closure), and a warning says so. An env that does not repeat an episode of the same seed and
    actions cannot be tried out in this way, and counts as one whose copies share nothing.

    Args:
        env: The environment. Only copies of it are reset and stepped here.
        mlp: The policies' shape, which says what actions there are.

    Returns:
        The envs, and whether others may play for them in other processes: not where one is watched,
        or two have been seen to do wrong.
    """
    if env.render_mode is not None:
        return [env], False
    try:
        tried = [copy.deepcopy(env) for _ in range(2)]
    except Exception:  # whatever an env of the user's raises, it can still be used alone
        return [env], True
    actions = _actions(mlp)
    with _trial():
        try:
            repeated = [_apart(tried, actions) for _ in range(2)]
        except Exception:  # the env may raise it, too, when it is used
            _keep_while_alive(env, tried)
            return [env], False
        are_independent = not _are_equal(*repeated) or _take_turns_as(repeated[0], tried, actions)
    if not are_independent:
        return alone([env, *tried]), False
    tried.clear()  # an env may be large
    return [env, *(copy.deepcopy(env) for _ in range(N_COPIES - 1))], True


def alone(envs: list[Env]) -> list[Env]:
    """The first of `envs` without its copies, which are not to be trusted; a warning says so."""
    env, *copies = envs
    _keep_while_alive(env, copies)
    warnings.warn(
        "Copies of `env` that take turns do not do what one does alone, as they share a state or "
        "lack what was changed in it, so policies are evaluated one after the other: to step "
        "several at once, pass a VectorEnv or a VecEnv of environments that are made separately.",
        stacklevel=2,
    )
    return [env]


def share_state(together: Rollouts, replay: Callable[[], Rollouts]) -> bool:
    """Whether whole episodes of copies that took turns are others than those of the env alone.

    An env that does not repeat its own episodes cannot tell, and counts as one that shares nothing.

    Args:
        together: Episodes of different policies, side by side.
        replay: Plays the last and the first of these policies again, in this order, alone.
    """
    with _unchanged_globals():
        played = _results(replay(), (0, 1))
        if _are_equal(played, _results(together, (-1, 0))):
            return False
        return _are_equal(played, _results(replay(), (0, 1)))


def are_same_episodes(one: Rollouts, other: Rollouts) -> bool:
    """Whether the same policies came to the same, bit for bit."""
    everyone = range(len(one))
    return np.array_equal(one.lengths, other.lengths) and _are_equal(
        [*_results(one, everyone), _visited(one)], [*_results(other, everyone), _visited(other)]
    )


def _visited(rollouts: Rollouts) -> tuple[npt.NDArray[Any], ...]:
    return () if rollouts.visited is None else (rollouts.visited,)


def _results(rollouts: Rollouts, policies: Iterable[int]) -> list[tuple[npt.NDArray[Any], ...]]:
    """All that the evaluator has of the episodes of some policies."""
    observations, _ = rollouts.trajectories
    parts = rollouts.returns, rollouts.success, rollouts.behaviors
    return [
        (*(part[i] for part in parts), observations[i, : rollouts.lengths[i] + 1]) for i in policies
    ]


@contextmanager
def _trial() -> Iterator[None]:
    """Leave no trace of what is tried out."""
    with _unchanged_globals(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the env that is used will give its own
        yield


def _apart(envs: list[Env], actions: list[npt.NDArray[Any]]) -> list[tuple[Float64Array, ...]]:
    """What the episodes of the envs show, one after the other."""
    return _rows([list(_episode(*pair)) for pair in zip(envs, actions, strict=True)])


def _take_turns_as(
    apart: list[tuple[Float64Array, ...]], envs: list[Env], actions: list[npt.NDArray[Any]]
) -> bool:
    """Whether the episodes are the same where the envs take turns."""
    try:
        together = _rows([_episode(*pair) for pair in zip(envs, actions, strict=True)])
    except Exception:  # such as that of a simulator that another env has reset
        return False
    return _are_equal(apart, together)


def _rows(episodes: Iterable[Iterable[Float64Array]]) -> list[tuple[Float64Array, ...]]:
    """What the episodes show at their reset, at their first step, and so on."""
    return list(zip_longest(*episodes, fillvalue=np.empty(0)))


def _are_equal(
    rows: list[tuple[npt.NDArray[Any], ...]], others: list[tuple[npt.NDArray[Any], ...]]
) -> bool:
    return len(rows) == len(others) and all(
        np.array_equal(*pair, equal_nan=True)
        for row, other in zip(rows, others, strict=True)
        for pair in zip(row, other, strict=True)
    )


def _actions(mlp: Mlp) -> list[npt.NDArray[Any]]:
    """Two different sequences of actions."""
    rng = np.random.default_rng(0)
    if mlp.is_discrete:
        return list(rng.integers(mlp.low.size, size=(2, N_TRIAL_STEPS)))
    shape = (2, N_TRIAL_STEPS, mlp.low.size)
    return list(rng.uniform(mlp.low, mlp.high, shape).astype(np.float32))


def _episode(env: Env, actions: npt.NDArray[Any]) -> Iterator[Float64Array]:
    """All that an evaluator reads of an episode, at its reset and at each step."""
    observation, info = env.reset(seed=0)
    yield _numbers(observation, info)
    for action in actions:
        observation, reward, terminated, truncated, info = env.step(action)
        yield _numbers(observation, info, reward, terminated, truncated)
        if terminated or truncated:
            return


def _numbers(observation: Any, info: dict[str, Any], *others: Any) -> Float64Array:
    behavior = info.get("behavior", ())
    is_success = info.get("is_success", False)
    parts = [np.ravel(part) for part in (observation, behavior, is_success, *others)]
    return np.concatenate(parts).astype(np.float64)


@contextmanager
def _unchanged_globals() -> Iterator[None]:
    """Leave the global generators, which an env may draw from, as they are."""
    states = random.getstate(), np.random.get_state(), th.get_rng_state()  # noqa: NPY002
    try:
        yield
    finally:
        random.setstate(states[0])
        np.random.set_state(states[1])  # noqa: NPY002
        th.set_rng_state(states[2])


def _keep_while_alive(env: Env, copies: list[Env]) -> None:
    """Let no copy be freed before `env`: it might close the handle that they share."""
    weakref.finalize(env, copies.clear).atexit = False
