"""GoExplore: states that are taken up, and episodes that are found by them."""

import copy

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3.common.evaluation import evaluate_policy

from curiosity_algos import GoExplore, evaluate_starts
from curiosity_algos.robust.demonstrations import demonstrations_of
from curiosity_gym import RecordEpisode

SMALL = {"population_size": 8, "n_steps": 20, "archive_size": 60, "seed": 0, "device": "cpu"}
HARD, CAR = "CuriosityMaze-Hard-v0", "MountainCarContinuous-v0"
ENVS = {
    "maze": (HARD, {}),
    "cells": (HARD, {"behavior": "cells"}),
    "held": (HARD, {"explorer": "held"}),
    "replayed": (CAR, {}),
    "copied": (CAR, {"is_copied": True}),
    "discrete": ("CartPole-v1", {}),
    "random starts": (lambda: gym.make(HARD, start_radius=5), {}),
}
ROBOTS = {
    "robot": ("CuriosityLocomotion-AntTrap-v0", {}),
    "gymnasium's robot": ("Ant-v5", {}),
    "control": ("CuriosityControl-BallInCup-v0", {}),
}


def run(name, n=4, **changes):
    env, kwargs = (ENVS | ROBOTS)[name]
    return GoExplore(env, **(SMALL | kwargs | changes)).learn(n * 8 * 20)


def test_a_copy_is_saved_as_it_is(tmp_path, assert_same):
    model = run("maze")
    copy.deepcopy(model).save(tmp_path / "copy")
    loaded = GoExplore.load(tmp_path / "copy", env=HARD)
    wholes = [
        [each.trail.whole for each in one._places._places.values()] for one in (model, loaded)
    ]
    assert_same(*wholes)


def outcome(model):
    """The states, the episodes and the counts."""
    parts = [model.archive.data(), model._places.state_dict(), *model.episodes]
    return [model.num_timesteps, *(value for part in parts for value in part.values())]


def assert_same_search(one, other):
    for mine, theirs in zip(outcome(one), outcome(other), strict=True):
        np.testing.assert_array_equal(mine, theirs)


class Walk(gym.Env):
    """A walk on a line to a place on the right, which only `is_success` names."""

    observation_space = spaces.Box(-20.0, 20.0, (1,))
    action_space = spaces.Discrete(2)

    def __init__(self, noise=False):
        self.noise = noise

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = 0
        return self._observation(), {}

    def step(self, action):
        self.place += 1 if action else -1
        arrived = self.place >= 12
        return self._observation(), float(arrived), arrived, False, {"is_success": arrived}

    def _observation(self):
        noise = np.random.default_rng().normal() if self.noise else 0.0
        return np.array([np.clip(self.place + noise, -20.0, 20.0)], dtype=np.float32)


@pytest.mark.parametrize(
    "name",
    [
        *ENVS,
        *(pytest.param(name, marks=pytest.mark.extra("control", "locomotion")) for name in ROBOTS),
    ],
)
def test_a_search_is_the_same_by_threads_and_after_a_file(name, tmp_path):
    n, timesteps = (4, 800) if name in ENVS else (2, 300)
    one, other = run(name, n, n_threads=1), run(name, n, n_threads=3)
    assert_same_search(one, other)
    other.save(tmp_path / "model")
    loaded = GoExplore.load(tmp_path / "model", env=(ENVS | ROBOTS)[name][0])
    for model in (one, loaded):
        model.learn(timesteps, reset_num_timesteps=False)
    assert_same_search(one, loaded)
    assert one.replayed_steps == loaded.replayed_steps
    assert (one.replayed_steps > 0) == (name in ("replayed", "discrete"))


@pytest.mark.parametrize("behavior", ["learned", "cells"])
def test_it_finds_the_goal_and_its_episodes_are_played_again(behavior, make_easy_maze):
    model = GoExplore(make_easy_maze(), **SMALL | {"behavior": behavior}).learn(4_000)
    assert model.first_success_timesteps <= model.num_timesteps
    best = model.episodes[0]
    assert best["total"] == model.best_return > 0.0
    totals = [episode["total"] for episode in model.episodes]
    assert totals == sorted(totals, reverse=True)
    env = RecordEpisode(make_easy_maze())
    for episode in model.episodes:
        assert env.replay(episode["start"], episode["actions"])[1] == episode["total"]
    assert [d.total for d in demonstrations_of(model, make_easy_maze())] == totals[:1]


