"""Episodes that came to a reward: their sources, and their file."""

import types

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv
from walk import Right, Walk

from curiosity_algos import NSLC, BonusVecEnvWrapper, CuriosityES
from curiosity_algos.evaluation.found import N_FOUND
from curiosity_algos.robust.demonstrations import (
    demonstrate,
    demonstrations_of,
    follow,
    load_demonstrations,
    save_demonstrations,
    successful,
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


def test_a_wrapper_keeps_the_best_episode_that_succeeds_and_others_wherever_they_began():
    found = walk_with_bonus().found.episodes
    assert N_FOUND < len(found) <= 2 * N_FOUND
    best, *others = (episode["total"] for episode in found)
    assert best == max(best, *others)
    assert others != sorted(others, reverse=True)
    again = demonstrations_of(found, Walk())
    assert again[0].total == pytest.approx(best, rel=1e-6)
    assert again[-1].total == pytest.approx(min(others), rel=1e-6)
    assert len({episode.observations[0, 0] for episode in again}) == N_FOUND  # starts are drawn


@pytest.mark.parametrize("algorithm", [CuriosityES, NSLC])
def test_a_population_shows_what_succeeded_from_other_starts(algorithm, tmp_path):
    settings = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}, "seed": 0}
    settings |= {"n_transitions": 5} if algorithm is CuriosityES else {"behavior": "state"}
    model = algorithm(Walk, **settings).learn(5_000)
    shown = demonstrations_of(model, Walk())
    starts = [each.start for each in shown]
    assert starts[0] == model.best_episode_seed
    assert len(set(starts)) == len(starts) > 3
    assert all(each.success for each in shown)
    model.save(tmp_path / "model")
    loaded = algorithm.load(tmp_path / "model", env=Walk)
    assert [each.start for each in demonstrations_of(loaded, Walk())] == starts


def test_observations_are_kept_where_an_environment_overwrites_its_own():
    class Overwriting(Walk):
        seen = np.zeros(2, np.float32)

        def _observation(self):
            self.seen[:] = super()._observation()
            return self.seen

    one, other = (demonstrate(Right(), env, 3).observations for env in (Overwriting(), Walk()))
    np.testing.assert_array_equal(one, other)


def test_of_one_start_the_best_episode_is_enough():
    shown = [
        {"start": 3, "actions": np.full((24, 1), each, np.float32)} for each in (0.7, 0.9, 0.8)
    ]
    (best,) = demonstrations_of(shown, Walk())
    assert best.actions[0] == np.float32(0.7)


def test_what_was_found_is_saved_with_the_wrapper(tmp_path, assert_same):
    one = walk_with_bonus()
    one.save(tmp_path / "bonus.npz")
    twin = BonusVecEnvWrapper.load(tmp_path / "bonus.npz", DummyVecEnv([Walk] * 2))
    assert_same(twin.found.state_dict(), one.found.state_dict())


def test_nothing_is_kept_of_environments_that_are_not_recorded(monkeypatch):
    monkeypatch.setattr("curiosity_algos.sb3.bonus_wrapper.record_episodes", lambda venv: None)
    assert walk_with_bonus().found.episodes == []


def dataset_of(shown, seeds):
    """As Minari gives one."""
    episodes = [
        types.SimpleNamespace(actions=each.actions, rewards=np.array([each.total]))
        for each in shown
    ]
    return types.SimpleNamespace(
        total_episodes=len(shown),
        iterate_episodes=lambda ids: [episodes[i] for i in ids],
        storage=types.SimpleNamespace(
            get_episode_metadata=lambda ids: [{"seed": seeds[i]} for i in ids]
        ),
    )


def test_a_dataset_gives_its_best_seeded_episode_and_others_down_to_the_last_that_succeeds():
    speeds = np.linspace(0.2, 1.0, 33)
    shown = [demonstrate(Right(speed), Walk(), seed=i) for i, speed in enumerate(speeds)]
    given = demonstrations_of(dataset_of(shown, range(33)), Walk())
    totals = sorted((each.total for each in shown if each.success), reverse=True)
    assert N_FOUND < len(totals) < 33
    assert (given[0].total, given[-1].total) == (totals[0], totals[-1])
    assert len(given) == N_FOUND


def test_a_dataset_gives_its_best_seeded_episode():
    shown = [demonstrate(Right(speed), Walk(), seed=3) for speed in (0.5, 0.9, 0.7)]
    dataset = dataset_of(shown, [3, 3, "None"])
    assert [each.total for each in demonstrations_of(dataset, Walk())] == [shown[1].total]
    dataset.storage.get_episode_metadata = lambda ids: [{"seed": "None"} for _ in ids]
    with pytest.raises(ValueError, match="resets were seeded"):
        demonstrations_of(dataset, Walk())


def test_the_file_gives_them_back(tmp_path, assert_same):
    dicts = demonstrate(Right(), Walk(), seed=3)
    dicts = type(dicts)(
        {"state": 1}, dicts.actions, {"x": dicts.observations}, dicts.total, success=True
    )
    demonstrations = [demonstrate(Right(), Walk(), seed=3), dicts]
    save_demonstrations(tmp_path / "shown.npz", demonstrations, {"seed": 3})
    again, run = load_demonstrations(tmp_path / "shown.npz")
    assert run == {"seed": 3}
    assert_same([vars(each) for each in again], [vars(each) for each in demonstrations])


def test_an_environment_may_change_what_it_takes_and_gives():
    class Halves(Walk):
        def step(self, action):
            action *= 0.5
            return super().step(action)

    shown = demonstrate(Right(0.9), Halves(), seed=3)
    assert (shown.actions == np.float32(0.9)).all()
    assert follow(RecordEpisode(Halves()), 3, shown.actions.copy()).total == shown.total


def test_mistakes_are_one_sentence():
    with pytest.raises(ValueError, match="a list of demonstrations or a Minari dataset, got list"):
        demonstrations_of([1, 2], Walk())
    with pytest.raises(ValueError, match="or else if its return is above 0"):
        successful([demonstrate(Right(0.1), Walk(), seed=3)])
    with pytest.raises(ValueError, match="`model` must be a population algorithm"):
        demonstrations_of(PPO("MlpPolicy", Walk(), device="cpu"), Walk())
    with pytest.raises(ValueError, match="`model` must have found an episode"):
        demonstrations_of([], Walk())
    with pytest.raises(ValueError, match="1 were played again, and none did"):
        demonstrations_of([{"start": 0, "actions": np.zeros((3, 1), np.float32)}], Walk())
