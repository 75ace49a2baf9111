"""The command `curiosity`: train, watch and compare."""

from __future__ import annotations

import sys
import traceback
from functools import partial
from typing import Annotated

import gymnasium as gym
import typer

from curiosity_algos.cli.enjoy import enjoy
from curiosity_algos.cli.export import export
from curiosity_algos.cli.plot import plot, report
from curiosity_algos.cli.robustify import robustify
from curiosity_algos.cli.solve import solve
from curiosity_algos.cli.sweep import sweep
from curiosity_algos.common import names
from curiosity_algos.common.presets import PRESETS
from curiosity_gym import __version__

INTERRUPTED = 130
"""A command's status after Ctrl-C."""
app = typer.Typer(
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("train")(sweep)
for command in (solve, robustify, enjoy, export, sweep, plot, report):
    app.command()(command)


@app.command("list")
def list_names() -> None:
    """Print environments, algorithms, bonuses and presets."""
    for title, known in {
        "Environments": names.ENVIRONMENTS,
        "Algorithms": names.ALGORITHMS,
        "Algorithms of Stable-Baselines3": names.STABLE_BASELINES,
        "Algorithms of sb3-contrib": names.CONTRIB,
        "Bonuses": names.BONUS_NAMES,
        "Presets": PRESETS,
    }.items():
        typer.echo("\n  ".join([f"{title}:", *known]))


def _print_version(is_asked: bool) -> None:
    if is_asked:
        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Train policies that explore by curiosity, watch them, and compare runs."""


def _is_mistake(error: Exception) -> bool:
    """Whether this package says so: not a library, nor code of the user's, which it calls."""
    if not isinstance(error, ValueError | OSError | ImportError):
        return isinstance(error, gym.error.Error)
    frames = traceback.walk_tb(error.__traceback__)
    names = [frame.f_globals.get("__name__", "").partition(".")[0] for frame, _ in frames]
    *_, source = (name for name in names if name not in sys.stdlib_module_names)
    return source in {"curiosity_algos", "curiosity_gym"}


def main(app: typer.Typer = app) -> None:
    """Run a command, `curiosity` or another.

    A mistake is one line on standard error and a status that is not 0; what other code raises, such
    as an environment's, keeps its traceback.
    """
    try:
        status = app(sys.argv[1:] or ["--help"], standalone_mode=False)
    except KeyboardInterrupt:
        status = INTERRUPTED
    except Exception as error:
        if not (hasattr(error, "exit_code") or _is_mistake(error)):
            raise
        message = getattr(error, "format_message", partial(str, error))()
        message += "".join(f" ({note})" for note in getattr(error, "__notes__", []))
        print(f"Error: {' '.join(message.split())}", file=sys.stderr)
        sys.exit(getattr(error, "exit_code", 1))
    if status == INTERRUPTED:  # typer's status, too
        print(
            "Interrupted: a training goes on from its last checkpoint, if there is one, when the "
            "same command is given again.",
            file=sys.stderr,
        )
    sys.exit(status if isinstance(status, int) else 0)