def test_the_policy_takes_the_actions_of_the_best_episode(make_easy_maze):
    model = GoExplore(make_easy_maze(), **SMALL).learn(4_000)
    mean, _ = evaluate_policy(model, model.get_env(), n_eval_episodes=2)
    assert mean == pytest.approx(model.best_return)
    assert evaluate_starts(model, make_easy_maze(), n=1).share == 1.0
    observation = model.observation_space.sample()
    action, state = model.predict(observation)
    np.testing.assert_array_equal(action, model.episodes[0]["actions"][0])
    action, state = model.predict(observation, state)
    np.testing.assert_array_equal(action, model.episodes[0]["actions"][1])
    actions, _ = model.predict(np.stack([observation] * 3), (np.array([0, 1, 10_000]),))
    np.testing.assert_array_equal(actions, model.episodes[0]["actions"][[0, 1, -1]])


def test_explorations_count_and_ways_do_not():
    model = run("replayed")
    assert model.num_timesteps == 4 * 8 * 20
    assert model.archive.data("objective").min() <= -40  # states lie beyond one exploration


def test_states_are_reached_by_their_actions():
    model = run("maze", n=6)
    env = RecordEpisode(gym.make(HARD))
    observed = model.archive.data("observation")
    for number, expected in zip(model.archive.data("place"), observed, strict=True):
        place = model._places[number]
        np.testing.assert_array_equal(env.replay(0, place.actions)[0], expected)
        assert place.length == len(place.actions)


def test_of_cells_the_sooner_reached_is_kept():
    model = run("cells", n=8)
    elites = model.archive.data()
    assert len(set(elites["index"])) == len(elites["index"])
    lengths = [model._places[number].length for number in elites["place"]]
    np.testing.assert_array_equal(elites["objective"], np.negative(lengths))


def test_what_was_chosen_less_is_chosen_more():
    model = run("maze", n=20)
    chosen = np.array([model._places[n].times_chosen for n in model.archive.data("place")])
    model._places[int(model.archive.data("place")[0])].times_chosen = 10**6
    drawn = np.concatenate([(model._ask(), model._chosen)[1] for _ in range(100)])
    assert chosen.max() < 20
    assert (drawn == 0).sum() <= 2
    assert len(set(drawn)) > len(chosen) / 2


def test_an_environment_that_draws_from_elsewhere_is_refused():
    for kwargs in ({}, {"is_copied": True}):
        model = GoExplore(lambda: gym.wrappers.TimeLimit(Walk(noise=True), 60), **SMALL, **kwargs)
        with pytest.raises(ValueError, match=r"`env` must come to the same .*differed at step 1\."):
            model.learn(100)
        assert model.num_timesteps == 0


def test_an_environment_that_changes_is_refused():
    env = Walk()
    model = GoExplore(gym.wrappers.TimeLimit(env, 60), **SMALL).learn(300)
    n = model.num_timesteps
    env.noise = True
    with pytest.raises(ValueError, match="`env` must come to the same"):
        model.learn(300, reset_num_timesteps=False)
    assert model.num_timesteps == n


def test_mistakes_are_one_sentence():
    for changes, message in [
        ({"behavior": "position"}, "`behavior` must be one of learned, cells"),
        ({"explorer": "ppo"}, "`explorer` must be one of auto, held, linear"),
        ({"policy_kwargs": {"net_arch": [4]}}, "`policy_kwargs` must be None"),
        ({"evaluator": "ray"}, '`evaluator` must be "auto"'),
        ({"n_steps": 0}, "`n_steps`"),
    ]:
        with pytest.raises(ValueError, match=message):
            GoExplore(HARD, **changes)
    with pytest.raises(ValueError, match='`behavior` "cells" needs an env with a bounded'):
        GoExplore(CAR, behavior="cells")
    with pytest.raises(ValueError, match="`env` must be an environment whose episodes can be"):
        GoExplore(gym.make_vec("CartPole-v1", 2, vectorization_mode="async"))


