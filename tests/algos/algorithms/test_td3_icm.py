import pickle

import numpy as np
import pytest
import torch as th
from logs import read_log
from stable_baselines3.common.logger import configure

from curiosity_algos import ICM, TD3ICM
from curiosity_algos.algorithms import td3_icm


@pytest.fixture
def make(make_model):
    return lambda env, **changes: make_model(TD3ICM, env, **changes)


def test_defaults_are_the_papers():
    model = TD3ICM("CuriosityMaze-US-v0", device="cpu")
    widths = [layer.out_features for layer in model.actor.mu if isinstance(layer, th.nn.Linear)]
    assert widths == [32, 32, 2]
    assert model.critic.q_networks[0][0].out_features == 32
    assert (model.learning_rate, model.gamma, model.batch_size, model.tau) == (
        5e-5,
        0.99,
        128,
        5e-3,
    )
    assert (model.learning_starts, model.buffer_size, model.gradient_steps) == (10_000, 10**6, -1)
    assert (model.train_freq.frequency, model.train_freq.unit.value) == (1, "episode")
    assert (model.n_updates, model.weight) == (64, 0.5)
    assert model._bonus.optimizer.param_groups[0]["lr"] == 6e-6
    noise = np.array([model.action_noise() for _ in range(4000)])
    assert noise.std(axis=0) == pytest.approx([0.1, 0.1], rel=0.05)
    assert noise.mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.01)


class TestOptimizers:
    def test_adam_is_fused(self, make, make_maze):
        model = make(make_maze())
        for optimizer in (model.actor.optimizer, model.critic.optimizer):
            assert [group["fused"] for group in optimizer.param_groups] == [True]
        assert model.policy_kwargs == {"net_arch": [4]}

    def test_what_is_asked_for_stays(self, make, make_maze):
        given = {"optimizer_class": th.optim.RMSprop}
        assert type(make(make_maze(), policy_kwargs=given).actor.optimizer) is th.optim.RMSprop
        given = {"optimizer_kwargs": {"fused": False}}
        model = make(make_maze(), policy_kwargs=given)
        assert not model.critic.optimizer.param_groups[0]["fused"]

    def test_a_model_of_before_goes_on_as_it_was(self, make, make_maze, tmp_path):
        model = make(make_maze())
        for optimizer in (model.actor.optimizer, model.critic.optimizer):
            optimizer.param_groups[0]["fused"] = None
        model.learn(60).save(tmp_path / "model")
        loaded = TD3ICM.load(tmp_path / "model", env=make_maze())
        for optimizer in (loaded.actor.optimizer, loaded.critic.optimizer):
            assert optimizer.param_groups[0]["fused"] is None


