"""Train CuriosityES on a maze and write what came of it: `python examples/train_curiosity_es.py`.

Writes to the output folder the model, a CSV of progress, a picture of every final position over the
maze, a picture of coverage and best return against timesteps, and an animation of the best policy.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import gymnasium as gym
import matplotlib
import numpy as np
import typer
from PIL import Image
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from curiosity_algos import CuriosityES, FinalBehaviors
from curiosity_gym.maze.plots import plot_density

matplotlib.use("Agg")
from matplotlib import pyplot as plt

STRIDE = 10
"""Environment steps between two frames of the animation."""


class History(BaseCallback):
    """Keeps coverage and best return of each generation."""

    def __init__(self) -> None:
        super().__init__()
        self.progress: list[tuple[float, float, float]] = []

    def _on_step(self) -> bool:
        model = self.model
        self.progress.append((model.num_timesteps, model.coverage, model.best_return))
        return True


def draw_positions(positions: np.ndarray, layout: object, path: Path) -> None:
    """Every final position over the maze, colored by density."""
    ax = plot_density(positions, layout)
    ax.figure.savefig(path, dpi=150, bbox_inches="tight")
    plt.close(ax.figure)


def draw_progress(history: History, path: Path) -> None:
    """Coverage and best return against timesteps."""
    timesteps, coverage, best_return = np.array(history.progress).T
    figure, (upper, lower) = plt.subplots(2, 1, sharex=True, figsize=(7, 6), layout="constrained")
    upper.plot(timesteps, 100.0 * coverage)
    upper.set(ylabel="coverage (% of reachable cells)", ylim=(0, 100))
    lower.plot(timesteps, best_return)
    lower.set(ylabel="best return", xlabel="environment steps", ylim=(0, 1))
    for ax in (upper, lower):
        ax.grid(alpha=0.3)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def animate(model: CuriosityES, env_id: str, path: Path) -> None:
    """One episode of the best policy as a GIF."""
    env = gym.make(env_id, render_mode="rgb_array")
    observation, _ = env.reset()
    frames, t, done = [env.render()], 0, False
    while not done:
        action, _ = model.predict(observation, deterministic=True)
        observation, _, terminated, truncated, _ = env.step(action)
        t, done = t + 1, terminated or truncated
        if done or t % STRIDE == 0:
            frames.append(env.render())
    env.close()
    first, *others = [Image.fromarray(frame) for frame in frames]
    first.save(path, save_all=True, append_images=others, duration=50, loop=0)


def main(
    env_id: Annotated[str, typer.Option("--env")] = "CuriosityMaze-Hard-v0",
    timesteps: float = 2e7,
    seed: int = 0,
    preset: str | None = None,
    out: Path = Path("runs/demo"),
) -> None:
    """Train CuriosityES and write a report."""
    out.mkdir(parents=True, exist_ok=True)
    print(f"CuriosityES on {env_id}, seed {seed}, {timesteps:,.0f} environment steps")
    make = CuriosityES if preset is None else partial(CuriosityES.from_preset, preset)
    model = make(env_id, seed=seed)
    model.set_logger(configure(str(out), ["csv"]))
    history, ends = History(), FinalBehaviors()
    model.learn(timesteps, callback=[history, ends], progress_bar=True)
    model.save(out / "model")

    if model.first_success_timesteps is None:
        print("The goal was not reached.")
    else:
        print(f"First reward after {model.first_success_timesteps:,} environment steps.")
    print(f"Coverage: {model.coverage:.1%} of the reachable cells.")
    print(f"Best return: {model.best_return:.3f}")

    layout = gym.make(env_id).unwrapped.layout
    draw_positions(ends.behaviors[:, :2], layout, out / "final_positions.png")
    draw_progress(history, out / "coverage_and_return.png")
    animate(model, env_id, out / "best_policy.gif")
    print(f"Written to {out}: {', '.join(sorted(path.name for path in out.iterdir()))}")


if __name__ == "__main__":
    typer.run(main)
