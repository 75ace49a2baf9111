"""Many robots at once: the state of all in arrays, one compiled call a step."""

from __future__ import annotations

from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.fixed import fixed
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze.dynamics import Maze
from curiosity_gym.maze.maze_env import SETTINGS, MazeEnv


@fixed(*SETTINGS)
class MazeVectorEnv(EpisodicVectorEnv):
    """An `EpisodicVectorEnv`; its other arguments are those of `MazeEnv`.

    `reset(options={"state": (x, y, vx, vy)})` starts elsewhere.
    """

    layout: MazeLayout
    maze: Maze
    lidar_range: float
    single_class = MazeEnv
    taken_over = ("layout", "maze", "lidar_range")