class TestTraining:
    def test_is_after_each_episode_for_as_many_steps(self, make, make_maze):
        model = make(make_maze(), gradient_steps=-1, learning_starts=60)
        for n_steps, n_updates in [(50, 0), (100, 50), (150, 100)]:
            model.learn(1, reset_num_timesteps=False)
            assert (model.num_timesteps, model._n_updates) == (n_steps, n_updates)

    def test_the_bonus_has_its_own_number_of_updates(self, make, make_maze, monkeypatch):
        calls = []
        monkeypatch.setattr(
            td3_icm, "train", lambda bonus, draw, **kwargs: calls.append(kwargs) or {}
        )
        make(make_maze(), n_updates=5, batch_size=9).learn(100)
        assert calls == [{"n_updates": 5, "batch_size": 9}] * 2

    def test_an_unscaled_bonus_is_as_populations_have_it(self, make, make_maze):
        bonus = make(make_maze(), bonus="apt").trained_bonus
        assert (bonus.power, bonus.horizon) == (1.0, 100)

    def test_the_reward_is_the_bonus_of_now(self, make, make_easy_maze):
        model = make(make_easy_maze(), bonus_kwargs={"learning_rate": 0.1}).learn(64)
        rows = model.replay_buffer.newest(64)
        before = model._bonus.score(*rows).mean()
        model.learn(64, reset_num_timesteps=False)
        state = model.replay_buffer._rng.bit_generator.state
        rewards = model.replay_buffer.sample(20).rewards
        model.replay_buffer._rng.bit_generator.state = state
        transitions = [x.numpy() for x in model.replay_buffer.sample_transitions(20)]
        expected = 0.5 * model._bonus.score(*transitions)
        np.testing.assert_allclose(rewards[:, 0], expected, rtol=1e-5)
        assert abs(model._bonus.score(*rows).mean() - before) > 1e-3

    def test_inputs_are_standardized_by_what_was_seen_once(self, make, make_maze):
        model = make(make_maze()).learn(200)
        seen = model.replay_buffer.observations[: model.replay_buffer.size(), 0]
        assert model._bonus.normalizer.count == len(seen) == 200
        np.testing.assert_allclose(model._bonus.normalizer.mean, seen.mean(axis=0), atol=1e-5)

    def test_the_bonus_observes_where_the_task_ended_an_episode(self, make, make_easy_maze):
        model = make(make_easy_maze(), buffer_size=1000)
        observed, observe = [], model._bonus.observe
        model._bonus.observe = lambda states: observed.append(states.numpy()) or observe(states)
        model.learn(300)
        n = model.replay_buffer.size()
        before, _, after = model.replay_buffer.newest(n)
        has_ended = model.replay_buffer.dones[:n, 0] > model.replay_buffer.timeouts[:n, 0]
        assert 0 < has_ended.sum() < n
        expected = np.concatenate([before, after[has_ended]])
        np.testing.assert_array_equal(
            *(np.sort(each, axis=0) for each in (np.concatenate(observed), expected))
        )

    def test_a_bonus_of_ones_own_is_taken_as_it_is(self, make, make_maze):
        env = make_maze()
        bonus = ICM(env.observation_space, env.action_space, seed=0, device="cpu")
        model = make(env, bonus=bonus).learn(100)
        assert model._bonus is bonus
        assert bonus.normalizer.count == 100


def test_the_bonus_sees_actions_as_the_environment_takes_them(make, make_pendulum):
    asked, model = [], make(make_pendulum(2**10))
    score, update = model._bonus.score, model._bonus.update
    model._bonus.score = lambda *batch: asked.append(batch) or score(*batch)
    model._bonus.update = lambda *batch: asked.append(batch) or update(*batch)
    model.learn(200)
    largest = [np.abs(actions).max() for _, actions, _ in asked]
    for row, part in zip(model.replay_buffer.newest(200), asked[0], strict=True):
        np.testing.assert_array_equal(row, part)
    assert len(largest) == 1 + 2 + 1  # the rollout's, the module's, and all of the critic's at once
    assert all(100.0 < each <= 1024.0 for each in largest)
    assert model.replay_buffer.sample(100).actions.abs().max() <= 1.0


def test_curiosity_does_not_depend_on_the_unit_of_actions(make, make_pendulum, assert_same):
    models = [make(make_pendulum(unit)).learn(400) for unit in (1, 2**10)]
    assert_same(models[0].get_parameters(), models[1].get_parameters())


class TestSettings:
    def test_errors_name_the_argument(self, make, make_maze):
        wrong = {"weight": -1.0, "n_updates": 0, "tau": 1.1, "gamma": "abc", "policy_delay": 0}
        wrong |= {"target_policy_noise": -0.1, "batch_size": 0, "buffer_size": 0, "extrinsic": 1}
        wrong |= {"bonus": "novelty", "bonus_kwargs": {"depth": 3}, "learning_starts": "a"}
        wrong |= {"seed": -1, "verbose": "a", "device": "gpu", "policy_kwargs": [32]}
        for name, value in wrong.items():
            with pytest.raises(ValueError, match=f"`{name}` must be"):
                make(make_maze(), **{name: value})

    def test_the_papers_learning_rate_is_no_more_than_a_default(self, make, make_maze):
        model = make(make_maze(), bonus="rnd", bonus_kwargs={"learning_rate": 0.01})
        assert model._bonus.name == "rnd"
        assert model._bonus.optimizer.param_groups[0]["lr"] == 0.01
        assert model.bonus_kwargs == {"learning_rate": 0.01}

    def test_a_loaded_model_may_learn_otherwise(self, make, make_maze, tmp_path):
        make(make_maze()).learn(100).save(tmp_path / "model")
        loaded = TD3ICM.load(tmp_path / "model", bonus_kwargs={"learning_rate": 0.01})
        assert loaded._bonus.optimizer.param_groups[0]["lr"] == 0.01
        with pytest.raises(RuntimeError, match="`bonus` must be made as the one that was saved"):
            TD3ICM.load(tmp_path / "model", bonus="rnd")

    def test_curiosity_alone(self, make, make_easy_maze):
        model = make(make_easy_maze(), extrinsic=False, weight=1e-9)
        model.learn(64)
        model.replay_buffer.rewards[:] = 7.0
        assert model.replay_buffer.sample(9).rewards.abs().max() < 1e-6


