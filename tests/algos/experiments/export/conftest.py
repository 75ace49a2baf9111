"""Environments of other spaces, by an id as a run's folder needs it."""

import gymnasium as gym
import pytest


@pytest.fixture
def register_toy():
    """Gives the id of the toy of a name, which is forgotten after the test."""
    ids = []

    def register(name):
        ids.append(f"Toy-{name}-v0")
        gym.register(ids[-1], "toys:Toy", kwargs={"name": name})
        return ids[-1]

    yield register
    for env_id in ids:
        del gym.registry[env_id]
