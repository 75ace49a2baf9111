"""`curiosity sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from tqdm import tqdm

from curiosity_algos.cli import options
from curiosity_algos.cli.options import Device, Keywords, LogFolder, Preset, Timesteps
from curiosity_gym.validation import check_at_least_one


def sweep(
    algos: Annotated[str, typer.Option(help="Algorithms, with commas.")] = "curiosity_es,nses",
    envs: Annotated[str, typer.Option(help="Ids, with commas.")] = "CuriosityMaze-US-v0",
    seeds: Annotated[str, typer.Option(help="Whole numbers, with commas.")] = "0,1,2",
    timesteps: Timesteps = 1e7,
    log_folder: LogFolder = Path("runs"),
    env_kwargs: Keywords = None,
    hyperparams: Keywords = None,
    preset: Preset = None,
    device: Device = "cpu",
    jobs: Annotated[int | None, typer.Option(help="Processes; None: one a processor.")] = None,
    interval: Annotated[float, typer.Option(help="Seconds between two checkpoints.")] = 60.0,
) -> None:
    """Train each algorithm on each environment with each seed; what is finished is left alone.

    Example: curiosity sweep --algos curiosity_es,nslc --envs CuriosityMaze-US-v0 --seeds 0,1,2
    """
    from curiosity_algos.experiments import sweep as many
    from curiosity_gym.processors import available_cpus

    settings = options.settings(hyperparams, preset, device, None)
    common = {"timesteps": timesteps, "settings": settings}
    common["env_kwargs"] = options.keywords("env-kwargs", env_kwargs)
    runs = many.grid(algos.split(","), envs.split(","), options.numbers("seeds", seeds), **common)
    jobs = available_cpus() if jobs is None else jobs
    check_at_least_one(jobs=jobs)
    for run in {(run.algorithm, run.env): run for run in runs}.values():
        run.check()
    errors = []
    with tqdm(total=len(runs), unit="run") as bar:

        def report(run: Any, outcome: bool | BaseException) -> None:
            bar.update()
            if isinstance(outcome, BaseException):
                errors.append(f"{run.folder(log_folder)}: {outcome}")
            elif outcome:
                bar.write(options.summary(run.folder(log_folder)))

        many.sweep(runs, log_folder, jobs=jobs, interval=interval, report=report)
    if errors:
        raise ValueError(f"{len(errors)} of {len(runs)} runs failed: {'; '.join(errors)}")
