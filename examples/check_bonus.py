"""Is a bonus right? `python examples/check_bonus.py` says so in numbers, and in two pictures.

Replace `BONUSES` by your own: anything that makes a `Bonus` for two spaces.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from curiosity_algos import APT, ICM, RND
from curiosity_algos.bonuses.checks import (
    Learned,
    StatePrediction,
    Watched,
    check_bonus,
    watch_noisy_tv,
)

BONUSES = {"APT": APT, "ICM": ICM, "RND": RND, "state prediction": StatePrediction}
COLORS = ["tab:red", "tab:blue", "tab:orange", "tab:green"]


def main(
    out: Path = Path("runs/check_bonus"),
    seed: int = 0,
    updates: Annotated[int, typer.Option(help="Gradient steps in front of the screen.")] = 3000,
) -> None:
    """Check every bonus on the tiny MDP, and measure what a noisy screen does to it."""
    out.mkdir(parents=True, exist_ok=True)
    learned, watched = {}, {}
    for name, bonus in BONUSES.items():
        make = partial(bonus, seed=seed, device="cpu")
        learned[name] = check_bonus(make, seed)
        watched[name] = watch_noisy_tv(make, updates, seed)
        seen, unseen = learned[name].seen[-1], learned[name].unseen[-1]
        noise = watched[name].noise_share[-10:].mean()
        print(f"{name}: tiny MDP, {seen:.2g} where it was trained and {unseen:.2g} elsewhere")
        print(f"{name}: noisy TV, {noise:.0%} of the bonus comes from noise")
    draw_tiny_mdp(learned).savefig(out / "tiny_mdp.png")
    draw_noisy_tv(watched).savefig(out / "noisy_tv.png")


def draw_tiny_mdp(learned: dict[str, Learned]) -> Figure:
    """The bonus of what was seen, solid, and of what was not, dashed."""
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    for (name, curves), color in zip(learned.items(), COLORS, strict=True):
        start = curves.seen[0]
        axes.plot(curves.n_updates, curves.seen / start, color=color, label=f"{name}, seen")
        axes.plot(curves.n_updates, curves.unseen / start, "--", color=color, label="not seen")
    axes.set(xlabel="gradient steps", ylabel="bonus, as a multiple of the first", yscale="log")
    axes.set_ylim(bottom=1e-4)
    figure.legend(loc="outside upper center", ncols=4, fontsize="small")
    return figure


def draw_noisy_tv(watched: dict[str, Watched]) -> Figure:
    """The share of each bonus that noise brings."""
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    for (name, curves), color in zip(watched.items(), COLORS, strict=True):
        axes.plot(curves.n_updates, 100 * curves.noise_share, color=color, label=name)
    axes.set(xlabel="gradient steps", ylabel="bonus that comes from noise (%)", ylim=(-5, 105))
    axes.legend()
    return figure


if __name__ == "__main__":
    typer.run(main)
