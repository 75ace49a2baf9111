"""A run of `robustify`, from another run's episodes to its own folder."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import pandas as pd
from stable_baselines3 import PPO

from curiosity_algos.common.names import find_algorithm
from curiosity_algos.evaluation.environments import MakeEnv
from curiosity_algos.experiments.baselines import load_baseline
from curiosity_algos.experiments.description import check_same, describe_run, differing
from curiosity_algos.experiments.env_spec import make_env
from curiosity_algos.experiments.film import Source
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.pretrained import load_pretrained, pretrained_seed
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.save_run import SaveRun
from curiosity_algos.experiments.training import is_finished, train
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.robust.demonstrations import (
    Demonstration,
    demonstrate,
    demonstrations_of,
    load_demonstrations,
    save_demonstrations,
    successful,
)
from curiosity_algos.robust.measure import Starts, evaluate_starts, n_different
from curiosity_algos.robust.robustify import Training, check_training
from curiosity_algos.robust.solve import Enough, found_nothing
from curiosity_algos.robust.starts import DemonstrationStarts
from curiosity_algos.robust.watch import is_stuck
from curiosity_algos.sb3.bonus_wrapper import found_episodes


def robustify_run(
    source: Source,
    folder: Path,
    *,
    timesteps: float = 1e7,
    success: float = 0.95,
    seed: int = 0,
    device: str = "auto",
    interval: float = 60.0,
    trust: bool = False,
    progress_bar: bool = False,
) -> Starts:
    """Train a policy from the episodes that a run found, or go on where that was interrupted.

    Args:
        source: Folder of the run, or the algorithm and the environment of a policy that comes with
            the package.
        folder: Folder of the training, a run of PPO; the episodes are in its `demonstrations.npz`.
        timesteps: As in `robustify`, the first ones included.
        success: As in `robustify`.
        seed: As in `robustify`.
        device: As in `robustify`.
        interval: Seconds between two checkpoints.
        trust: Also run code that the run's folder names or contains.
        progress_bar: As in `robustify`.

    Returns:
        The success of the policy from a hundred unseen starts, or from the one where all are alike.

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If it has found no episode that succeeds, `folder` holds another run, or an
            argument is out of its range.
    """
    check_training(success, seed, device, timesteps=timesteps)
    save = SaveRun(folder, interval=interval)
    make = _maker(source, trust)
    described = _describe(source)
    demonstrations = _demonstrations(source, described, folder, make)
    training = Training(make, demonstrations, success=success, seed=seed, device=device)
    if not RunFolder(folder).demonstrations.exists():
        folder.mkdir(parents=True, exist_ok=True)
        save_demonstrations(RunFolder(folder).demonstrations, demonstrations, described)
    checkpoint = RunFolder(folder).checkpoint
    with closing(training.env), closing(save):
        if checkpoint is None:
            training.begin()
        else:
            check_same(folder, RunFolder(folder).describe(), describe_run(training.model))
            loaded: Any = load_baseline(PPO, checkpoint, training.env, device=device)
            training.model = loaded
        if not _is_over(folder, training.starts, timesteps, success):
            training.learn(timesteps, save, progress_bar=progress_bar)
    with closing(make()) as env:
        n = n_different(env, demonstrations)
        starts = evaluate_starts(training.model, env, n)
    RunFolder(folder).note(starts=starts.counts)
    return starts


def solve_run(
    run: RunSpec,
    folder: Path,
    *,
    n_episodes: int,
    timesteps: float = 1e7,
    success: float = 0.95,
    interval: float = 60.0,
    **shared: Any,
) -> Starts:
    """Search until so many episodes are found, then train a policy by them, or go on with either.

    Args:
        run: Run of `GoExplore`.
        folder: Folder of the search; that of the training is in it.
        n_episodes: Episodes that end the search, from 1 to 10.
        timesteps: As in `robustify`, of the training.
        success: As in `robustify`.
        interval: Seconds between two checkpoints.
        **shared: `device` and `progress_bar`, as in `robustify_run`.

    Returns:
        As `robustify_run`.

    Raises:
        ValueError: As `robustify_run`, and if an argument of the search is wrong.
    """
    enough, robust = Enough(n_episodes), folder / "robust"
    check_training(success, run.seed, shared.get("device", "auto"), timesteps=timesteps)
    if RunFolder(robust).demonstrations.exists():
        is_finished(run, folder)  # raises where it is another run, as `train` does
    else:
        progress_bar = shared.get("progress_bar", False)
        train(run, folder, interval=interval, progress_bar=progress_bar, enough=enough)
        result = RunFolder(folder).result()
        if result["first_success_timesteps"] is None:
            raise found_nothing(result["timesteps"])
    return robustify_run(
        folder,
        robust,
        timesteps=timesteps,
        success=success,
        seed=run.seed,
        interval=interval,
        trust=True,  # who names an environment trusts its module
        **shared,
    )


def _is_over(folder: Path, starts: DemonstrationStarts, timesteps: float, success: float) -> bool:
    """Whether a training has come to its budget, works as often as asked for, or is stuck."""
    run = Run(folder)
    if not run.folder.result().get("ended"):
        return False
    tested = run.progress.get("robust/tested", pd.Series([0.0]))
    has_ended = run.result["timesteps"] >= timesteps or tested.iloc[-1] >= success
    return bool(has_ended or is_stuck(starts))


def _maker(source: Source, trust: bool) -> MakeEnv:
    if isinstance(source, tuple):
        return partial(gym.make, source[1])
    return partial(make_env, Run(source).description, trust=trust)


def _describe(source: Source) -> dict[str, Any]:
    if isinstance(source, tuple):
        return dict(zip(("algorithm", "env"), source, strict=True))
    return Run(source).description


def _demonstrations(
    source: Source, described: Mapping[str, Any], folder: Path, make: MakeEnv
) -> list[Demonstration]:
    """Those in the folder, or else of the source."""
    path = RunFolder(folder).demonstrations
    if not path.exists():
        if not RunFolder(folder).is_empty():
            raise ValueError(f"`folder` must be empty or that of this run, {folder} is not.")
        with closing(make()) as env:
            return successful(_find(source, env))
    demonstrations, there = load_demonstrations(path)
    if different := differing(there, described):
        raise ValueError(
            f"`folder` must be of episodes of the same run, {folder} has those of another, whose "
            f"{different}."
        )
    return demonstrations


def _find(source: Source, env: gym.Env[Any, Any]) -> list[Demonstration]:
    if isinstance(source, tuple):
        return [demonstrate(load_pretrained(*source), env, pretrained_seed(*source) or 0)]
    run = Run(source)
    return demonstrations_of(run.folder.read(partial(_load, run, env)), env)


def _load(run: Run, env: Any, checkpoint: Path) -> Any:
    """What has found episodes, of a run's checkpoint."""
    name = run.description["algorithm"].partition(" + ")[0]
    cls = find_algorithm(name)
    if issubclass(cls, EvolutionaryAlgorithm):
        return cls.load(checkpoint / "model", env=env)
    if not (checkpoint / "bonus.npz").exists():
        raise ValueError(
            "`run` must be of an algorithm that evolves policies, or of an on-policy one with a "
            f"bonus, which keeps the episodes that succeed, {run} is of {name}."
        )
    return found_episodes(checkpoint / "bonus.npz")
