"""Mazes with beams, and final states over them."""

import math

import gymnasium as gym
import numpy as np
from matplotlib.collections import LineCollection, QuadMesh

from curiosity_algos.experiments.figures.mazes import show_final_states, show_mazes
from curiosity_gym.built_in import BUILT_IN

ENVS = ["CuriosityMaze-Snake-v0", "CuriosityMaze-US-v0"]


def walk(start, angle, reach, layout):
    """Length of a beam, by small steps until a wall or the border is met."""
    lengths = np.arange(0.0, reach, 0.01)
    x, y = start[0] + lengths * math.cos(angle), start[1] + lengths * math.sin(angle)
    is_hit = (x <= 0.0) | (x >= layout.width) | (y <= 0.0) | (y >= layout.height)
    for left, bottom, width, height in layout.walls:
        is_hit |= (left < x) & (x < left + width) & (bottom < y) & (y < bottom + height)
    return lengths[is_hit.argmax()] if is_hit.any() else reach


def test_beams_end_where_a_wall_begins(has_ink):
    figure = show_mazes(ENVS)
    layout = BUILT_IN["us"]
    ax = figure.axes[1]
    (beams,) = [each for each in ax.collections if isinstance(each, LineCollection)]
    segments = np.array(beams.get_segments())
    assert segments.shape == (32, 2, 2)
    reach = gym.make(ENVS[1]).unwrapped.lidar_range
    for i, (start, end) in enumerate(segments):
        assert tuple(start) == layout.start
        angle = 2.0 * math.pi * i / 32
        expected = walk(layout.start, angle, reach, layout)
        direction = math.cos(angle), math.sin(angle)
        np.testing.assert_allclose(end - start, expected * np.array(direction), atol=0.02)
    hits = ax.get_lines()[2].get_xydata()
    assert 0 < len(hits) < 32  # along the corridor nothing is hit
    assert has_ink(figure, *figure.axes)
    assert [each.get_title() for each in figure.axes] == ["Snake", "US"]


def test_every_final_state_is_in_its_square():
    rng = np.random.default_rng(0)
    states = {
        name: {env: rng.poisson(rate, (100, 100)) for env, rate in zip(ENVS, rates, strict=True)}
        for name, rates in {"NSES": (0.1, 5.0), "CMAME": (1.0, 0.0)}.items()
    }
    figure = show_final_states(states)
    *panels, bar = figure.axes
    assert "positions in a square of 2 x 2" in bar.get_ylabel()
    titles = [(name, env) for name in states for env in ENVS]
    norms = set()
    for ax, (name, env) in zip(panels, titles, strict=True):
        counts = states[name][env]
        assert ax.get_title() == f"{name} on {env.split('-')[1]}, {counts.sum():,} episodes"
        (squares,) = [each for each in ax.collections if isinstance(each, QuadMesh)]
        shown = squares.get_array()
        np.testing.assert_array_equal(shown.filled(0), counts)
        assert (shown.mask == (counts == 0)).all()  # which are left as they are
        norms.add(squares.norm)
    assert len(norms) == 1  # a color means the same in every panel
