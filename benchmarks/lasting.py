"""How noise that lasts through an episode affects curiosity: `python -m benchmarks.lasting`.

Eight entries stand beside what the robot of a maze observes. They are as they were at the start of
the episode, or they drift, and those of all episodes of a generation are the same, or each has its
own. Policies see them, too. A run ends with its first success; runs that `lasting.csv` has are left
alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import pandas as pd
import typer
from gymnasium.vector import VectorEnv
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers import TransformObservation

from benchmarks.measure import markdown
from benchmarks.results import FOLDER, add_rows, recorded
from benchmarks.until_found import UntilFound, in_words
from curiosity_algos import NSES, CuriosityES
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm

MAZES = ("US", "Hard")
N_ENTRIES, N_ENVS, LARGEST = 8, 56, 4.0
KEPT = 0.999
"""Share of a drifting entry that a step leaves; the rest is drawn, so that its deviation stays."""
KEYS = ["maze", "noise", "algorithm", "seed"]


@dataclass(frozen=True)
class Noise:
    """Entries beside an observation, each of deviation 1.

    Attributes:
        is_shared: Whether all episodes that begin together have the same.
        drifts: Whether it changes within an episode.
    """

    is_shared: bool
    drifts: bool


NOISES = {
    "none": None,
    "constant, shared": Noise(is_shared=True, drifts=False),
    "constant, own": Noise(is_shared=False, drifts=False),
    "drifting, shared": Noise(is_shared=True, drifts=True),
    "drifting, own": Noise(is_shared=False, drifts=True),
}
ALGORITHMS: dict[str, Callable[..., EvolutionaryAlgorithm]] = {
    "CuriosityES, selective": partial(CuriosityES, bonus_kwargs={"selective": True}),
    "NSES": NSES,
    "CuriosityES": CuriosityES,
}


class Noisy(VectorEnv[Any, Any, Any]):
    """Mazes side by side, whose observations have noise beside them.

    A Gymnasium wrapper of a VectorEnv hides the environments, and a wrapper of each is slow.

    Args:
        env_id: Of the maze.
        noise: What stands beside its observations.
        seed: Of episodes' own noise; shared noise is drawn by the seed that they begin with.
    """

    def __init__(self, env_id: str, noise: Noise, *, seed: int) -> None:
        env = gym.make_vec(env_id, num_envs=N_ENVS, vectorization_mode="vector_entry_point")
        self._env, self._noise, self._rng = env, noise, np.random.default_rng(seed)
        self.num_envs, self.metadata = env.num_envs, env.metadata
        space: Any = env.single_observation_space
        low, high = (
            np.append(side, np.full(N_ENTRIES, bound, np.float32))
            for side, bound in ((space.low, -LARGEST), (space.high, LARGEST))
        )
        self.single_observation_space = gym.spaces.Box(low, high)
        self.observation_space = batch_space(self.single_observation_space, N_ENVS)
        self.single_action_space, self.action_space = env.single_action_space, env.action_space
        self.env_fns = [partial(self._make_single, env_id)]

    def _make_single(self, env_id: str) -> gym.Env[Any, Any]:
        """One maze whose noise is 0: nothing plays in it."""
        none = np.zeros(N_ENTRIES, np.float32)
        beside = partial(np.append, values=none)
        return TransformObservation(gym.make(env_id), beside, self.single_observation_space)

    def _draw(self) -> np.ndarray:
        n = 1 if self._noise.is_shared else N_ENVS
        drawn = self._rng.normal(size=(n, N_ENTRIES)).astype(np.float32)
        return np.broadcast_to(drawn, (N_ENVS, N_ENTRIES))

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin episodes, with noise that is drawn."""
        observations, infos = self._env.reset(seed=seed, options=options)
        if self._noise.is_shared and seed is not None:
            self._rng = np.random.default_rng(seed)  # of which all are the same
        self._beside = self._draw().clip(-LARGEST, LARGEST)
        return np.hstack([observations, self._beside]), infos

    def step(self, actions: np.ndarray) -> tuple[Any, ...]:
        """Step the mazes, and the noise where it drifts."""
        observations, *rest = self._env.step(actions)
        if self._noise.drifts:
            drawn = KEPT * self._beside + (1.0 - KEPT**2) ** 0.5 * self._draw()
            self._beside = drawn.clip(-LARGEST, LARGEST)
        return np.hstack([observations, self._beside]), *rest


def main(
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each, from seed 0 on.")] = 5,
    timesteps: float = 1e7,
    out: Annotated[Path, typer.Option(help="Where the CSV file goes.")] = FOLDER,
) -> None:
    """Search each maze beside each noise with each algorithm, until the first success."""
    path = out / "lasting.csv"
    done = recorded(path, KEYS)
    for algorithm, seed, *task in product(ALGORITHMS, range(seeds), MAZES, NOISES):
        key = *task, algorithm, seed
        if key not in done:
            add_rows(pd.DataFrame([search(*key, timesteps)]), path, KEYS)


def search(maze: str, noise: str, algorithm: str, seed: int, timesteps: float) -> dict[str, Any]:
    """A run: timesteps and seconds until its first success, or until its end."""
    env_id, begin = f"CuriosityMaze-{maze}-v0", time.perf_counter()
    chosen = NOISES[noise]
    env = gym.make(env_id) if chosen is None else Noisy(env_id, chosen, seed=seed)
    model = ALGORITHMS[algorithm](env, seed=seed, n_threads=1)
    model.learn(timesteps, UntilFound())
    return {
        **dict(zip(KEYS, (maze, noise, algorithm, seed), strict=True)),
        "timesteps": model.num_timesteps,
        "first_success_timesteps": model.first_success_timesteps,
        "seconds": round(time.perf_counter() - begin, 1),
    }


def table(values: pd.DataFrame) -> str:
    """A row for each noise: by each algorithm how many runs found the goal, and when."""
    rows = []
    for noise, of_noise in values.groupby("noise", sort=False):
        firsts = of_noise.set_index("algorithm")["first_success_timesteps"]
        rows.append([noise, *(in_words(firsts[[each]]) for each in ALGORITHMS)])
    return markdown(["Noise", *ALGORITHMS], rows)


if __name__ == "__main__":
    typer.run(main)
