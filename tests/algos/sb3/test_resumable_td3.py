"""TD3's part of the contract: SB3's promises, exact resume, errors before anything changes."""

import copy
import signal

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from gymnasium.envs.classic_control import PendulumEnv
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from gymnasium.wrappers.vector import TransformReward
from logs import read_log
from stable_baselines3 import TD3
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback, CheckpointCallback, ConvertCallback
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.logger import configure
from stable_baselines3.common.noise import NormalActionNoise, OrnsteinUhlenbeckActionNoise
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecNormalize

from curiosity_algos import TD3ICM
from curiosity_algos.algorithms import td3_icm
from curiosity_algos.evaluation import vector
from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer


class Save(BaseCallback):
    """Saves once, after step `moment` or at the end of the rollout that it is in."""

    def __init__(self, moment, path, at_rollout_end=False):
        super().__init__()
        self.moment, self.path, self.at_rollout_end = moment, path, at_rollout_end
        self.is_done = False

    def _save(self):
        if not self.is_done and self.num_timesteps >= self.moment:
            self.model.save(self.path)
            self.is_done = True

    def _on_step(self):
        if not self.at_rollout_end:
            self._save()
        return True

    def _on_rollout_end(self):
        if self.at_rollout_end:
            self._save()


class Interrupt(BaseCallback):
    """Presses Ctrl-C in a step."""

    def __init__(self, moment):
        super().__init__()
        self.moment = moment

    def _on_step(self):
        if self.num_timesteps == self.moment:
            signal.raise_signal(signal.SIGINT)
        return True


@pytest.fixture
def make(make_model):
    return lambda env, **changes: make_model(TD3ICM, env, **changes)


