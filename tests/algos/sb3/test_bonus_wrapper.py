from functools import partial

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from recorder import Count, Recorder
from saved_files import with_entry
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecNormalize

import curiosity_algos
from curiosity_algos.curiosity.curiosity import RewardScale
from curiosity_algos.sb3 import bonus_wrapper
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper


class Entries(gym.ObservationWrapper):
    """Count's number in a Dict, beside another."""

    observation_space = spaces.Dict(
        {"number": Count.observation_space, "other": spaces.Box(0, 99, (2,))}
    )

    def observation(self, observation):
        return {"number": observation, "other": np.full(2, 36, np.float32) + observation}


class FromOne(Count):
    action_space = spaces.Discrete(2, start=1)


class StepsOfEpisodes:
    """A memory of n episodes, whose bonus is the number of a step in its own; it keeps them all."""

    def __init__(self, n):
        self.steps, self.paid = np.zeros(n, dtype=np.float32), []

    def score(self, observations, actions, next_observations):
        self.steps += 1
        self.paid.append(self.steps.tolist())
        return self.steps.copy()

    def end(self, dones):
        self.steps[dones] = 0

    def state_dict(self):
        return {"steps": th.from_numpy(self.steps.copy())}

    def load_state_dict(self, state):
        self.steps = state["steps"].numpy()


class Episodic(Recorder):
    """A bonus that asks what the episode has seen."""

    def episodes(self, n):
        self.memory = StepsOfEpisodes(n)
        return self.memory


def make_venv(n=2, env=Count):
    return DummyVecEnv([env] * n)


def wrap(venv=None, **changes):
    settings = {"seed": 0, "device": "cpu", "train_interval": 8, "n_updates": 2, "batch_size": 4}
    given = {"bonus": "icm", "weight": 1.0, "norm_reward": False} | settings | changes
    return BonusVecEnvWrapper(venv or make_venv(), **given)


def wrap_trained(venv=None, bonus=None, **changes):
    """A wrapper that has trained in an episode of its own, so that it pays a bonus."""
    wrapper = wrap(venv, bonus=bonus or Recorder(), **(changes | {"train_interval": 1}))
    play(wrapper, 4)
    wrapper.train_interval = 8
    wrapper.bonus.asked.clear()
    return wrapper


def unequal():
    """Environments whose episodes end at other times, by the task and by a limit."""
    return DummyVecEnv([Count, lambda: gym.wrappers.TimeLimit(Count(), 3), Count])


def play(venv, n_steps, seed=0):
    """What each step gave: observations, rewards, dones, infos."""
    rng = np.random.default_rng(seed)
    venv.reset()
    return [
        venv.step(rng.uniform(-1, 1, (venv.num_envs, 1)).astype(np.float32)) for _ in range(n_steps)
    ]


