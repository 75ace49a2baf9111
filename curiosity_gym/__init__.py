"""Sparse-reward environments for Gymnasium; importing this package registers their ids."""

from curiosity_gym.maze.layouts import MazeLayout
from curiosity_gym.registration import register_envs

__version__ = "0.1.0"

__all__ = ["MazeLayout", "register_envs"]

register_envs()
