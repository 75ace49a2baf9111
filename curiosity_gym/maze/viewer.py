"""Drawing a robot in its maze: frames by Pillow."""

import math
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from curiosity_gym.core import FloatArray, Frame
from curiosity_gym.layouts import ROBOT_RADIUS, MazeLayout

FLOOR = "#faf9f6"
WALL = "#3a4254"
START = "#d64541"
GOAL = "#1f8f5f"
GOAL_AREA = "#c4e8d5"
BEAM = "#f7dcae"
HIT = "#e8962e"
ROBOT = "#1f62b4"
VELOCITY = "#0d2f61"

# Frames are drawn this many times larger and averaged: Pillow's own shapes have jagged edges.
_SUPERSAMPLING = 2
# The velocity tick ends where the robot would be after this long (seconds).
_VELOCITY_TIME = 0.5


class MazeViewer:
    """Draws the maze, the robot, its velocity and its beams, with y up.

    A beam shorter than `beam_range` ends in a dot. The longer side of a frame has `size` pixels,
    and both are even, as video codecs require.
    """

    def __init__(
        self,
        layout: MazeLayout,
        *,
        n_beams: int,
        beam_range: float,
        goal_radius: float,
        size: int = 500,
    ) -> None:
        angles = 2.0 * np.pi * np.arange(n_beams) / n_beams
        self._directions = np.column_stack([np.cos(angles), np.sin(angles)])
        self._hit_range = beam_range * (1.0 - 1e-6)  # float32 beams may round below the range
        world = np.array([layout.width, layout.height])
        sides = np.maximum(2, 2 * np.round(world * (size / world.max() / 2.0)).astype(int))
        self._frame_size = int(sides[0]), int(sides[1])
        self._scale = sides * _SUPERSAMPLING / world
        self._background = self._draw_background(layout, goal_radius)

    def draw(self, state: Sequence[float] | FloatArray, beams: FloatArray) -> Frame:
        """A frame (height, width, 3) of a state (4,) and the lengths of beams (n_beams,)."""
        image = self._background.copy()
        canvas = ImageDraw.Draw(image)
        position, velocity = np.array(state, dtype=np.float64).reshape(2, 2)
        self._draw_beams(canvas, position, beams)
        tick = [*self._pixels(position), *self._pixels(position + _VELOCITY_TIME * velocity)]
        canvas.line(tick, fill=VELOCITY, width=2 * _SUPERSAMPLING)
        self._draw_disk(canvas, position, ROBOT_RADIUS, at_least=4, fill=ROBOT)
        return np.array(image.reduce(_SUPERSAMPLING))

    def _draw_background(self, layout: MazeLayout, goal_radius: float) -> Image.Image:
        width, height = (side * _SUPERSAMPLING for side in self._frame_size)
        image = Image.new("RGB", (width, height), FLOOR)
        canvas = ImageDraw.Draw(image)
        covers_all = 2.0 * math.hypot(layout.width, layout.height)  # Pillow takes long for more
        radius = min(goal_radius, covers_all)
        self._draw_disk(canvas, layout.goal, radius, fill=GOAL_AREA, outline=GOAL)
        for low, size in layout.walls.reshape(-1, 2, 2):
            left, bottom = self._pixels(low)
            right, top = self._pixels(low + size)
            # Pillow fills the last row and column too.
            canvas.rectangle([left, top, max(left, right - 1), max(top, bottom - 1)], fill=WALL)
        canvas.rectangle([0, 0, width - 1, height - 1], outline=WALL, width=_SUPERSAMPLING)
        self._draw_disk(canvas, layout.goal, 0.0, at_least=2, fill=GOAL)
        self._draw_disk(canvas, layout.start, 0.0, at_least=3, fill=START)
        return image

    def _draw_beams(
        self, canvas: ImageDraw.ImageDraw, position: FloatArray, beams: FloatArray
    ) -> None:
        ends = position + np.asarray(beams, dtype=np.float64)[:, None] * self._directions
        for end in ends:
            line = [*self._pixels(position), *self._pixels(end)]
            canvas.line(line, fill=BEAM, width=_SUPERSAMPLING)
        for end in ends[beams < self._hit_range]:
            self._draw_disk(canvas, end, 0.0, at_least=1, fill=HIT)

    def _draw_disk(
        self,
        canvas: ImageDraw.ImageDraw,
        center: Sequence[float] | FloatArray,
        radius: float,
        *,
        at_least: float = 0.0,
        fill: str,
        outline: str | None = None,
    ) -> None:
        """Draw a disk of a radius (maze units) that is no smaller than `at_least` (pixels)."""
        x, y = self._pixels(center)
        radius_x, radius_y = np.maximum(radius * self._scale, at_least * _SUPERSAMPLING).tolist()
        box = [x - radius_x, y - radius_y, x + radius_x, y + radius_y]
        canvas.ellipse(box, fill=fill, outline=outline, width=_SUPERSAMPLING)

    def _pixels(self, position: Sequence[float] | FloatArray) -> tuple[float, float]:
        """Return where a position is on the supersampled image, whose rows run downwards."""
        x, y = (np.asarray(position) * self._scale).tolist()
        return x, self._frame_size[1] * _SUPERSAMPLING - y
