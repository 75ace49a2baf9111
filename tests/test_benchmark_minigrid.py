"""The benchmark of MiniGrid's doors, on tiles of our own, which are faster."""

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest

from benchmarks import minigrid


class Tiles(gym.Env):
    """An image of tiles; each episode ends after 64 steps with a return of 1."""

    observation_space = gym.spaces.Box(0, 255, (7, 7, 3), np.uint8)
    action_space = gym.spaces.Discrete(7)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.n_steps = 0
        return self.observation_space.sample(), {}

    def step(self, action):
        self.n_steps += 1
        is_last = self.n_steps == 64
        return self.observation_space.sample(), float(is_last), False, is_last, {}


@pytest.mark.nightly
def test_runs_are_kept_with_the_returns_so_far(tmp_path, monkeypatch):
    monkeypatch.setattr(minigrid, "FRAMES", {"MiniGrid-DoorKey-8x8-v0": 2048})
    monkeypatch.setattr(minigrid, "EVERY", 512)
    monkeypatch.setattr(minigrid, "make_env", lambda env: Tiles())
    minigrid.main("none,noveld", "0", tmp_path / "runs", 1, tmp_path)
    written = pd.read_csv(tmp_path / "minigrid.csv")
    assert written["algorithm"].tolist() == [*["PPO"] * 4, *["PPO + NovelD"] * 4]
    assert written["frames"].tolist() == [512, 1024, 1536, 2048] * 2
    assert written["return"].tolist() == [0.0, 0.0, 1.0, 1.0] * 2  # known a step after the end
    monkeypatch.delattr(minigrid, "make_env")  # what is there is not trained again
    minigrid.main("noveld", "0", tmp_path / "runs", 1, tmp_path)
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "minigrid.csv"), written)
    (tmp_path / "runs/MiniGrid-DoorKey-8x8-v0-none-0.csv").unlink()  # as where a clone begins
    minigrid.main("noveld", "0", tmp_path / "runs", 1, tmp_path)
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "minigrid.csv"), written)


def test_a_task_is_solved_when_the_mean_return_is():
    returns = {("PPO", 0): [0.0, 0.0], ("PPO + RND", 0): [0.5, 0.7], ("PPO + RND", 1): [0.95, 0.8]}
    rows = [
        (algorithm, "MiniGrid-DoorKey-8x8-v0", seed, 8192 * (i + 1), value)
        for (algorithm, seed), values in returns.items()
        for i, value in enumerate(values)
    ]
    columns = ["algorithm", "env", "seed", "frames", "return"]
    lines = minigrid.table(pd.DataFrame(rows, columns=columns)).splitlines()
    assert lines[2:] == [
        "| MiniGrid-DoorKey-8x8-v0 | PPO + RND | never / 8,192 | 0.70 / 0.80 |",
        "| MiniGrid-DoorKey-8x8-v0 | PPO | never | 0.00 |",
    ]
