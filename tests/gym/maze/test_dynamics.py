import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from curiosity_gym.built_in import BUILT_IN
from curiosity_gym.layouts import ROBOT_RADIUS, MazeLayout
from curiosity_gym.maze.dynamics import (
    DT,
    MARGIN,
    build_maze,
    cast_beams,
    draw_start,
    is_at_goal,
    move,
    observe,
)
from curiosity_gym.reachability import reachable_region

TOLERANCE = 1e-2
WIDTH, HEIGHT = 40.0, 30.0
# Where the robot comes to rest beside the border, and beside a wall.
STOP = ROBOT_RADIUS + MARGIN


def make_maze(layout, **changes):
    values = {
        "max_speed": 20.0,
        "max_acceleration": 5.0,
        "n_beams": 32,
        "lidar_range": 0.2 * math.hypot(layout.width, layout.height),
        "restitution": 0.0,
        "goal_radius": 2.0,
    }
    return build_maze(layout, **(values | changes))


def make_layout(walls, start=(20.0, 15.0)):
    return MazeLayout("test", WIDTH, HEIGHT, start, start, np.array(walls, dtype=float))


def moved(maze, state, *accelerations):
    state = np.array(state, dtype=float)
    for ax, ay in accelerations:
        move(maze, state, float(ax), float(ay))
    return state


# Whole and half numbers, so that walls touch, share edges and leave gaps as wide as the robot;
# and any numbers, so that they do not.
coordinates = st.one_of(
    st.integers(-10, 90).map(lambda n: n / 2), st.floats(-5.0, 45.0, allow_nan=False)
)
sizes = st.one_of(st.integers(1, 40).map(lambda n: n / 2), st.floats(0.01, 20.0))
walls = st.lists(st.tuples(coordinates, coordinates, sizes, sizes), min_size=1, max_size=8)


@st.composite
def layouts(draw):
    """Layouts whose start, somewhere free, often just beside a wall, is the goal as well."""
    rectangles = draw(walls)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    starts = rng.uniform([1.0, 1.0], [WIDTH - 1.0, HEIGHT - 1.0], (50, 2))
    if draw(st.booleans()):
        starts = np.round(2.0 * starts) / 2.0
    for start in starts:
        try:
            return make_layout(rectangles, tuple(start))
        except ValueError:
            continue
    return make_layout(rectangles[:0])


def bang_bang(rng, n_steps):
    """Full accelerations that switch after random times, some of them along an axis."""
    values = rng.choice([-1.0, 0.0, 1.0], (n_steps, 2), p=[0.45, 0.1, 0.45])
    return np.repeat(values, rng.integers(1, 12, n_steps), axis=0)[:n_steps]


def depth_in_grown_walls(layout, positions):
    """How deep (n,) positions (n, 2) are in walls and border grown by the robot's radius."""
    low = layout.walls[:, :2] - ROBOT_RADIUS
    high = layout.walls[:, :2] + layout.walls[:, 2:] + ROBOT_RADIUS
    inside = np.minimum(positions[:, None] - low, high - positions[:, None]).min(axis=2)
    world = np.array([layout.width, layout.height])
    border = np.minimum(positions, world - positions).min(axis=1)
    return np.maximum(inside.max(axis=1, initial=-np.inf), ROBOT_RADIUS - border)


