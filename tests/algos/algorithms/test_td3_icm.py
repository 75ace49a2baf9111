import gymnasium as gym
import numpy as np
import pytest
import torch as th
from logs import read_log
from stable_baselines3 import TD3
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import DummyVecEnv

from curiosity_algos import TD3ICM, BonusReplayBuffer

HARD = "CuriosityMaze-Hard-v0"


@pytest.fixture
def make(make_model):
    return lambda env, **changes: make_model(TD3ICM, env, **changes)


def test_defaults_are_the_papers():
    model = TD3ICM("CuriosityMaze-US-v0", device="cpu")
    widths = [layer.out_features for layer in model.actor.mu if isinstance(layer, th.nn.Linear)]
    assert widths == [32, 32, 2]
    assert model.critic.q_networks[0][0].out_features == 32
    assert (model.learning_rate, model.gamma, model.batch_size) == (5e-5, 0.99, 128)
    assert model.tau == 5e-3
    assert (model.learning_starts, model.buffer_size, model.gradient_steps) == (10_000, 10**6, -1)
    assert (model.train_freq.frequency, model.train_freq.unit.value) == (1, "episode")
    buffer = model.replay_buffer
    assert (buffer.n_updates, buffer.batch_size, buffer.weight) == (64, 128, 0.5)
    assert buffer.gamma is None
    assert buffer.bonus.optimizer.param_groups[0]["lr"] == 6e-6
    noise = np.array([model.action_noise() for _ in range(4000)])
    assert noise.std(axis=0) == pytest.approx([0.1, 0.1], rel=0.05)


def test_settings_are_as_in_stable_baselines3_but_for_the_papers(make, make_maze):
    given = {"optimizer_class": th.optim.RMSprop}
    assert type(make(make_maze(), policy_kwargs=given).actor.optimizer) is th.optim.RMSprop
    model = make(make_maze(), policy_kwargs={"optimizer_kwargs": {"fused": False}})
    assert not model.critic.optimizer.param_groups[0]["fused"]
    assert model.policy_kwargs["net_arch"] == [32, 32]
    assert make(make_maze()).critic.optimizer.param_groups[0]["fused"]


class TestTraining:
    def test_is_after_each_episode_for_as_many_steps(self, make, make_maze):
        model = make(make_maze(), gradient_steps=-1, learning_starts=60)
        for n_steps, n_updates in [(50, 0), (100, 50), (150, 100)]:
            model.learn(1, reset_num_timesteps=False)
            assert (model.num_timesteps, model._n_updates) == (n_steps, n_updates)

    def test_the_bonus_observes_all_and_has_its_own_number_of_updates(self, make, make_maze):
        model = make(make_maze(), n_updates=5, learning_starts=60)
        bonus, batches = model.replay_buffer.bonus, []
        update = bonus.update
        bonus.update = lambda *batch: batches.append(len(batch[0])) or update(*batch)
        model.learn(150)
        assert batches == [8] * 5 * 2
        assert bonus.normalizer.count == 150

    def test_threads_change_no_bit(self, make, make_easy_maze, assert_same):
        parameters = []
        for n_threads in (1, 2):
            th.set_num_threads(n_threads)
            model = make(make_easy_maze(), policy_kwargs={"net_arch": [400, 300]})
            parameters.append(model.learn(64).get_parameters())
        assert_same(*parameters)


def test_it_finds_a_goal_that_is_near(make, make_easy_maze):
    model = make(make_easy_maze(), learning_starts=2000, gradient_steps=1).learn(2000)
    assert 0 < model.first_success_timesteps <= model.num_timesteps
    assert 0.0 < model.best_return < 1.0
    assert 0.0 < model.coverage < 1.0


def test_it_logs_the_bonus_and_what_it_finds(make, make_easy_maze, tmp_path):
    model = make(make_easy_maze())
    model.set_logger(configure(str(tmp_path), ["json"]))
    model.learn(300, log_interval=1)
    rows = read_log(tmp_path)
    names = {"coverage/reachable", "coverage/all", "coverage/visited", "rollout/success_rate"}
    names |= {"icm/loss", "icm/forward_loss", "icm/inverse_loss", "train/critic_loss"}
    assert names <= set(rows[-1])
    assert rows[-1]["coverage/reachable"] == model.coverage > 0.0
    assert rows[-1]["intrinsic/max"] > rows[-1]["intrinsic/mean"] > 0.0


class TestEnvironments:
    @pytest.mark.parametrize("kind", ["id", "function", "VecEnv"])
    def test_may_be(self, make, make_maze, kind):
        env = {"id": HARD, "function": make_maze, "VecEnv": DummyVecEnv([make_maze])}[kind]
        model = make(env).learn(1)
        assert model.num_timesteps == (2000 if kind == "id" else 50)

    @pytest.mark.parametrize("env", [None, 3, gym.spaces.Discrete(2)])
    def test_what_is_none(self, env):
        with pytest.raises(ValueError, match="`env` must be an environment id"):
            TD3ICM(env)


def test_another_keyword_is_refused(make, make_maze):
    with pytest.raises(TypeError, match="unexpected keyword argument 'n_steps'"):
        make(make_maze(), n_steps=3)


def test_the_papers_learning_rate_is_no_more_than_a_default(make, make_maze):
    for bonus in ("icm", "rnd"):
        model = make(make_maze(), bonus=bonus, bonus_kwargs={"learning_rate": 0.01})
        assert model.replay_buffer.bonus.name == bonus
        assert model.replay_buffer.bonus.optimizer.param_groups[0]["lr"] == 0.01


class TestFiles:
    def test_they_are_those_of_stable_baselines3(self, make, make_maze, tmp_path, assert_same):
        model = make(make_maze(), weight=3.0).learn(100)
        model.save(tmp_path / "model")
        model.save_replay_buffer(tmp_path / "buffer")
        loaded = TD3ICM.load(tmp_path / "model", env=HARD)
        assert_same(loaded.get_parameters(), model.get_parameters())
        assert isinstance(loaded.replay_buffer, BonusReplayBuffer)
        assert loaded.replay_buffer.weight == 3.0
        loaded.load_replay_buffer(tmp_path / "buffer")
        before = model.replay_buffer.bonus.state_dict()
        assert_same(loaded.replay_buffer.bonus.state_dict(), before)
        assert loaded.learn(1, reset_num_timesteps=False).num_timesteps == 2100
        assert TD3.load(tmp_path / "model").num_timesteps == 100

    def test_what_the_buffer_keeps_is_set_there(self, tmp_path):
        model = TD3ICM(HARD, buffer_size=10)
        model.save(tmp_path / "model")
        ways_on = dict.fromkeys(("bonus", "bonus_kwargs"), "make a new model")
        for name in ("weight", "extrinsic", "n_updates"):
            ways_on[name] = f"set `model.replay_buffer.{name}`"
        for name, way_on in ways_on.items():
            with pytest.raises(ValueError, match=f"^`{name}` must stay .*: {way_on}.$"):
                TD3ICM.load(tmp_path / "model", **{name: 1})
            with pytest.raises(ValueError, match=f"^`{name}` must stay .*: {way_on}.$"):
                setattr(model, name, 1)

    def test_a_preset_stays(self, tmp_path):
        assert TD3ICM(HARD, buffer_size=10).preset is None
        TD3ICM.from_preset("paper", HARD, buffer_size=10).save(tmp_path / "model")
        assert TD3ICM.load(tmp_path / "model").preset == "paper"
