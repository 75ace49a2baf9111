"""Episodes that came to a reward: their sources, and their file."""

import types

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv
from walk import Right, Walk

from curiosity_algos import BonusVecEnvWrapper
from curiosity_algos.evaluation.found import N_FOUND
from curiosity_algos.robust.demonstrations import (
    demonstrate,
    demonstrations_of,
    follow,
    load_demonstrations,
    save_demonstrations,
)
from curiosity_gym import RecordEpisode


def walk_with_bonus(n_envs=2, n_steps=600):
    """Walk to the right at random, in a wrapper that sees it."""
    venv = BonusVecEnvWrapper(DummyVecEnv([Walk] * n_envs), bonus="rnd", seed=0, buffer_size=100)
    venv.seed(5)
    venv.reset()
    rng = np.random.default_rng(0)
    for _ in range(n_steps):
        venv.step(rng.uniform(-0.3, 1.0, (n_envs, 1)).astype(np.float32))
    return venv


def test_an_episode_is_followed_bit_for_bit(assert_same):
    shown = demonstrate(Right(0.7), Walk(), seed=3)
    again = follow(RecordEpisode(Walk()), shown.start, shown.actions)
    assert_same(vars(again), vars(shown))
    assert shown.success


def test_a_wrapper_keeps_the_best_episodes_that_succeed_wherever_they_began():
    found = walk_with_bonus().found.episodes
    assert len(found) == N_FOUND
    totals = [episode["total"] for episode in found]
    assert totals == sorted(totals, reverse=True)
    again = demonstrations_of(found, Walk())
    np.testing.assert_allclose([episode.total for episode in again], totals, rtol=1e-6)
    assert len({episode.observations[0, 0] for episode in again}) == N_FOUND  # starts are drawn


def test_what_was_found_is_saved_with_the_wrapper(tmp_path, assert_same):
    one = walk_with_bonus()
    one.save(tmp_path / "bonus.npz")
    twin = BonusVecEnvWrapper.load(tmp_path / "bonus.npz", DummyVecEnv([Walk] * 2))
    assert_same(twin.found.state_dict(), one.found.state_dict())


def test_nothing_is_kept_of_environments_that_are_not_recorded(monkeypatch):
    monkeypatch.setattr("curiosity_algos.sb3.bonus_wrapper.record_episodes", lambda venv: None)
    assert walk_with_bonus().found.episodes == []


def test_a_dataset_gives_its_best_seeded_episodes():
    shown = [demonstrate(Right(speed), Walk(), seed=3) for speed in (0.5, 0.9, 0.7)]
    episodes = [
        types.SimpleNamespace(actions=each.actions, rewards=np.array([each.total]))
        for each in shown
    ]
    dataset = types.SimpleNamespace(
        total_episodes=3,
        iterate_episodes=lambda ids: [episodes[i] for i in ids],
        storage=types.SimpleNamespace(
            get_episode_metadata=lambda ids: [{"seed": [3, 3, "None"][i]} for i in ids]
        ),
    )
    assert [each.total for each in demonstrations_of(dataset, Walk())] == [
        shown[1].total,
        shown[0].total,
    ]
    dataset.storage.get_episode_metadata = lambda ids: [{"seed": "None"} for _ in ids]
    with pytest.raises(ValueError, match="resets were seeded"):
        demonstrations_of(dataset, Walk())


def test_the_file_gives_them_back(tmp_path, assert_same):
    dicts = demonstrate(Right(), Walk(), seed=3)
    dicts = type(dicts)(
        {"state": 1}, dicts.actions, {"x": dicts.observations}, dicts.total, success=True
    )
    demonstrations = [demonstrate(Right(), Walk(), seed=3), dicts]
    save_demonstrations(tmp_path / "shown.npz", demonstrations)
    again = load_demonstrations(tmp_path / "shown.npz")
    assert_same([vars(each) for each in again], [vars(each) for each in demonstrations])


def test_mistakes_are_one_sentence():
    with pytest.raises(ValueError, match="`model` must be a population algorithm"):
        demonstrations_of(PPO("MlpPolicy", Walk(), device="cpu"), Walk())
    with pytest.raises(ValueError, match="`model` must have found an episode"):
        demonstrations_of([], Walk())
    with pytest.raises(ValueError, match="1 were played again, and none did"):
        demonstrations_of([{"start": 0, "actions": np.zeros((3, 1), np.float32)}], Walk())