class TestResume:
    """Episodes have 64 steps, training begins after the first."""

    # In mid-episode before and after training began, at an episode's last and first step.
    @pytest.mark.parametrize(
        ("moment", "at_rollout_end"),
        [
            (10, False),
            (64, False),
            (65, False),
            (100, False),
            (128, False),
            (64, True),
            (128, True),
        ],
    )
    def test_a_checkpoint_of_any_moment_goes_on(
        self, make, make_easy_maze, tmp_path, assert_same_run, moment, at_rollout_end
    ):
        whole = make(make_easy_maze())
        whole.learn(320, callback=Save(moment, tmp_path / "model", at_rollout_end))
        resumed = TD3ICM.load(tmp_path / "model", env=make_easy_maze())
        assert resumed.num_timesteps >= moment
        resumed.learn(320 - resumed.num_timesteps, reset_num_timesteps=False)
        assert_same_run(whole, resumed)

    @pytest.mark.parametrize(
        "changes",
        [
            {"train_freq": (7, "step"), "gradient_steps": 2},
            {"train_freq": (2, "episode")},
            {"bonus": "rnd", "extrinsic": False},
            {"buffer_size": 50},
            {"action_noise": NormalActionNoise(np.zeros(2), np.ones(2))},
            {"action_noise": OrnsteinUhlenbeckActionNoise(np.zeros(2), np.ones(2))},
            {"learning_starts": 1000},
            {"gradient_steps": 0},
            {"policy_delay": 3, "gamma": 0.9, "tau": 0.1},
        ],
        ids=lambda changes: ",".join(map(str, changes)),
    )
    def test_whatever_the_settings(self, make, make_easy_maze, tmp_path, assert_same_run, changes):
        whole = make(make_easy_maze(), **changes)
        whole.learn(300, callback=Save(150, tmp_path / "model"))
        resumed = TD3ICM.load(tmp_path / "model", env=make_easy_maze())
        resumed.learn(300 - 150, reset_num_timesteps=False)
        assert_same_run(whole, resumed)

    @pytest.mark.extra("control")
    @pytest.mark.parametrize("random_start", [False, True])
    def test_control_tasks_go_on(self, random_start, make, tmp_path, assert_same_run):
        def make_env():
            keywords = {"horizon": 50, "random_start": random_start}
            return gym.make("CuriosityControl-BallInCup-v0", **keywords)

        whole = make(make_env())
        whole.learn(150, callback=Save(70, tmp_path / "model"))
        resumed = TD3ICM.load(tmp_path / "model", env=make_env())
        resumed.learn(80, reset_num_timesteps=False)
        assert_same_run(whole, resumed)

    def test_the_env_may_be_set_later(self, make, make_easy_maze, tmp_path, assert_same_run):
        whole = make(make_easy_maze())
        whole.learn(300, callback=Save(150, tmp_path / "model"))
        resumed = TD3ICM.load(tmp_path / "model")
        resumed.save(tmp_path / "again")
        again = TD3ICM.load(tmp_path / "again")
        again.set_env(make_easy_maze())
        again.save(tmp_path / "once more")
        last = TD3ICM.load(tmp_path / "once more", env=make_easy_maze())
        last.learn(150, reset_num_timesteps=False)
        assert_same_run(whole, last)

    def test_setting_an_env_after_a_checkpoint_begins_an_episode(self, make, make_maze, tmp_path):
        model, recorder = make(make_maze()), Lengths()
        model.learn(50, callback=Save(30, tmp_path / "model"))
        model.set_env(make_maze())
        model.learn(50, reset_num_timesteps=False, callback=recorder)
        assert recorder.lengths == [50]
        assert model.num_timesteps == 100

    def test_a_file_is_gone_on_with_once(self, make, make_maze, tmp_path):
        make(make_maze()).learn(50, callback=Save(30, tmp_path / "model"))
        model, recorder = TD3ICM.load(tmp_path / "model", env=make_maze()), Lengths()
        model.learn(20, reset_num_timesteps=False)
        model.set_env(make_maze())
        model.learn(50, reset_num_timesteps=False, callback=recorder)
        assert recorder.lengths == [50]
        assert model.num_timesteps == 100

    @pytest.mark.parametrize("moment", [80, 100])
    def test_a_file_without_transitions_goes_on(self, make, make_maze, tmp_path, moment):
        model = make(make_maze())
        model.learn(1e9, callback=lambda locals_, globals_: model.num_timesteps < moment)
        model.save(tmp_path / "one", exclude=["buffer"])
        model.save(tmp_path / "other", exclude=["replay_buffer"])
        for name in ("one", "other"):
            loaded = TD3ICM.load(tmp_path / name, env=make_maze())
            assert loaded.replay_buffer.size() == 0
            with pytest.warns(UserWarning, match="was saved without its buffer"):
                loaded.learn(70, reset_num_timesteps=False)
            assert loaded._n_updates > model._n_updates

    def test_a_smaller_replay_buffer_keeps_the_newest(self, make, make_maze, tmp_path):
        model = make(make_maze(), buffer_size=100).learn(250)
        model.save(tmp_path / "model")
        newest = model.replay_buffer.newest(100)[0]
        for capacity, n in [(40, 40), (100, 100), (500, 100)]:
            loaded = TD3ICM.load(tmp_path / "model", env=make_maze(), buffer_size=capacity)
            assert loaded.replay_buffer.size() == n
            np.testing.assert_array_equal(loaded.replay_buffer.newest(n)[0], newest[-n:])
            loaded.learn(50, reset_num_timesteps=False)
            assert loaded.replay_buffer.size() == min(capacity, n + 50)

    def test_an_abandoned_rollout_is_not_counted(self, make, make_maze):
        model = make(make_maze(), gradient_steps=-1, learning_starts=1)
        model.learn(1e9, callback=lambda locals_, globals_: model.num_timesteps < 30)
        model.learn(50)
        assert model._n_updates == 50

    def test_where_no_state_is_given_an_episode_begins(self, make, make_maze, tmp_path):
        def make_env():
            return TimeLimit(make_maze(), 40)

        make(make_env()).learn(100, callback=Save(70, tmp_path / "model"))
        resumed = TD3ICM.load(tmp_path / "model", env=make_env())
        recorder = Lengths()
        resumed.learn(40, reset_num_timesteps=False, callback=recorder)
        assert recorder.lengths == [40]

    def test_in_another_maze_an_episode_begins(self, make, make_maze, tmp_path):
        make(make_maze()).learn(60, callback=Save(40, tmp_path / "model"))
        resumed = TD3ICM.load(tmp_path / "model", env=make_maze(layout="snake", horizon=30))
        recorder = Lengths()
        resumed.learn(30, reset_num_timesteps=False, callback=recorder)
        assert recorder.lengths == [30]
        assert resumed._last_obs.tolist() == resumed.env.reset().tolist()

    def test_resetting_the_timesteps_begins_an_episode(self, make, make_maze, tmp_path):
        make(make_maze()).learn(60, callback=Save(40, tmp_path / "model"))
        resumed, recorder = TD3ICM.load(tmp_path / "model", env=make_maze()), Lengths()
        assert resumed.learn(50, callback=recorder).num_timesteps == 50
        assert recorder.lengths == [50]

    def test_ctrl_c_leaves_a_model_that_resumes(self, make, make_easy_maze, tmp_path, assert_same):
        interrupted, uninterrupted = make(make_easy_maze()), make(make_easy_maze())
        with pytest.raises(KeyboardInterrupt):
            interrupted.learn(1e9, callback=Interrupt(100))
        assert interrupted.num_timesteps == 100
        interrupted.save(tmp_path / "model")
        loaded = TD3ICM.load(tmp_path / "model", env=make_easy_maze())
        uninterrupted.learn(300)
        for model in (interrupted, loaded):
            model.learn(200, reset_num_timesteps=False)
            assert_same(model.get_parameters(), uninterrupted.get_parameters())

    @pytest.mark.parametrize("method", ["_see_rollout", "_train_parts"])
    def test_ctrl_c_between_rollout_and_training_loses_neither(
        self, make, make_maze, monkeypatch, assert_same, method
    ):
        interrupted, uninterrupted = make(make_maze()), make(make_maze())
        function = getattr(interrupted, method)

        def press(*arguments):
            function(*arguments)
            if interrupted.num_timesteps == 100:
                signal.raise_signal(signal.SIGINT)

        monkeypatch.setattr(interrupted, method, press)
        with pytest.raises(KeyboardInterrupt):
            interrupted.learn(1e9)
        assert interrupted.num_timesteps == 100
        interrupted.learn(100, reset_num_timesteps=False)
        uninterrupted.learn(200)
        assert_same(interrupted.get_parameters(), uninterrupted.get_parameters())

    def test_a_callback_that_stops_leaves_one_too(self, make, make_easy_maze, assert_same_run):
        stopped, whole = make(make_easy_maze()), make(make_easy_maze())
        stopped.learn(1e9, callback=lambda locals_, globals_: stopped.num_timesteps < 128)
        assert stopped.num_timesteps == 128
        stopped.learn(100, reset_num_timesteps=False)
        assert_same_run(stopped, whole.learn(228))


