import pytest
from gymnasium import spaces

from curiosity_algos.curiosity.bonus import action_size


@pytest.mark.parametrize(
    ("space", "size"), [(spaces.Discrete(4), 4), (spaces.Box(-1, 1, (3,)), 3)], ids=str
)
def test_action_sizes(space, size):
    assert action_size(space) == size
