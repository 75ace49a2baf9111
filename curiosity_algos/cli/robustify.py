"""`curiosity robustify`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option, echo

from curiosity_algos.cli.options import Pretrained, Success, Trust, find_own_modules, is_terminal


def robustify(
    run: Annotated[
        str,
        Argument(
            help="Folder of a run that has found a success, or with --pretrained the id of an "
            "environment."
        ),
    ],
    pretrained: Pretrained = None,
    out: Annotated[
        Path | None,
        Option(
            help="Folder for the training. Without it, robust in the run's folder (with "
            "--pretrained, here)."
        ),
    ] = None,
    timesteps: Annotated[
        float, Option("--timesteps", "-n", help="Environment steps, at most.")
    ] = 1e7,
    success: Success = 0.95,
    seed: Annotated[int, Option(help="Seed of everything random.")] = 0,
    device: Annotated[str, Option(help="Device of neural networks: auto, cpu or cuda.")] = "auto",
    interval: Annotated[float, Option(help="Seconds between two checkpoints.")] = 60.0,
    trust: Trust = False,
) -> None:
    """Train a policy that holds from any start, by a run's episodes.

    The policy is PPO's, and its folder is a run as others. What was interrupted continues when the
    same command is given again.

    Example: curiosity robustify runs/CuriosityES/CuriosityLocomotion-AntTrap-v0/0

    Example: curiosity robustify --pretrained curiosity_es CuriosityLocomotion-AntTrap-v0
    """
    from curiosity_algos.experiments.robust_run import robustify_run

    if trust:
        find_own_modules()
    source = Path(run) if pretrained is None else (pretrained, run)
    folder = (source if isinstance(source, Path) else Path()) / "robust" if out is None else out
    starts = robustify_run(
        source,
        folder,
        timesteps=timesteps,
        success=success,
        seed=seed,
        device=device,
        interval=interval,
        trust=trust,
        progress_bar=is_terminal(),
    )
    echo(f"{folder}: succeeds by its best actions from {starts}")
