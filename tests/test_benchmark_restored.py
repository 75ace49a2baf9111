"""How soon searches by restored states find goals: the steps that they save, and their table."""

from functools import partial

import gymnasium as gym
import numpy as np
import pandas as pd

from benchmarks import restored


def test_ways_are_what_a_search_takes_again_where_nothing_is_restored():
    make = partial(gym.make, "CuriosityMaze-US-v0", horizon=200)
    settings = {"seed": 0, "population_size": 8}
    fast = restored.WithWays(make, **settings).learn(2_500)
    slow = restored.WithWays(lambda: gym.Wrapper(make()), **settings).learn(2_500)
    assert fast.replayed_steps == 0
    assert slow.replayed_steps == slow.ways == fast.ways > 0
    for name in ("place", "measures"):
        np.testing.assert_array_equal(slow.archive.data(name), fast.archive.data(name))


def test_ways_count_in_the_table_and_its_words():
    rows = [
        ("rooms-4x4-door8-seed10", 0, 1e6, 2e6, 9e5),
        ("rooms-4x4-door8-seed11", 0, 1e6, 4e6, 8e5),
        ("rooms-4x4-door8-seed11", 1, 4e6, 9e6, np.nan),
        ("AntTrap", 0, 2e6, np.nan, 1e6),
    ]
    values = pd.DataFrame(
        rows, columns=["task", "seed", "timesteps", "ways", "first_success_timesteps"]
    ).assign(behavior="learned", seconds=2.0)
    *_, rooms, ant = restored.table(values).splitlines()
    assert rooms == (
        "| rooms-4x4-door8, learned | 2 of 3 | 0.85 (0.80 to 0.90) | 4.00 (3.00 to 5.00) | 2 |"
    )
    assert ant == "| AntTrap, learned | 1 of 1 | 1.00 (1.00 to 1.00) |  | 2 |"
    words = restored.rooms_in_words(values)
    assert "In 2 such mazes" in words
    assert "2 of 3 runs" in words
    assert "4.0 M (median), and 5.0 M at most" in words