class TestRewards:
    def test_a_bonus_is_that_of_the_true_last_observation(self):
        venv = wrap_trained(bonus=(bonus := Recorder()))
        steps = play(venv, 9)
        befores, actions, afters = (np.array([each[i] for each in bonus.asked]) for i in range(3))
        taken = np.random.default_rng(0).uniform(-1, 1, (9, 2, 1)).astype(np.float32)
        np.testing.assert_array_equal(actions, taken)
        np.testing.assert_array_equal(befores[:, 0, 0], [0, 1, 2, 3, 0, 1, 2, 3, 0])
        np.testing.assert_array_equal(afters[:, 0, 0], [1, 2, 3, 4, 1, 2, 3, 4, 1])
        seen = [observations[0, 0] for observations, *_ in steps]
        assert seen == [1, 2, 3, 0, 1, 2, 3, 0, 1]

    def test_it_observes_where_steps_begin_and_where_the_task_ends_episodes(self):
        venv = DummyVecEnv([Count, lambda: gym.wrappers.TimeLimit(Count(), 3)])
        play(wrap(venv, bonus=(bonus := Recorder())), 4)
        observed = [each.ravel().tolist() for each in bonus.observed]
        assert observed == [[0, 0], [1, 1], [2, 2], [3, 0, 4]]

    def test_a_memory_of_each_episode_ends_with_it_and_with_a_reset(self):
        venv = DummyVecEnv([Count, lambda: gym.wrappers.TimeLimit(Count(), 3)])
        wrapper = wrap(venv, bonus=(bonus := Episodic()))
        play(wrapper, 6)
        assert bonus.memory.paid == [[1, 1], [2, 2], [3, 3], [4, 1], [1, 2], [2, 3]]
        wrapper.reset()
        wrapper.step(np.zeros((2, *venv.action_space.shape), dtype=np.float32))
        assert bonus.memory.paid[-1] == [1, 1]

    def test_a_bonus_with_a_horizon_learns_from_spans_within_episodes(self):
        bonus = Recorder()
        bonus.horizon = 3
        venv = wrap(bonus=bonus, train_interval=1000)
        for _ in range(20):
            play(venv, 6)  # the last in mid-episode
        held = venv.buffer.state_dict()
        spans = (held["next_observations"] - held["observations"]).int().ravel().tolist()
        assert set(spans) == {1, 2, 3}
        for venv.training in (False, True):
            venv.step(np.zeros((2, 1), dtype=np.float32))  # no span over what was not learned from
        assert venv.buffer.state_dict()["observations"][-2:].ravel().tolist() == [3, 3]

    @pytest.mark.parametrize(("extrinsic", "weight"), [(True, 0.25), (False, 1.0)])
    def test_rewards_add_up_and_infos_keep_them_apart(self, extrinsic, weight):
        steps = play(wrap_trained(bonus=Recorder(), extrinsic=extrinsic, weight=weight), 9)
        plain = play(wrap_trained(bonus=Recorder()), 9)
        for (_, rewards, dones, infos), (_, _, _, unweighted) in zip(steps, plain, strict=True):
            assert rewards.dtype == np.float32
            for i, info in enumerate(infos):
                assert info["reward_extrinsic"] == float(dones[i])
                bonus = unweighted[i]["reward_intrinsic"]
                assert info["reward_intrinsic"] == pytest.approx(weight * bonus)
                total = extrinsic * info["reward_extrinsic"] + info["reward_intrinsic"]
                assert rewards[i] == np.float32(total)

    @pytest.mark.parametrize("weight", [0.0, 0.02, 5.0])
    @pytest.mark.parametrize("extrinsic", [True, False])
    def test_the_sum_is_scaled_as_sb3s_vec_normalize_scales_it(self, extrinsic, weight):
        settings = {"extrinsic": extrinsic, "weight": weight, "gamma": 0.9, "train_interval": 1}
        ours = wrap(unequal(), bonus=Recorder(), norm_reward=True, **settings)
        theirs = VecNormalize(
            wrap(unequal(), bonus=Recorder(), **settings), norm_obs=False, gamma=0.9
        )
        for is_training in (True, True, False, True):  # each ends in mid-episode
            ours.training = theirs.training = theirs.venv.training = is_training
            both = zip(play(ours, 30), play(theirs, 30), strict=True)
            for (_, rewards, *_), (_, expected, *_) in both:
                np.testing.assert_allclose(rewards, expected, rtol=1e-5)

    def test_without_a_scale_yet_rewards_are_as_they_are(self):
        large = partial(gym.wrappers.TransformReward, func=lambda reward: 100.0 * reward)
        venv = wrap(DummyVecEnv([lambda: large(Count())]), norm_reward=True)
        venv.training = False
        assert {rewards[0] for _, rewards, *_ in play(venv, 8)} == {0.0, 100.0}

    def test_without_a_discount_nothing_is_scaled(self):
        steps = play(wrap_trained(norm_reward=True, gamma=None, weight=2.0), 4)
        assert [rewards[0] for _, rewards, *_ in steps] == [2.0, 4.0, 6.0, 9.0]

    def test_the_bonus_is_scaled_by_the_deviation_of_its_discounted_sum(self):
        venv = wrap(make_venv(3), bonus=Recorder(), gamma=0.9, train_interval=1)
        scale = RewardScale(3, bounds_sums=True)
        for t, (_, _, _, infos) in enumerate(play(venv, 100)):
            if t:  # there is no bonus before the first training
                scale.learn(np.full(3, 1.0 + t % 4), gamma=0.9)
                expected = scale.scaled(np.full(3, 1.0 + t % 4))
                assert [info["reward_intrinsic"] for info in infos] == pytest.approx(expected)

    def test_there_is_none_before_the_first_training(self):
        venv = wrap(bonus=(bonus := Recorder()), train_interval=10)
        bonus.asked.clear()
        steps = play(venv, 7)
        assert len(bonus.asked) == 2
        is_paid = [info[0]["reward_intrinsic"] > 0 for *_, info in steps]
        assert is_paid == [False] * 5 + [True] * 2
        assert [rewards[0] for _, rewards, *_ in steps[:5]] == [0, 0, 0, 1, 0]

    def test_what_is_remembered_begins_with_the_episode_all_the_same(self):
        venv = wrap(bonus="noveld", train_interval=10)
        steps = play(venv, 2)
        assert not any(info["reward_intrinsic"] for *_, infos in steps for info in infos)
        assert all(venv._episodes._seen)

    def test_stacked_below_the_last_observation_is_too(self):
        play(wrap_trained(VecFrameStack(make_venv(), 2), bonus=(bonus := Recorder())), 5)
        led_to = [after[0].tolist() for *_, after in bonus.asked]
        assert led_to == [[0, 1], [1, 2], [2, 3], [3, 4], [0, 1]]

    @pytest.mark.parametrize(("value", "n"), [(np.nan, 0), (np.inf, 2), (np.nan, 4)])
    def test_observations_that_are_not_finite_are_named(self, value, n):
        class Broken(Count):
            def reset(self, **kwargs):
                observation, info = super().reset(**kwargs)
                return (np.full(1, value, dtype=np.float32) if n == 0 else observation), info

            def step(self, action):
                observation, *others = super().step(action)
                return np.where(self.n == n, value, observation).astype(np.float32), *others

        venv = wrap(make_venv(env=Broken))
        with pytest.raises(ValueError, match="`env` must give finite observations"):
            play(venv, 4)
        assert len(venv.buffer) == 2 * max(n - 1, 0)

    def test_a_reward_that_is_not_finite_is_named(self):
        class Broken(Count):
            def step(self, action):
                observation, _, *others = super().step(action)
                return observation, np.inf if self.n == 3 else 0.0, *others

        venv = wrap(make_venv(env=Broken), extrinsic=False)
        with pytest.raises(ValueError, match="`env` must give finite rewards, it gave NaN"):
            play(venv, 4)
        assert len(venv.buffer) == 4

    def test_replay_buffers_that_ask_for_rewards_anew_are_refused(self):
        with pytest.raises(ValueError, match="`replay_buffer_class` must not be HerReplayBuffer"):
            wrap().env_method("compute_reward", 0, 0, {})