class Lengths(BaseCallback):
    """Of the episodes that end."""

    def _init_callback(self):
        self.lengths = []

    def _on_step(self):
        self.lengths += [info["episode"]["l"] for info in self.locals["infos"] if "episode" in info]
        return True


class TestRandomness:
    def test_the_seed_decides(self, make, make_easy_maze, assert_same):
        one, twin, other = (make(make_easy_maze(), seed=s).learn(200) for s in (1, 1, 2))
        assert_same(one.get_parameters(), twin.get_parameters())
        assert not th.equal(one.actor.mu[0].weight, other.actor.mu[0].weight)

    def test_no_seed_is_fresh_entropy(self, make, make_maze):
        one, other = (make(make_maze(), seed=None) for _ in range(2))
        assert not th.equal(one.actor.mu[0].weight, other.actor.mu[0].weight)
        assert one.action_noise().tolist() != other.action_noise().tolist()

    def test_what_others_draw_changes_no_bit(self, make, make_easy_maze, assert_same):
        alone, disturbed = make(make_easy_maze()), make(make_easy_maze())
        alone.learn(100).learn(100, reset_num_timesteps=False)
        disturbed.learn(100)
        th.rand(7)
        np.random.rand(7)  # noqa: NPY002
        disturbed.learn(100, reset_num_timesteps=False)
        assert_same(alone.get_parameters(), disturbed.get_parameters())

    def test_threads_change_no_bit(self, make, make_easy_maze, assert_same):
        parameters = []
        for n_threads in (1, 2):
            th.set_num_threads(n_threads)
            model = make(make_easy_maze(), policy_kwargs={"net_arch": [400, 300]})
            parameters.append(model.learn(100).get_parameters())
        assert_same(*parameters)

    def test_a_run_may_be_seeded_anew(self, make, make_easy_maze, assert_same):
        one, other = make(make_easy_maze()), make(make_easy_maze())
        one.learn(100)
        for model in (one, other):
            model.set_random_seed(5)
        assert_same(one._generators.state_dict(), other._generators.state_dict())
        assert one.action_space.sample().tolist() == other.action_space.sample().tolist()


