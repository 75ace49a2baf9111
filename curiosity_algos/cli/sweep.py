"""`curiosity train`, which is also `curiosity sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option, echo

from curiosity_algos.cli import options

if TYPE_CHECKING:
    from curiosity_algos.experiments.run_spec import RunSpec


def _pairs(name: str, more: str = "") -> Any:
    text = f"{name} and its value. Repeat the option for others{more}."
    return Option(metavar="NAME:VALUE", help=text)


def sweep(
    algos: Annotated[
        str,
        Option(
            "--algo",
            "--algos",
            help="Algorithms in any spelling, such as curiosity_es,map-elites,ppo.",
            autocompletion=options.ALGOS,
        ),
    ] = "curiosity_es",
    envs: Annotated[
        str,
        Option(
            "--env",
            "--envs",
            help="Ids of environments, likewise; MODULE:ID is one that a module registers.",
            autocompletion=options.ENVS,
        ),
    ] = "CuriosityMaze-Hard-v0",
    seeds: Annotated[str, Option("--seed", "--seeds", help="Seeds, likewise, or as 0-4.")] = "0",
    timesteps: Annotated[
        float, Option("--timesteps", "-n", help="Environment steps of a run.")
    ] = 1e7,
    log_folder: Annotated[
        Path,
        Option(
            "--log-folder", "-f", help="Folder for the runs, which go to FOLDER/algorithm/env/seed."
        ),
    ] = Path("runs"),
    env_kwargs: Annotated[list[str] | None, _pairs("A keyword of the environment")] = None,
    wrapper: Annotated[
        list[str] | None,
        Option(
            metavar="CLASS[:NAME=VALUE...]",
            help="Wrapper of the environment, such as minigrid.wrappers.FlatObsWrapper, and its "
            "keywords. Repeat the option for others, from the inside out.",
        ),
    ] = None,
    hyperparams: Annotated[
        list[str] | None,
        _pairs("A setting of the algorithm", "; of several values of one setting, all are tried"),
    ] = None,
    bonus: Annotated[
        str,
        Option(
            help="Bonuses that algorithms explore by, likewise, such as none,apt,rnd. For an "
            "algorithm of Stable-Baselines3's own a bonus is added to the reward.",
            autocompletion=options.BONUSES,
        ),
    ] = "none",
    bonus_kwargs: Annotated[
        list[str] | None,
        _pairs("A keyword of the bonus or of what adds it to the reward, such as weight:0.5,"),
    ] = None,
    n_envs: Annotated[
        int,
        Option(help="Environments side by side, for an algorithm of Stable-Baselines3's own."),
    ] = 1,
    repeat_action: Annotated[
        int,
        Option(help="Steps for which an action is repeated. Timesteps then count actions."),
    ] = 1,
    settle: Annotated[
        float | None,
        Option(
            help="Timesteps in which the learning rate of an algorithm of Stable-Baselines3's own "
            "shrinks to 1 / e while at least half of its episodes succeed, where rewards are "
            "sparse. Without it, the rate stays."
        ),
    ] = None,
    preset: Annotated[
        str | None,
        Option(help="Settings to begin with, paper or tuned. Without it, the defaults."),
    ] = None,
    device: Annotated[
        str | None, Option(help="Device of neural networks: auto, cpu or cuda.")
    ] = None,
    jobs: Annotated[
        int | None, Option(help="Runs at a time. Without it, one for each processor.")
    ] = None,
    interval: Annotated[float, Option(help="Seconds between two checkpoints of a run.")] = 60.0,
) -> None:
    """Train each algorithm on each environment with each seed.

    Each run has a folder. Runs that are finished are left alone, and those that were interrupted
    continue when the same command is given again.

    Example: curiosity train --algo curiosity_es --env CuriosityMaze-Hard-v0 -n 1e7

    Example: curiosity train --algo ppo --bonus apt --n-envs 16 --repeat-action 10 --hyperparams
    n_steps:64 --settle 6e4 -n 3e5

    Example: curiosity sweep --algos nses --seeds 0-4 --hyperparams sigma:0.1 --hyperparams
    sigma:0.3
    """
    env_ids = options.names("envs", envs)
    if wrapper or any(":" in env for env in env_ids):
        options.find_own_modules()
    from curiosity_algos.experiments import sweep as sweeps

    settings = options.alternatives("hyperparams", hyperparams)
    given = {"preset": preset, "device": device}
    settings |= {name: [value] for name, value in given.items() if value is not None}
    runs = sweeps.grid(
        options.names("algos", algos),
        env_ids,
        options.numbers("seeds", seeds),
        {name: values for name, values in settings.items() if len(values) > 1},
        settings={name: values[0] for name, values in settings.items() if len(values) == 1},
        bonuses=[None if name == "none" else name for name in options.names("bonus", bonus)],
        timesteps=timesteps,
        env_kwargs=options.keywords("env-kwargs", env_kwargs),
        bonus_kwargs=options.keywords("bonus-kwargs", bonus_kwargs),
        wrappers=[options.wrapping(text) for text in wrapper or []],
        n_envs=n_envs,
        repeat_action=repeat_action,
        settle=settle,
    )
    if len(runs) > 1 or jobs is not None:
        options.check_all(runs)
        sweeps.sweep(runs, log_folder, jobs=jobs, interval=interval)
        return
    _train(runs[0], runs[0].folder(log_folder), interval)


def _train(run: RunSpec, folder: Path, interval: float) -> None:
    from curiosity_algos.experiments import training

    if training.train(run, folder, interval=interval, progress_bar=options.is_terminal()):
        echo(training.summary(folder))
    else:
        echo(f"{folder} is finished.")
