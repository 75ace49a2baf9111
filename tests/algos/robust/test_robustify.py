"""From found episodes to a policy that works from any start."""

import io
import re
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.logger import configure
from walk import Right, Walk

from curiosity_algos import CuriosityES
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.robust import robustify as module
from curiosity_algos.robust import watch
from curiosity_algos.robust.demonstrations import demonstrate, demonstrations_of
from curiosity_algos.robust.measure import evaluate_starts
from curiosity_algos.robust.robustify import robustify
from curiosity_gym import RecordEpisode


@pytest.fixture
def demonstration():
    return demonstrate(Right(), Walk(), seed=3)


@pytest.fixture
def often(monkeypatch):
    """Test whether the policy works after each rollout."""
    monkeypatch.setattr(watch, "TEST_INTERVAL", 8_192)


@pytest.fixture
def short(monkeypatch):
    """Imitate for a moment, and play in few environments."""
    monkeypatch.setattr(module, "N_STEPS", 20)
    monkeypatch.setattr(module, "N_ENVS", 4)


def test_a_policy_works_from_any_start_and_the_training_ends_by_itself(often, demonstration):
    model = robustify([demonstration], Walk, total_timesteps=2e5, seed=0, device="cpu")
    assert model.num_timesteps < 2e5
    assert evaluate_starts(model, Walk(), 50).share >= 0.95
    file = io.BytesIO()
    model.save(file)
    file.seek(0)
    observation = np.array([0.3, 2.0], np.float32)
    models = model, PPO.load(file, device="cpu")
    actions = [one.predict(observation, deterministic=True)[0] for one in models]
    np.testing.assert_array_equal(*actions)


@pytest.fixture
def with_torch_threads():
    """Calls a function while torch has so many threads."""
    before = th.get_num_threads()

    def call(n, function):
        th.set_num_threads(n)
        return function()

    yield call
    th.set_num_threads(before)


def test_one_demonstration_needs_no_list_and_those_that_failed_are_left_out(short, demonstration):
    failed = replace(demonstration, success=False)
    for given in (demonstration, [failed, demonstration]):
        model = robustify(given, Walk, total_timesteps=1, seed=0, device="cpu")
        assert model.get_env().demonstrations == [demonstration]


def test_the_bar_shows_the_front_and_no_time_that_is_left(short, demonstration, capsys):
    robustify([demonstration], Walk, total_timesteps=2_000, device="cpu", progress_bar=True)
    shown = capsys.readouterr().err
    assert re.search(r"2\.00k of 2\.00k steps at most \[.*, front=\d+%, near=\d+%", shown)


def test_threads_of_torch_change_no_bit(short, demonstration, with_torch_threads):
    def train():
        kwargs = {"total_timesteps": 1, "seed": 0, "device": "cpu"}
        return robustify([demonstration], Walk, **kwargs).policy.state_dict()

    one, two = (with_torch_threads(n, train) for n in (1, 2))
    assert all((one[name] == two[name]).all() for name in one)


def test_threads_of_torch_begin_no_run_otherwise(with_torch_threads):
    settings = {"policy_kwargs": {"net_arch": [128, 128]}}
    spec = RunSpec("ppo", "CartPole-v1", 0, timesteps=1, settings=settings)
    one, two = (with_torch_threads(n, spec.make).policy.state_dict() for n in (1, 2))
    assert all((one[name] == two[name]).all() for name in one)


def test_seeds_decide(short, demonstration):
    def train(seed):
        kwargs = {"total_timesteps": 1, "device": "cpu"}
        return robustify([demonstration], Walk, seed=seed, **kwargs).policy.state_dict()

    one, twin, other = train(0), train(0), train(1)
    assert all((one[name] == twin[name]).all() for name in one)
    assert any((one[name] != other[name]).any() for name in one)


