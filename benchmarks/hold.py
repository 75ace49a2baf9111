"""From how many unseen starts policies succeed: `python -m benchmarks.hold`, `run` or `collect`.

A search finds episodes, `robustify` trains a policy by them, and both are tested from the same 100
starts; `alone` trains PPO with APT for as many steps as both took. Runs are in
`runs/hold/TASK/SEED`; what was interrupted continues.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd
import typer
from gymnasium.wrappers import RepeatAction
from PIL import Image, ImageSequence
from stable_baselines3 import PPO

from benchmarks.bonuses import RECIPE
from benchmarks.figures import IMAGES
from benchmarks.gallery import with_few_colors
from benchmarks.measure import markdown
from benchmarks.pretrained import FOLDER as PACKAGE
from benchmarks.results import FOLDER, add_rows, read_rows, read_runs
from curiosity_algos import evaluate_starts
from curiosity_algos.common.names import find_algorithm
from curiosity_algos.experiments import film
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.pretrained import load_pretrained
from curiosity_algos.experiments.robust_run import robustify_run
from curiosity_algos.experiments.run_folder import RunFolder, write_arrays
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.training import train
from curiosity_algos.robust.demonstrations import load_demonstrations
from curiosity_algos.robust.measure import UNSEEN

app = typer.Typer(pretty_exceptions_enable=False)
RUNS = Path("runs/hold")
KEYS = ["task", "seed"]
REPEAT = RECIPE.repeat_action
"""Steps that PPO alone takes an action for."""
SUCCESS = 0.98
"""That is asked for: a policy that has passed two tests at .95 comes to some less in the next."""


@dataclass(frozen=True)
class Task:
    """A search, and how long `robustify` may take; without timesteps the package has its policy."""

    env: str
    search_timesteps: float | None = None
    timesteps: float = 1e7
    search: Mapping[str, Any] = field(default_factory=dict)
    """Other fields of the search's `RunSpec`."""
    success: float = SUCCESS
    """Of unseen starts, which ends the training."""
    is_perturbed: bool = False
    """Whether both policies are tested in a `Perturbed` maze, which neither was trained in."""

    def spec(self, seed: int) -> RunSpec:
        """The search."""
        assert self.search_timesteps is not None
        kwargs = {"algorithm": "curiosity_es", **self.search}
        return RunSpec(env=self.env, seed=seed, timesteps=self.search_timesteps, **kwargs)


class Perturbed(gym.Wrapper[Any, Any, Any, Any]):
    """A maze whose observations are noisy, and whose actions are turned by up to five degrees."""

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(**arguments)
        return self._noisy(observation), info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take a step."""
        angle = np.deg2rad(self.np_random.uniform(-5.0, 5.0))
        sine, cosine = np.sin(angle), np.cos(angle)
        turned = np.array([[cosine, -sine], [sine, cosine]]) @ action
        observation, *outcome = self.env.step(turned.astype(np.float32))
        return self._noisy(observation), *outcome

    def _noisy(self, observation: Any) -> Any:
        noise = self.np_random.normal(scale=0.01, size=observation.shape)
        return (observation + noise).astype(observation.dtype)


MAZES = ("Hard", "Labyrinth", "Snake", "US")
RANDOM = {"env_kwargs": {"random_start": True}}
WITHIN_2, WITHIN_20 = ({"env_kwargs": {"start_radius": radius}} for radius in (2.0, 20.0))
APT = {
    "algorithm": "ppo",
    "bonus": "apt",
    "bonus_kwargs": {"norm_reward": False},
    "n_envs": 16,
    "repeat_action": 10,
    "settings": {"n_steps": 64},
}
WEIGHTS = {"MountainCarContinuous-v0": {"weight": 2.0}}
"""Of the recipe's bonus, where a solved episode earns some hundred times more."""
GO_EXPLORE = {"algorithm": "go_explore"}
ROOMS = {"env_kwargs": {"layout": "rooms-4x4-door8-seed10"}}
TASKS = {
    "MountainCarContinuous": Task("MountainCarContinuous-v0", 3e6),
    "AntTrap": Task("CuriosityLocomotion-AntTrap-v0"),
    "HumanoidTrap": Task("CuriosityLocomotion-HumanoidTrap-v0", timesteps=2e7, success=0.9),
    "BallInCup": Task("CuriosityControl-BallInCup-v0", 1e6, search=RANDOM),
    "Finger": Task("CuriosityControl-Finger-v0", 1e7, 3e6, search=RANDOM),
    "Hard, PPO + APT": Task("CuriosityMaze-Hard-v0", 3e5, 2e6, APT),
    **{
        f"{name} within 20": Task(f"CuriosityMaze-{name}-v0", 1e7, search=WITHIN_20)
        for name in ("Hard", "Snake", "US")
    },
    "Labyrinth within 20": Task("CuriosityMaze-Labyrinth-v0", 2e6, search=GO_EXPLORE | WITHIN_20),
    "A maze with loops within 20": Task(
        "CuriosityMaze-v0",
        1e7,
        search={"env_kwargs": {"layout": "loops-8x8-seed0", "start_radius": 20.0}},
    ),
    **{
        f"{name}, perturbed": Task(
            f"CuriosityMaze-{name}-v0", 1e7, search=WITHIN_2, is_perturbed=True
        )
        for name in ("Hard", "Snake", "US")
    },
    "Labyrinth, perturbed": Task(
        "CuriosityMaze-Labyrinth-v0", 2e6, search=GO_EXPLORE | WITHIN_2, is_perturbed=True
    ),
    **{
        f"{name}, GoExplore": Task(f"CuriosityMaze-{name}-v0", 2e6, search=GO_EXPLORE)
        for name in MAZES
    },
    "Rooms with doors of 8, GoExplore": Task("CuriosityMaze-v0", 2e6, search=GO_EXPLORE | ROOMS),
}


