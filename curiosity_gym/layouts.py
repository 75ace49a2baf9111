"""Maze layouts: where the walls, the start and the goal are, and what the robot can reach.

Lengths are in maze units, the origin is bottom left and y points up.
"""

import hashlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from curiosity_gym.core import Float64Array, Mask
from curiosity_gym.reachability import Region, reachable_region
from curiosity_gym.validation import LARGEST

ROBOT_RADIUS = 1.0
GOAL_RADIUS = 2.0


@dataclass(frozen=True, eq=False)
class MazeLayout:
    """An immutable maze: a rectangular world, axis-aligned walls, a start and a goal.

    Walls may overlap each other and stick out of the world: they are clipped to it.

    Args:
        name: What the maze is called.
        width: Extent of the world along x, above `2 * ROBOT_RADIUS`, at most 1e12.
        height: Extent of the world along y, above `2 * ROBOT_RADIUS`, at most 1e12.
        start: The robot's first position (x, y), at least `ROBOT_RADIUS` from walls and border.
        goal: The goal (x, y), outside the walls, in reach of the robot up to `GOAL_RADIUS`.
        walls: (n, 4) x, y of the lower left corner, width and height; kept as a read-only copy.

    Raises:
        ValueError: A field breaks the rules above or holds something else than finite numbers.
    """

    name: str
    width: float
    height: float
    start: tuple[float, float]
    goal: tuple[float, float]
    walls: Float64Array

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise ValueError(f"name must be a string, got {self.name!r}.")
        for field in ("width", "height"):
            self._set(field, _number_above(2 * ROBOT_RADIUS, field, getattr(self, field)))
        for field in ("start", "goal"):
            place = _floats(field, getattr(self, field), "two numbers (x, y)", (2,))
            self._set(field, tuple(place.tolist()))
        self._set("walls", _walls(self.walls, self.width, self.height))
        self.walls.setflags(write=False)
        _check_places(self)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, MazeLayout):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def __reduce__(self) -> tuple[Any, ...]:
        # Default pickling would hand back writable walls.
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "MazeLayout":
        """Build a layout from a mapping whose keys are the fields, all of them and no others."""
        names = {field.name for field in fields(cls)}
        if not isinstance(values, Mapping) or set(values) != names:
            raise ValueError(f"layout must have the keys {sorted(names)}, got {values!r:.200}.")
        return cls(**values)

    @classmethod
    def from_json(cls, path: str | os.PathLike[str]) -> "MazeLayout":
        """Read a layout from a JSON file, an object with the fields as keys."""
        try:
            values = json.loads(Path(path).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise ValueError(f"layout {str(path)!r} is not JSON: {error}.") from error
        return cls.from_dict(values)

    @classmethod
    def from_ascii(
        cls, text: str, *, name: str = "custom", cell_size: float = 10.0
    ) -> "MazeLayout":
        """Read a drawing: `#` wall, `.` free, `S` start, `G` goal, top row first.

        Rows have equal length; indentation and blank lines around them are ignored. A character is
        a square of side `cell_size`; the robot fits through one if that is above 2.
        """
        size = _number_above(0.0, "cell_size", cell_size)
        rows = [row.strip() for row in text.strip().splitlines()][::-1]  # y points up
        _check_rows(rows)
        centers = {
            letter: ((x + 0.5) * size, (y + 0.5) * size)
            for y, row in enumerate(rows)
            for x, letter in enumerate(row)
        }
        walls = [
            (run.start() * size, y * size, len(run.group()) * size, size)
            for y, row in enumerate(rows)
            for run in re.finditer("#+", row)
        ]
        extent = len(rows[0]) * size, len(rows) * size
        return cls(name, *extent, centers["S"], centers["G"], np.array(walls))

    def to_dict(self) -> dict[str, Any]:
        """All fields, as `from_dict` takes them and JSON can hold them."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return values | {"walls": self.walls.tolist()}

    def to_json(self, path: str | os.PathLike[str]) -> None:
        """Write the layout to a JSON file that `from_json` reads back."""
        Path(path).write_text(json.dumps(self.to_dict()) + "\n", encoding="utf-8")

    @property
    def digest(self) -> str:
        """Eight hexadecimal digits that tell layouts apart by all fields, in any process."""
        return hashlib.sha256(repr(self._key()).encode()).hexdigest()[:8]

    def _set(self, field: str, value: object) -> None:
        object.__setattr__(self, field, value)

    def _key(self) -> tuple[object, ...]:
        return self.name, self.width, self.height, self.start, self.goal, self.walls.tobytes()


def reachable_cells(layout: MazeLayout, n_cells: int = 50) -> Mask:
    """Which cells [ix, iy] of a regular grid the robot's center can enter from the start."""
    return _reachable(layout).cells((layout.width, layout.height), n_cells)


def closest_approach(layout: MazeLayout) -> float:
    """Return the shortest distance to the goal that the robot's center can reach."""
    return _reachable(layout).distance(layout.goal)


def are_free(layout: MazeLayout, places: Float64Array, margin: float) -> Mask:
    """Whether places (k, 2) are at least a margin away from every wall and the border, (k,)."""
    limit = np.array([layout.width, layout.height]) - margin
    in_world = np.all((places >= margin) & (places <= limit), axis=1)
    low, high = layout.walls[:, :2] - margin, layout.walls[:, :2] + layout.walls[:, 2:] + margin
    in_walls = np.all((places[:, None] > low) & (places[:, None] < high), axis=2)
    return in_world & ~np.any(in_walls, axis=1)


@lru_cache(maxsize=8)  # a layout's check, its reachable cells and its goal ask for the same
def _reachable(layout: MazeLayout) -> Region:
    size = layout.width, layout.height
    return reachable_region(layout.walls, size, layout.start, ROBOT_RADIUS)


def _number_above(limit: float, field: str, value: object) -> float:
    number = float(_floats(field, value, "a number", ()))
    if not limit < number <= LARGEST:
        what = f"above {limit:g}, at most {LARGEST:.0e}"
        raise ValueError(f"{field} must be {what}, got {number:g}.")
    return number


def _floats(field: str, value: object, meaning: str, shape: tuple[int, ...]) -> Float64Array:
    """Convert to finite float64 of a shape, in which -1 is any length, or raise."""
    try:
        array = np.asarray(value)
    except ValueError:  # rows of unequal length
        array = np.asarray(None)
    if array.size == 0 and -1 in shape:
        array = array.reshape(0, *shape[1:])
    fits = array.ndim == len(shape) and all(
        wanted in (-1, length) for wanted, length in zip(shape, array.shape, strict=True)
    )
    if array.dtype.kind not in "iuf" or not fits or not np.isfinite(array).all():
        raise ValueError(f"{field} must be {meaning}, finite, got {value!r:.60}.")
    return array.astype(np.float64) + 0.0  # -0.0 would make equal layouts differ in bytes


def _walls(value: object, width: float, height: float) -> Float64Array:
    """Clip walls (n, 4) to the world and drop what is outside; those inside keep their bits."""
    walls = _floats("walls", value, "rows of x, y, width, height", (-1, 4))
    bad = np.flatnonzero((walls[:, 2:] <= 0).any(axis=1))
    if bad.size:
        raise ValueError(f"walls must have positive sizes, got {walls[bad[0]].tolist()}.")
    low, limit = walls[:, :2], np.array([width, height])
    high = low + walls[:, 2:]
    sticks_out = (low < 0) | (high > limit)
    low, high = np.maximum(low, 0.0), np.minimum(high, limit)
    size = np.where(sticks_out, high - low, walls[:, 2:])
    return np.hstack([low, size])[(size > 0).all(axis=1)]


def _check_places(layout: MazeLayout) -> None:
    world = f"the {layout.width:g} x {layout.height:g} world"
    if not are_free(layout, np.array([layout.start]), ROBOT_RADIUS).all():
        raise ValueError(
            f"start must be at least {ROBOT_RADIUS:g} away from every wall and from the border of "
            f"{world}, got {layout.start}."
        )
    if not are_free(layout, np.array([layout.goal]), 0.0).all():
        raise ValueError(f"goal must be in {world} and outside the walls, got {layout.goal}.")
    if not closest_approach(layout) < GOAL_RADIUS:
        raise ValueError(
            f"goal must be within {GOAL_RADIUS:g} of a point that the robot can reach from the "
            f"start, got {layout.goal}."
        )


def _check_rows(rows: list[str]) -> None:
    text = "".join(rows)
    is_drawing = len({*map(len, rows)}) == 1 and set(text) <= set("#.SG")
    if not is_drawing or (text.count("S"), text.count("G")) != (1, 1):
        raise ValueError(
            "layout text must have rows of one length, of '#' and '.', one 'S' and one 'G', got "
            f"{rows[::-1]!r:.200}."
        )
