"""The control tasks by name."""

from curiosity_gym.control.tasks.base import TASKS, BallInCup, ControlTask, Finger, Stacker

__all__ = ["TASKS", "BallInCup", "ControlTask", "Finger", "Stacker"]
