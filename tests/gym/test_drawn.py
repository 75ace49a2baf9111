"""Mazes drawn at random: what their kinds promise, by what a robot meets there."""

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from curiosity_gym import random_layout
from curiosity_gym.built_in import resolve_layout
from curiosity_gym.drawn import KINDS, NARROWEST, SIDE, WALL
from curiosity_gym.layouts import ROBOT_RADIUS, are_free, reachable_cells
from curiosity_gym.maze.dynamics import DT, MARGIN
from curiosity_gym.reachability import reachable_region

LONGEST_WAY = 1.083 * 2000 * DT * 20.0 / 3.0
"""Along a grid it is up to 8.3 % longer than one that goes straight."""
REFUSED = (1, 5), (5, 21), (5, 2.5), 5, (5, 5, 5), None, (True, 5)
DIGESTS = {
    "perfect": "0b346022",
    "loops": "d509b024",
    "rooms": "225eecb4",
    "open": "dd0ca154",
}
SIZES = st.tuples(st.integers(2, 20), st.integers(2, 20))


def shortest_way(layout, step=1.0):
    """By the points of a fine grid and their eight neighbors, of a robot that touches no wall."""
    n = int(SIDE / step)
    x, y = np.meshgrid(*[(np.arange(n) + 0.5) * step] * 2, indexing="ij")
    free = are_free(layout, np.stack([x, y], -1).reshape(-1, 2), ROBOT_RADIUS).reshape(n, n)
    number = np.arange(n * n).reshape(n, n)
    pairs, lengths = [], []
    for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
        here = np.s_[: n - dx, max(0, -dy) : n - max(0, dy)]
        there = np.s_[dx:, max(0, dy) : n + min(0, dy)]
        both = free[here] & free[there]
        pairs.append((number[here][both], number[there][both]))
        lengths.append(np.full(both.sum(), step * np.hypot(dx, dy)))
    rows, columns = map(np.concatenate, zip(*pairs, strict=True))
    graph = csr_array((np.concatenate(lengths), (rows, columns)), (n * n, n * n))
    start, goal = (number[tuple(int(c / step) for c in p)] for p in (layout.start, layout.goal))
    return dijkstra(graph, directed=False, indices=start)[goal]


def passages(layout, columns, rows):
    """The number of neighboring cells whose centers a robot can go between in a straight line."""
    sides = np.array([SIDE / columns, SIDE / rows])
    n = 0
    for x in range(columns):
        for y in range(rows):
            for other in ((x + 1, y), (x, y + 1)):
                if other[0] < columns and other[1] < rows:
                    ends = (np.array([(x, y), other]) + 0.5) * sides
                    line = np.linspace(*ends, 41)
                    n += are_free(layout, line, ROBOT_RADIUS).all()
    return n


@given(st.sampled_from(KINDS), SIZES, st.integers(0, 10**9))
@settings(max_examples=15, deadline=None)
def test_goals_are_in_reach_within_two_thousand_steps_at_a_third_of_the_speed(kind, size, seed):
    layout = random_layout(kind, size, door=None if kind != "rooms" else 4.0, seed=seed)
    assert shortest_way(layout) <= LONGEST_WAY
    assert kind == "open" or reachable_cells(layout, 10).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_goal_is_not_at_the_end_of_a_way_that_is_too_long(seed):
    layout = random_layout("perfect", (20, 20), seed=seed)
    assert 0.6 * LONGEST_WAY < shortest_way(layout) <= LONGEST_WAY


@given(SIZES, st.integers(0, 10**9))
@settings(max_examples=10, deadline=None)
def test_corridors_are_a_tree_or_have_loops(size, seed):
    columns, rows = size
    n_walls = columns * (rows - 1) + rows * (columns - 1) - (columns * rows - 1)
    n_opened = max(1, round(n_walls / 4))
    perfect, loops = (random_layout(kind, size, seed=seed) for kind in ("perfect", "loops"))
    assert passages(perfect, columns, rows) == columns * rows - 1
    assert passages(loops, columns, rows) == columns * rows - 1 + n_opened


@given(SIZES, st.floats(0.0, 1.0))
@settings(max_examples=15, deadline=None)
def test_rooms_have_doors_of_the_width_which_the_robot_passes(size, share):
    (columns, rows), widest = size, SIDE / max(size) - WALL
    door = NARROWEST + share * (widest - NARROWEST)
    layout = random_layout("rooms", size, door=min(door, widest), seed=7)
    length = layout.walls[:, 2:].prod(axis=1).sum() / WALL
    lines = columns + rows - 2
    assert length == pytest.approx(lines * SIDE - (columns * rows - 1) * door)
    assert resolve_layout(layout.name) == layout
    radius = ROBOT_RADIUS + 2 * MARGIN  # walls stop a robot a little before it touches them
    region = reachable_region(layout.walls, (SIDE, SIDE), layout.start, radius)
    assert region.cells((SIDE, SIDE), 10).all()


@pytest.mark.parametrize("side", [3, 7, 19])
def test_a_door_may_be_as_wide_as_its_room(side):
    layout = random_layout("rooms", (side, side), door=SIDE / side - WALL)
    corridors = random_layout("perfect", (side, side))
    np.testing.assert_allclose(layout.walls, corridors.walls, atol=1e-9)


def test_a_maze_stays_what_it_is():
    digests = {kind: random_layout(kind, (8, 8), seed=0).digest for kind in KINDS}
    assert digests == DIGESTS


def test_fields_have_a_block_in_each_cell():
    layout = random_layout("open", (5, 3), seed=1)
    centers = layout.walls[:, :2] + layout.walls[:, 2:] / 2
    cells = {tuple(cell) for cell in (centers // [SIDE / 5, SIDE / 3]).astype(int)}
    assert len(cells) == len(layout.walls) == 15


@given(st.sampled_from(KINDS), SIZES, st.integers(0, 9))
@settings(max_examples=15, deadline=None)
def test_a_name_is_a_layout(kind, size, seed):
    layout = random_layout(kind, size, seed=seed)
    assert resolve_layout(layout.name) == layout == random_layout(kind, size, seed=seed)
    other = random_layout(kind, size, seed=seed + 1000)
    assert not np.array_equal(other.walls, layout.walls) or max(size) < 4


def test_an_environment_takes_a_name():
    env = gym.make("CuriosityMaze-v0", layout="rooms-4x4-door4.5-seed7")
    assert env.unwrapped.layout == random_layout("rooms", (4, 4), door=4.5, seed=7)


def test_mistakes_are_one_sentence():
    for arguments, match in [
        ({"kind": "round"}, "`kind` must be one of perfect, loops, rooms, open"),
        *(({"kind": "open", "size": size}, "`size` must be two whole") for size in REFUSED),
        *(({"kind": "open", "seed": seed}, "`seed` must be a whole") for seed in (-1, None, 0.5)),
        ({"kind": "perfect", "door": 4.0}, '`door` must be left out but for "rooms"'),
        *(({"kind": "rooms", "door": door}, "`door` must be") for door in (2.0, 24.0, "8", [8])),
    ]:
        with pytest.raises(ValueError, match=match):
            random_layout(**arguments)
    for name, match in [
        ("rooms-4x4-doors4-seed7", "`world` must be .* a name of random_layout such as"),
        ("rooms-1x4-seed7", "`world` 'rooms-1x4-seed7' names no maze: `size` must be"),
    ]:
        with pytest.raises(ValueError, match=match):
            resolve_layout(name, name="world")
