"""`curiosity train`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from curiosity_algos.cli import options


def train(
    algo: Annotated[
        str,
        typer.Option(
            help="Name of the algorithm, in any spelling: curiosity_es, map-elites, and of "
            "Stable-Baselines3 ppo or SAC.",
            autocompletion=options.ALGOS,
        ),
    ] = "curiosity_es",
    env: Annotated[
        str,
        typer.Option(
            help="Id of the environment, or MODULE:ID of one that a module registers, which may "
            "lie in the working directory.",
            autocompletion=options.ENVS,
        ),
    ] = "CuriosityMaze-Hard-v0",
    timesteps: options.Timesteps = 1e7,
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 0,
    log_folder: options.LogFolder = Path("runs"),
    env_kwargs: options.EnvKeywords = None,
    wrapper: options.Wrappers = None,
    hyperparams: options.Keywords = None,
    bonus: Annotated[
        str,
        typer.Option(
            help="Bonus that the algorithm explores by, such as apt or rnd: for one of "
            "Stable-Baselines3's own it is added to the reward. Without it, the algorithm as it "
            "is.",
            autocompletion=options.BONUSES,
        ),
    ] = "none",
    bonus_kwargs: options.BonusKeywords = None,
    n_envs: options.NEnvs = 1,
    repeat_action: options.RepeatAction = 1,
    preset: options.Preset = None,
    device: options.Device = None,
    num_threads: Annotated[
        int | None, typer.Option(help="Number of threads. Without it, one for each processor.")
    ] = None,
    progress: Annotated[
        bool | None,
        typer.Option(
            "--progress/--no-progress",
            "-P",
            help="Show a progress bar. Without it, there is one on a terminal.",
        ),
    ] = None,
    interval: options.Interval = 60.0,
) -> None:
    """Train one model, and keep its run in a folder.

    A run that was interrupted goes on when the same command is given again.

    Example: curiosity train --algo curiosity_es --env CuriosityMaze-Hard-v0 -n 1e7

    Example: curiosity train --algo ppo --bonus apt --bonus-kwargs weight:0.02 --n-envs 16
    --repeat-action 10 --hyperparams n_steps:64 -n 3e5
    """
    from curiosity_algos.experiments import training

    options.keywords("hyperparams", hyperparams)  # a sweep's may have several values
    (run,) = options.make_runs(
        [algo],
        [env],
        [seed],
        timesteps=timesteps,
        env_kwargs=env_kwargs,
        wrappers=wrapper,
        hyperparams=hyperparams,
        settings={"preset": preset, "device": device, "n_threads": num_threads},
        bonuses=[bonus],
        bonus_kwargs=bonus_kwargs,
        n_envs=n_envs,
        repeat_action=repeat_action,
    )
    folder = run.folder(log_folder)
    if progress is None:
        progress = sys.stdout.isatty() and sys.stderr.isatty()
    if not training.train(run, folder, interval=interval, progress_bar=progress):
        typer.echo(f"{folder} is finished.")
        return
    typer.echo(training.summary(folder))
