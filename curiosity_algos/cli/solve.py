"""`curiosity solve`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option, echo

from curiosity_algos.cli import options
from curiosity_algos.cli.enjoy import draw_off_screen


def solve(
    env: Annotated[
        str,
        Argument(
            help="Id of the environment; MODULE:ID is one that a module registers.",
            autocompletion=options.ENVS,
        ),
    ],
    seed: Annotated[int, Option(help="Seed of everything random.")] = 0,
    search_timesteps: Annotated[
        float, Option(help="Environment steps of the search, at most.")
    ] = 1e7,
    timesteps: Annotated[
        float, Option("--timesteps", "-n", help="Environment steps of the training, at most.")
    ] = 1e7,
    episodes: Annotated[
        int,
        Option(
            help="Episodes that end the search, from 1 to 10; the best of them is learned from."
        ),
    ] = 10,
    success: options.Success = 0.95,
    log_folder: Annotated[
        Path,
        Option(
            "--log-folder",
            "-f",
            help="Folder for the run, which goes to FOLDER/GoExplore/env/seed.",
        ),
    ] = Path("runs"),
    env_kwargs: Annotated[
        list[str] | None,
        Option(metavar="NAME:VALUE", help="A keyword of the environment. Repeat it for others."),
    ] = None,
    hyperparams: Annotated[
        list[str] | None,
        Option(metavar="NAME:VALUE", help="A setting of the search. Repeat it for others."),
    ] = None,
    device: Annotated[str, Option(help="Device of neural networks: auto, cpu or cuda.")] = "auto",
    interval: Annotated[float, Option(help="Seconds between two checkpoints.")] = 60.0,
    film: Annotated[
        bool, Option(help="Write best_policy.gif, a film of the policy, into its folder.")
    ] = True,
) -> None:
    """Find an episode that succeeds, and train a policy by it.

    The search restores states of the environment. An episode succeeds if its last info says
    is_success, or else if its return is above 0. What was interrupted continues when the same
    command is given again. The policy is PPO's, in the folder robust of the run.

    Example: curiosity solve CuriosityMaze-Hard-v0
    """
    from curiosity_algos.experiments.film import can_draw
    from curiosity_algos.experiments.film import film as write
    from curiosity_algos.experiments.robust_run import solve_run
    from curiosity_algos.experiments.run_spec import RunSpec

    if ":" in env:
        options.find_own_modules()
    settings = {"device": device, **options.keywords("hyperparams", hyperparams)}
    kwargs = options.keywords("env-kwargs", env_kwargs)
    run = RunSpec("GoExplore", env, seed, search_timesteps, env_kwargs=kwargs, settings=settings)
    folder = run.folder(log_folder)
    starts = solve_run(
        run,
        folder,
        n_episodes=episodes,
        timesteps=timesteps,
        success=success,
        device=device,
        interval=interval,
        progress_bar=options.is_terminal(),
    )
    robust = folder / "robust"
    echo(f"{robust}: succeeds by its best actions from {starts}")
    if film and not can_draw(robust):
        echo(f"{env} draws no pictures: there is no film.")
    elif film:
        draw_off_screen()
        path = robust / "best_policy.gif"
        write(robust, path, stride=10, trust=True)
        echo(path)
