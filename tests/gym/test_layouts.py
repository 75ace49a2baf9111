import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from curiosity_gym.built_in import BUILT_IN
from curiosity_gym.layouts import GOAL_RADIUS, MazeLayout, closest_approach, reachable_cells

FIELDS = {
    "name": "room",
    "width": 30.0,
    "height": 20.0,
    "start": (5.0, 5.0),
    "goal": (25.0, 15.0),
    "walls": [[10.0, 0.0, 5.0, 10.0]],
}
ASCII = """
    #S..#
    #G..#
"""


def make_layout(**changes):
    return MazeLayout(**(FIELDS | changes))


class TestFields:
    def test_are_normalized(self):
        layout = make_layout(width=30, start=np.array([5, 5]), goal=[25, 15])
        assert isinstance(layout.width, float)
        assert layout.start == (5.0, 5.0)
        assert layout.goal == (25.0, 15.0)
        assert layout.walls.dtype == np.float64

    def test_walls_are_a_read_only_copy(self):
        walls = np.array(FIELDS["walls"])
        layout = make_layout(walls=walls)
        walls[:] = 0.0
        np.testing.assert_array_equal(layout.walls, FIELDS["walls"])
        with pytest.raises(ValueError, match="read-only"):
            layout.walls[0, 0] = 1.0

    def test_walls_are_clipped_to_the_world(self):
        walls = [[-5, 15, 10, 10], [40, 0, 5, 5], [30, 0, 5, 5], [10, -3, 5, 13]]
        np.testing.assert_array_equal(
            make_layout(walls=walls).walls, [[0, 15, 5, 5], [10, 0, 5, 10]]
        )

    def test_bad_ones_are_named(self):
        for changes in [
            {"name": 3},
            {"width": 2.0},
            {"width": 1.1e12},
            {"height": "20"},
            {"start": (5.0, np.nan)},
            {"start": (5.0, 5.0, 0.0)},
            {"start": (9.5, 5.0)},
            {"start": (5.0, 19.5)},
            {"goal": (25.0, -1.0)},
            {"goal": (30.5, 15.0)},
            {"goal": (10.5, 5.0)},
            {"walls": [[10.0, 0.0, 5.0]]},
            {"walls": [[10.0, 0.0, 5.0, 5.0], [1.0]]},
            {"walls": [[10.0, 0.0, 5.0, 0.0]]},
        ]:
            (field,) = changes
            with pytest.raises(ValueError, match=rf"^{field} must [^\n]*\.$"):
                make_layout(**changes)

    def test_start_may_touch_a_wall(self):
        assert closest_approach(make_layout(start=(9.0, 1.0))) == 0.0


class TestGoal:
    def test_behind_a_wall_or_an_exactly_closed_gap_is_refused(self):
        for walls in ([[10, 0, 5, 20]], [[10, 0, 5, 10], [10, 12, 5, 8]]):
            with pytest.raises(ValueError, match=r"^goal must be within 2 of a point"):
                make_layout(walls=walls)
        assert closest_approach(make_layout(walls=[[10, 0, 5, 10], [10, 12.01, 5, 8]])) == 0.0

    def test_may_be_where_the_robot_comes_near_only(self):
        corner = make_layout(goal=(30.0, 20.0))
        assert closest_approach(corner) == pytest.approx(np.sqrt(2.0))
        assert closest_approach(corner) < GOAL_RADIUS

    def test_may_lie_beyond_a_thin_wall(self):
        # The robot's center comes to x = 9, and the goal is at 10.9 behind a wall of width 0.5.
        layout = make_layout(walls=[[10, 0, 0.5, 20]], goal=(10.9, 10.0))
        assert closest_approach(layout) == pytest.approx(1.9)


class TestIdentity:
    def test_every_field_counts(self):
        for changes in [
            {"name": "b"},
            {"width": 31},
            {"start": (5, 6)},
            {"goal": (24, 15)},
            {"walls": []},
        ]:
            assert make_layout() != make_layout(**changes)

    def test_zeros_of_either_sign_are_equal(self):
        layout, same = make_layout(walls=[[10, -0.0, 5, 10]]), make_layout()
        assert layout == same
        assert hash(layout) == hash(same)

    def test_survives_copies(self, duplicate):
        layout = BUILT_IN["labyrinth"]
        assert duplicate(layout) == layout
        assert not duplicate(layout).walls.flags.writeable


