import re

import numpy as np
import pytest

from curiosity_algos import Rollouts
from curiosity_algos.evaluation.rollouts import as_behaviors

RECORD = {
    "returns": np.zeros(3),
    "lengths": np.array([4, 1, 7]),
    "success": np.zeros(3, dtype=bool),
    "terminated": np.zeros(3, dtype=bool),
    "behaviors": np.zeros((3, 0)),
    "final_observations": np.zeros((3, 2), dtype=np.float32),
}


def test_counts_individuals_and_their_steps():
    rollouts = Rollouts(**RECORD)
    assert len(rollouts) == 3
    assert rollouts.timesteps == 12
    assert type(rollouts.timesteps) is int


def test_trajectories_are_there_or_an_error():
    with pytest.raises(ValueError, match="hold no trajectories"):
        _ = Rollouts(**RECORD).trajectories
    arrays = {"observations": np.zeros((3, 8, 2)), "actions": np.zeros((3, 7, 1))}
    observations, actions = Rollouts(**RECORD, **arrays).trajectories
    assert observations is arrays["observations"]
    assert actions is arrays["actions"]


def test_a_record_is_frozen():
    with pytest.raises(AttributeError):
        Rollouts(**RECORD).returns = np.ones(3)


@pytest.mark.parametrize("odd", ["left", [1.0], 2.0, [[1.0, 2.0]], None], ids=repr)
def test_the_behavior_that_is_not_like_the_others_is_named(odd):
    with pytest.raises(ValueError, match=re.escape(f"or none, got {odd!r}.")):
        as_behaviors([[0.0, 1.0], [2.0, 3.0], odd])
