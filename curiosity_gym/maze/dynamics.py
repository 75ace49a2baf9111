"""The mazes' dynamics: compiled pure functions on arrays, shared by every caller.

So the same actions give the same bits everywhere. Positions and velocities are float64, as one
rounding of float32 is enough to end up inside a wall; observations are float32.

A robot is a square of half-width `ROBOT_RADIUS`, which is a point among walls grown by that radius:
the Minkowski sum that swept collision works with.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from curiosity_gym.compiled import compiled
from curiosity_gym.layouts import ROBOT_RADIUS, MazeLayout

DT = 0.1  # duration of a step (seconds)

MARGIN = 1e-3
"""The robot stops this far from a grown wall: exactly on it, one rounding would let it through."""

MAX_CONTACTS = 4  # contacts resolved in one step; what is left of the step after them is not moved

START_DRAWS, DRAWS_AT_ONCE = 100, 100
"""Tries to draw a start, each of so many places, before it is the layout's own."""

N_BASE_FEATURES = 4  # observation entries before the beams: position and velocity

_CELL = 5.0
_MAX_CELLS = 64
_MAX_INVERSE = 1e9

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]


class Maze(NamedTuple):
    """A layout and its physical constants, laid out for the compiled functions.

    `near_walls[near_start[c]:near_start[c + 1]]` are the walls within the lidar's range of cell c,
    `contact_boxes[contact_start[c]:contact_start[c + 1]]` the grown walls that one step from it can
    touch. Cells are squares, in rows of `n_columns`.
    """

    walls: FloatArray
    """(n, 4): low x, low y, high x, high y."""
    boxes: FloatArray
    """(n, 4): the same, grown by the robot's radius and the margin."""
    near_start: IntArray
    near_walls: IntArray
    contact_start: IntArray
    contact_boxes: IntArray
    cell: float
    """Width of a cell."""
    n_columns: int
    inverse_x: npt.NDArray[np.float32]
    """(n_beams,): 1 / (lidar range x cosine of the beam's angle)."""
    inverse_y: npt.NDArray[np.float32]
    start: FloatArray
    """(4,): x, y, vx, vy at the start of an episode, if it is not drawn."""
    width: float
    height: float
    goal_x: float
    goal_y: float
    goal_radius: float
    max_speed: float
    max_acceleration: float
    restitution: float
    start_radius: float = 0.0
    """Distance from `start` within which episodes begin."""


def same_maze(one: Maze, other: Maze) -> bool:
    """Whether two mazes have the same geometry and constants."""
    pairs: Any = zip(one, other, strict=True)
    return all(np.array_equal(*pair) for pair in pairs)


def build_maze(layout: MazeLayout, *, n_beams: int, lidar_range: float, **constants: float) -> Maze:
    """Lay `layout` out for the compiled functions, with physical constants by name."""
    low, size = layout.walls[:, :2], layout.walls[:, 2:]
    walls = np.concatenate([low, low + size], axis=1)
    grow = ROBOT_RADIUS + MARGIN
    boxes = walls + np.array([-grow, -grow, grow, grow])
    # Large worlds get larger cells, so that the lists stay small.
    cell = max(_CELL, layout.width / _MAX_CELLS, layout.height / _MAX_CELLS)
    n_cells = (math.ceil(layout.width / cell), math.ceil(layout.height / cell))
    near_start, near_walls = _boxes_by_cell(walls, cell, n_cells, lidar_range)
    # A step goes as far along each axis, and may begin a margin inside its box.
    reach = math.sqrt(2.0) * constants["max_speed"] * DT + 2.0 * MARGIN
    contact_start, contact_boxes = _boxes_by_cell(boxes, cell, n_cells, reach)
    angles = 2.0 * np.pi * np.arange(n_beams) / n_beams
    return Maze(
        walls=walls,
        boxes=boxes,
        near_start=near_start,
        near_walls=near_walls,
        contact_start=contact_start,
        contact_boxes=contact_boxes,
        cell=cell,
        n_columns=n_cells[0],
        inverse_x=_inverse(lidar_range * np.cos(angles)),
        inverse_y=_inverse(lidar_range * np.sin(angles)),
        start=np.array([*layout.start, 0.0, 0.0]),
        width=layout.width,
        height=layout.height,
        goal_x=layout.goal[0],
        goal_y=layout.goal[1],
        **constants,
    )


def _inverse(components: FloatArray) -> npt.NDArray[np.float32]:
    """1 / components, finite for beams along an axis: 0 x inf would be NaN beside a wall's edge."""
    tiny = np.where(components < 0.0, -1.0, 1.0) / _MAX_INVERSE
    inverse: FloatArray = 1.0 / np.where(np.abs(components) * _MAX_INVERSE < 1.0, tiny, components)
    return inverse.astype(np.float32)