class TestMove:
    @settings(max_examples=6 * settings.default.max_examples)
    @given(
        layout=layouts(),
        seed=st.integers(0, 2**32),
        max_speed=st.one_of(st.sampled_from([20.0, 500.0]), st.floats(0.1, 500.0)),
        restitution=st.sampled_from([0.0, 0.5, 1.0]),
        is_fast=st.booleans(),
    )
    def test_never_enters_a_wall_nor_goes_through_one(
        self, layout, seed, max_speed, restitution, is_fast
    ):
        rng = np.random.default_rng(seed)
        acceleration = 10.0 * max_speed if is_fast else 5.0
        maze = make_maze(
            layout, max_speed=max_speed, restitution=restitution, max_acceleration=acceleration
        )
        velocity = rng.choice([-max_speed, 0.0, max_speed], 2)
        state = np.array([*layout.start, *velocity])
        states = [state.copy()]
        for ax, ay in bang_bang(rng, 150):
            move(maze, state, ax, ay)
            states.append(state.copy())
        states = np.array(states)
        assert depth_in_grown_walls(layout, states[:, :2]).max() <= TOLERANCE
        assert np.abs(states[:, 2:]).max() <= max_speed
        assert (np.abs(np.diff(states[:, :2], axis=0)) <= max_speed * DT * (1 + 1e-9)).all()
        # A thin wall can be jumped without ever being in it: the robot must stay where it can go.
        size, radius = (layout.width, layout.height), ROBOT_RADIUS - TOLERANCE
        region = reachable_region(layout.walls, size, layout.start, radius)
        assert max(region.distance(tuple(position)) for position in states[:, :2]) <= 1e-9

    def test_a_corner_two_margins_deep_stays_closed(self):
        # The grown corner of two walls in "hard": evolution found its way through it.
        layout = BUILT_IN["hard"]
        maze, state = make_maze(layout), np.array([38.999, 50.998999999999995, 0.0, 0.5])
        positions = []
        for _ in range(30):
            move(maze, state, 1.0, -1.0)
            positions.append(state[:2].copy())
        assert depth_in_grown_walls(layout, np.array(positions)).max() <= MARGIN + 1e-9

    @settings(max_examples=20 * settings.default.max_examples)
    @given(
        size=st.tuples(*[st.integers(1, 9)] * 2),
        is_high=st.tuples(st.booleans(), st.booleans()),
        # Two margins deep on both sides would be in the wall already.
        depths=st.tuples(
            st.sampled_from([-1.0, 0.0, 1.0, 2.0]), st.sampled_from([-1.0, 0.0, 1.0])
        ).flatmap(st.permutations),
        nudges=st.tuples(*[st.integers(-1, 1)] * 2),
        velocity=st.tuples(*[st.sampled_from([-2.0, -0.5, 0.0, 0.5, 2.0])] * 2),
        place=st.tuples(*[st.integers(5, 15)] * 2),
        seed=st.integers(0, 2**32),
    )
    def test_corners_stay_closed_to_the_last_bit(
        self, size, is_high, depths, nudges, velocity, place, seed
    ):
        layout = make_layout([(*place, *size)], start=(2.0, 2.0))
        maze = make_maze(layout)
        low_x, low_y, high_x, high_y = maze.boxes[0]
        corner = [high_x if is_high[0] else low_x, high_y if is_high[1] else low_y]
        for axis in range(2):
            inwards = -1.0 if is_high[axis] else 1.0
            corner[axis] += inwards * depths[axis] * MARGIN
            for _ in range(abs(nudges[axis])):
                corner[axis] = np.nextafter(corner[axis], np.inf * nudges[axis])
        rng = np.random.default_rng(seed)
        directions = rng.choice([-1.0, 0.0, 1.0], (3, 2)).repeat([1, 12, 12], axis=0)
        state, positions = np.array([*corner, *velocity]), []
        for ax, ay in directions:
            move(maze, state, ax, ay)
            positions.append(state[:2].copy())
        assert depth_in_grown_walls(layout, np.array(positions)).max() <= MARGIN + 1e-9

    @settings(max_examples=2 * settings.default.max_examples)
    @given(layout=layouts(), seed=st.integers(0, 2**32))
    def test_bouncing_keeps_speed_and_sliding_never_gains_any(self, layout, seed):
        rng = np.random.default_rng(seed)
        velocity = rng.uniform(-20.0, 20.0, 2)
        for restitution in (0.0, 1.0):
            state = np.array([*layout.start, *velocity])
            maze = make_maze(layout, restitution=restitution)
            for _ in range(40):
                before = np.abs(state[2:])
                move(maze, state, 0.0, 0.0)
                if restitution == 1.0:
                    np.testing.assert_array_equal(np.abs(state[2:]), before)
                else:
                    assert set(np.abs(state[2:])) <= {0.0, *before}

    def test_free_flight(self):
        maze = make_maze(make_layout([]))
        state = moved(maze, (20.0, 15.0, 1.0, -2.0), (1.0, -0.5), (0.0, 0.0))
        velocity = np.array([1.5, -2.25])
        np.testing.assert_allclose(state[2:], velocity)
        np.testing.assert_allclose(state[:2], np.array([20.0, 15.0]) + 2 * DT * velocity)

    def test_speed_is_limited_along_each_axis(self):
        maze = make_maze(make_layout([]), max_speed=1.0)
        state = moved(maze, (20.0, 15.0, 0.9, -0.9), (1.0, -1.0))
        np.testing.assert_allclose(state, [20.1, 14.9, 1.0, -1.0])

    def test_straight_hits_stop_at_the_wall(self):
        for velocity, expected in [
            ((20.0, 0.0), (25.0 - STOP, 15.0)),
            ((-20.0, 0.0), (15.0 + STOP, 15.0)),
            ((0.0, 20.0), (20.0, 20.0 - STOP)),
            ((0.0, -20.0), (20.0, 10.0 + STOP)),
        ]:
            room = [[10, 5, 5, 20], [25, 5, 5, 20], [10, 20, 20, 5], [10, 5, 20, 5]]
            state = moved(make_maze(make_layout(room)), (20.0, 15.0, *velocity), *[(0, 0)] * 4)
            np.testing.assert_allclose(state, [*expected, 0.0, 0.0], atol=1e-12)

    def test_the_border_stops_the_robot_in_its_corners(self):
        for corner in [(-20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)]:
            state = moved(make_maze(make_layout([])), (20.0, 15.0, *corner), *[(0, 0)] * 20)
            expected = np.where(np.array(corner) < 0, STOP, np.array([WIDTH, HEIGHT]) - STOP)
            np.testing.assert_allclose(state, [*expected, 0.0, 0.0], atol=1e-12)

    def test_slides_along_a_wall_with_what_is_left_of_the_step(self):
        maze = make_maze(make_layout([[25, 0, 5, 30]]))
        state = moved(maze, (23.5, 15.0, 10.0, 5.0), (0.0, 0.0))
        np.testing.assert_allclose(state, [25.0 - STOP, 15.5, 0.0, 5.0])

    def test_slides_along_flush_walls_as_along_one(self):
        one = make_maze(make_layout([[0, 5, 40, 2]]))
        many = make_maze(make_layout([[0, 5, 10, 2], [10, 5, 10, 2], [18, 4, 22, 3]]))
        actions = [(1.0, -1.0)] * 60
        start = (2.0, 15.0, 0.0, 0.0)
        np.testing.assert_array_equal(moved(one, start, *actions), moved(many, start, *actions))

    @pytest.mark.parametrize("restitution", [0.5, 1.0])
    def test_bounces_with_what_is_left_of_the_step(self, restitution):
        maze = make_maze(make_layout([[25, 0, 5, 30]]), restitution=restitution)
        state = moved(maze, (23.5, 15.0, 10.0, 5.0), (0.0, 0.0))
        stop = 25.0 - STOP
        overshoot = 24.5 - stop
        expected = [stop - restitution * overshoot, 15.5, -10.0 * restitution, 5.0]
        np.testing.assert_allclose(state, expected)

    def test_passes_a_gap_a_little_wider_than_the_robot_and_no_narrower_one(self):
        for gap, passes in ((2.1, True), (1.9, False)):
            rows = [[20, 0, 2, 15 - gap / 2], [20, 15 + gap / 2, 2, 30]]
            maze = make_maze(make_layout(rows, start=(10.0, 15.0)))
            state = moved(maze, (10.0, 15.0, 20.0, 0.0), *[(0, 0)] * 8)
            assert (state[0] > 22.0) == passes

    def test_a_start_at_exactly_the_radius_can_leave_in_every_free_direction(self):
        layout = make_layout([[20, 10, 10, 10]], start=(19.0, 15.0))
        maze = make_maze(layout)
        for action in ((-1, 0), (0, 1), (0, -1)):
            state = moved(maze, maze.start, *[action] * 3)
            assert np.dot(state[:2] - maze.start[:2], action) > 0.2
        assert moved(maze, maze.start, (1, 0))[0] == 19.0


