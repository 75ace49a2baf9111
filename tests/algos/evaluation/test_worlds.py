"""Episodes that are taken up where they stood."""

import gymnasium as gym
import numpy as np
import pytest

from curiosity_algos.evaluation.environments import open_env
from curiosity_algos.evaluation.places import Place, Places
from curiosity_algos.evaluation.worlds import OneWorld, SimulatedWorlds, make_worlds

IDS = ["CuriosityMaze-Hard-v0", "MountainCarContinuous-v0", "CartPole-v1"]


def make(env_id, n=3, **kwargs):
    env = gym.make(env_id, **kwargs)
    return env, make_worlds(open_env(env), n, 1, is_copied=False)


def walk(env, n_steps):
    env.action_space.seed(1)
    return np.array([env.action_space.sample() for _ in range(n_steps)])


@pytest.mark.parametrize("is_copied", [False, True])
@pytest.mark.parametrize("env_id", IDS)
def test_they_step_as_the_environment_does(env_id, is_copied):
    env = gym.make(env_id)
    worlds = make_worlds(open_env(gym.make(env_id)), 3, 1, is_copied=is_copied)
    worlds.seed = 5
    actions, (observation, _) = walk(env, 12), env.reset(seed=5)
    start = Places(actions[:0]).start()
    np.testing.assert_array_equal(worlds.restore([start])[0], observation)
    for action, (seen, reward) in zip(actions, worlds.follow(start, actions), strict=True):
        observation, expected, *_ = env.step(action)
        np.testing.assert_array_equal(seen, observation)
        assert reward == expected


def test_several_places_are_taken_up_at_once():
    env, worlds = make("CuriosityMaze-Hard-v0", n=4)
    assert isinstance(worlds, SimulatedWorlds)
    actions, start = walk(env, 9), Places(np.zeros((0, 2), np.float32)).start()
    seen = [observation for observation, _ in worlds.follow(start, actions)]
    places = [Place(start.trail.then(actions[:n]), 0.0) for n in (3, 0, 9)]
    found = worlds.restore(places)
    np.testing.assert_array_equal(found[0], seen[2])
    np.testing.assert_array_equal(found[1], env.reset()[0])
    np.testing.assert_array_equal(found[2], seen[8])
    (state,) = worlds.states(np.array([2]))
    restored = Place(places[2].trail, 0.0, state)
    np.testing.assert_array_equal(worlds.restore([start, restored])[1], seen[8])
    assert worlds.replayed_steps == 0


def test_the_limit_counts_along_the_whole_way():
    for env_id, kwargs in [
        ("CuriosityMaze-Hard-v0", {"horizon": 10}),
        ("CartPole-v1", {"max_episode_steps": 10}),
    ]:
        env, worlds = make(env_id, **kwargs)
        actions = walk(env, 10)
        if env_id == "CartPole-v1":
            actions[:] = [0, 1] * 5  # the pole stands
        place = Place(Places(actions[:0]).start().trail.then(actions[:8]), 0.0)
        worlds.restore([place])
        first, last = (worlds.step(action[None], np.array([0])) for action in actions[8:])
        assert not first.ended[0]
        assert last.ended[0]
        assert not last.terminated[0]


def test_an_action_again_counts_as_replayed():
    env, worlds = make("CartPole-v1")
    assert isinstance(worlds, OneWorld)
    actions = walk(env, 6)
    trail = Places(actions[:0]).start().trail.then(actions[:4])
    worlds.restore([Place(trail, 0.0)])
    assert worlds.replayed_steps == 4


@pytest.mark.parametrize("says", [lambda t: t > 0, lambda t: t == 3])
def test_a_behavior_that_is_missing_at_times_is_a_mistake(says):
    class Sometimes(gym.Wrapper):
        def reset(self, **arguments):
            self.t = 0
            observation, info = self.env.reset(**arguments)
            return observation, info | self._behavior()

        def step(self, action):
            self.t += 1
            *outcome, info = self.env.step(action)
            return *outcome, info | self._behavior()

        def _behavior(self):
            return {"behavior": np.zeros(2)} if says(self.t) else {}

    env = Sometimes(gym.make("MountainCarContinuous-v0"))
    worlds = make_worlds(open_env(env), 1, 1, is_copied=False)
    actions = walk(env, 5)
    start = Places(actions[:0]).start()
    worlds.restore([start])
    with pytest.raises(ValueError, match=r'`env` must give an info\["behavior"\] of as many'):
        worlds.behaviors(1), list(worlds.follow(start, actions))
