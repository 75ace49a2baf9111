import numpy as np
import pytest
from PIL import ImageColor

from curiosity_gym.built_in import BUILT_IN
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze import viewer as viewer_module
from curiosity_gym.maze.viewer import MazeViewer

SIZE = 500
SCALE = 2.5
AT_REST = (55.0, 105.0, 0.0, 0.0)
NO_BEAMS = np.zeros(32)


def make_viewer(layout="hard", **changes):
    layout = BUILT_IN[layout] if isinstance(layout, str) else layout
    return MazeViewer(layout, **({"n_beams": 32, "beam_range": 50.0, "goal_radius": 2.0} | changes))


def color_at(frame, x, y, scale=SCALE):
    return tuple(frame[frame.shape[0] - 1 - int(y * scale), int(x * scale)])


def rgb(name):
    return ImageColor.getrgb(getattr(viewer_module, name))


class TestDraw:
    def test_shows_the_maze_with_y_up(self):
        for name in BUILT_IN:
            layout = BUILT_IN[name]
            frame = make_viewer(name).draw((*layout.goal, 0.0, 0.0), NO_BEAMS)
            assert frame.shape == (SIZE, SIZE, 3)
            assert frame.dtype == np.uint8
            assert color_at(frame, *layout.start) == rgb("START")
            assert color_at(frame, *layout.goal) == rgb("ROBOT")
            for x, y, width, height in layout.walls:
                assert color_at(frame, x + width / 2, y + height / 2) == rgb("WALL")
            is_wall = (frame == rgb("WALL")).all(axis=2)
            centers = (np.arange(SIZE) + 0.5) / SCALE
            x, y = np.meshgrid(centers, centers[::-1])
            low, high = layout.walls[:, :2], layout.walls[:, :2] + layout.walls[:, 2:]
            expected = np.zeros((SIZE, SIZE), dtype=bool)
            for (left, bottom), (right, top) in zip(low, high, strict=True):
                expected |= (left < x) & (x < right) & (bottom < y) & (y < top)
            inside = np.s_[1:-1, 1:-1]  # the border is drawn in the color of the walls
            np.testing.assert_array_equal(is_wall[inside], expected[inside])

    def test_shows_the_goal_and_its_area(self):
        frame = make_viewer(goal_radius=8.0).draw(AT_REST, NO_BEAMS)
        x, y = BUILT_IN["hard"].goal
        assert color_at(frame, x, y) == rgb("GOAL")
        assert color_at(frame, x + 7.0, y) == rgb("GOAL_AREA")
        assert color_at(frame, x, y - 7.0) == rgb("GOAL_AREA")
        assert color_at(frame, x, y + 8.8) == rgb("FLOOR")

    def test_an_area_of_any_size_is_drawn_at_once(self):
        frames = [make_viewer(goal_radius=r).draw(AT_REST, NO_BEAMS) for r in (600.0, 1e4, 1e12)]
        assert color_at(frames[0], 195.0, 195.0) == rgb("GOAL_AREA")
        for frame in frames[1:]:
            np.testing.assert_array_equal(frame, frames[0])

    def test_beam_points_to_its_angle(self):
        for i in [0, 8, 16, 24]:
            beams = NO_BEAMS.copy()
            beams[i] = 20.0
            viewer = make_viewer()
            changed = (viewer.draw(AT_REST, beams) != viewer.draw(AT_REST, NO_BEAMS)).any(axis=2)
            rows, columns = np.nonzero(changed)
            direction = np.array(
                [columns.mean() / SCALE - 55.0, (SIZE - rows.mean()) / SCALE - 105.0]
            )
            angle = np.arctan2(direction[1], direction[0])
            assert np.cos(angle - 2.0 * np.pi * i / 32) > 0.99
            assert np.hypot(columns - 55.0 * SCALE, SIZE - rows - 105.0 * SCALE).max() == (
                pytest.approx(20.0 * SCALE, abs=3.0)
            )

    def test_only_beams_that_hit_end_in_a_dot(self):
        viewer = make_viewer(beam_range=20.0)
        beams = NO_BEAMS + np.float32(20.0)
        beams[0] = 15.0
        frame = viewer.draw(AT_REST, beams)
        assert (frame == rgb("HIT")).all(axis=2).any()
        beams[0] = 20.0
        assert not (viewer.draw(AT_REST, beams) == rgb("HIT")).all(axis=2).any()

    def test_velocity_tick_points_where_the_robot_goes(self):
        frame = make_viewer().draw((55.0, 105.0, 0.0, 20.0), NO_BEAMS)
        assert color_at(frame, 55.0, 112.0) == rgb("VELOCITY")
        assert color_at(frame, 55.0, 98.0) == rgb("FLOOR")

    def test_other_worlds_keep_their_shape_on_even_sides(self):
        layout = MazeLayout("flat", 61.0, 23.0, (5, 5), (8, 5), np.array([[30, 0, 10, 10]]))
        frame = make_viewer(layout, size=301).draw((20, 10, 0, 0), NO_BEAMS)
        assert frame.shape == (114, 300, 3)
        assert color_at(frame, 35.0, 5.0, 300 / 61) == rgb("WALL")
        assert color_at(frame, 35.0, 15.0, 300 / 61) == rgb("FLOOR")