class TestEnvironments:
    @pytest.mark.parametrize("kind", ["id", "VectorEnv", "VecEnv"])
    def test_any_kind_of_one(self, make, make_maze, kind):
        env = {
            "id": lambda: "CuriosityMaze-Hard-v0",
            "VectorEnv": lambda: SyncVectorEnv([make_maze]),
            "VecEnv": lambda: DummyVecEnv([make_maze]),
        }[kind]()
        model = make(env)
        assert model.get_env().num_envs == 1
        assert model.learn(1).num_timesteps == (2000 if kind == "id" else 50)

    @pytest.mark.parametrize("make_env", [SyncVectorEnv, DummyVecEnv])
    def test_several_are_refused(self, make, make_maze, make_env):
        with pytest.raises(ValueError, match="`env` must be one environment, got 2"):
            make(make_env([make_maze] * 2))
        model = make(make_maze())
        env = model.get_env()
        with pytest.raises(ValueError, match="`env` must be one environment, got 2"):
            model.set_env(make_env([make_maze] * 2))
        assert model.get_env() is env

    def test_a_wrapper_of_the_whole_batch_is_refused(self, make, make_maze):
        with pytest.raises(ValueError, match=r"`env` must be a VectorEnv .* in no wrapper"):
            make(TransformReward(SyncVectorEnv([make_maze]), lambda reward: 2 * reward))

    @pytest.mark.parametrize("env_id", ["CartPole-v1", "FrozenLake-v1"])
    def test_actions_must_be_a_box(self, make, env_id):
        with pytest.raises(ValueError, match="`env` must have a bounded one-dimensional Box"):
            make(gym.make(env_id))

    @pytest.mark.parametrize(
        "space",
        [
            spaces.Box(-1, 1, (1,), np.int32),
            spaces.Box(np.float32([-1, 3]), np.float32([1, 3])),
            spaces.Box(-np.inf, 1, (1,)),
        ],
    )
    def test_actions_must_have_entries_that_vary(self, make, space):
        env = PendulumEnv()
        env.action_space = space
        with pytest.raises(ValueError, match=r"`env` must have .* at least one entry, of floats"):
            make(env)

    def test_observations_must_have_entries(self, make):
        env = PendulumEnv()
        env.observation_space = spaces.Box(-1, 1, (0,))
        with pytest.raises(ValueError, match="`observation_space` must have at least one entry"):
            make(env)

    @pytest.mark.parametrize(
        "space",
        [
            spaces.Tuple([spaces.Discrete(2)]),
            spaces.Discrete(2, start=1),
            spaces.MultiDiscrete([[2, 3]]),
            spaces.Dict(x=spaces.MultiDiscrete([2], start=[1])),
            spaces.Dict(),
        ],
        ids=str,
    )
    def test_observations_must_be_such_as_sb3s_policies_take(self, make, space):
        env = PendulumEnv()
        env.observation_space = space
        with pytest.raises(ValueError, match=r"observation space .* Stable-Baselines3's policies"):
            make(env)

    def test_cells_are_visited_at_any_step(self, make, make_maze):
        cells, oracle = set(), make_maze()
        oracle.reset()
        grid = oracle.unwrapped.coverage_grid

        def step(local, _):
            info = oracle.step(local["actions"][0])[-1]
            cells.add(grid.cells(info["behavior"][None]).item())
            if local["dones"][0]:
                oracle.reset()
            return True

        model = make(make_maze()).learn(120, ConvertCallback(step))
        assert model.coverage_shares["visited"] == len(cells) / grid.reachable.sum()
        assert model.coverage_shares["visited"] > model.coverage > 0.0

    def test_coverage_starts_anew_elsewhere(self, make, make_maze):
        model = make(make_maze()).learn(60)
        assert model.coverage > 0.0
        model.set_env(make_maze())
        assert model.coverage > 0.0
        model.set_env(make_maze(layout="snake"))
        assert (model.coverage, model.best_return) == (0.0, -np.inf)

    def test_normalized_observations(self, make, make_maze):
        env = VecNormalize(make_vec_env(make_maze))
        model = make(env).learn(120)
        stored = model.replay_buffer.newest(50)[0]
        assert np.abs(stored[:, :2]).max() <= 1.0  # as the maze gave them
        assert model._n_updates > 0

    def test_stacked_observations(self, make, make_maze):
        model = make(VecFrameStack(make_vec_env(make_maze), 2)).learn(120)
        assert model.replay_buffer.newest(1)[0].shape == (1, 72)
        assert model._n_updates > 0


