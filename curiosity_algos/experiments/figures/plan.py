"""The runs of the paper's figures, their budgets and their folders.

"Curiosity creates Diversity in Policy Search", sections 4 to 7, whose figures are counted from 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from curiosity_algos.experiments.run_spec import RunSpec, variant_of

MAZES = ("CuriosityMaze-Snake-v0", "CuriosityMaze-US-v0", "CuriosityMaze-Hard-v0")
CONTROL = (
    "CuriosityControl-BallInCup-v0",
    "CuriosityControl-Finger-v0",
    "CuriosityControl-Stacker-v0",
)
BOTTLENECK = ("CuriosityMaze-Snake-v0", "CuriosityMaze-US-v0", "CuriosityControl-Finger-v0")
COMPARED = ("CuriosityES", "NSES", "MAPElites", "CMAME", "TD3ICM")
WITHOUT_REWARD: Mapping[str, Mapping[str, Any]] = {
    "CuriosityES": {"phi": 0.0},
    "NSES": {"phi": 0.0},
    "TD3ICM": {"extrinsic": False},
}
"""Keywords that make algorithms explore without regard to reward."""


@dataclass(frozen=True)
class Budget:
    """The length of the runs of figures, and their number.

    Args:
        seeds: Seeds of the runs.
        maze: Timesteps on a maze.
        control: Timesteps on a control task.
        td3_maze: Timesteps of TD3ICM on a maze; its steps cost hundreds of a population's.
        td3_control: Timesteps of TD3ICM on a control task.
        env_kwargs: Keywords by environment, for shorter episodes and easier goals.
        settings: Keywords by algorithm, for cheaper training.
        jobs: Runs at a time; None: one for each processor.
        note: Note below figures of these runs; empty if nothing is easier than in the paper.
    """

    seeds: tuple[int, ...]
    maze: float
    control: float
    td3_maze: float
    td3_control: float
    env_kwargs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    jobs: int | None = None
    note: str = ""

    def timesteps(self, algorithm: str, env: str) -> float:
        """Timesteps of a run."""
        if algorithm == "TD3ICM":
            return self.td3_control if env in CONTROL else self.td3_maze
        return self.control if env in CONTROL else self.maze


GENERATIONS, POPULATION = 2_000, 56
SMOKE_GOALS = dict(zip(MAZES, (16.5, 91.5, 120.0), strict=True))
"""Radius of the goal, by maze."""
SMOKE_NOTE = (
    "Budget smoke, a trial of seconds that tells nothing of the algorithms: episodes are short, "
    "and the goals of mazes\n"
    "are widened from a radius of 2 to 16.5 (Snake), 91.5 (US) and 120 (Hard)."
)
BUDGETS = {
    # Goals that hardly any policy misses, so that no figure is empty.
    "smoke": Budget(
        seeds=(0,),
        maze=3 * 56 * 100,
        control=2 * 56 * 20,
        td3_maze=800,
        td3_control=160,
        env_kwargs={
            **{env: {"horizon": 100, "goal_radius": r} for env, r in SMOKE_GOALS.items()},
            **{env: {"horizon": 20} for env in CONTROL},
        },
        settings={"CuriosityES": {"n_updates": 2}, "CMAME": {"es": "lm_ma_es"}},
        jobs=1,  # a run takes less time than the start of a process
        note=SMOKE_NOTE,
    ),
    "short": Budget(seeds=(0, 1, 2), maze=3e7, control=1e6, td3_maze=3e5, td3_control=1e5),
    "tenth": Budget(seeds=(0, 1, 2), maze=2.24e7, control=1.12e7, td3_maze=2e5, td3_control=2e5),
    "paper": Budget(
        seeds=(0, 1, 2, 3, 4),
        maze=GENERATIONS * POPULATION * 2_000,
        control=GENERATIONS * POPULATION * 1_000,
        td3_maze=1e6,
        td3_control=1e6,
    ),
}
"""By name; the paper's own is 2,000 generations of 56 individuals, a tenth of it 200."""


@dataclass(frozen=True)
class Series:
    """An algorithm in a figure.

    Args:
        algorithm: Name of the algorithm.
        settings: Keywords of the algorithm in the figure, beside those of the preset.
    """

    algorithm: str
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Text in the legend."""
        whole_state = self.settings.get("behavior") == "state"
        return f"{self.algorithm} (whole state)" if whole_state else self.algorithm

    @property
    def variant(self) -> str:
        """Folder of its runs; "" for runs with the preset's settings."""
        return variant_of(self.settings)


def series_of(figure: int) -> dict[str, list[Series]]:
    """The series of a figure's panels, by environment."""
    if figure in (2, 3):
        return {env: [Series(name) for name in COMPARED] for env in MAZES}
    if figure == 4:
        return {env: [Series(name) for name in ("CMAME", "NSES", "CuriosityES")] for env in MAZES}
    if figure == 5:
        return {env: [Series(name) for name in COMPARED] for env in CONTROL}
    if figure == 6:
        return {env: [exploring(name, env) for name in COMPARED] for env in CONTROL}
    if figure == 7:
        return {env: _bottleneck(env) for env in BOTTLENECK}
    if figure == 8:
        return {MAZES[1]: [Series(name) for name in ("CuriosityES", "CMAME", "MAPElites")]}
    return {}  # the mazes themselves


def exploring(algorithm: str, env: str, **settings: Any) -> Series:
    """The series for coverage, which explores control tasks without regard to reward."""
    alone = WITHOUT_REWARD.get(algorithm, {}) if env in CONTROL else {}
    return Series(algorithm, {**settings, **alone})


def _bottleneck(env: str) -> list[Series]:
    series = [exploring(name, env) for name in ("CuriosityES", "NSES", "NSLC")]
    series += [exploring(name, env, behavior="state") for name in ("NSES", "NSLC")]
    return [*series, *(exploring(name, env) for name in ("AURORA", "MAPElites"))]


@dataclass(frozen=True)
class Plan:
    """The runs of figures.

    Args:
        folder: Folder of the runs: those with the preset's settings as `curiosity sweep` puts them,
            others in a folder that is named by their settings (`phi=0.0`).
        budget: Budget of the runs.
        preset: "paper" or "tuned".
        seeds: Seeds of the runs.
    """

    folder: Path
    budget: Budget
    preset: str
    seeds: Sequence[int]

    def runs(self, figure: int) -> list[RunSpec]:
        """The runs that a figure needs."""
        return [
            self.run(series, env, seed)
            for env, panel in series_of(figure).items()
            for series in panel
            for seed in self.seeds
        ]

    def note(self, figure: int) -> str:
        """The note below a figure, which may be empty."""
        return self.budget.note if series_of(figure) else ""

    def run(self, series: Series, env: str, seed: int) -> RunSpec:
        """The run of a series, an environment and a seed."""
        cheaper = self.budget.settings.get(series.algorithm, {})
        return RunSpec(
            series.algorithm,
            env,
            seed,
            self.budget.timesteps(series.algorithm, env),
            self.budget.env_kwargs.get(env, {}),
            {"preset": self.preset, "device": "cpu", **cheaper, **series.settings},
            series.variant,
        )