def oracle_beam(obstacles, x, y, angle, lidar_range):
    end = x + lidar_range * math.cos(angle), y + lidar_range * math.sin(angle)
    hit = shapely.LineString([(x, y), end]).intersection(obstacles)
    return lidar_range if hit.is_empty else shapely.Point(x, y).distance(hit)


def assert_beams_agree(layout, position, **changes):
    """Compare with shapely; a beam that grazes a corner may go past it or not."""
    maze = make_maze(layout, **changes)
    n_beams = len(maze.inverse_x)
    lidar_range = changes.get("lidar_range", 0.2 * math.hypot(layout.width, layout.height))
    beams = np.empty(n_beams, dtype=np.float32)
    x, y = map(float, position)
    cast_beams(maze, x, y, beams)
    boxes = [shapely.box(a, b, a + w, b + h) for a, b, w, h in layout.walls]
    border = shapely.box(0.0, 0.0, layout.width, layout.height).exterior
    obstacles = shapely.union_all([*boxes, border])
    for i, beam in enumerate(beams):
        angle = 2.0 * math.pi * i / n_beams
        expected = [
            oracle_beam(obstacles, x, y, angle + turn, lidar_range) for turn in (-1e-6, 0, 1e-6)
        ]
        assert min(expected) - 1e-3 <= beam * lidar_range <= max(expected) + 1e-3


