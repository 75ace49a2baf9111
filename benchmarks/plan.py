"""The runs of the paper's figures, their budgets and their folders."""

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
NAMES = {
    "CuriosityES": "Curiosity-ES",
    "NSES": "NS-ES",
    "MAPElites": "MAP-Elites",
    "CMAME": "CMA-ME",
    "TD3ICM": "TD3-ICM",
}
"""The paper's names of algorithms, where they are others."""
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
        population: Timesteps on a maze, and on a control task.
        td3: Those of TD3ICM, whose steps cost hundreds of a population's.
        env_kwargs: Keywords by environment, for shorter episodes and easier goals.
        settings: Keywords by algorithm, for cheaper training.
        jobs: Runs at a time; None: one for each processor.
        note: Note below figures of these runs; empty if nothing is easier than in the paper.
    """

    seeds: tuple[int, ...]
    population: tuple[float, float]
    td3: tuple[float, float]
    env_kwargs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    jobs: int | None = None
    note: str = ""

    def timesteps(self, algorithm: str, env: str) -> float:
        """Timesteps of a run."""
        maze, control = self.td3 if algorithm == "TD3ICM" else self.population
        return control if env in CONTROL else maze


SMOKE_GOALS = dict(zip(MAZES, (16.5, 91.5, 120.0), strict=True))
"""Radius of the goal, by maze: hardly any policy misses it, so that no figure is empty."""
SMOKE_NOTE = (
    "Budget smoke, a trial of seconds that says nothing about the algorithms: episodes are short, "
    "and the goals of mazes\n"
    "are widened from a radius of 2 to 16.5 (Snake), 91.5 (US) and 120 (Hard)."
)
BUDGETS = {
    "smoke": Budget(
        seeds=(0,),
        population=(3 * 56 * 100, 2 * 56 * 20),
        td3=(800, 160),
        env_kwargs={
            **{env: {"horizon": 100, "goal_radius": r} for env, r in SMOKE_GOALS.items()},
            **{env: {"horizon": 20} for env in CONTROL},
        },
        settings={"CuriosityES": {"n_updates": 2}, "CMAME": {"es": "lm_ma_es"}},
        jobs=1,  # a run takes less time than the start of a process
        note=SMOKE_NOTE,
    ),
    "short": Budget(seeds=(0, 1, 2), population=(3e7, 1e6), td3=(3e5, 1e5)),
    "tenth": Budget(seeds=(0, 1, 2), population=(2.24e7, 1.12e7), td3=(2e5, 2e5)),
    "paper": Budget(seeds=(0, 1, 2, 3, 4), population=(2.24e8, 1.12e8), td3=(1e6, 1e6)),
}
"""By name; the paper's own is 2,000 generations of 56 individuals, of 2,000 or 1,000 steps each."""


@dataclass(frozen=True)
class Series:
    """An algorithm in a figure, with its keywords beside those of the preset."""

    algorithm: str
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Text in the legend."""
        name = NAMES.get(self.algorithm, self.algorithm)
        return f"{name} (whole state)" if self.is_of_whole_states else name

    @property
    def is_of_whole_states(self) -> bool:
        """Whether its behavior is the whole last state."""
        return bool(self.settings.get("behavior") == "state")

    @property
    def variant(self) -> str:
        """Folder of its runs; "" for runs with the preset's settings."""
        return variant_of(self.settings)


def series_of(figure: int) -> dict[str, list[Series]]:
    """The series of a figure's panels, by environment; of the mazes themselves there are none."""
    if figure == 6:
        return {env: [exploring(name, env) for name in COMPARED] for env in CONTROL}
    if figure == 7:
        whole = {"behavior": "state"}
        tried: list[tuple[str, dict[str, Any]]] = [
            *((name, {}) for name in ("CuriosityES", "NSES", "NSLC")),
            *(("NSES", whole), ("NSLC", whole), ("AURORA", {}), ("MAPElites", {})),
        ]
        return {env: [exploring(name, env, **kw) for name, kw in tried] for env in BOTTLENECK}
    envs, names = {
        1: ((), ()),
        2: (MAZES, COMPARED),
        3: (MAZES, COMPARED),
        4: (MAZES, ("CMAME", "NSES", "CuriosityES")),
        5: (CONTROL, COMPARED),
        8: (MAZES[1:2], ("CuriosityES", "CMAME", "MAPElites")),
    }[figure]
    return {env: [Series(name) for name in names] for env in envs}


def exploring(algorithm: str, env: str, **settings: Any) -> Series:
    """The series for coverage, which explores control tasks without regard to reward."""
    alone = WITHOUT_REWARD.get(algorithm, {}) if env in CONTROL else {}
    return Series(algorithm, {**settings, **alone})


@dataclass(frozen=True)
class Plan:
    """The runs of figures.

    Args:
        folder: Folder of the runs: those with the preset's settings as `curiosity sweep` puts them,
            others in a folder that is named by their settings (`phi=0.0`).
        budget: Their budget.
        preset: "paper" or "tuned".
        seeds: Their seeds.
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
