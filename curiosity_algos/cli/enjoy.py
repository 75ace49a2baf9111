"""`curiosity enjoy`."""

from __future__ import annotations

import ctypes.util
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option, echo

from curiosity_algos.cli.options import Pretrained, Trust, find_own_modules
from curiosity_gym.validation import check_at_least_one

if TYPE_CHECKING:
    from curiosity_algos.robust.measure import Starts


def enjoy(
    run: Annotated[
        str, Argument(help="Folder of a run, or with --pretrained the id of an environment.")
    ],
    pretrained: Pretrained = None,
    out: Annotated[
        Path | None,
        Option(
            help="GIF or MP4 to write. Without it, a window shows the episode. Without a screen, "
            "too, it is written to best_policy.gif in the run's folder (with --pretrained, here)."
        ),
    ] = None,
    no_render: Annotated[
        bool, Option("--no-render", help="Print the return, and draw nothing.")
    ] = False,
    stride: Annotated[int, Option(help="Environment steps from frame to frame.")] = 10,
    seed: Annotated[
        int | None,
        Option(help="Seed of the episode. Without it, that of the policy's best, or 0."),
    ] = None,
    starts: Annotated[
        int,
        Option(
            help="Episodes, whose seeds count up: side by side in a film, with their mean return "
            "and how many succeed."
        ),
    ] = 1,
    trust: Trust = False,
) -> None:
    """Show or record an episode of a trained policy.

    It is the best policy of a run, or one that comes with the package.

    Example: curiosity enjoy runs/CuriosityES/CuriosityMaze-Hard-v0/0

    Example: curiosity enjoy --pretrained curiosity_es CuriosityMaze-Hard-v0
    """
    from curiosity_algos.experiments import film

    check_at_least_one(stride=stride, starts=starts)
    if trust:
        find_own_modules()
    source = Path(run) if pretrained is None else (pretrained, run)
    if no_render:
        echo(_result(film.play(source, seed=seed, n_starts=starts, trust=trust)))
    elif out is None and has_screen() and starts == 1:
        echo(_result(film.watch(source, seed=seed, trust=trust)))
    else:
        draw_off_screen()
        folder = source if isinstance(source, Path) else Path()
        path = folder / "best_policy.gif" if out is None else out
        played = film.film(source, path, stride=stride, seed=seed, n_starts=starts, trust=trust)
        echo(f"{_result(played)}: {path}")


def _result(played: Starts) -> str:
    """The return of an episode, or of several the mean return and how many succeeded."""
    if len(played.success) == 1:
        return f"Return {played.mean_return:.3f}"
    return f"Mean return {played.mean_return:.3f}, success from {played}"


def draw_off_screen() -> None:
    """Let MuJoCo draw where there is no screen."""
    for name in ("EGL", "OSMesa"):
        if not has_screen() and ctypes.util.find_library(name):
            os.environ.setdefault("MUJOCO_GL", name.lower())


def has_screen() -> bool:
    """Whether windows are visible: SDL's driver draws on a screen, and there is a display."""
    if os.environ.get("SDL_VIDEODRIVER") in ("dummy", "offscreen"):
        return False
    needs_display = sys.platform not in ("darwin", "win32")
    return not needs_display or bool(os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY"})