@app.command()
def run(task: str, seed: int, runs: Path = RUNS, interval: float = 60.0) -> None:
    """Search and `robustify`, or go on with both."""
    chosen, folder = TASKS[task], runs / task / str(seed)
    source: Any = ("curiosity_es", chosen.env)
    if chosen.search_timesteps is not None:
        source = folder / "search"
        train(chosen.spec(seed), source, interval=interval)
    budget = {"timesteps": chosen.timesteps, "success": chosen.success}
    settings: Any = {**budget, "seed": seed, "interval": interval}
    starts = robustify_run(source, folder / "robust", **settings)
    typer.echo(f"{task}, seed {seed}: {starts}")


@app.command()
def alone(task: str, seed: int, runs: Path = RUNS, interval: float = 60.0) -> None:
    """Train PPO with APT for as many steps as a search and `robustify` took, or go on."""
    folder, chosen = runs / task / str(seed), TASKS[task]
    steps = _search(folder)["timesteps"] + Run(folder / "robust").result["timesteps"]
    spec = replace(
        RECIPE,
        env=chosen.env,
        seed=seed,
        timesteps=steps // REPEAT,
        env_kwargs=chosen.search.get("env_kwargs", {}),
        bonus_kwargs=WEIGHTS.get(chosen.env, {}),
        settle=steps / REPEAT / 5,
    )
    train(spec, folder / "alone", interval=interval)


@app.command()
def keep(task: str, seed: int, runs: Path = RUNS) -> None:
    """Write the policy of a run into the package, for `curiosity enjoy --pretrained ppo`."""
    search = TASKS[task].search
    if search.get("env_kwargs", {}).keys() - {"start_radius"} or "repeat_action" in search:
        message = "must be of an environment as its id makes it; starts may be others."
        raise typer.BadParameter(message, param_hint="TASK")
    model = PPO.load(_model(runs / task / str(seed) / "robust"), device="cpu")
    states = model.policy.state_dict()
    path = PACKAGE / f"PPO_{TASKS[task].env}.npz"
    write_arrays(path, {name: tensor.numpy() for name, tensor in states.items()})


@app.command()
def picture(out: Path = IMAGES) -> None:
    """Film ten episodes of the ant that comes with the package, side by side."""
    path = out / "robust_ants.gif"
    film.film(("ppo", TASKS["AntTrap"].env), path, stride=20, seed=UNSEEN, n_starts=10)
    with Image.open(path) as whole:
        frames = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(whole)]
    film.write_film(with_few_colors(frames, 32), path)


@app.command()
def collect(runs: Path = RUNS, out: Path = FOLDER) -> None:
    """Add what runs came to, finished or not, to `hold.csv` and `hold_alone.csv`."""
    rows = [_row(folder) for folder in _folders(runs, "robust")]
    add_rows(pd.DataFrame(rows), out / "hold.csv", KEYS)
    if rows := [_row_alone(folder) for folder in _folders(runs, "alone")]:
        add_rows(pd.DataFrame(rows), out / "hold_alone.csv", KEYS)