class TestTraining:
    def test_it_trains_when_enough_has_come(self):
        venv = wrap(bonus=(bonus := Recorder()), train_interval=6, n_updates=2, batch_size=5)
        counts = []
        venv.reset()
        for _ in range(7):
            venv.step(np.zeros((2, 1), dtype=np.float32))
            counts.append(len(bonus.batches))
        assert counts == [0, 0, 2, 2, 2, 4, 4]
        assert [len(part) for part in bonus.batches[0]] == [5, 5, 5]
        assert venv.metrics == {"recorder/loss": 3.5}

    def test_the_buffer_holds_true_transitions(self):
        venv = wrap(bonus=(bonus := Recorder()), train_interval=100, batch_size=200)
        venv.reset()
        for n in range(50):
            venv.step(np.full((2, 1), n % 4 / 10, dtype=np.float32))
        before, actions, after = bonus.batches[0]
        assert set(after.ravel().tolist()) == {1.0, 2.0, 3.0, 4.0}
        assert th.equal(after, before + 1)
        assert th.allclose(actions, before / 10)
        assert th.equal(th.cat(bonus.observed)[:4].ravel(), th.tensor([0.0, 0.0, 1.0, 1.0]))

    def test_it_may_be_switched_off(self, assert_same):
        venv = wrap(bonus="rnd", train_interval=2, norm_reward=True)
        play(venv, 5)
        venv.training = False
        before = venv.state_dict()
        steps = play(venv, 6, seed=1)
        after = venv.state_dict()
        names = "scale", "total_scale"
        scales = [[each["curiosity"].pop(name) for name in names] for each in (before, after)]
        for name in ("curiosity", "buffer"):
            assert_same(before[name], after[name])
        for scale, later in zip(*scales, strict=True):
            np.testing.assert_array_equal(scale["statistics"], later["statistics"])
            assert not later["sums"].any()  # since the reset
        assert all(info[0]["reward_intrinsic"] > 0 for *_, info in steps)


@pytest.mark.parametrize(
    ("key", "last"), [(None, [4, 40, 40]), ("number", [4]), ("other", [40, 40])]
)
def test_dictionaries(tmp_path, key, last, assert_same):
    venv, other = (make_venv(env=lambda: Entries(Count())) for _ in range(2))
    venv = wrap(venv, train_interval=16, observation_key=key)
    play(venv, 4)
    assert venv.buffer.state_dict()["next_observations"][-1].tolist() == last
    venv.save(tmp_path / "wrapper.npz")
    other = BonusVecEnvWrapper.load(tmp_path / "wrapper.npz", other, device="cpu")
    assert_same(venv.state_dict(), other.state_dict())


