"""A network bonus of a user's own."""

import pytest
from gymnasium import spaces

from curiosity_algos.bonuses.base import NetworkBonus


class Untrained(NetworkBonus):
    """Has nothing to train."""

    name = "untrained"

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self._begin()

    def losses(self, before, actions, after):
        raise NotImplementedError

    def score(self, observations, actions, next_observations):
        raise NotImplementedError


def test_it_must_have_something_to_train():
    with pytest.raises(ValueError, match="Untrained must have a parameter that is trained"):
        Untrained(spaces.Box(-1, 1, (3,)), spaces.Discrete(2))