def test_environments_are_closed_where_the_training_fails(short, demonstration, monkeypatch):
    closed = []
    monkeypatch.setattr(Walk, "close", lambda self: closed.append(self))
    for each in (demonstration, replace(demonstration, total=5.0)):
        closed.clear()
        with pytest.raises((ZeroDivisionError, ValueError)):
            robustify([each], Walk, total_timesteps=1, callback=lambda *_: 1 // 0)
        assert len({*map(id, closed)}) >= 4


def test_returns_are_of_fresh_episodes_alone_and_the_learner_sees_them_scaled(short, demonstration):
    seen = []

    def see(values, _):
        seen.extend(zip(values["rewards"], values["infos"], strict=True))
        return True

    robustify([demonstration], Walk, total_timesteps=2e4, seed=0, device="cpu", callback=see)
    ended = [(reward, info) for reward, info in seen if "is_fresh" in info]
    for _, info in ended:
        assert info["is_fresh"] == ("episode" in info) == ("is_success" in info)
    fresh = [
        (reward, info["episode"]["r"], info["is_success"])
        for reward, info in ended
        if info["is_fresh"]
    ]
    assert 0 < len(fresh) < len(ended)
    last, returns, success = np.array(fresh).T
    assert success.any()
    worth = np.where(success, np.maximum(returns, demonstration.total), 0.0)
    np.testing.assert_allclose(last, module.RETURN / demonstration.total * worth, rtol=1e-4)


def test_what_is_ahead_of_the_fronts_is_imitated_further(short, demonstration, monkeypatch):
    training = module.Training(Walk, [demonstration] * 2, success=0.95, seed=0, device="cpu")
    training.starts.rates[0, 4:] = 0.9
    training.starts.rates[1, 1:] = 0.9
    imitated = []
    monkeypatch.setattr(watch, "imitate", lambda model, ahead, **_: imitated.extend(ahead))
    training.learn(1)
    training.env.close()
    (ahead,) = imitated
    assert len(ahead) == 3
    np.testing.assert_array_equal(ahead.observations, demonstration.observations[:3])


@pytest.mark.parametrize(("total", "scale"), [(0.5, 12.0), (-60.0, 0.1), (1e-9, 100.0), (0.0, 1.0)])
def test_the_learner_sees_demonstrations_of_returns_of_the_size_of_six(demonstration, total, scale):
    assert module._scale([replace(demonstration, total=total)]) == pytest.approx(scale)


@pytest.mark.parametrize(("steps", "horizon"), [(3, 100), (300, 400), (9_000, 2_000)])
def test_the_discount_sees_a_third_beyond_a_demonstration(demonstration, steps, horizon):
    long = replace(demonstration, actions=np.zeros((steps, 1)))
    assert 1.0 / (1.0 - watch.gamma_of([long])) == pytest.approx(horizon)


def test_steps_and_draws_shrink_together_and_draws_are_free_before(short, demonstration):
    training = module.Training(Walk, [demonstration], success=0.95, seed=0, device="cpu")
    training.starts.good_steps = watch.SHRINKING
    training.learn(1)
    assert training.model.lr_schedule(1.0) == pytest.approx(watch.SETTINGS["learning_rate"] / np.e)
    assert 0.05 < training.model.clip_range(1.0) < 0.2
    horizon = np.e / (1.0 - watch.gamma_of([demonstration]))
    for discounting in (training.model, training.model.rollout_buffer):
        assert 1.0 / (1.0 - discounting.gamma) == pytest.approx(horizon)
    log_std = training.model.policy.log_std
    assert log_std.item() == pytest.approx(watch.LOG_STD - 1.0, abs=0.05)
    for good_steps, wide, expected in [(0, 0.5, 0.5), (10**9, 0.5, watch.SMALLEST_LOG_STD)]:
        training.starts.good_steps = good_steps
        log_std.data.fill_(wide)
        training.learn(training.model.num_timesteps + 1)
        assert log_std.item() == pytest.approx(expected, abs=0.1)
    training.env.close()


@pytest.fixture
def at_a_rollout(short, demonstration):
    """Calls a training's watch at the start of a rollout, with a rate of fresh episodes."""
    training = module.Training(Walk, [demonstration], success=0.95, seed=0, device="cpu")

    def call(fresh_rate, success=0.95, n=100):
        training.starts.rates[:, 0] = fresh_rate
        observer = watch.Watch(training.starts, RecordEpisode(Walk()), success=success, seed=5)
        observer.n = n
        observer.init_callback(training.model)
        training.model.num_timesteps += 1_024
        training.model._logger = configure(None, [])
        observer._on_rollout_start()
        return observer._is_over

    yield call, training.starts
    training.env.close()


@pytest.mark.parametrize(
    ("shares", "works"), [([0.9], False), ([1.0, 0.9], False), ([1.0] * 2, True)]
)
def test_a_policy_works_if_it_passes_twice(at_a_rollout, monkeypatch, shares, works):
    call, starts = at_a_rollout
    starts.good_steps = watch.TEST_INTERVAL - 1_024
    seeds, given = [], iter(shares)

    def test(self, seed):
        seeds.append(seed)
        return next(given)

    monkeypatch.setattr(watch.Watch, "_test", test)
    assert call(1.0) == works
    assert len({*seeds}) == len(shares)


@pytest.fixture
def tested(monkeypatch):
    """The first seeds of the tests, which fail."""
    seeds = []
    monkeypatch.setattr(watch.Watch, "_test", lambda self, seed: seeds.append(seed) or 0.0)
    return seeds


def test_a_policy_is_tested_once_at_each_mark_of_good_steps(at_a_rollout, tested):
    call, starts = at_a_rollout
    starts.good_steps = 3 * watch.TEST_INTERVAL - 2 * 1_024
    for fresh_rate, n_tests in [(0.9, 0), (0.1, 0), (0.9, 1), (0.1, 1), (0.46, 1), (0.9, 1)]:
        call(fresh_rate)
        assert len(tested) == n_tests
    starts.good_steps = 4 * watch.TEST_INTERVAL - 1_024
    call(0.9)
    assert abs(tested[1] - tested[0]) >= 200


def test_where_all_begins_alike_it_is_tested_once_a_drawn_episode_succeeded(
    at_a_rollout, tested, monkeypatch
):
    monkeypatch.setattr(watch, "imitate", lambda *_, **__: None)  # takes most of the time
    call, _ = at_a_rollout
    for fresh_rate, n_tests in [(0.0, 0), (0.01, 2)]:
        for _ in range(2 * watch.SHORT_INTERVAL // 1_024):
            call(fresh_rate, n=1)
        assert len(tested) == n_tests


@pytest.mark.parametrize(
    ("success", "rate", "is_good"),
    [(0.95, 0.44, False), (0.95, 0.46, True), (0.3, 0.34, False), (0.3, 0.36, True)],
)
def test_steps_are_good_if_fresh_episodes_nearly_succeed(at_a_rollout, success, rate, is_good):
    call, starts = at_a_rollout
    call(rate, success)
    assert starts.good_steps == 1_024 * is_good


def test_a_search_demonstrates_by_its_best_policy_and_by_elites(make_easy_maze):
    model = CuriosityES(make_easy_maze(), population_size=6, seed=0).learn(3_000)
    (best, *others) = demonstrations_of(model, make_easy_maze())
    assert best.total == pytest.approx(model.best_return)
    assert best.success
    assert not others


def test_mistakes_are_one_sentence(make_easy_maze, demonstration):
    model = CuriosityES(gym.make("CuriosityMaze-Hard-v0"), population_size=4, seed=0).learn(1)
    with pytest.raises(ValueError, match="`model` must have found an episode that succeeds"):
        robustify(model)
    for env in (None, Walk()):
        with pytest.raises(ValueError, match="`env` must be an id"):
            robustify([demonstration], env)
    with pytest.raises(ValueError, match="`success`"):
        robustify([demonstration], Walk, success=1.5)
    with pytest.raises(ValueError, match="`callback` must be one of SB3's"):
        robustify([demonstration], Walk, callback="abc")
    with pytest.raises(ValueError, match="`model` must have found an episode that succeeds"):
        robustify([replace(demonstration, success=False)], Walk)
    with pytest.raises(ValueError, match="`env` must have the observation_space of the model"):
        robustify(model, "MountainCarContinuous-v0")

    class Plain(gym.Wrapper):
        pass

    ppo = PPO("MlpPolicy", make_vec_env("CartPole-v1", wrapper_class=Plain), device="cpu")
    with pytest.raises(ValueError, match=r"`env` must be a function .* cannot make a Plain again"):
        robustify(ppo)
