"""Fill an archive in a maze and use it: `python examples/quality_diversity.py`.

Writes to the output folder the archive, a heat map of its elites over the maze, and a picture of
every final position; then acts with the elite that comes nearest to a place.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import gymnasium as gym
import matplotlib
import numpy as np

from curiosity_algos import (
    AURORA,
    CMAME,
    NSLC,
    CuriosityMAPElites,
    FinalBehaviors,
    MAPElites,
)
from curiosity_algos.archives.plots import plot_archive
from curiosity_algos.loops.quality_diversity import QualityDiversity
from curiosity_gym.maze.plots import plot_density

matplotlib.use("Agg")

ALGORITHMS = {each.__name__: each for each in (NSLC, MAPElites, CMAME, CuriosityMAPElites, AURORA)}


def parse_arguments() -> argparse.Namespace:
    """What the command line says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--algorithm", choices=ALGORITHMS, default="NSLC")
    parser.add_argument("--env", default="CuriosityMaze-US-v0", help="id of a maze")
    parser.add_argument("--timesteps", type=float, default=1e7)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--target", type=float, nargs=2, metavar=("X", "Y"), help="default: goal")
    parser.add_argument("--out", type=Path, default=Path("runs/quality_diversity"))
    return parser.parse_args()


def act(model: QualityDiversity, env: gym.Env, niche: list[float]) -> np.ndarray:
    """The behavior that an episode of the elite nearest to `niche` comes to."""
    observation, info = env.reset()
    done = False
    while not done:
        action, _ = model.predict(observation, niche=niche)
        observation, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    return info["behavior"]


def main() -> None:
    """Train, report, write files, act."""
    arguments = parse_arguments()
    out = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    env = gym.make(arguments.env)
    layout, names = env.unwrapped.layout, env.unwrapped.behavior_names

    model = ALGORITHMS[arguments.algorithm](arguments.env, seed=arguments.seed)
    final = FinalBehaviors()
    model.learn(arguments.timesteps, callback=final, progress_bar=True)
    report = model.archive.verify(arguments.env)
    print(f"{arguments.algorithm} on {arguments.env}, {model.num_timesteps:,} environment steps")
    print(f"Coverage: {model.coverage:.1%} of the reachable cells.")
    print(f"Elites: {len(model.archive)}, of which {report.share:.0%} reproduce.")
    print(f"Best return: {model.best_return:.3f}")

    model.archive.save(out / "archive.npz")
    pictures = {
        "elites.png": plot_archive(model.archive, layout, behavior_names=names),
        "final_positions.png": plot_density(final.behaviors[:, :2], layout),
    }
    for name, ax in pictures.items():
        ax.figure.savefig(out / name, dpi=150, bbox_inches="tight")
    print(f"Written to {out}: archive.npz, {', '.join(pictures)}")

    x, y = arguments.target or layout.goal
    end = act(model, env, niche=[x, y, 0.0, 0.0])  # at rest
    print(f"Sent towards ({x:g}, {y:g}), the nearest elite ends at ({end[0]:.1f}, {end[1]:.1f}).")


if __name__ == "__main__":
    main()
