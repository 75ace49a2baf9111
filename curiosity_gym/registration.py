"""Every environment id of this package."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

_MAZES = {"Snake": "snake", "US": "us", "Hard": "hard", "Labyrinth": "labyrinth"}

SPECS: dict[str, dict[str, Any]] = {
    **{f"CuriosityMaze-{name}-v0": {"layout": layout} for name, layout in _MAZES.items()},
    **{f"Maze-{name}-v0": {"layout": layout} for name, layout in _MAZES.items()},
    "CuriosityMaze-v0": {},
}
"""Id: keywords of the environment."""


def register_envs() -> None:
    """Register every id with Gymnasium; ids already there stay as they are."""
    for env_id, kwargs in SPECS.items():
        if env_id not in gym.registry:
            # No TimeLimit: the env itself truncates, so that reward and end always agree.
            gym.register(
                env_id,
                entry_point="curiosity_gym.maze.maze_env:MazeEnv",
                vector_entry_point="curiosity_gym.maze.vector_env:MazeVectorEnv",
                max_episode_steps=None,
                kwargs=kwargs,
            )
