"""Is a bonus right? `python examples/check_bonus.py` says so in numbers, and in two pictures.

Replace `BONUSES` by your own: anything that makes a `Bonus` for two spaces.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import torch as th
import typer
from gymnasium import spaces
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from curiosity_algos import APT, ICM, RND
from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.bonuses.checks import Learned, check_bonus
from curiosity_algos.common.networks import single_torch_thread

N_SIGNALS, N_CHANNELS, N_ACTIONS, BATCH_SIZE = 4, 4, 3, 256
LENGTH = 16
"""Transitions of an episode, which stand side by side."""
SCREENS = ("changing", "constant", "drifting", "switched")
"""What the television shows: noise of each step, of an episode, a walk, or anew by the button."""


class StatePrediction(ICM):
    """Predicts the next state itself, without features: what a noisy screen catches."""

    name = "state"

    def __init__(
        self, observation_space: spaces.Box, action_space: spaces.Space, **kwargs: object
    ) -> None:
        n_entries = observation_space.shape[0]
        super().__init__(observation_space, action_space, beta=1.0, n_features=n_entries, **kwargs)
        self.encoder = th.nn.Identity()


BONUSES = {
    "APT": APT,
    "APT, selective": partial(APT, selective=True),
    "ICM": ICM,
    "RND": RND,
    "state prediction": StatePrediction,
}
COLORS = ["tab:red", "tab:purple", "tab:blue", "tab:orange", "tab:green"]


def main(
    out: Path = Path("runs/check_bonus"),
    seed: int = 0,
    updates: Annotated[int, typer.Option(help="Gradient steps in front of the screen.")] = 3000,
) -> None:
    """Check every bonus on the tiny MDP, and measure what a noisy screen does to it."""
    out.mkdir(parents=True, exist_ok=True)
    learned, shares = {}, {}
    for name, bonus in BONUSES.items():
        make = partial(bonus, seed=seed, device="cpu")
        learned[name] = check_bonus(make, seed)
        shares[name] = {each: watch_noisy_tv(make, updates, seed, each) for each in SCREENS}
        seen, unseen = learned[name].seen[-1], learned[name].unseen[-1]
        noise = ", ".join(
            f"{each} {round(100 * curve[-10:].mean())}%" for each, curve in shares[name].items()
        )
        print(f"{name}: tiny MDP, {seen:.2g} where it was trained and {unseen:.2g} elsewhere")
        print(f"{name}: noise's share: {noise}")
    draw_tiny_mdp(learned).savefig(out / "tiny_mdp.png")
    draw_noisy_tv(shares, updates).savefig(out / "noisy_tv.png")


def noisy_tv(n: int, *, seed: int, screen: str, is_on: bool = True) -> tuple[np.ndarray, ...]:
    """Transitions of a walker in front of a television, whole episodes of `LENGTH`.

    Four entries of an observation are what actions move, four are the screen: noise of one of the
    kinds in `SCREENS`, or gray, its mean, where it is off. The first action is the button.
    """
    rng = np.random.default_rng(seed)
    directions = np.random.default_rng(0).normal(0.0, 0.5, (N_ACTIONS, N_SIGNALS))
    positions = rng.uniform(-1.0, 1.0, (n, N_SIGNALS))
    actions = rng.integers(0, N_ACTIONS, n)
    now, new = rng.uniform(-1.0, 1.0, (2, n, N_CHANNELS))
    if screen != "changing":
        now = now[::LENGTH].repeat(LENGTH, axis=0)[:n]
        if screen == "switched":
            new = np.where((actions == 0)[:, None], new, now)
        else:
            scale = 0.1 if screen == "drifting" else 0.0
            walks = rng.normal(0.0, scale, (n // LENGTH, LENGTH + 1, N_CHANNELS)).cumsum(axis=1)
            starts = now
            now, new = (
                starts + each.reshape(n, N_CHANNELS) for each in (walks[:, :-1], walks[:, 1:])
            )
    before = np.hstack([positions, now * is_on])
    after = np.hstack([positions + directions[actions], new * is_on])
    return before.astype(np.float32), actions, after.astype(np.float32)


def watch_noisy_tv(
    make_bonus: Callable[..., Bonus], n_updates: int, seed: int, screen: str
) -> np.ndarray:
    """Train a bonus where a screen shows noise; the share of the bonus that is for noise alone.

    What is left of it before a gray screen is not: `1 - gray / noisy`, at 31 moments at most.
    """
    space = spaces.Box(-np.inf, np.inf, (N_SIGNALS + N_CHANNELS,))
    bonus = make_bonus(space, spaces.Discrete(N_ACTIONS))
    noisy, gray = (noisy_tv(1008, seed=seed, screen=screen, is_on=each) for each in (True, False))
    watched = noisy_tv(BATCH_SIZE * n_updates, seed=seed + 1, screen=screen)
    stream = [th.from_numpy(each) for each in watched]
    batches = iter(zip(*(th.split(each, BATCH_SIZE) for each in stream), strict=True))
    shares = []
    with single_torch_thread():
        for n in np.diff(moments(n_updates), prepend=0):
            bonus.observe(stream[0])
            for _ in range(n):
                before, actions, after = next(batches)
                bonus.update(before, actions[:, None].float(), after)
            shares.append(1.0 - bonus.score(*gray).mean() / bonus.score(*noisy).mean())
    return np.array(shares)


def moments(n_updates: int) -> np.ndarray:
    """Gradient steps after which a bonus is looked at."""
    return np.unique(np.linspace(0, n_updates, 31).astype(np.int64))


def draw_tiny_mdp(learned: dict[str, Learned]) -> Figure:
    """The bonus of what was seen, solid, and of what was not, dashed."""
    figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
    for (name, curves), color in zip(learned.items(), COLORS, strict=True):
        start = curves.seen[0]
        axes.plot(curves.n_updates, curves.seen / start, color=color, label=f"{name}, seen")
        axes.plot(curves.n_updates, curves.unseen / start, "--", color=color, label="not seen")
    axes.set(xlabel="gradient steps", ylabel="bonus, as a multiple of the first", yscale="log")
    axes.set_ylim(bottom=1e-4)
    figure.legend(loc="outside upper center", ncols=len(learned), fontsize="small")
    return figure


def draw_noisy_tv(shares: dict[str, dict[str, np.ndarray]], n_updates: int) -> Figure:
    """The share of each bonus that noise brings, for each kind of noise."""
    figure, axes = plt.subplots(
        2, 2, figsize=(8, 6), sharex=True, sharey=True, layout="constrained"
    )
    for screen, ax in zip(SCREENS, axes.flat, strict=True):
        for (name, curves), color in zip(shares.items(), COLORS, strict=True):
            label = name if screen == SCREENS[0] else None
            ax.plot(moments(n_updates), 100 * curves[screen], color=color, label=label)
        ax.set(title=f"{screen} noise", ylim=(-5, 105))
    figure.supxlabel("gradient steps")
    figure.supylabel("bonus that comes from noise (%)")
    figure.legend(loc="outside upper center", ncols=5, fontsize="small")
    return figure


if __name__ == "__main__":
    typer.run(main)
