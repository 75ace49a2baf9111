import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import torch as th
from gymnasium import spaces

from curiosity_algos.curiosity.icm import ICM
from curiosity_algos.curiosity.make import stored_action_size
from curiosity_algos.curiosity.settings import CuriositySettings

GIVEN = {
    "gamma": 0.9,
    "bonus": "icm",
    "bonus_kwargs": {"beta": 0.7, "hidden": 8},
    "n_transitions": 3,
    "n_updates": 2,
    "batch_size": 5,
    "buffer_size": 40,
}
OBSERVATIONS = spaces.Box(-1, 1, (4,))
ACTIONS = [spaces.Box(-1, 1, (2,)), spaces.Discrete(6)]


def settings_of(**changes):
    """The settings of an algorithm with other attributes beside."""
    return CuriositySettings.of(SimpleNamespace(sigma=1.0, **(GIVEN | changes)))


def make_motivation(action_space=ACTIONS[0], *, seed=0, **changes):
    return settings_of(**changes).make_motivation(
        OBSERVATIONS,
        action_space,
        seed=np.random.SeedSequence(seed),
        device=th.device("cpu"),
        n_threads=1,
    )


def test_they_are_the_algorithms():
    assert dataclasses.asdict(settings_of()) == GIVEN


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("gamma", 1.1, "`gamma` must be from 0 to 1"),
        ("gamma", -0.1, "`gamma` must be from 0 to 1"),
        ("bonus", "rdn", "`bonus` must be one of icm, rnd, got 'rdn'"),
        ("bonus_kwargs", {"bta": 1}, "`bonus_kwargs` must be one of beta, .* got 'bta'"),
        ("bonus_kwargs", {"seed": 1}, "`bonus_kwargs` must be one of beta, .* got 'seed'"),
        ("bonus_kwargs", {"device": "cpu"}, "`bonus_kwargs` must be one of .* got 'device'"),
        ("bonus_kwargs", {"action_space": 1}, "`bonus_kwargs` must be one of .* 'action_space'"),
        ("n_transitions", 0, "`n_transitions` must be a whole number of at least 1"),
        ("n_updates", 0, "`n_updates` must be a whole number of at least 1"),
        ("batch_size", 1.5, "`batch_size` must be a whole number of at least 1"),
        ("buffer_size", None, "`buffer_size` must be a whole number of at least 1"),
    ],
)
def test_errors_name_the_argument(name, value, message):
    with pytest.raises(ValueError, match=message):
        settings_of(**{name: value})


@pytest.mark.parametrize("gamma", [0.0, 1.0])
def test_bounds_of_gamma_are_allowed(gamma):
    assert settings_of(gamma=gamma).gamma == gamma


@pytest.mark.parametrize("action_space", ACTIONS)
def test_the_parts_have_the_settings(action_space):
    motivation = make_motivation(action_space)
    for name in ("gamma", "n_transitions", "n_updates", "batch_size"):
        assert getattr(motivation, name) == GIVEN[name]
    assert isinstance(motivation.bonus, ICM)
    assert (motivation.bonus.beta, motivation.bonus.is_discrete) == (
        0.7,
        isinstance(action_space, spaces.Discrete),
    )
    assert motivation.bonus.encoder[0].weight.shape == (8, 4)
    assert motivation.buffer.capacity == 40
    held = motivation.buffer.state_dict()
    assert held["observations"].shape == held["next_observations"].shape == (0, 4)
    assert held["actions"].shape == (0, stored_action_size(action_space))


def test_what_is_stored_of_an_action():
    assert stored_action_size(spaces.Box(-1, 1, (3,))) == 3
    assert stored_action_size(spaces.Discrete(5)) == 1


def test_seeds_decide_about_all_parts(assert_same):
    one, same, other = (make_motivation(seed=seed) for seed in (0, 0, 1))
    assert_same(one.state_dict(), same.state_dict())
    states = one.state_dict(), other.state_dict()
    weights = [state["bonus"]["modules"]["encoder.0.weight"] for state in states]
    assert not th.equal(*weights)
    assert not th.equal(*(state["buffer"]["generator"] for state in states))
    assert states[0]["rng"] != states[1]["rng"]
