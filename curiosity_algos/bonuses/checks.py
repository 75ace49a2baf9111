"""Is a bonus right? Small worlds whose answers can be written down, for any `Bonus`.

`check_bonus` and `check_episodes` raise AssertionError with the figure that is wrong, much as
Gymnasium's `check_env` does. `learn_tiny_mdp` gives the figures themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.common.arrays import Array, Float64Array, Int64Array
from curiosity_algos.common.networks import single_torch_thread

MakeBonus: TypeAlias = "Callable[[spaces.Box[Any], spaces.Discrete[Any]], Bonus]"

N_STATES, N_ACTIONS, N_ENTRIES = 20, 3, 6


def tiny_mdp(seed: int = 0) -> tuple[Array, ...]:
    """All 60 transitions of 20 states and 3 actions, three in a row of each state, as `score` has.

    States are random vectors; the first ten lead to one another and so do the last ten, at random.
    """
    rng = np.random.default_rng(seed)
    states = rng.normal(0.0, 1.0, (N_STATES, N_ENTRIES)).astype(np.float32)
    half = N_STATES // 2
    successors = rng.integers(0, half, (N_STATES, N_ACTIONS))
    successors[half:] += half
    before = np.repeat(np.arange(N_STATES), N_ACTIONS)
    actions = np.tile(np.arange(N_ACTIONS), N_STATES)
    return states[before], actions, states[successors[before, actions]]


@dataclass(frozen=True)
class Learned:
    """Mean bonus while a bonus is trained.

    Attributes:
        n_updates: Gradient steps so far, (n,).
        seen: Mean bonus of what it is trained on, (n,).
        unseen: Mean bonus of the rest, (n,).
    """

    n_updates: Int64Array
    seen: Float64Array
    unseen: Float64Array


def learn_tiny_mdp(make_bonus: MakeBonus, n_updates: int = 3000, seed: int = 0) -> Learned:
    """Train a bonus on the transitions of the first ten states, and watch it on all.

    Args:
        make_bonus: Makes it for a Box of 6 entries and 3 discrete actions.
        n_updates: Gradient steps, of all 30 transitions each.
        seed: Of the MDP.
    """
    seen, unseen = zip(*(np.split(each, 2) for each in tiny_mdp(seed)), strict=True)
    bonus = make_bonus(spaces.Box(-np.inf, np.inf, (N_ENTRIES,)), spaces.Discrete(N_ACTIONS))
    before, actions, after = map(th.from_numpy, seen)
    bonus.observe(before)
    moments = np.unique(np.linspace(0, n_updates, 31).astype(np.int64))
    means = []
    with single_torch_thread():
        for n in np.diff(moments, prepend=0):
            for _ in range(n):
                bonus.observe(before)  # with every update, as algorithms do
                bonus.update(before, actions.reshape(-1, 1).float(), after)
            means.append([_score(bonus, half).mean() for half in (seen, unseen)])
    return Learned(moments, *np.array(means, dtype=np.float64).T)


def _score(bonus: Bonus, transitions: Sequence[Array]) -> Array:
    """Bonus of each transition, as the first of an episode where that counts."""
    return (bonus.episodes(len(transitions[0])) or bonus).score(*transitions)


def check_bonus(make_bonus: MakeBonus, seed: int = 0) -> Learned:
    """Check that a bonus falls where it is trained, and there alone.

    Args:
        make_bonus: As in `learn_tiny_mdp`.
        seed: Of the MDP, as in `learn_tiny_mdp`.

    Raises:
        AssertionError: If the mean bonus of what was seen stays above a tenth of what it was, or of
            the rest; if that of the rest falls below a twentieth of what it was; or if one is
            negative.
    """
    learned = learn_tiny_mdp(make_bonus, seed=seed)
    seen, unseen = learned.seen[-1], learned.unseen[-1]
    is_right = {
        "must fall where it is trained": seen < 0.1 * learned.seen[0],
        "must stay higher elsewhere": seen < 0.1 * unseen,
        "must stay high elsewhere": unseen > 0.05 * learned.unseen[0],
        "must not be negative": min(seen, unseen) >= 0.0,
    }
    before, after = (f"{learned.seen[i]:.3g} and {learned.unseen[i]:.3g}" for i in (0, -1))
    for what in [what for what, is_so in is_right.items() if not is_so]:  # as of a NaN
        raise AssertionError(
            f"The bonus {what}: before training it is {before} where it is trained and elsewhere, "
            f"after it {after}."
        )
    return learned


N_EPISODES, N_STEPS = 3, 12


def check_episodes(make_bonus: MakeBonus) -> None:
    """Check that a bonus with a memory of its episode remembers that, and nothing else.

    Args:
        make_bonus: As in `learn_tiny_mdp`; its bonus has a memory of episodes.

    Raises:
        AssertionError: If an episode has another bonus than `score_trajectory` says of it alone,
            where others are played beside it or were played before.
    """
    rng = np.random.default_rng(0)
    states = rng.normal(0.0, 1.0, (N_STATES, N_ENTRIES)).astype(np.float32)
    # Four places each: of twelve steps most lead back.
    places = rng.integers(0, 4, (N_EPISODES, N_STEPS + 1)) + 4 * np.arange(N_EPISODES)[:, None]
    observations = states[places]
    actions = rng.integers(0, N_ACTIONS, (N_EPISODES, N_STEPS))
    bonus = make_bonus(spaces.Box(-np.inf, np.inf, (N_ENTRIES,)), spaces.Discrete(N_ACTIONS))
    parts = observations[:, :-1], actions, observations[:, 1:]
    seen, taken, reached = (th.from_numpy(each.reshape(N_EPISODES * N_STEPS, -1)) for each in parts)
    bonus.observe(seen)
    bonus.update(seen, taken, reached)  # what is new in training may count, too
    alone = [bonus.score_trajectory(*each) for each in zip(observations, actions, strict=True)]
    episodes = bonus.episodes(N_EPISODES)
    assert episodes is not None
    for when in ("beside others", "after another"):
        steps = zip(*(each.swapaxes(0, 1) for each in parts), strict=True)
        together = np.stack([episodes.score(*step) for step in steps], axis=1)
        if not np.allclose(together, alone, rtol=1e-4, atol=1e-6):
            raise AssertionError(
                f"The bonus of an episode must be the same {when}: it is {np.mean(together):.3g} "
                f"on average, and {np.mean(alone):.3g} alone."
            )
        episodes.end(np.ones(N_EPISODES, dtype=np.bool_))