class TestLength:
    @pytest.fixture(autouse=True)
    def _bound(self, monkeypatch):
        monkeypatch.setattr(vector, "MAX_EPISODE_STEPS", 50)

    @pytest.mark.parametrize("n_episodes", [1, 2])
    def test_episodes_that_do_not_end_are_an_error(self, make, n_episodes):
        model = make(PendulumEnv(), train_freq=(n_episodes, "episode"))
        for n in (50, 100):  # each time it is given as many
            with pytest.raises(ValueError, match=r"`env` must end .* after 50 steps\. Give"):
                model.learn(1000, reset_num_timesteps=False)
            assert model.num_timesteps == n
        model.set_env(TimeLimit(PendulumEnv(), 60))  # a limit of the env may be higher
        assert model.learn(1, reset_num_timesteps=False).num_timesteps == 100 + 60 * n_episodes

    def test_each_episode_of_a_rollout_may_be_as_long(self, make):
        model = make(TimeLimit(PendulumEnv(), 50), train_freq=(3, "episode"))
        assert model.learn(1).num_timesteps == 150

    def test_rollouts_of_steps_end_by_themselves(self, make):
        model = make(PendulumEnv(), train_freq=(90, "step"))
        assert model.learn(1).num_timesteps == 90


class RaisesOnce(gym.Wrapper):
    """Fails in the step of a number, and never again."""

    def __init__(self, env, moment):
        super().__init__(env)
        self.n_steps, self.moment = 0, moment

    def step(self, action):
        self.n_steps += 1
        if self.n_steps == self.moment:
            raise RuntimeError("the simulation failed")
        return super().step(action)


class GivesOnce(gym.Wrapper):
    """Gives a value as reward or observation in the step of a number."""

    def __init__(self, env, moment, part, value):
        super().__init__(env)
        self.n_steps, self.moment, self.part, self.value = 0, moment, part, value

    def step(self, action):
        self.n_steps += 1
        step = list(super().step(action))
        if self.n_steps == self.moment:
            step[self.part] = np.full_like(step[self.part], self.value)[()]
        return tuple(step)


