"""Is a bonus right? Small worlds whose answers can be written down, for any `Bonus`.

`check_bonus`, `check_episodes` and `check_wrapper` raise AssertionError with the figure that is
wrong, much as Gymnasium's `check_env` does. `learn_tiny_mdp` gives the figures themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import gymnasium as gym
import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.bonuses.episodes import EpisodicBonus, episodes_of
from curiosity_algos.common.arrays import Array, Float32Array, Float64Array, Int64Array, Mask
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.common.randomness import seeded_globally

MakeBonus: TypeAlias = "Callable[[spaces.Box[Any], spaces.Discrete[Any]], Bonus]"

N_STATES, N_ACTIONS, N_ENTRIES = 20, 3, 6


# -- a tiny MDP -----------------------------------------------------------------------------------


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
    return (episodes_of(bonus, len(transitions[0])) or bonus).score(*transitions)


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
    _check(seen < 0.1 * learned.seen[0], "must fall where it is trained", learned)
    _check(seen < 0.1 * unseen, "must stay higher elsewhere", learned)
    _check(unseen > 0.05 * learned.unseen[0], "must stay high elsewhere", learned)
    _check(min(seen, unseen) >= 0.0, "must not be negative", learned)
    return learned


def _check(is_right: bool, what: str, learned: Learned) -> None:
    """Raise AssertionError, with what a bonus was before its training and after."""
    if not is_right:  # a NaN is not right either
        before, after = (f"{learned.seen[i]:.3g} and {learned.unseen[i]:.3g}" for i in (0, -1))
        raise AssertionError(
            f"The bonus {what}: before training it is {before} where it is trained and elsewhere, "
            f"after it {after}."
        )


# -- episodes -------------------------------------------------------------------------------------

N_EPISODES, N_STEPS = 3, 12


def check_episodes(make_bonus: MakeBonus) -> None:
    """Check that a bonus with a memory of its episode remembers that, and nothing else.

    Args:
        make_bonus: As in `learn_tiny_mdp`; it makes an `EpisodicBonus`.

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
    assert isinstance(bonus, EpisodicBonus)
    parts = observations[:, :-1], actions, observations[:, 1:]
    seen, taken, reached = (th.from_numpy(each.reshape(N_EPISODES * N_STEPS, -1)) for each in parts)
    bonus.observe(seen)
    bonus.update(seen, taken, reached)  # what is new in training may count, too
    alone = [bonus.score_trajectory(*each) for each in zip(observations, actions, strict=True)]
    episodes = bonus.episodes(N_EPISODES)
    for when in ("beside others", "after another"):
        steps = zip(*(each.swapaxes(0, 1) for each in parts), strict=True)
        together = np.stack([episodes.score(*step) for step in steps], axis=1)
        if not np.allclose(together, alone, rtol=1e-4, atol=1e-6):
            raise AssertionError(
                f"The bonus of an episode must be the same {when}: it is {np.mean(together):.3g} "
                f"on average, and {np.mean(alone):.3g} alone."
            )
        episodes.end(np.ones(N_EPISODES, dtype=np.bool_))


# -- a wrapper, or a callback ---------------------------------------------------------------------

HORIZON, GAMMA, N_CORRIDORS = 8, 0.9, 256


class _Corridor(gym.Env[Any, Any]):
    """Observes how many steps were taken, of 8; nothing else happens."""

    observation_space = spaces.Box(0.0, HORIZON, (1,))
    action_space = spaces.Discrete(2)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        super().reset(seed=seed)
        self._n = 0
        return np.zeros(1, dtype=np.float32), {}

    def step(self, action: Any) -> Any:
        self._n += 1
        return np.full(1, self._n, dtype=np.float32), 0.0, self._n == HORIZON, False, {}


class _AtTheEnd(Bonus):
    """A bonus of 1 for reaching the end of the corridor, and 0 for all else; it learns nothing."""

    name = "end"

    def score(self, observations: Any, actions: Any, next_observations: Any) -> Float32Array:
        reached: Mask = next_observations[:, 0] == HORIZON
        return reached.astype(np.float32)

    def update(self, *batch: th.Tensor) -> dict[str, float]:
        return {}

    def state_dict(self) -> dict[str, Any]:
        return {}

    def load_state_dict(self, state: Any, strict: bool = True) -> None:
        pass


def check_wrapper(
    wrap: Callable[[VecEnv, Bonus], VecEnv], callback: BaseCallback | None = None
) -> None:
    """Check that a bonus at the end of an episode is there, and is worth something at its start.

    What is checked comes after 2,048 transitions, so that the wrapper may learn a scale before.

    Args:
        wrap: Adds a bonus to a VecEnv.
        callback: Does so instead, where `wrap` does not, in a model of Stable-Baselines3.

    Raises:
        AssertionError: If the bonus is asked for the observation after the reset, or enters once
            the advantages are computed.
    """
    with seeded_globally(np.random.SeedSequence(0), th.device("cpu")):
        venv = wrap(DummyVecEnv([_Corridor] * N_CORRIDORS), _AtTheEnd())
        n = HORIZON * N_CORRIDORS
        settings: dict[str, Any] = {"n_steps": HORIZON, "batch_size": n, "n_epochs": 1}
        model = PPO("MlpPolicy", venv, gamma=GAMMA, gae_lambda=1.0, device="cpu", **settings)
        model.learn(2 * n, callback=callback)
    returns = model.rollout_buffer.returns[:, 0]
    if not returns[-1] > 0.0:
        raise AssertionError(
            "The last transition of an episode must have the bonus of its true last observation, "
            f"it has that of the observation after the reset, or none within {2 * n} transitions."
        )
    expected = GAMMA ** (HORIZON - 1) * returns[-1]
    if not np.isclose(returns[0], expected, rtol=1e-3):
        raise AssertionError(
            f"A bonus at the end of an episode must be worth {expected:.3g} at its start, it is "
            f"worth {returns[0]:.3g}: it must enter the reward before advantages are computed."
        )
