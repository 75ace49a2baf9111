"""The four mazes that have a name, and the arguments that mean a layout."""

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from curiosity_gym.drawn import named_layout
from curiosity_gym.layouts import MazeLayout

# fmt: off
_SNAKE = [
    [10, 0, 10, 180], [10, 180, 180, 10], [30, 160, 170, 10], [10, 140, 180, 10],
    [30, 120, 170, 10], [10, 100, 180, 10], [30, 80, 170, 10], [10, 60, 180, 10],
    [30, 40, 170, 10], [10, 20, 180, 10],
]
_US = [
    [10, 10, 180, 10], [10, 10, 10, 180], [180, 10, 10, 180], [10, 180, 85, 10],
    [105, 180, 85, 10], [105, 30, 65, 10], [30, 30, 65, 10], [30, 30, 10, 140],
    [160, 30, 10, 140], [30, 160, 130, 10], [50, 50, 100, 10], [50, 50, 10, 100],
    [140, 50, 10, 100], [50, 140, 45, 10], [105, 140, 45, 10], [70, 70, 25, 10],
    [105, 70, 25, 10], [70, 70, 10, 60], [120, 70, 10, 60], [70, 120, 60, 10],
]
_HARD = [
    [40, 10, 160, 10], [40, 10, 10, 40], [20, 70, 30, 10], [60, 70, 10, 80], [0, 110, 40, 10],
    [20, 140, 50, 10], [20, 140, 10, 60], [40, 40, 140, 10], [170, 40, 10, 140],
    [80, 170, 100, 10], [30, 70, 120, 10], [140, 70, 10, 80], [100, 100, 10, 80],
]
_LABYRINTH = [
    [180, 0, 10, 10], [160, 20, 40, 10], [160, 10, 10, 20], [40, 10, 130, 10], [40, 10, 10, 40],
    [10, 30, 40, 10], [20, 0, 10, 20], [10, 60, 10, 20], [10, 70, 30, 10], [30, 70, 10, 60],
    [0, 100, 20, 10], [10, 120, 30, 10], [10, 120, 10, 80], [30, 50, 30, 10], [50, 50, 10, 90],
    [30, 140, 30, 10], [30, 140, 10, 50], [50, 160, 10, 40], [50, 160, 30, 10], [70, 30, 10, 140],
    [100, 10, 10, 180], [90, 30, 30, 10], [90, 70, 30, 10], [90, 110, 30, 10], [90, 150, 30, 10],
    [130, 30, 10, 170], [70, 50, 20, 10], [70, 90, 20, 10], [70, 130, 20, 10], [120, 50, 20, 10],
    [120, 90, 20, 10], [120, 130, 20, 10], [150, 40, 10, 150], [180, 40, 10, 150],
    [150, 120, 40, 10],
]
# fmt: on

BUILT_IN = {
    layout.name: layout
    for layout in (
        MazeLayout("snake", 200, 200, (5, 5), (25, 5), np.array(_SNAKE)),
        MazeLayout("us", 200, 200, (100, 5), (100, 100), np.array(_US)),
        MazeLayout("hard", 200, 200, (195, 5), (60, 30), np.array(_HARD)),
        MazeLayout("labyrinth", 200, 200, (195, 5), (170, 140), np.array(_LABYRINTH)),
    )
}


def resolve_layout(
    layout: Any, built_in: Mapping[str, MazeLayout] = BUILT_IN, name: str = "layout"
) -> MazeLayout:
    """Return the layout itself, or what its fields, a name, a .json path or a text mean.

    Names are those of the built-in mazes and of `random_layout`.

    In a text a backslash and an n are a line break, too. An error has the argument's `name`.

    Raises:
        ValueError: `layout` is none of these, or the layout it means is not valid.
    """
    if isinstance(layout, MazeLayout):
        return layout
    if isinstance(layout, Mapping):
        return MazeLayout.from_dict(layout)
    if isinstance(layout, str) and layout in built_in:
        return built_in[layout]
    if isinstance(layout, str):
        try:
            drawn = named_layout(layout)
        except ValueError as error:
            raise ValueError(f"`{name}` {layout!r} names no maze: {error}") from error
        if drawn is not None:
            return drawn
    if isinstance(layout, str | os.PathLike) and str(layout).endswith(".json"):
        return MazeLayout.from_json(layout)
    if isinstance(layout, str) and "\n" in (text := layout.replace(r"\n", "\n")):
        return MazeLayout.from_ascii(text)  # a shell passes the two characters
    raise ValueError(
        f"`{name}` must be a MazeLayout or its fields, a built-in name ({', '.join(built_in)}), a "
        "name of random_layout such as rooms-4x4-door8-seed0, a path ending in .json, or ASCII "
        f"text with a line break, got {layout!r:.60}."
    )