class TestErrors:
    @pytest.mark.parametrize(
        ("around", "value"),
        [
            (lambda venv: venv, np.inf),
            (VecNormalize, np.nan),  # it clips an infinity
        ],
    )
    @pytest.mark.parametrize(  # in mid-episode, and at its end
        ("moment", "part", "name"), [(70, 0, "observations"), (100, 1, "rewards")]
    )
    def test_what_is_not_finite_is_never_learned(
        self, make, make_maze, around, moment, part, name, value
    ):
        venv = DummyVecEnv([lambda: GivesOnce(make_maze(), moment, part, value)])
        model = make(around(venv))
        with pytest.raises(ValueError, match=f"`env` must give finite {name}"):
            model.learn(200)
        assert model.num_timesteps == model.replay_buffer.size() == moment - 1
        assert all(th.isfinite(each).all() for each in model.policy.parameters())

    @pytest.mark.parametrize(
        ("is_reset", "n_timesteps", "n_updates"), [(True, 150, 250), (False, 300, 300)]
    )
    def test_training_goes_on_after_an_env_has_failed(
        self, make, make_maze, is_reset, n_timesteps, n_updates
    ):
        """Neither is a step lost, nor more trained than was collected."""
        model = make(RaisesOnce(make_maze(), 130), gradient_steps=-1)
        with pytest.raises(RuntimeError, match="the simulation failed"):
            model.learn(1e9)
        assert (model.num_timesteps, model._n_updates) == (129, 100)
        model.learn(150, reset_num_timesteps=is_reset)
        assert (model.num_timesteps, model._n_updates) == (n_timesteps, n_updates)

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("train_freq", (0, "episode")),
            ("gradient_steps", 1.5),
            ("gradient_steps", -2),
        ],
    )
    def test_errors_name_the_argument(self, make, make_maze, name, value):
        with pytest.raises(ValueError, match=f"`{name}` "):
            make(make_maze(), **{name: value})

    def test_the_replay_buffer_is_its_own(self, make, make_maze):
        with pytest.raises(TypeError, match="unexpected keyword argument 'replay_buffer_class'"):
            make(make_maze(), replay_buffer_class=None)