def _boxes_by_cell(
    boxes: FloatArray, cell: float, n_cells: tuple[int, int], reach: float
) -> tuple[IntArray, IntArray]:
    """Indices of the boxes within `reach` of each cell, and where each cell's begin."""
    n_columns, n_rows = n_cells
    low_x, low_y = cell * np.arange(n_columns), cell * np.arange(n_rows)
    owners, indices = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for index, (left, bottom, right, top) in enumerate(boxes):
        gap_x = np.maximum(0.0, np.maximum(left - (low_x + cell), low_x - right))
        gap_y = np.maximum(0.0, np.maximum(bottom - (low_y + cell), low_y - top))
        cells = np.flatnonzero(np.hypot(gap_x, gap_y[:, None]) <= reach)
        owners.append(cells)
        indices.append(np.full(len(cells), index))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    starts = np.searchsorted(owner[order], np.arange(n_columns * n_rows + 1))
    return starts.astype(np.int32), np.concatenate(indices)[order].astype(np.int32)


@compiled
def _cell(maze: Maze, x: float, y: float) -> int:
    return int(y / maze.cell) * maze.n_columns + int(x / maze.cell)


@compiled
def _entry(position: float, velocity: float, low: float, high: float) -> tuple[float, float]:
    """Times at which a point enters and leaves the slab ]low, high[; never: (inf, -inf).

    Up to two margins deep the robot still stands before the wall, not in it: a layout may start it
    there, and it must be stopped by that wall, yet slide along it.
    """
    if velocity > 0.0:
        gap, far = low - position, high - position
    elif velocity < 0.0:
        gap, far = position - high, position - low
    # The same differences as above: what slides before the wall must be stopped by it, to the bit.
    elif low - position < -2.0 * MARGIN and position - high < -2.0 * MARGIN:
        return -np.inf, np.inf
    else:
        return np.inf, -np.inf
    if -2.0 * MARGIN <= gap < 0.0:
        gap = 0.0
    speed = abs(velocity)
    return gap / speed, far / speed


@compiled
def _first_contact(
    maze: Maze, cell: int, x: float, y: float, vx: float, vy: float, remaining: float
) -> tuple[float, int, float]:
    """Time, axis (0: x, 1: y, -1: none) and stopping coordinate of the next contact."""
    time, axis, stop = remaining, -1, 0.0
    to_x, to_y = x + vx * remaining, y + vy * remaining
    border = ROBOT_RADIUS + MARGIN
    high_x, high_y = maze.width - border, maze.height - border
    if (to_x > high_x and vx > 0.0) or (to_x < border and vx < 0.0):
        stop = high_x if vx > 0.0 else border
        time, axis = max(0.0, (stop - x) / vx), 0
    if (to_y > high_y and vy > 0.0) or (to_y < border and vy < 0.0):
        wall = high_y if vy > 0.0 else border
        t = max(0.0, (wall - y) / vy)
        if t < time:
            time, axis, stop = t, 1, wall
    min_x, max_x, min_y, max_y = min(x, to_x), max(x, to_x), min(y, to_y), max(y, to_y)
    for k in range(maze.contact_start[cell], maze.contact_start[cell + 1]):
        box = maze.contact_boxes[k]
        low_x, low_y = maze.boxes[box, 0], maze.boxes[box, 1]
        high_x, high_y = maze.boxes[box, 2], maze.boxes[box, 3]
        # Most boxes are off the way: comparisons tell, at a fraction of the divisions' cost.
        if max_x <= low_x or min_x >= high_x or max_y <= low_y or min_y >= high_y:
            continue
        enter_x, leave_x = _entry(x, vx, low_x, high_x)
        enter_y, leave_y = _entry(y, vy, low_y, high_y)
        enter = max(enter_x, enter_y)
        if 0.0 <= enter < min(leave_x, leave_y) and enter < time:
            time = enter
            if enter_x >= enter_y:
                axis, stop = 0, low_x if vx > 0.0 else high_x
            else:
                axis, stop = 1, low_y if vy > 0.0 else high_y
    return time, axis, stop


def draw_start(maze: Maze, rng: np.random.Generator) -> FloatArray:
    """Draw where an episode begins, (4,) x, y, vx, vy, at rest.

    Places are uniform among those within the start radius, and beyond that of the goal, to which
    the robot can go straight from the layout's start. Without such places it is that start.
    """
    boxes = np.arange(len(maze.boxes), dtype=np.int32)
    ends = np.array([0, len(boxes)], dtype=np.int32)
    whole = maze._replace(contact_start=ends, contact_boxes=boxes)  # of one cell
    center, limits = maze.start[:2], np.array([maze.width, maze.height]) - ROBOT_RADIUS
    low = np.maximum(center - maze.start_radius, ROBOT_RADIUS)
    high = np.minimum(center + maze.start_radius, limits)
    for _ in range(START_DRAWS):
        places = rng.uniform(low, high, (DRAWS_AT_ONCE, 2))
        i = _first_start(whole, places)
        if i >= 0:
            return np.append(places[i], (0.0, 0.0))
    return maze.start


@compiled
def _first_start(maze: Maze, places: FloatArray) -> int:
    """The first of places (k, 2) where an episode may begin; -1: none."""
    x, y = maze.start[0], maze.start[1]
    for i in range(len(places)):
        dx, dy = places[i, 0] - x, places[i, 1] - y
        is_near = dx * dx + dy * dy <= maze.start_radius * maze.start_radius
        if not is_near or is_at_goal(maze, places[i]):
            continue
        if _first_contact(maze, 0, x, y, dx, dy, 1.0)[1] == -1:
            return i
    return -1


