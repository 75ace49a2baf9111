"""Mazes drawn at random: corridors in a tree or with loops, rooms with doors, fields of blocks."""

from __future__ import annotations

import heapq
import math
import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from curiosity_gym.core import Float64Array
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.validation import (
    LARGEST_COUNT,
    check_choice,
    check_positive,
    check_whole,
    is_whole,
)

KINDS = ("perfect", "loops", "rooms", "open")
SIDE = 200.0
"""Of the square world, as of the built-in mazes."""
WALL = 2.0
LOOPS = 0.25
"""Share of the walls between cells that "loops" opens."""
LONGEST = 1300.0
"""Of the way to a goal, in maze units: less than 2,000 steps at a third of the top speed."""
GAP = 3.0
"""Least distance of a block from the border of its cell."""
NARROWEST = 2.1
"""Of doors: walls stop a robot, 2 wide, a little before it touches them."""
NUMBER = "(0|[1-9][0-9]*)"
NAME = re.compile(
    rf"({'|'.join(KINDS)})-{NUMBER}x{NUMBER}(?:-door([0-9]+(?:\.[0-9]+)?))?-seed{NUMBER}"
)

Cell = tuple[int, int]
Doors = dict[tuple[Cell, Cell], tuple[float, float]]
"""Between a cell and its right or upper neighbor: where the gap in their wall begins and ends."""


class _Grid(NamedTuple):
    """Cells (column, row) of a world."""

    columns: int
    rows: int

    @property
    def sides(self) -> tuple[float, float]:
        """Width and height of a cell."""
        return SIDE / self.columns, SIDE / self.rows

    def center(self, cell: Cell) -> tuple[float, float]:
        return (cell[0] + 0.5) * self.sides[0], (cell[1] + 0.5) * self.sides[1]

    def neighbors(self, cell: Cell) -> Iterator[Cell]:
        x, y = cell
        for other in ((x + 1, y), (x, y + 1), (x - 1, y), (x, y - 1)):
            if 0 <= other[0] < self.columns and 0 <= other[1] < self.rows:
                yield other


def random_layout(
    kind: str, size: tuple[int, int] = (8, 8), *, door: float | None = None, seed: int = 0
) -> MazeLayout:
    """Draw a maze of 200 x 200 units; the same arguments draw the same one.

    The start is in the lower left cell. The goal is in the cell with the longest way, of those
    whose way 2,000 steps at a third of the top speed are enough for; that of "open" is in the upper
    right corner. The maze's name, such as `rooms-4x4-door4-seed7`, is also a `layout` of
    `CuriosityMaze-v0`.

    Args:
        kind: "perfect": corridors without a loop; "loops": a quarter of their inner walls, at least
            one, is open; "rooms": as "perfect", through doors in the walls; "open": a field with a
            block in each cell.
        size: Columns and rows of cells, 2 to 20 each.
        door: Width of doors (maze units), for "rooms", from 2.1 up to the side of a room without
            its walls; None: 8.
        seed: Of the draws.

    Raises:
        ValueError: If an argument is not what it may be.
    """
    check_choice(KINDS, kind=kind)
    grid = _Grid(*_checked_size(size))
    check_whole(0, LARGEST_COUNT, seed=seed)
    width = _checked_door(kind, grid, door)
    rng = np.random.default_rng(seed)
    middle = "" if width is None else f"-door{width!r}".removesuffix(".0")
    name = f"{kind}-{grid.columns}x{grid.rows}{middle}-seed{seed}"
    if kind == "open":
        corner = GAP / 2
        return MazeLayout(
            name, SIDE, SIDE, (corner, corner), (SIDE - corner,) * 2, _blocks(grid, rng)
        )
    doors = {edge: _place(grid, edge, width, rng) for edge in _tree(grid, rng)}
    if kind == "loops":
        closed = [edge for edge in _edges(grid) if edge not in doors]
        opened = rng.permutation(len(closed))[: max(1, round(LOOPS * len(closed)))]
        doors |= {closed[i]: _place(grid, closed[i], None, rng) for i in opened}
    goal = _furthest(grid, doors)
    return MazeLayout(name, SIDE, SIDE, grid.center((0, 0)), grid.center(goal), _walls(grid, doors))


def _checked_size(size: tuple[int, int]) -> tuple[int, int]:
    is_pair = isinstance(size, tuple | list) and len(size) == 2
    if not is_pair or not all(is_whole(number, 2, 20) for number in size):
        raise ValueError(f"`size` must be two whole numbers from 2 to 20, got {size!r}.")
    return int(size[0]), int(size[1])


