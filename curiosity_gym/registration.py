"""Every environment id of this package."""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium as gym

_MAZES = {"Snake": "snake", "US": "us", "Hard": "hard", "Labyrinth": "labyrinth"}
_CONTROL = {"BallInCup": "ball_in_cup", "Finger": "finger", "Stacker": "stacker"}
_LOCOMOTION = ("Ant", "HalfCheetah", "Hopper", "Humanoid", "Swimmer", "Walker2d")
_SPARSE = {
    "PointMaze_UMaze": "PointMaze_UMaze-v3",
    "PointMaze_Large": "PointMaze_Large-v3",
    "AntMaze_UMaze": "AntMaze_UMaze-v5",
    "CartPoleSwingUp": "dm_control/cartpole-swingup_sparse-v0",
    "AcrobotSwingUp": "dm_control/acrobot-swingup_sparse-v0",
}


def _spec(kind: str, **kwargs: Any) -> dict[str, Any]:
    """Of the environment and the vector environment of `maze`, `control` or `locomotion`."""
    module, name = f"curiosity_gym.{kind}.{kind}_env", kind.capitalize()
    return {
        "entry_point": f"{module}:{name}Env",
        "vector_entry_point": f"{module}:{name}VectorEnv",
        "kwargs": kwargs,
    }


_maze, _control = partial(_spec, "maze"), partial(_spec, "control")


def _locomotion(robot: str, **kwargs: Any) -> dict[str, Any]:
    return _spec("locomotion", env_id=f"{robot}-v5", **kwargs)


_SPARSE_ENV = {"entry_point": "curiosity_gym.wrappers.ready_made:SparseEnv"}


SPECS: dict[str, dict[str, Any]] = {
    **{f"CuriosityMaze-{name}-v0": _maze(layout=layout) for name, layout in _MAZES.items()},
    **{f"Maze-{name}-v0": _maze(layout=layout) for name, layout in _MAZES.items()},
    "CuriosityMaze-v0": _maze(),
    **{f"CuriosityControl-{name}-v0": _control(task=task) for name, task in _CONTROL.items()},
    **{f"CuriosityLocomotion-{robot}-v0": _locomotion(robot) for robot in _LOCOMOTION},
    "CuriosityLocomotion-AntTrap-v0": _locomotion("Ant", world="trap", sparse=True),
    "CuriosityLocomotion-AntMaze-v0": _locomotion("Ant", world="maze", sparse=True),
    # Whoever falls goes on: a random humanoid has fallen after half a second.
    "CuriosityLocomotion-HumanoidTrap-v0": _locomotion(
        "Humanoid",
        world="small_trap",
        sparse=True,
        horizon=2000,
        env_kwargs={"terminate_when_unhealthy": False},
    ),
    **{
        f"CuriositySparse-{name}-v0": _SPARSE_ENV | {"kwargs": {"env_id": env_id}}
        for name, env_id in _SPARSE.items()
    },
}
"""The arguments of `gymnasium.register`, by id."""


def register_envs() -> None:
    """Register every id with Gymnasium; ids already there stay as they are."""
    for env_id, spec in SPECS.items():
        if env_id not in gym.registry:
            # No TimeLimit: the env itself truncates, so that reward and end always agree.
            gym.register(env_id, max_episode_steps=None, **spec)
