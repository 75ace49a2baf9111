"""`curiosity sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from curiosity_algos.cli import options
from curiosity_algos.cli.options import (
    ConfFile,
    Device,
    Entity,
    Keywords,
    LogFolder,
    Preset,
    ProjectName,
    Timesteps,
    Track,
)
from curiosity_gym.validation import check_at_least_one


def sweep(
    algos: Annotated[str, typer.Option(help="Algorithms, with commas.")] = "curiosity_es,nses",
    envs: Annotated[str, typer.Option(help="Ids, with commas.")] = "CuriosityMaze-US-v0",
    seeds: Annotated[str, typer.Option(help="Whole numbers, with commas.")] = "0,1,2",
    timesteps: Timesteps = None,
    log_folder: LogFolder = Path("runs"),
    env_kwargs: Keywords = None,
    hyperparams: Keywords = None,
    preset: Preset = None,
    conf_file: ConfFile = None,
    device: Device = None,
    jobs: Annotated[int | None, typer.Option(help="Processes; None: one a processor.")] = None,
    interval: Annotated[float, typer.Option(help="Seconds between two checkpoints.")] = 60.0,
    track: Track = False,
    wandb_project_name: ProjectName = "curiosity",
    wandb_entity: Entity = None,
) -> None:
    """Train each algorithm on each environment with each seed; what is finished is left alone.

    Example: curiosity sweep --algos curiosity_es,nslc --envs CuriosityMaze-US-v0 --seeds 0,1,2
    """
    from curiosity_algos.cli.bars import SweepBars
    from curiosity_algos.experiments import sweep as many
    from curiosity_gym.processors import available_cpus

    jobs = available_cpus() if jobs is None else jobs
    check_at_least_one(jobs=jobs)
    runs = options.make_runs(
        algos.split(","),
        envs.split(","),
        options.numbers("seeds", seeds),
        timesteps=timesteps,
        env_kwargs=env_kwargs,
        settings=options.settings(hyperparams, preset=preset, device=device),
        conf_file=conf_file,
    )
    project = options.find_project(track, wandb_project_name, wandb_entity)
    errors = []
    with SweepBars(len(runs)) as bars:

        def report(run: Any, outcome: bool | BaseException) -> None:
            failed = isinstance(outcome, BaseException)
            if failed:
                errors.append(f"{run.folder(log_folder)}: {outcome}")
            has_trained = outcome and not failed
            bars.end(run, options.summary(run.folder(log_folder)) if has_trained else None)

        many.sweep(
            runs,
            log_folder,
            jobs=jobs,
            interval=interval,
            track=project,
            report=report,
            advance=bars.advance,
        )
    if errors:
        raise ValueError(f"{len(errors)} of {len(runs)} runs failed: {'; '.join(errors)}")