class TestFiles:
    def test_episodes_that_the_file_does_not_know_begin_with_the_first_step(
        self, tmp_path, monkeypatch
    ):
        venv = wrap()
        play(venv, 3)
        monkeypatch.setattr(bonus_wrapper, "episode_states", lambda venv: None)
        venv.save(tmp_path / "bonus.npz")
        loaded = BonusVecEnvWrapper.load(tmp_path / "bonus.npz", make_venv(), device="cpu")
        for _ in range(2):
            loaded.step(np.zeros((2, 1), dtype=np.float32))
        state = loaded.buffer.state_dict()
        assert state["observations"].flatten().tolist() == [0, 0, 1, 1, 2, 2, 0, 0, 1, 1]
        assert state["next_observations"].flatten().tolist() == [1, 1, 2, 2, 3, 3, 1, 1, 2, 2]

    def test_a_load_leaves_the_first_start_to_the_model(self, tmp_path):
        wrap(make_vec_env("Pendulum-v1")).save(tmp_path / "bonus.npz")
        venv = BonusVecEnvWrapper.load(tmp_path / "bonus.npz", make_vec_env("Pendulum-v1", seed=3))
        np.testing.assert_array_equal(venv.reset(), make_vec_env("Pendulum-v1", seed=3).reset())

    def test_a_bonus_of_ones_own_is_given_again(self, tmp_path):
        path, one = tmp_path / "wrapper.npz", wrap(bonus=Recorder())
        play(one, 4)
        one.save(path)
        bonus = Recorder()
        BonusVecEnvWrapper.load(path, make_venv(), bonus=bonus, device="cpu")
        assert len(bonus.batches) == 2
        with pytest.raises(ValueError, match="`bonus` must be given, it was an object"):
            BonusVecEnvWrapper.load(path, make_venv())
        wrap().save(path)
        with pytest.raises(ValueError, match="`bonus` must be None, it was 'icm'"):
            BonusVecEnvWrapper.load(path, make_venv(), bonus=bonus)


@pytest.mark.parametrize(
    ("name", "bonus"), [("BonusVecEnvWrapper", "apt"), ("ICMVecEnvWrapper", "icm")]
)
def test_a_wrapper_has_a_bonus_of_its_own_unless_it_is_named(name, bonus, tmp_path):
    made = getattr(curiosity_algos, name)
    assert made(make_venv(), device="cpu").bonus.name == bonus
    made(make_venv(), bonus="rnd", device="cpu").save(tmp_path / "bonus.npz")
    assert made.load(tmp_path / "bonus.npz", make_venv(), device="cpu").bonus.name == "rnd"


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("settings.n_steps", 3),
        ("settings.weight", -1),
        ("state.wrapper", {}),
        ("state.wrapper.observations", np.zeros((2, 3), np.float32)),
        ("state.wrapper.recent.rng", "x"),
        ("state.wrapper.buffer.generator", th.zeros(5056, dtype=th.uint8)),
        ("state.wrapper.curiosity.n_untrained", 1.5),
    ],
)
def test_a_damaged_file_is_refused_in_one_sentence(entry, value, tmp_path):
    path = tmp_path / "bonus.npz"
    wrapper = wrap(bonus="rnd")
    play(wrapper, 3)
    wrapper.save(path)
    with_entry(path, "BonusVecEnvWrapper", entry, value)
    with pytest.raises(ValueError, match=r"^`path` must be saved of a wrapper around 2 env.*npz"):
        BonusVecEnvWrapper.load(path, make_venv())


@pytest.mark.parametrize(
    "make", [lambda: make_venv(3), lambda: make_vec_env("CartPole-v1", n_envs=2)]
)
def test_a_file_of_other_environments_is_refused(make, tmp_path):
    wrapper = wrap()
    play(wrapper, 3)
    wrapper.save(tmp_path / "bonus.npz")
    with pytest.raises(
        ValueError, match=r"^`path` must be saved .* around . env.*npz.* make a new"
    ):
        BonusVecEnvWrapper.load(tmp_path / "bonus.npz", make())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (Count, "be a VecEnv"),
        (lambda: VecFrameStack(VecNormalize(make_venv()), 2), "hold no VecNormalize"),
        (lambda: VecFrameStack(wrap(make_venv()), 2), "hold no other BonusVecEnvWrapper"),
        (lambda: make_venv(env=FromOne), "take actions from 0 on"),
    ],
)
def test_other_envs_are_refused(make, message):
    with pytest.raises(ValueError, match=f"`venv` must {message}"):
        wrap(make())