class Coin(Walk):
    """A walk that is paid on the way, and goes on; infos say nothing."""

    def step(self, action):
        observation, *_ = super().step(action)
        return observation, float(self.place == 3), False, False, {}


class Stay(Walk):
    """A walk that goes on at its goal."""

    def step(self, action):
        observation, reward, _, _, info = super().step(action)
        return observation, reward, False, False, info


class LateInfo(Walk):
    """A walk that says `is_success` at its end alone, and is paid for steps to the right."""

    def step(self, action):
        observation, _, arrived, _, info = super().step(action)
        return observation, 0.1 * self.place, arrived, False, info if arrived else {}


def make_short(env):
    return gym.wrappers.TimeLimit(env, 60)


@pytest.mark.parametrize("env", [Coin, Stay])
def test_an_exploration_finds_a_reward_once(env):
    model = GoExplore(lambda: make_short(env()), **SMALL | {"n_steps": 60})  # to its end
    counts = []
    model.learn(4_000, callback=lambda *_: counts.append(len(model._explored.found)) or True)
    assert model.episodes
    assert max(counts) <= model.population_size
    lengths = {len(episode["actions"]) for episode in model.episodes}
    assert lengths == {60} if env is Coin else 12 in lengths


def test_what_an_info_does_not_say_is_not_found_on_the_way():
    model = GoExplore(lambda: make_short(LateInfo()), **SMALL).learn(3_000)
    assert all(len(episode["actions"]) >= 12 for episode in model.episodes)


def test_of_equal_returns_the_shortest_is_the_best_and_no_behavior_is_needed():
    model = GoExplore(lambda: make_short(Walk()), **SMALL).learn(6_000)
    lengths = [len(episode["actions"]) for episode in model.episodes]
    assert lengths == sorted(lengths)
    assert lengths[0] == 12
    assert model.first_success_timesteps is not None
    assert model.coverage is None


def test_a_population_may_grow(tmp_path):
    one = run("maze", population_size=4, n_steps=60)
    one.population_size = 8
    one.learn(960, reset_num_timesteps=False)
    one.save(tmp_path / "model")
    other = GoExplore.load(tmp_path / "model", env=HARD)
    for model in (one, other):
        model.learn(1_900, reset_num_timesteps=False)
    assert_same_search(one, other)


def test_long_chains_are_copied_and_seeded_anew():
    model = GoExplore(make_short(Walk()), **SMALL).learn(300)
    place = model._places[int(model.archive.data("place")[0])]
    for _ in range(3_000):
        place.trail = place.trail.then(np.array([1]))
    model.set_random_seed(3)
    again = copy.deepcopy(model._places)
    number = int(model.archive.data("place")[0])
    np.testing.assert_array_equal(again[number].actions, place.actions)


def test_another_environment_begins_anew_whether_or_not_its_cells_are_the_same():
    model = GoExplore(make_short(Walk()), **SMALL).learn(3_000)
    assert model.episodes
    model.set_env(make_short(Walk()))
    assert model.best_return == -np.inf
    assert model.best_episode_seed is None
    assert not len(model.policy.actions)
    assert model.archive.empty
    assert not model.episodes
    assert len(model.learn(320).archive) > 1


class Broken(Walk):
    """A walk whose observations are no numbers."""

    def _observation(self):
        return np.full(1, np.nan, dtype=np.float32)


def test_what_cannot_be_played_is_one_sentence():
    with pytest.raises(ValueError, match="`env` must give finite observations"):
        GoExplore(make_short(Broken()), **SMALL).learn(100)
    env = Walk()
    env.more = (step for step in range(3))
    with pytest.raises(ValueError, match="`is_copied` must be False for `env`, which cannot be"):
        GoExplore(make_short(env), is_copied=True, **SMALL).learn(100)
