"""Train on a maze of your own, drawn in ASCII: `python examples/custom_maze.py`."""

from __future__ import annotations

import argparse

import gymnasium as gym

from curiosity_algos import CuriosityES
from curiosity_gym import MazeLayout

TWO_ROOMS = """
##########
#...#....#
#.S.#..G.#
#...#....#
#...#....#
#........#
##########
"""


def main() -> None:
    """Make the maze, save it as JSON, and search it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--timesteps", type=float, default=2e6)
    timesteps = parser.parse_args().timesteps

    layout = MazeLayout.from_ascii(TWO_ROOMS, name="two-rooms")
    env = gym.make("CuriosityMaze-v0", layout=layout, horizon=500)
    model = CuriosityES(env, seed=0).learn(timesteps)
    print(f"{layout.name}: {len(layout.walls)} walls, {layout.width:g} x {layout.height:g} units")
    print(f"Coverage: {model.coverage:.1%} of the reachable cells.")
    print(f"Best return: {model.best_return:.3f}")


if __name__ == "__main__":
    main()