@settings(max_examples=2 * settings.default.max_examples)
@given(
    layout=layouts(),
    n_beams=st.sampled_from([1, 2, 7, 32]),
    lidar_range=st.one_of(st.sampled_from([10.0, 60.0]), st.floats(0.5, 60.0)),
)
def test_beams_agree_with_shapely_in_random_layouts(layout, n_beams, lidar_range):
    assert_beams_agree(layout, layout.start, n_beams=n_beams, lidar_range=lidar_range)


def test_observe_scales_every_entry():
    maze = make_maze(make_layout([]), max_speed=10.0, lidar_range=5.0)
    observation = np.empty(36, dtype=np.float32)
    observe(maze, np.array([10.0, 24.0, -5.0, 2.5]), observation)
    np.testing.assert_allclose(observation[:4], [-0.5, 0.6, -0.5, 0.25], rtol=1e-6)
    assert observation[4:].min() >= 0.0
    assert observation[4:].max() == 1.0


def drawn_starts(maze, n):
    rng = np.random.default_rng(0)
    return np.array([draw_start(maze, rng) for _ in range(n)])


class TestDrawStart:
    @given(layout=layouts(), radius=st.one_of(st.floats(2.5, 60.0), st.just(1e12)))
    def test_is_where_the_robot_can_go_straight_by_shapely(self, layout, radius):
        boxes = [[x, y, x + w, y + h] for x, y, w, h in layout.walls.tolist()]
        grown = np.array(boxes).reshape(-1, 4) + (ROBOT_RADIUS - 1e-6) * np.array([-1, -1, 1, 1])
        walls = shapely.union_all([shapely.box(*box) for box in grown])
        free = shapely.box(1.0, 1.0, WIDTH - 1.0, HEIGHT - 1.0)
        for start in drawn_starts(make_maze(layout, start_radius=radius), 5).tolist():
            path = shapely.LineString([layout.start, start[:2]])
            assert start[2:] == [0.0, 0.0]
            assert 2.0 <= path.length <= radius * (1.0 + 1e-12) or path.length == 0.0
            assert not path.intersects(walls)
            assert free.covers(path)

    def test_is_uniform_over_the_disc_and_its_cut_by_walls(self):
        for walls, (low, high) in (([], (12.0, 28.0)), ([[0, 16, 40, 2]], (12.0, 28.0))):
            layout = MazeLayout("test", WIDTH, HEIGHT, (20.0, 12.0), (38.0, 12.0), walls)
            starts = drawn_starts(make_maze(layout, start_radius=8.0), 600)[:, :2]
            x, y = starts.T
            disc = shapely.Point(20.0, 12.0).buffer(8.0, 64)
            free = shapely.box(low, 1.0, high, 15.0 if walls else HEIGHT).intersection(disc)
            for edge in np.linspace(low, high, 9)[1:-1]:
                left = free.intersection(shapely.box(0.0, 0.0, edge, HEIGHT)).area / free.area
                assert np.mean(x < edge) == pytest.approx(left, abs=0.07)
            below = free.intersection(shapely.box(0.0, 0.0, WIDTH, 10.0)).area / free.area
            assert np.mean(y < 10.0) == pytest.approx(below, abs=0.07)

    def test_is_the_layouts_own_where_there_is_no_room(self):
        layout = make_layout([[0, 0, 40, 14], [0, 16.002, 40, 14]], start=(20.0, 15.001))
        maze = make_maze(layout, start_radius=9.0)
        np.testing.assert_array_equal(drawn_starts(maze, 2), [maze.start] * 2)


def test_is_at_goal_strictly_within_the_radius():
    maze = make_maze(make_layout([]), goal_radius=2.0)
    assert is_at_goal(maze, np.array([21.9, 15.0, 0.0, 0.0]))
    assert not is_at_goal(maze, np.array([22.0, 15.0, 0.0, 0.0]))
    assert not is_at_goal(maze, np.array([21.5, 16.5, 0.0, 0.0]))


def test_slides_along_flush_walls_from_a_start_that_touches_them():
    layout = make_layout([[5, 20, 5, 5], [10, 20, 5, 5], [15, 20, 5, 5]])
    maze = make_maze(layout)
    state = np.array([6.0, 19.0, 0.0, 0.0])
    for _ in range(40):
        move(maze, state, 1.0, 1.0 if state[0] < 20.0 else 0.0)
    assert state[0] > 25.0