class TestJson:
    @given(
        name=st.text(),
        # Left of x = 30, so that start and goal stay free.
        walls=st.lists(
            st.tuples(
                st.floats(-50, 10),
                st.floats(-50, 150),
                st.floats(1e-3, 20),
                st.floats(1e-3, 200),
            )
        ),
    )
    def test_round_trip(self, tmp_path_factory, name, walls):
        layout = MazeLayout(name, 100.0, 100.0, (50.0, 50.0), (60.0, 60.1), np.array(walls))
        path = tmp_path_factory.getbasetemp() / "layout.json"
        layout.to_json(path)
        assert MazeLayout.from_json(path) == layout
        assert json.loads(path.read_text())["walls"] == layout.walls.tolist()

    @pytest.mark.parametrize(
        ("message", "contents"),
        [
            (r"layout '.*bad\.json' is not JSON", ["", b"\xff\xfe\x00"]),
            ("layout must have the keys", ["[]", json.dumps(FIELDS | {"colour": "red"})]),
            ("walls must be rows", [json.dumps(FIELDS | {"walls": [[1.0, np.nan, 1.0, 1.0]]})]),
        ],
        ids=["no JSON", "no layout", "NaN"],
    )
    def test_files_of_something_else_are_refused(self, tmp_path, message, contents):
        path = tmp_path / "bad.json"
        for content in contents:
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
            with pytest.raises(ValueError, match=f"^{message}"):
                MazeLayout.from_json(path)

    def test_missing_file_is_named(self, tmp_path):
        with pytest.raises(ValueError, match=r"^layout '.*none\.json' is not JSON: .*No such file"):
            MazeLayout.from_json(tmp_path / "none.json")


def draw_ascii(layout, n_columns, n_rows, cell_size):
    """The inverse of from_ascii: what is at the center of each cell."""

    def letter(x, y):
        if (x, y) in (layout.start, layout.goal):
            return "S" if (x, y) == layout.start else "G"
        low, high = layout.walls[:, :2], layout.walls[:, :2] + layout.walls[:, 2:]
        return "#" if ((low < (x, y)) & ((x, y) < high)).all(axis=1).any() else "."

    rows = [
        "".join(letter((ix + 0.5) * cell_size, (iy + 0.5) * cell_size) for ix in range(n_columns))
        for iy in reversed(range(n_rows))
    ]
    return "\n".join(rows)


class TestAscii:
    @given(
        rows=st.integers(2, 9).flatmap(
            lambda n: st.lists(st.text("#.", min_size=n, max_size=n), min_size=1, max_size=9)
        ),
        place=st.tuples(st.integers(0, 100), st.integers(0, 100)),
        cell_size=st.sampled_from([2.5, 4.0, 10.0, 17.3]),
    )
    def test_round_trip(self, rows, place, cell_size):
        y, x = place[0] % len(rows), place[1] % (len(rows[0]) - 1)
        rows[y] = rows[y][:x] + "SG" + rows[y][x + 2 :]
        text = "\n".join(rows)
        layout = MazeLayout.from_ascii(text + "\n", cell_size=cell_size)
        assert draw_ascii(layout, len(rows[0]), len(rows), cell_size) == text
        assert len(layout.walls) == len(re.findall("#+", text))

    def test_malformed_text_is_refused(self):
        for text, reason in [
            ("S..\n.G\n", "one length"),
            ("S.x\n..G\n", "S.x"),
            ("...\n..G\n", "one 'S'"),
            ("SS.\n..G\n", "one 'S'"),
        ]:
            with pytest.raises(ValueError, match=rf"^layout [^\n]*{reason}"):
                MazeLayout.from_ascii(text)

    def test_bad_cell_size_is_named(self):
        for cell_size in [0.0, np.nan]:
            with pytest.raises(ValueError, match=r"^cell_size must be"):
                MazeLayout.from_ascii(ASCII, cell_size=cell_size)


def test_reachable_cells_are_indexed_x_first():
    # Free are the lower left half and a corridor along the bottom.
    layout = make_layout(walls=[[15, 5, 15, 15]], start=(3.0, 3.0), goal=(28.0, 2.0))
    cells = reachable_cells(layout, 4)
    assert cells.shape == (4, 4)
    np.testing.assert_array_equal(cells, [[1, 1, 1, 1], [1, 1, 1, 1], [1, 0, 0, 0], [1, 0, 0, 0]])