@compiled
def _advance(start: float, velocity: float, time: float, stop: float, is_contact: bool) -> float:
    """The new coordinate; a contact never moves the robot back, that could push it into a wall."""
    if not is_contact:
        return start + velocity * time
    return max(start, stop) if velocity > 0.0 else min(start, stop)


@compiled
def move(maze: Maze, state: FloatArray, acceleration_x: float, acceleration_y: float) -> None:
    """Move the robot for one step with swept collision, and overwrite `state` (4,) x, y, vx, vy.

    Accelerations are in units of the maximal one, already within [-1, 1].
    """
    x, y = state[0], state[1]
    limit = maze.max_speed
    gain = DT * maze.max_acceleration
    vx = min(max(state[2] + gain * acceleration_x, -limit), limit)
    vy = min(max(state[3] + gain * acceleration_y, -limit), limit)
    # The boxes of the cell where the step begins: no contact is farther than one step from it.
    cell = _cell(maze, x, y)
    remaining = DT
    for _ in range(MAX_CONTACTS):
        time, axis, stop = _first_contact(maze, cell, x, y, vx, vy, remaining)
        x = _advance(x, vx, time, stop, axis == 0)
        y = _advance(y, vy, time, stop, axis == 1)
        if axis == -1:
            break
        if axis == 0:
            vx *= -maze.restitution
        else:
            vy *= -maze.restitution
        remaining -= time
    state[0], state[1], state[2], state[3] = x, y, vx, vy


@compiled
def cast_beams(maze: Maze, x: float, y: float, beams: npt.NDArray[np.float32]) -> None:
    """Distance to the nearest wall or border along each beam, in units of the lidar's range.

    `beams` (n_beams,) are overwritten with values in [0, 1]; beam i points to 2 pi i / n_beams.
    """
    inverse_x, inverse_y = maze.inverse_x, maze.inverse_y
    n_beams = inverse_x.shape[0]
    zero, one = np.float32(0.0), np.float32(1.0)
    # Differences are taken in float64, so that a distance's relative error is that of float32.
    left, right = np.float32(-x), np.float32(maze.width - x)
    bottom, top = np.float32(-y), np.float32(maze.height - y)
    for i in range(n_beams):
        leave_x = max(left * inverse_x[i], right * inverse_x[i])
        leave_y = max(bottom * inverse_y[i], top * inverse_y[i])
        beams[i] = min(one, min(leave_x, leave_y))
    cell = _cell(maze, x, y)
    for k in range(maze.near_start[cell], maze.near_start[cell + 1]):
        wall = maze.near_walls[k]
        left, right = np.float32(maze.walls[wall, 0] - x), np.float32(maze.walls[wall, 2] - x)
        bottom, top = np.float32(maze.walls[wall, 1] - y), np.float32(maze.walls[wall, 3] - y)
        for i in range(n_beams):
            a, b = left * inverse_x[i], right * inverse_x[i]
            c, d = bottom * inverse_y[i], top * inverse_y[i]
            enter = max(min(a, b), min(c, d))
            leave = min(max(a, b), max(c, d))
            nearest = beams[i]
            is_hit = (enter >= zero) & (enter <= leave) & (enter < nearest)
            beams[i] = enter if is_hit else nearest


@compiled
def reset(maze: Maze, state: FloatArray, observation: npt.NDArray[np.float32]) -> None:
    """Put the robot at the start, at rest, and write its observation."""
    for i in range(state.shape[0]):
        state[i] = maze.start[i]
    observe(maze, state, observation)


@compiled
def observe(maze: Maze, state: FloatArray, observation: npt.NDArray[np.float32]) -> None:
    """Write the observation of `state`, shape (4 + n_beams,), every entry in [-1, 1]."""
    x, y = state[0], state[1]
    observation[0] = 2.0 * x / maze.width - 1.0
    observation[1] = 2.0 * y / maze.height - 1.0
    observation[2] = state[2] / maze.max_speed
    observation[3] = state[3] / maze.max_speed
    cast_beams(maze, x, y, observation[N_BASE_FEATURES:])


@compiled
def is_at_goal(maze: Maze, state: FloatArray) -> bool:
    """Whether the robot's center is within the goal's radius."""
    dx, dy = state[0] - maze.goal_x, state[1] - maze.goal_y
    return bool(dx * dx + dy * dy < maze.goal_radius * maze.goal_radius)


@compiled
def step(
    maze: Maze,
    state: FloatArray,
    action: npt.NDArray[np.float32],
    observation: npt.NDArray[np.float32],
) -> bool:
    """Step from `state` (4,) to `observation` (4 + n_beams,); whether the goal is reached.

    Both are overwritten; `action` (2,) must be finite, and is clipped here to [-1, 1].
    """
    move(maze, state, min(max(action[0], -1.0), 1.0), min(max(action[1], -1.0), 1.0))
    observe(maze, state, observation)
    return is_at_goal(maze, state)