def _checked_door(kind: str, grid: _Grid, door: float | None) -> float | None:
    if kind != "rooms":
        if door is not None:
            raise ValueError(f'`door` must be left out but for "rooms", got {door!r}.')
        return None
    if door is None:
        door = 8.0
    check_positive(door=door)
    widest = min(grid.sides) - WALL
    if not NARROWEST <= door <= widest:
        raise ValueError(f"`door` must be from {NARROWEST} to {widest}, got {door!r}.")
    return float(door)


def named_layout(name: str) -> MazeLayout | None:
    """The layout of a name of the form that `random_layout` gives; None of another form.

    Raises:
        ValueError: If `random_layout` draws none of the name.
    """
    match = NAME.fullmatch(name)
    if match is None:
        return None
    kind, columns, rows, door, seed = match.groups()
    size = int(columns), int(rows)
    return random_layout(kind, size, door=None if door is None else float(door), seed=int(seed))


def _edges(grid: _Grid) -> Iterator[tuple[Cell, Cell]]:
    """Every cell with its right and its upper neighbor."""
    for x in range(grid.columns):
        for y in range(grid.rows):
            yield from (((x, y), other) for other in grid.neighbors((x, y)) if other > (x, y))


def _tree(grid: _Grid, rng: np.random.Generator) -> list[tuple[Cell, Cell]]:
    """A spanning tree of the cells, by a walk that goes back where it cannot go on."""
    way, seen, edges = [(0, 0)], {(0, 0)}, []
    while way:
        others = [other for other in grid.neighbors(way[-1]) if other not in seen]
        if not others:
            way.pop()
            continue
        other = others[rng.integers(len(others))]
        edges.append((min(way[-1], other), max(way[-1], other)))
        seen.add(other)
        way.append(other)
    return edges


def _place(
    grid: _Grid, edge: tuple[Cell, Cell], width: float | None, rng: np.random.Generator
) -> tuple[float, float]:
    """Where the gap between two cells begins and ends; without a width, as wide as it can be."""
    (x, y), other = edge
    row, side = (y, grid.sides[1]) if other[0] > x else (x, grid.sides[0])
    low, high = row * side + WALL / 2, (row + 1) * side - WALL / 2
    if width is None:
        return low, high
    begin = float(rng.uniform(low, max(low, high - width)))
    return begin, begin + width


def _walls(grid: _Grid, doors: Doors) -> Float64Array:
    """Along each line between cells, what their doors leave of a wall."""
    walls: list[tuple[float, float, float, float]] = []
    width, height = grid.sides
    for x in range(1, grid.columns):
        edges = [((x - 1, y), (x, y)) for y in range(grid.rows)]
        place = x * width - WALL / 2
        walls += [(place, low, WALL, high - low) for low, high in _left(edges, doors)]
    for y in range(1, grid.rows):
        edges = [((x, y - 1), (x, y)) for x in range(grid.columns)]
        place = y * height - WALL / 2
        walls += [(low, place, high - low, WALL) for low, high in _left(edges, doors)]
    return np.array(walls)


def _left(edges: list[tuple[Cell, Cell]], doors: Doors) -> Iterator[tuple[float, float]]:
    begin = 0.0
    for low, high in (doors[edge] for edge in edges if edge in doors):
        yield begin, low
        begin = high
    yield begin, SIDE


def _furthest(grid: _Grid, doors: Doors) -> Cell:
    """The cell with the longest way from the first, of those whose way is not too long."""
    ways, pending = {(0, 0): 0.0}, [(0.0, (0, 0))]
    while pending:
        way, cell = heapq.heappop(pending)
        for other in grid.neighbors(cell):
            if (edge := (min(cell, other), max(cell, other))) not in doors:
                continue
            middle = sum(doors[edge]) / 2
            is_beside = cell[0] != other[0]
            line = max(cell[0], other[0]) * grid.sides[0], max(cell[1], other[1]) * grid.sides[1]
            gap = (line[0], middle) if is_beside else (middle, line[1])
            ends = grid.center(cell), grid.center(other)
            longer = way + sum(math.dist(end, gap) for end in ends)
            if longer < ways.get(other, LONGEST):
                ways[other] = longer
                heapq.heappush(pending, (longer, other))
    return max(ways, key=lambda cell: (ways[cell], cell))


def _blocks(grid: _Grid, rng: np.random.Generator) -> Float64Array:
    """A block in each cell, away from its borders."""
    free = np.array(grid.sides) - 2 * GAP
    sizes = rng.uniform(0.3, 1.0, (grid.columns * grid.rows, 2)) * free
    cells = np.array([(x, y) for x in range(grid.columns) for y in range(grid.rows)])
    corners = cells * grid.sides + GAP + rng.random(sizes.shape) * (free - sizes)
    return np.hstack([corners, sizes])