def test_it_logs_as_every_algorithm(make, make_easy_maze, tmp_path):
    model = make(make_easy_maze())
    model.set_logger(configure(str(tmp_path), ["json"]))
    model.learn(300, log_interval=1)
    rows = read_log(tmp_path)
    names = ["coverage/reachable", "coverage/all", "intrinsic/mean", "intrinsic/max", "icm/loss"]
    names += [
        "coverage/visited",
        "icm/forward_loss",
        "icm/inverse_loss",
        "rollout/ep_rew_mean",
        "rollout/ep_len_mean",
    ]
    names += ["rollout/success_rate", "time/total_timesteps", "train/critic_loss"]
    assert set(names) <= set(rows[-1])
    assert rows[-1]["coverage/reachable"] == model.coverage > 0.0
    assert rows[-1]["intrinsic/max"] > rows[-1]["intrinsic/mean"] > 0.0


def test_a_log_holds_the_bonus_of_all_episodes_since_the_last(make, make_maze, monkeypatch):
    seen, model = [], make(make_maze(), learning_starts=1000)
    score = model._bonus.score
    monkeypatch.setattr(
        model._bonus, "score", lambda *batch: seen.append(score(*batch)) or seen[-1]
    )
    model.learn(200, log_interval=None)
    logged = model.logger.name_to_value
    assert len(seen) == 4
    assert logged["intrinsic/mean"] == pytest.approx(0.5 * np.mean(seen), rel=1e-5)
    assert logged["intrinsic/max"] == pytest.approx(0.5 * np.max(seen), rel=1e-5)


def test_it_finds_a_goal_that_is_near(make, make_easy_maze):
    model = make(make_easy_maze(), learning_starts=2000, gradient_steps=1).learn(2000)
    assert 0 < model.first_success_timesteps <= model.num_timesteps
    assert 0.0 < model.best_return < 1.0


def test_a_replay_buffer_that_trains_by_itself_is_refused(make, make_maze, tmp_path):
    model = make(make_maze()).learn(50)
    model.save_replay_buffer(tmp_path / "own")
    model.load_replay_buffer(tmp_path / "own")
    vars(model.replay_buffer)["train_interval"] = 10
    model.save_replay_buffer(tmp_path / "other")
    with pytest.raises(ValueError, match="`path` must be a replay buffer that TD3ICM has saved"):
        model.load_replay_buffer(tmp_path / "other")


def test_what_is_no_replay_buffer_of_the_env_leaves_the_model_as_it_was(
    make, make_maze, make_pendulum, tmp_path
):
    model, own = make(make_maze()), make(make_pendulum(1.0))
    before = model.replay_buffer
    own.save_replay_buffer(tmp_path / "pendulum")
    (tmp_path / "plain.pkl").write_bytes(pickle.dumps({"a": 1}))
    for name, sentence in {"pendulum": "it is of others", "plain": "that TD3ICM has saved"}.items():
        with pytest.raises(ValueError, match=f"`path` must be a replay buffer .*{sentence}"):
            model.load_replay_buffer(tmp_path / name)
        assert model.replay_buffer is before
