from pathlib import Path

import pytest

from curiosity_gym.built_in import BUILT_IN, resolve_layout
from curiosity_gym.layouts import MazeLayout

ASCII = "S.G\n.#.\n"
ROOM = MazeLayout("room", 30.0, 20.0, (5.0, 5.0), (25.0, 15.0), [[10.0, 0.0, 5.0, 10.0]])


class TestResolve:
    def test_built_in_name(self):
        for name in BUILT_IN:
            assert resolve_layout(name) is BUILT_IN[name]
            assert BUILT_IN[name].name == name

    @pytest.mark.parametrize("as_type", [str, Path])
    def test_json_path(self, tmp_path, as_type):
        path = tmp_path / "maze.json"
        ROOM.to_json(path)
        assert resolve_layout(as_type(path)) == ROOM

    def test_ascii_text(self):
        for text in (ASCII, ASCII.replace("\n", r"\n")):  # as a shell passes it
            assert resolve_layout(text) == MazeLayout.from_ascii(ASCII)

    def test_fields(self):
        assert resolve_layout(ROOM.to_dict()) == ROOM
        with pytest.raises(ValueError, match="layout must have the keys"):
            resolve_layout({})

    def test_anything_else_is_refused(self):
        for layout in ["maze", "S.G", Path("maze.txt"), 3]:
            with pytest.raises(
                ValueError, match=r"^`layout` must be .*snake, us, hard, labyrinth.*json"
            ):
                resolve_layout(layout)
