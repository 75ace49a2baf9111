import json

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.classic_control import PendulumEnv

from curiosity_algos.experiments.env_spec import decode_spec, encode_spec


class Mine(PendulumEnv):
    pass


class Unrecorded(gym.Wrapper):
    pass


def made_again(env):
    encoded = encode_spec(env.spec)
    assert json.loads(json.dumps(encoded)) == encoded
    return gym.make(decode_spec(encoded))


@pytest.mark.parametrize(
    "make",
    [
        lambda: gym.make("CuriosityMaze-US-v0", horizon=9, render_mode="rgb_array"),
        lambda: gym.make("Pendulum-v1", max_episode_steps=9, g=3.0),
        lambda: gym.wrappers.RescaleAction(
            gym.wrappers.FlattenObservation(gym.make("Pendulum-v1")), np.float32(-1), np.float32(1)
        ),
    ],
)
def test_an_environment_is_made_again(make):
    env = make()
    again = made_again(env)
    assert str(again) == str(env)
    assert again.action_space == env.action_space
    given = {name: value for name, value in env.spec.kwargs.items() if name != "render_mode"}
    assert again.unwrapped.spec.kwargs == given
    assert again.spec.max_episode_steps == env.spec.max_episode_steps
    assert again.render_mode is None


def test_ids_that_are_registered_elsewhere_are_made_by_their_class():
    gym.register("Mine-v0", Mine, vector_entry_point=lambda **_: None)
    env = gym.make("Mine-v0")
    del gym.registry["Mine-v0"]
    assert type(made_again(env).unwrapped) is Mine


def make_mine():
    return Mine()


def test_a_registered_function_makes_it_again():
    gym.register("Mine-v2", f"{__name__}:make_mine")
    env = gym.make("Mine-v2")
    assert type(made_again(env).unwrapped) is Mine
    del gym.registry["Mine-v2"]
    with pytest.raises(ValueError, match=r"a class of gymnasium\.Env in run\.json.*:make_mine"):
        made_again(env)


@pytest.mark.parametrize("entry", ["os:system", "subprocess:Popen", "gymnasium:make"])
def test_a_file_runs_nothing_but_environments(entry, tmp_path):
    env = gym.wrappers.RescaleAction(gym.make("Pendulum-v1"), np.float32(-1), np.float32(1))
    encoded = encode_spec(env.spec)
    (wrapper,) = encoded["additional_wrappers"]
    given = {"entry_point": entry, "kwargs": {"command": f"touch {tmp_path / 'ran'}"}}
    for changed in (given, {"additional_wrappers": [wrapper | given]}):
        with pytest.raises(ValueError, match=f"`run` must name a class of .*; got {entry}"):
            decode_spec(encoded | changed)
    assert list(tmp_path.iterdir()) == []


def test_what_no_file_holds_is_not_made_again():
    gym.register("Mine-v1", lambda: Mine())
    pendulum = gym.make("Pendulum-v1")
    for env in (
        gym.make("Mine-v1"),
        Unrecorded(pendulum),
        gym.wrappers.TransformReward(pendulum, lambda reward: reward),
    ):
        assert encode_spec(env.spec) is None
    del gym.registry["Mine-v1"]