class TestAsInStableBaselines:
    SETTINGS = {  # noqa: RUF012
        "learning_starts": 30,
        "batch_size": 8,
        "policy_kwargs": {"net_arch": [4]},
        "train_freq": (1, "episode"),
        "gradient_steps": 20,
        "learning_rate": lambda progress: 0.01 * progress,
        "seed": 3,
        "device": "cpu",
        "buffer_size": 300,
    }

    def test_without_a_bonus_it_is_sb3s_td3(self, make_easy_maze, monkeypatch, assert_same):
        """Given SB3's own way to sample, and the same states of the global generators."""

        def make_noise():
            return OrnsteinUhlenbeckActionNoise(np.zeros(2), 0.3 * np.ones(2))

        monkeypatch.setattr(BonusReplayBuffer, "sample", ReplayBuffer.sample)
        monkeypatch.setattr(td3_icm, "train", lambda *arguments, **kwargs: {})
        ours = TD3ICM(make_easy_maze(), action_noise=make_noise(), **self.SETTINGS)
        theirs = TD3("MlpPolicy", make_easy_maze(), action_noise=make_noise(), **self.SETTINGS)
        own = theirs.get_parameters()
        theirs.set_parameters({name: ours.get_parameters()[name] for name in own})
        with copy.deepcopy(ours._generators).lent():
            theirs.learn(300)
        ours.learn(300)
        assert_same(ours.policy.state_dict(), theirs.policy.state_dict())
        assert ours._n_updates == theirs._n_updates > 0
        rates = [model.actor.optimizer.param_groups[0]["lr"] for model in (ours, theirs)]
        assert rates[0] == rates[1] < 0.01

    def test_values_that_callbacks_log_are_of_the_same_row(self, make, make_maze, tmp_path):
        class Logs(BaseCallback):
            def _on_step(self):
                self.logger.record("own/timesteps", self.num_timesteps)
                return True

        model = make(make_maze())
        model.set_logger(configure(str(tmp_path), ["json"]))
        model.learn(150, callback=Logs(), log_interval=1)
        rows = read_log(tmp_path)
        assert [row["own/timesteps"] for row in rows] == [50, 100, 150]

    def test_callbacks_see_each_step(self, make, make_maze):
        seen = []

        def callback(locals_, globals_):
            seen.append(set(locals_))
            return True

        model = make(make_maze()).learn(100, callback=callback)
        assert len(seen) == model.num_timesteps == 100
        names = {"env", "actions", "buffer_actions", "new_obs", "rewards", "dones", "infos"}
        names |= {"replay_buffer", "action_noise", "train_freq", "learning_starts"}
        names |= {"num_collected_steps", "num_collected_episodes"}
        assert all(names <= each for each in seen)

    def test_checkpoints_count_steps(self, make, make_easy_maze, tmp_path):
        make(make_easy_maze()).learn(128, callback=CheckpointCallback(50, str(tmp_path)))
        names = {path.name for path in tmp_path.iterdir()}
        assert names == {"rl_model_50_steps.zip", "rl_model_100_steps.zip"}
        assert TD3ICM.load(tmp_path / "rl_model_50_steps").num_timesteps == 50

    def test_a_replay_buffer_of_its_own_file(self, make, make_maze, tmp_path):
        model, other = make(make_maze()).learn(100), make(make_maze(), seed=1)
        model.save_replay_buffer(tmp_path / "buffer")
        other.load_replay_buffer(tmp_path / "buffer")
        assert other.replay_buffer.size() == model.replay_buffer.size() == 100
        assert other.replay_buffer.bonus is other._bonus
        assert other.learn(100, reset_num_timesteps=False)._n_updates > 0

    def test_a_replay_buffer_takes_on_the_models_weights(self, make, make_maze, tmp_path):
        make(make_maze()).save_replay_buffer(tmp_path / "buffer")
        other = make(make_maze(), weight=3.0, extrinsic=False)
        other.load_replay_buffer(tmp_path / "buffer")
        assert (other.replay_buffer.weight, other.replay_buffer.extrinsic) == (3.0, False)
        theirs = TD3("MlpPolicy", make_maze(), buffer_size=9, device="cpu")
        theirs.save_replay_buffer(tmp_path / "theirs")
        own = other.replay_buffer
        with pytest.raises(ValueError, match="`path` must be a replay buffer that TD3ICM"):
            other.load_replay_buffer(tmp_path / "theirs")
        assert other.replay_buffer is own

    def test_a_copy_trains_on_its_own(self, make, make_easy_maze, assert_same):
        model = make(make_easy_maze()).learn(100)
        twin = copy.deepcopy(model)
        assert twin.replay_buffer.bonus is twin._bonus is not model._bonus
        for each in (model, twin):
            each.learn(100, reset_num_timesteps=False)
        assert_same(model.get_parameters(), twin.get_parameters())


def test_images(make, tmp_path):
    class Camera(gym.Env):
        observation_space = spaces.Box(0, 255, (36, 36, 1), np.uint8)
        action_space = spaces.Box(-1, 1, (2,))

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            return self.observation_space.sample(), {}

        def step(self, action):
            return self.observation_space.sample(), 0.0, False, False, {}

    model = make(TimeLimit(Camera(), 10), policy="CnnPolicy", learning_starts=5, buffer_size=30)
    model.learn(30)
    model.save(tmp_path / "model")
    loaded = TD3ICM.load(tmp_path / "model", env=TimeLimit(Camera(), 10))
    assert loaded.replay_buffer.newest(1)[0].dtype == np.uint8
    assert loaded.learn(10, reset_num_timesteps=False).num_timesteps == 40
