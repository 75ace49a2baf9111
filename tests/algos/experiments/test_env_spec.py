import json

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.classic_control import PendulumEnv

from curiosity_algos.experiments.env_spec import decode_spec, encode_spec


class Mine(PendulumEnv):
    pass


def made_again(env, **trust):
    encoded = encode_spec(env.spec)
    assert json.loads(json.dumps(encoded)) == encoded
    return gym.make(decode_spec(encoded, **trust))


@pytest.mark.parametrize(
    "make",
    [
        lambda: gym.make("CuriosityMaze-US-v0", horizon=9, render_mode="rgb_array"),
        lambda: gym.wrappers.RescaleAction(
            gym.wrappers.FlattenObservation(gym.make("Pendulum-v1", max_episode_steps=9, g=3.0)),
            np.float32(-1),
            np.float32(1),
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
    assert again.spec.vector_entry_point == env.spec.vector_entry_point  # steps it in batches
    assert again.render_mode is None


def make_mine():
    return Mine()


def test_what_is_not_registered_needs_trust():
    gym.register("Mine-v0", Mine, vector_entry_point=lambda **_: None)
    env = gym.make("Mine-v0")
    assert type(made_again(env).unwrapped) is Mine
    gym.register("Mine-v0", make_mine)
    with pytest.raises(ValueError, match=r"`trust` must be given .*: Mine-v0 would run .*:Mine"):
        made_again(env)
    del gym.registry["Mine-v0"]
    with pytest.raises(ValueError, match=r"`trust` must be given .*: Mine-v0 would run .*:Mine"):
        made_again(env)
    assert type(made_again(env, trust=True).unwrapped) is Mine


def test_wrappers_of_others_need_trust():
    encoded = encode_spec(gym.wrappers.TimeAwareObservation(gym.make("Pendulum-v1")).spec)
    (wrapper,) = encoded["additional_wrappers"]
    monitor = "stable_baselines3.common.monitor:Monitor"
    decode_spec(encoded | {"additional_wrappers": [wrapper | {"entry_point": monitor}]})
    wrapper["kwargs"] = {"filename": "over/mine"}
    for entry in ("os:system", "gymnasium.wrappers.rendering:RecordVideo", monitor):
        changed = encoded | {"additional_wrappers": [wrapper | {"entry_point": entry}]}
        with pytest.raises(ValueError, match=f"Pendulum-v1 would run {entry}"):
            decode_spec(changed)


@pytest.mark.parametrize("change", [{"id": 3}, {"kwargs": {"@array": "gone"}}, {"more": 1}])
def test_a_damaged_one_is_refused(change):
    encoded = encode_spec(gym.make("Pendulum-v1").spec)
    with pytest.raises(ValueError, match=r"`env_spec` in run\.json is damaged"):
        decode_spec(encoded | change)


class Unrecorded(gym.Wrapper):
    pass


def test_what_no_file_holds_is_named():
    gym.register("Mine-v1", lambda: Mine())
    pendulum = gym.make("Pendulum-v1")
    changed = gym.wrappers.TransformReward(pendulum, lambda reward: reward)
    for env, what in [
        (gym.make("Mine-v1"), "Mine-v1 is made by a function that no module names"),
        (Unrecorded(pendulum), "the wrapper Unrecorded does not record its arguments"),
        (changed, "the wrapper TransformReward takes .*`kwargs/func` there is a function"),
        (gym.make("Pendulum-v1", g=Mine()), "`kwargs/g` there is a Mine"),
    ]:
        with pytest.raises(ValueError, match=what):
            encode_spec(env.spec)
    del gym.registry["Mine-v1"]
