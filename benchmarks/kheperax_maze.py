"""Kheperax's maze with a target, played by populations of policies of this package."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from ribs.archives import GridArchive

from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.mlp import build_mlp
from curiosity_algos.evaluation.rollouts import Rollouts, check_parameters

EPISODE = 250
"""Steps of an episode that does not come to the target."""
N_CELLS = 100
"""Of the grid of coverage, along x and along y."""
HIDDEN = [8, 8]
"""Widths of the policies' hidden layers."""


class KheperaxSpaces(gym.Env[Any, Any]):
    """What searches know of the maze: lasers and bumpers, wheels, and where episodes may end.

    It is never stepped: `KheperaxEvaluator` plays.
    """

    observation_space = spaces.Box(-1.0, 1.0, (5,), np.float32)
    action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
    behavior_space = spaces.Box(0.0, 1.0, (2,), np.float64)
    behavior_names = ("x", "y")

    def reset(self, **_: Any) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Stable-Baselines3 asks for an observation when learning begins; no search reads it."""
        return np.zeros(5, dtype=np.float32), {}


MLP = build_mlp(KheperaxSpaces.observation_space, KheperaxSpaces.action_space, HIDDEN)


def make_task() -> Any:
    """Kheperax's maze with a target, as the tutorial has it; ImportError without Kheperax."""
    from kheperax.tasks.target import TargetKheperaxConfig, TargetKheperaxTask

    config = TargetKheperaxConfig.get_default()
    config.episode_length, config.mlp_policy_hidden_layer_sizes = EPISODE, tuple(HIDDEN)
    return TargetKheperaxTask(config)


def make_play(task: Any) -> Callable[[npt.ArrayLike], Any]:
    """A compiled function of parameters (P, 138), in this package's layout.

    It returns observations (P, T + 1, 5), actions (P, T, 2), positions (P, T + 1, 2), and whether
    the robot is at the target after each step, (P, T). Episodes do not stop there.
    """
    import jax
    from jax import numpy as jnp

    start = task.reset(jax.random.PRNGKey(0))

    def act(parameters: Any, seen: Any) -> Any:
        offset = 0
        for n_in, n_out in pairwise(MLP.sizes.tolist()):
            seen = jax.nn.relu(seen) if offset else seen
            weights, biases = jnp.split(parameters[offset:][: (n_in + 1) * n_out], [n_in * n_out])
            seen = seen @ weights.reshape(n_in, n_out) + biases
            offset += (n_in + 1) * n_out
        return jnp.tanh(seen)

    def episode(parameters: Any) -> Any:
        def step(carried: Any, _: None) -> Any:
            robot, observation = carried
            # The maze has no noise: one key for all steps, so that no time goes into drawing.
            state = start.replace(robot=robot, obs=observation, info={})
            action = act(parameters, observation)
            after = task.step(state, action)
            place = after.info["state_descriptor"]
            return (after.robot, after.obs), (after.obs, action, place, after.done)

        robot = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), start.robot)
        _, later = jax.lax.scan(step, (robot, start.obs), length=EPISODE)
        seen, actions, places, at_target = later
        seen = jnp.concatenate([start.obs[None], seen])
        places = jnp.concatenate([start.info["state_descriptor"][None], places])
        return seen, actions, places, at_target

    return jax.jit(jax.vmap(episode))


class Record:
    """The first episodes that ended in each cell.

    Args:
        n_episodes: The budget; later episodes do not count.

    Attributes:
        n: Episodes so far.
    """

    def __init__(self, n_episodes: int) -> None:
        self.n_episodes = n_episodes
        self.n = 0
        unit = [(0.0, 1.0)] * 2
        self._grid = GridArchive(solution_dim=0, dims=[N_CELLS] * 2, ranges=unit)
        self._first = np.full(N_CELLS**2, np.inf)

    def add(self, behaviors: npt.NDArray[np.floating[Any]]) -> None:
        """Count episodes, in order, by where they ended: (P, 2)."""
        numbers = self.n + 1.0 + np.arange(len(behaviors))
        np.minimum.at(self._first, self._grid.index_of(behaviors), numbers)
        self.n += len(behaviors)

    @property
    def is_full(self) -> bool:
        """Whether the budget is spent."""
        return self.n >= self.n_episodes

    def coverage(self, n_episodes: float | None = None) -> float:
        """Share of the cells in which one of the first so many episodes ended; None: of all."""
        within = self.n_episodes if n_episodes is None else n_episodes
        return float((self._first <= within).mean())


class KheperaxEvaluator(Evaluator):
    """Plays Kheperax's maze, and records where episodes end.

    Behaviors are Kheperax's: the position (x, y) before the last step. Returns are 0, so that no
    search is told of the target.
    """

    n_parameters = MLP.n_parameters
    draws = False

    def __init__(self, record: Record) -> None:
        self.record = record
        self._play = make_play(make_task())

    def evaluate(self, parameters: npt.NDArray[np.float32], seed: int | None = None) -> Rollouts:
        """An episode of each policy (P, 138)."""
        played = self._play(check_parameters(parameters, self.n_parameters))
        observations, actions, places, at_target = map(np.asarray, played)
        success, individuals = at_target.any(axis=1), np.arange(len(parameters))
        lengths = np.where(success, at_target.argmax(axis=1) + 1, EPISODE)
        behaviors = places[individuals, lengths - 1].astype(np.float64)
        self.record.add(behaviors)
        return Rollouts(
            returns=np.zeros(len(parameters)),
            lengths=lengths,
            success=success,
            terminated=success,
            behaviors=behaviors,
            final_observations=observations[individuals, lengths],
            observations=observations,
            actions=actions,
        )
