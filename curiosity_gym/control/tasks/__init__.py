"""The control tasks by name, one domain of the DeepMind Control Suite a file."""

from curiosity_gym.control.tasks.ball_in_cup import BallInCup
from curiosity_gym.control.tasks.base import ControlTask
from curiosity_gym.control.tasks.finger import Finger
from curiosity_gym.control.tasks.stacker import Stacker

TASKS: dict[str, type[ControlTask]] = {
    "ball_in_cup": BallInCup,
    "finger": Finger,
    "stacker": Stacker,
}

__all__ = ["TASKS", "BallInCup", "ControlTask", "Finger", "Stacker"]
