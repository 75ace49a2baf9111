"""`curiosity sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from curiosity_algos.cli import options


def sweep(
    algos: Annotated[
        str,
        typer.Option(help="Algorithms, with commas between them.", autocompletion=options.ALGOS),
    ] = "curiosity_es,nses",
    envs: Annotated[
        str,
        typer.Option(help="Ids of environments, likewise.", autocompletion=options.ENVS),
    ] = "CuriosityMaze-US-v0",
    seeds: Annotated[str, typer.Option(help="Seeds, likewise, or as 0-4.")] = "0,1,2",
    timesteps: options.Timesteps = 1e7,
    log_folder: options.LogFolder = Path("runs"),
    env_kwargs: options.EnvKeywords = None,
    wrapper: options.Wrappers = None,
    hyperparams: options.Alternatives = None,
    bonus: Annotated[
        str,
        typer.Option(
            help="Bonuses that algorithms explore by, with commas between them, such as "
            "none,apt,rnd: all are tried.",
            autocompletion=options.BONUSES,
        ),
    ] = "none",
    bonus_kwargs: options.BonusKeywords = None,
    n_envs: options.NEnvs = 1,
    repeat_action: options.RepeatAction = 1,
    preset: options.Preset = None,
    device: options.Device = None,
    jobs: Annotated[
        int | None,
        typer.Option(help="Runs to train at a time. Without it, one for each processor."),
    ] = None,
    interval: options.Interval = 60.0,
) -> None:
    """Train each algorithm on each environment with each seed.

    Runs that are finished are left alone, and those that were interrupted go on.

    Example: curiosity sweep --algos curiosity_es,nslc --envs CuriosityMaze-US-v0 --seeds 0-4

    Example: curiosity sweep --algos nses --hyperparams sigma:0.1 --hyperparams sigma:0.3

    Example: curiosity sweep --algos ppo --bonus none,apt,rnd --n-envs 16 -n 1e6
    """
    from curiosity_algos.experiments import sweep as sweeps

    runs = options.make_runs(
        options.names("algos", algos),
        options.names("envs", envs),
        options.numbers("seeds", seeds),
        timesteps=timesteps,
        env_kwargs=env_kwargs,
        wrappers=wrapper,
        hyperparams=hyperparams,
        settings={"preset": preset, "device": device},
        bonuses=options.names("bonus", bonus),
        bonus_kwargs=bonus_kwargs,
        n_envs=n_envs,
        repeat_action=repeat_action,
    )
    options.check_all(runs)
    sweeps.sweep(runs, log_folder, jobs=jobs, interval=interval)
