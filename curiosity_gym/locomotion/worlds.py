"""Walls around a robot: the layouts of the mazes, extruded; a unit is a meter."""

from __future__ import annotations

import os
from itertools import product
from typing import Any

import numpy as np

from curiosity_gym.built_in import BUILT_IN, resolve_layout
from curiosity_gym.core import Float64Array, Mask, norm
from curiosity_gym.extras import import_extra
from curiosity_gym.layouts import GOAL_RADIUS, MazeLayout

WALL_HEIGHT = 10.0  # height of the walls that stop a robot: an ant has jumped 4 m high
DRAWN_HEIGHT = 1.0  # height of the walls in pictures
HIDDEN, SHOWN = 3, 0  # groups of geoms that a viewer leaves out, and shows, by default
CAMERA, CAMERA_AXES = (0.0, -5.0, 7.0), (1.0, 0.0, 0.0, 0.0, 0.81, 0.59)
"""The camera of pictures, above a robot at the origin, to see the walls."""
TOUCHES_ALL, TOUCHES_NONE = -1, 0  # bits of contact, of which robots of one's own may have any
BORDER = 1.0  # thickness of the walls around the world
COLOR, GOAL_COLOR = (0.6, 0.45, 0.3, 1.0), (0.2, 0.8, 0.3, 0.6)

_TRAP = np.array([(19.5, 11.5, 1.0, 7.0), (14.5, 17.5, 6.0, 1.0), (14.5, 11.5, 6.0, 1.0)])
TRAP = MazeLayout("trap", 40.0, 30.0, start=(8.0, 15.0), goal=(26.0, 15.0), walls=_TRAP)
"""A U between start and goal, open towards the start, with walls where QDax has them for its ant.

After Conti et al. 2018, https://arxiv.org/abs/1712.06560.
"""
_SMALL_TRAP = np.array([(9.5, 6.0, 0.5, 4.0), (7.0, 9.5, 2.5, 0.5), (7.0, 6.0, 2.5, 0.5)])
SMALL_TRAP = MazeLayout(
    "small_trap", 20.0, 16.0, start=(4.0, 8.0), goal=(13.0, 8.0), walls=_SMALL_TRAP
)
"""The same at half the size for a humanoid, whose steps take a third of the time of an ant's."""
_MAZE = np.array([(12.0, 0.0, 0.5, 12.0), (7.5, 6.0, 4.5, 0.5), (7.0, 12.5, 0.5, 9.5)])
MAZE = MazeLayout("maze", 22.0, 22.0, start=(2.5, 2.5), goal=(19.5, 2.5), walls=_MAZE)
"""QDax's `antmaze` at half its size: a wall between start and goal, and two that lead astray."""
WORLDS = {layout.name: layout for layout in (TRAP, SMALL_TRAP, MAZE)}


class World:
    """A layout around a robot, which starts where the robot does: at the origin.

    Its least x and y, from the start, are `low` (2,), and its largest `high`.
    """

    def __init__(self, layout: MazeLayout | str | os.PathLike[str]) -> None:
        self.layout = resolve_layout(layout, {**WORLDS, **BUILT_IN}, name="world")
        self._start = np.array(self.layout.start)
        self.low: Float64Array = -self._start
        self.high: Float64Array = np.array([self.layout.width, self.layout.height]) - self._start
        self._goal = np.array(self.layout.goal) - self._start

    def __eq__(self, other: object) -> bool:
        """Equal worlds have the same layout."""
        return isinstance(other, World) and self.layout == other.layout

    def distances(self, positions: Float64Array) -> Float64Array:
        """From the goal, as the crow flies, (k,) of positions (k, 2), in meters."""
        return norm(positions - self._goal)

    def is_at_goal(self, positions: Float64Array) -> Mask:
        """Whether positions (k, 2) are within `GOAL_RADIUS` of the goal."""
        return self.distances(positions) <= GOAL_RADIUS

    def standardize(self, positions: Float64Array) -> Float64Array:
        """Positions (k, 2) with the world's bounds at -1 and 1."""
        return 2.0 * (positions - self.low) / (self.high - self.low) - 1.0

    def model_of(self, path: str) -> Any:
        """The model of an XML file, compiled with the walls."""
        (mujoco,) = import_extra("locomotion", "mujoco")
        spec = mujoco.MjSpec.from_file(path)
        kinds = ((WALL_HEIGHT, HIDDEN, TOUCHES_ALL), (DRAWN_HEIGHT, SHOWN, TOUCHES_NONE))
        for (height, group, bits), box in product(kinds, self._boxes().tolist()):
            x, y, width, depth = box
            spec.worldbody.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=(x + width / 2.0, y + depth / 2.0, height / 2.0),
                size=(width / 2.0, depth / 2.0, height / 2.0),
                group=group,
                contype=bits,
                conaffinity=bits,
                rgba=COLOR,
            )
        spec.worldbody.add_site(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            pos=(*self._goal, 0.0),
            size=(GOAL_RADIUS, 0.01, 0.0),
            rgba=GOAL_COLOR,
        )
        for camera in spec.cameras:
            camera.pos = CAMERA
            camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
            camera.alt.xyaxes = CAMERA_AXES
        return spec.compile()

    def _boxes(self) -> Float64Array:
        """Lower left corner, width and height of the walls and of the border, (n, 4)."""
        (x, y), (width, height) = self.low, self.high - self.low
        border = [
            (x - BORDER, y - BORDER, BORDER, height + 2.0 * BORDER),
            (x + width, y - BORDER, BORDER, height + 2.0 * BORDER),
            (x, y - BORDER, width, BORDER),
            (x, y + height, width, BORDER),
        ]
        walls = self.layout.walls - np.append(self._start, (0.0, 0.0))
        return np.concatenate([walls.reshape(-1, 4), border])
