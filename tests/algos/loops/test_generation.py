import numpy as np
import pytest

from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.loops.generation import as_step


@pytest.fixture
def rollouts():
    return Rollouts(
        returns=np.array([np.float32(0.66), 0.0, -2.0]),
        lengths=np.array([3, 5, 4]),
        success=np.array([True, False, False]),
        behaviors=np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]]),
        final_observations=np.arange(6, dtype=np.float32).reshape(3, 2),
    )


def test_each_individual_ends_an_episode(rollouts):
    step = as_step(rollouts, 12.3456789)
    assert step["rollouts"] is rollouts
    assert step["rewards"] is rollouts.returns
    assert step["dones"].tolist() == [True] * 3
    assert [info["episode"] for info in step["infos"]] == [
        {"r": 0.66, "l": 3, "t": 12.345679},
        {"r": 0.0, "l": 5, "t": 12.345679},
        {"r": -2.0, "l": 4, "t": 12.345679},
    ]
    assert [info["is_success"] for info in step["infos"]] == [True, False, False]
    assert [info["terminal_observation"].tolist() for info in step["infos"]] == [
        [0.0, 1.0],
        [2.0, 3.0],
        [4.0, 5.0],
    ]
    assert step["infos"][1]["behavior"].tolist() == [0.3, 0.4]


def test_no_behavior_is_no_entry(rollouts):
    without = Rollouts(**{**vars(rollouts), "behaviors": np.empty((3, 0))})
    assert all("behavior" not in info for info in as_step(without, 0.0)["infos"])
