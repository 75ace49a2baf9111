"""Who finds the goal: `python -m benchmarks.learning` trains, and writes what tables are made from.

A sweep that was interrupted goes on; what is finished is not done again. `python -m
benchmarks.tables` then writes the tables of the README and the docs, and `curiosity report` makes a
page of the runs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from benchmarks.plan import CONTROL, MAZES
from benchmarks.results import FOLDER, collect
from curiosity_algos.cli.sweep import sweep

WORLDS = ("CuriosityLocomotion-AntTrap-v0", "CuriosityLocomotion-AntMaze-v0")
LABYRINTH = ("CuriosityMaze-Labyrinth-v0",)
ALGORITHMS = (
    "CuriosityES",
    "NSES",
    "NSLC",
    "CMAME",
    "CuriosityMAPElites",
    "MAPElites",
    "AURORA",
    "CanonicalES",
)
TOLD_NOTHING = {"algos": ("NSLC",), "hyperparams": ["behavior:'learned'"]}
"""Novelty search with behaviors that it learns."""
ON_CONTROL = {"algos": ("CuriosityES", "CanonicalES"), "envs": CONTROL, "timesteps": 1e6}
AMONG_WALLS = {"envs": WORLDS, "timesteps": 1e6}
FAR = {"envs": (*WORLDS, "CuriosityLocomotion-HumanoidTrap-v0"), "timesteps": 1e7}
POPULATIONS = {"algos": ("CuriosityES", "NSES", "NSLC", "MAPElites", "CMAME")}
AS_IN_THE_PAPER = {
    "algos": ("CuriosityES",),
    # Its settings of US: it has none of a robot.
    "hyperparams": [
        "bonus:'icm'",
        "bonus_kwargs:{'beta': .2, 'learning_rate': 1e-4, 'normalize': False}",
        "n_states:None",
        "n_updates:64",
        "batch_size:1024",
        "phi:.8",
        "gamma:.99",
        "step:'paper'",
        "no_reward:'random'",
        "learning_rate:1",
    ],
}
ON_A_ROBOT = {"algos": ("CuriosityES",), "envs": WORLDS[:1], "timesteps": 1e6}
ROBOT_TRIES: dict[str, dict[str, Any]] = {
    "linear": {"hyperparams": ["policy_kwargs:{'net_arch': []}"]},
    "normalize_observations": {"hyperparams": ["normalize_observations:True"]},
    "population_size=28": {"hyperparams": ["population_size:28", "n_parents:14"]},
    "mirrored_sampling": {"hyperparams": ["mirrored_sampling:True"]},
    "learning_rate=1": {"hyperparams": ["learning_rate:1"]},
    "power=3, horizon=10": {"hyperparams": ["bonus_kwargs:{'horizon': 10, 'power': 3.0}"]},
    # Of the same physics: a step is as long as two or four.
    "held 2 steps": {
        "env_kwargs": ["horizon:500", "env_kwargs:{'frame_skip': 10}"],
        "timesteps": 5e5,
    },
    "held 4 steps": {
        "env_kwargs": ["horizon:250", "env_kwargs:{'frame_skip': 20}"],
        "timesteps": 2.5e5,
    },
}
"""What was tried with CuriosityES on a robot, by the names of folders."""
SWEEPS: dict[str, dict[str, Any]] = {
    "mazes": {"algos": ALGORITHMS, "envs": MAZES, "timesteps": 3e7, "preset": "tuned"},
    "rounding": {"algos": ("CuriosityES",), "envs": MAZES, "timesteps": 3e7, "preset": "tuned"},
    "mazes/learned": {**TOLD_NOTHING, "envs": MAZES, "timesteps": 3e7, "preset": "tuned"},
    "labyrinth": {"algos": ALGORITHMS, "envs": LABYRINTH, "timesteps": 2.24e8},
    "labyrinth/learned": {**TOLD_NOTHING, "envs": LABYRINTH, "timesteps": 2.24e8},
    "control": ON_CONTROL,
    "control_random": {**ON_CONTROL, "env_kwargs": ["random_start:True"]},
    "control_strict": {
        **ON_CONTROL,
        "envs": ("CuriosityControl-Stacker-v0",),
        "env_kwargs": ["success_threshold:0.5"],
    },
    "locomotion": {**POPULATIONS, **AMONG_WALLS},
    "locomotion/paper": {**AS_IN_THE_PAPER, **AMONG_WALLS},
    "locomotion/learned": {**TOLD_NOTHING, **AMONG_WALLS},
    "locomotion_long": {**POPULATIONS, **FAR},
    "locomotion_long/paper": {**AS_IN_THE_PAPER, **FAR},
    "locomotion_tries": {
        **ON_A_ROBOT,
        "hyperparams": [f"sigma:{sigma}" for sigma in (0.05, 0.1, 0.2, 0.3, 1.0)],
    },
    **{
        f"locomotion_tries/{name}": {**ON_A_ROBOT, **settings}
        for name, settings in ROBOT_TRIES.items()
    },
    "buffer": {
        "algos": ("CuriosityES",),
        "envs": ("CuriosityMaze-US-v0", "CuriosityMaze-Hard-v0"),
        "timesteps": 1e7,
        "hyperparams": ["buffer_size:100_000", "buffer_size:500_000"],
    },
    "normalized": {
        "algos": ("CanonicalES",),
        "envs": ("CuriosityLocomotion-HalfCheetah-v0", "CuriosityLocomotion-Hopper-v0"),
        "timesteps": 5e5,
        "hyperparams": ["normalize_observations:False", "normalize_observations:True"],
    },
}
"""What is trained for each name, in the words of `curiosity sweep`; before a "/" is its table.

"rounding" is for other vector instructions, whose sums are rounded otherwise:
`ATEN_CPU_CAPABILITY=default MKL_ENABLE_INSTRUCTIONS=SSE4_2 OPENBLAS_CORETYPE=Nehalem python -m
benchmarks.learning rounding`.
"""


def main(
    name: Annotated[str, typer.Argument(help=f"One of {', '.join(SWEEPS)}.")] = "mazes",
    seeds: str = "0,1,2,3,4",
    timesteps: Annotated[float | None, typer.Option(help="None: the table's.")] = None,
    runs: Path = Path("runs"),
    jobs: int = 2,
    out: Annotated[Path, typer.Option(help="Where the CSV files go.")] = FOLDER,
) -> None:
    """Train every algorithm on every environment with every seed, and write the CSV files."""
    if name not in SWEEPS:
        raise typer.BadParameter(f"The name is one of {', '.join(SWEEPS)}, not {name}.")
    settings = SWEEPS[name] | ({} if timesteps is None else {"timesteps": timesteps})
    names = {key: ",".join(settings.pop(key)) for key in ("algos", "envs")}
    sweep(**names, **settings, seeds=seeds, log_folder=runs / name, jobs=jobs)
    table = name.partition("/")[0]
    collect(runs / table, table, out)


if __name__ == "__main__":
    typer.run(main)
