"""The command `curiosity`: train, watch and compare."""

from __future__ import annotations

import ast
import sys
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import typer
from tqdm import tqdm

from curiosity_gym.validation import check_at_least_one

app = typer.Typer(
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Curiosity-driven policy search.",
)

Algo = Annotated[
    str,
    typer.Option("--algo", help="An algorithm, in any spelling: curiosity_es, NSES, map-elites."),
]
Env = Annotated[str, typer.Option("--env", help="Id of an environment.")]
Timesteps = Annotated[
    float,
    typer.Option(
        "--timesteps", "-n", "--n-timesteps", "--total-timesteps", help="Budget, such as 1e7."
    ),
]
LogFolder = Annotated[
    Path, typer.Option("--log-folder", "-f", help="Where runs are: FOLDER/algorithm/env/seed.")
]
Keywords = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME:VALUE", help="A keyword and its value; may be given many times."),
]
Preset = Annotated[str | None, typer.Option(help="Settings to begin with: paper or tuned.")]
Device = Annotated[str, typer.Option(help="Where networks are, as in Stable-Baselines3.")]


@app.command()
def train(
    algo: Algo = "curiosity_es",
    env: Env = "CuriosityMaze-Hard-v0",
    timesteps: Timesteps = 1e7,
    seed: Annotated[int, typer.Option(help="Of everything random.")] = 0,
    log_folder: LogFolder = Path("runs"),
    env_kwargs: Keywords = None,
    hyperparams: Keywords = None,
    preset: Preset = None,
    device: Device = "auto",
    num_threads: Annotated[int | None, typer.Option(help="None: as many as processors.")] = None,
    progress: Annotated[bool, typer.Option("--progress", "-P", help="Show a bar.")] = False,
) -> None:
    """Train one model and keep its run in a folder; one that was interrupted goes on.

    Example: curiosity train --algo curiosity_es --env CuriosityMaze-Hard-v0 -n 1e7 -P
    """
    from curiosity_algos.experiments import training

    settings = _settings(hyperparams, preset, device, num_threads)
    run = training.Run(algo, env, seed, timesteps, _keywords("env-kwargs", env_kwargs), settings)
    run.check()
    folder = run.folder(log_folder)
    if not training.train(run, folder, progress_bar=progress):
        typer.echo(f"{folder} is finished.")
        return
    typer.echo(_summary(folder))


@app.command()
def enjoy(
    run: Annotated[Path, typer.Argument(help="The folder of a run.")],
    out: Annotated[
        Path | None, typer.Option(help="A GIF or MP4; None: best_policy.gif in the run's folder.")
    ] = None,
    stride: Annotated[int, typer.Option(help="Environment steps from frame to frame.")] = 10,
    seed: Annotated[int, typer.Option(help="Of the environment.")] = 0,
) -> None:
    """Record an episode of a run's best policy, and print its return.

    Example: curiosity enjoy runs/CuriosityES/CuriosityMaze-Hard-v0/0
    """
    from curiosity_algos.experiments import film

    check_at_least_one(stride=stride)
    path = run / "best_policy.gif" if out is None else out
    total = film.film(run, path, stride=stride, seed=seed)
    typer.echo(f"Return {total:.3f}: {path}")


@app.command()
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

    settings = _settings(hyperparams, preset, device, None)
    common = {"timesteps": timesteps, "settings": settings}
    common["env_kwargs"] = _keywords("env-kwargs", env_kwargs)
    runs = many.grid(algos.split(","), envs.split(","), _numbers("seeds", seeds), **common)
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
                bar.write(_summary(run.folder(log_folder)))

        many.sweep(runs, log_folder, jobs=jobs, interval=interval, report=report)
    if errors:
        raise ValueError(f"{len(errors)} of {len(runs)} runs failed: {'; '.join(errors)}")


@app.command(name="list")
def list_() -> None:
    """Print environments, algorithms and presets."""
    from curiosity_algos.experiments.names import ALGORITHMS, ENVIRONMENTS
    from curiosity_algos.loops.presets import PRESETS

    for title, names in [
        ("Environments", ENVIRONMENTS),
        ("Algorithms", ALGORITHMS),
        ("Presets", PRESETS),
    ]:
        typer.echo("\n  ".join([f"{title}:", *names]))


def _settings(
    hyperparams: list[str] | None, preset: str | None, device: str, n_threads: int | None
) -> dict[str, Any]:
    settings = {"device": device, **_keywords("hyperparams", hyperparams)}
    if preset is not None:
        settings["preset"] = preset
    if n_threads is not None:
        settings["n_threads"] = n_threads
    return settings


def _keywords(option: str, pairs: list[str] | None) -> dict[str, Any]:
    """Keywords of `NAME:VALUE`, values as Python writes them, or text."""
    keywords = {}
    for pair in pairs or []:
        name, colon, value = pair.partition(":")
        if not colon or not name.isidentifier():
            raise ValueError(f"--{option} must be NAME:VALUE, got {pair}.")
        keywords[name] = _value(value)
    return keywords


def _value(text: str) -> Any:
    try:
        return ast.literal_eval(text)
    except (MemoryError, RecursionError, SyntaxError, TypeError, ValueError):
        return text


def _numbers(option: str, text: str) -> list[int]:
    if not all(part.strip().isdecimal() for part in text.split(",")):
        raise ValueError(f"--{option} must be whole numbers with commas, got {text}.")
    return [int(part) for part in text.split(",")]


def _summary(folder: Path) -> str:
    """A run's result in a line."""
    from curiosity_algos.experiments import RunFolder

    result = RunFolder(folder).result()
    first = result["first_success_timesteps"]
    found = "no reward" if first is None else f"first reward after {first:,} timesteps"
    shares = [f"{name} {share:.1%}" for name, share in result["coverage"].items()]
    coverage = f", coverage {', '.join(shares)}" if shares else ""
    best = result["best_return"]
    return f"{folder}: best return {'none' if best is None else f'{best:.3f}'}, {found}{coverage}"


def main() -> None:
    """Run the command; a mistake is one line on standard error and a status that is not 0."""
    try:
        status = app(sys.argv[1:] or ["--help"], standalone_mode=False)
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception as error:
        message = getattr(error, "format_message", error.__str__)()
        if not isinstance(error, ValueError | OSError | ImportError | gym.error.Error) and (
            not hasattr(error, "exit_code")
        ):
            raise
        print(f"Error: {' '.join(message.split())}", file=sys.stderr)
        sys.exit(getattr(error, "exit_code", 1))
    sys.exit(status if isinstance(status, int) else 0)