def _folders(runs: Path, part: str) -> list[Path]:
    """Those of tasks and seeds whose policies were tested, and that have a part of that name."""
    found = sorted(path.parents[1] for path in runs.glob(f"*/*/{part}/run.json"))
    tested = [each for each in found if Run(each / "robust").result.get("starts")]
    return [each for each in tested if each.parent.name in TASKS]


def _row_alone(folder: Path) -> dict[str, Any]:
    run, task = Run(folder / "alone"), TASKS[folder.parent.name]
    env: Any = gym.make(task.env, **task.search.get("env_kwargs", {}))
    env = RepeatAction(Perturbed(env) if task.is_perturbed else env, REPEAT)
    n = Run(folder / "robust").result["starts"]["n"]
    return {
        "task": folder.parent.name,
        "seed": int(folder.name),
        "timesteps": REPEAT * run.result["timesteps"],
        "seconds": run.result["seconds"],
        "solved": int(evaluate_starts(PPO.load(_model(folder / "alone")), env, n).success.sum()),
    }


def _row(folder: Path) -> dict[str, Any]:
    robust, task = Run(folder / "robust"), TASKS[folder.parent.name]
    result, search = robust.result, _search(folder)
    solved = result["starts"]["success"]
    if task.is_perturbed:
        found = find_algorithm(task.spec(0).algorithm).load(_model(folder / "search"))
        models = [found, PPO.load(_model(folder / "robust"))]
        env = Perturbed(gym.make(task.env, **task.search["env_kwargs"]))
        search_solved, solved = (int(evaluate_starts(m, env).success.sum()) for m in models)
    elif task.search_timesteps is None:
        policy = load_pretrained("curiosity_es", task.env)
        search_solved = int(evaluate_starts(policy, task.env).success.sum())
    elif search.get("starts"):
        search_solved = search["starts"]["success"]
    else:  # all start alike
        search_solved = int(film.play(folder / "search").mean_return > 0.0)
    demonstrations, _ = load_demonstrations(robust.folder.demonstrations)
    return {
        "task": folder.parent.name,
        "seed": int(folder.name),
        "search_timesteps": search["timesteps"],
        "search_seconds": search["seconds"],
        "demonstration": len(demonstrations[0]),
        "search_solved": search_solved,
        "timesteps": result["timesteps"],
        "seconds": result["seconds"],
        "solved": solved,
        "starts": result["starts"]["n"],
    }


def _search(folder: Path) -> dict[str, Any]:
    """What the search came to that found the episodes of a task and seed."""
    task = TASKS[folder.parent.name]
    is_pretrained = task.search_timesteps is None
    return _long_search(task.env) if is_pretrained else Run(folder / "search").result


def _long_search(env: str) -> dict[str, Any]:
    """The run of ten million steps whose best policy comes with the package."""
    runs = read_runs("locomotion_long")
    own = runs[(runs["algorithm"] == "CuriosityES") & (runs["env"] == env)]
    best: dict[str, Any] = own.sort_values("best_return").iloc[-1].to_dict()
    return best


def _model(run: Path) -> Path:
    """The file of a run's last model."""
    checkpoint = RunFolder(run).checkpoint
    assert checkpoint is not None
    return checkpoint / "model"


FORMATS = {
    "The search's best policy": ("search_solved", "{:.0f}"),
    "PPO + APT alone": ("alone", "{:.0f}"),
    "After `robustify`": ("solved", "{:.0f}"),
    "Timesteps (M)": ("timesteps", "{:.2f}"),
    "Minutes": ("seconds", "{:.1f}"),
}
"""Columns of the table: their data, in millions or minutes, and how they are written."""


def _each(numbers: pd.Series[Any], form: str) -> str:
    """Seed by seed; empty if nothing was measured."""
    texts = ["-" if np.isnan(number) else form.format(number) for number in numbers]
    return " / ".join(texts) if numbers.notna().any() else ""


def table(values: pd.DataFrame) -> str:
    """A row for each task: of unseen starts those that are solved, seed by seed."""
    values = values.assign(timesteps=values["timesteps"] / 1e6, seconds=values["seconds"] / 60)
    apart = read_rows("hold_alone").set_index(KEYS)["solved"].rename("alone")
    values = values.join(apart, on=KEYS)
    rows = []
    for (task, n_starts), runs in values.groupby(["task", "starts"], sort=False):
        cells = [_each(runs[name], form) for name, form in FORMATS.values()]
        searched = f"{runs['search_timesteps'].median() / 1e6:.2g} M"
        rows.append([f"{task}, {searched}, of {n_starts}", *cells])
    return markdown(["Task, steps of the search, of so many starts", *FORMATS], rows)


if __name__ == "__main__":
    app()
