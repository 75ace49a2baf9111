import copy
from itertools import pairwise

import gymnasium as gym
import numpy as np
import pytest
import sb3_contrib
import stable_baselines3
import torch as th
from gymnasium import spaces
from recorder import Count, Recorder
from saved_files import with_entry
from stable_baselines3.common.buffers import DictReplayBuffer, ReplayBuffer
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from toys import OFF_POLICY, Toy

from curiosity_algos.bonuses import make
from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.curiosity.curiosity import RewardScale
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper
from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer

BONUSES = [name for name, bonus in make.BONUSES.items() if bonus.episodes is Bonus.episodes]
OBSERVATIONS, ACTIONS = spaces.Box(-9, 9, (1,)), spaces.Box(-1, 1, (1,))


class Weighted(Recorder):
    """What a transition is worth tells all three parts apart, times a factor that tests change."""

    factor = 1.0

    def score(self, observations, actions, next_observations):
        numbers = (each.reshape(len(each), -1)[:, 0] for each in (observations, next_observations))
        before, after = numbers
        actions = np.asarray(actions, dtype=np.float32).reshape(len(actions))
        return self.factor * (2 * before + 10 * actions + 4 * after)

    @property
    def seen(self):
        return [
            number for observations in self.observed for number in observations.ravel().tolist()
        ]


def worth(x):
    """What Weighted says of `add`'s step from x: 2 x + x + 4 (x + 1)."""
    return 7 * x + 4


class OfNow(BonusReplayBuffer):
    """Scores whatever it samples, as after a training."""

    def _bonus_of(self, drawn):
        self.curiosity.n_trainings += 1
        return super()._bonus_of(drawn)


def newest(buffer, n):
    """The last n steps of every environment, as the bonus sees them."""
    return buffer._transitions(buffer._newest(n))


def make_buffer(capacity=10, observation_space=OBSERVATIONS, action_space=ACTIONS, **settings):
    """Of a bonus that does not train by itself, as it is."""
    given = {"weight": 0.5, "gamma": None, "train_interval": None, "seed": 0, **settings}
    return (OfNow if given["train_interval"] is None else BonusReplayBuffer)(
        capacity, observation_space, action_space, "cpu", **{"bonus": Weighted(), **given}
    )


def add(buffer, x, reward=0.0, done=False, truncated=False):
    """A step from x to x + 1."""
    row = np.full((1, 1), x, dtype=np.float32)
    info = {"TimeLimit.truncated": truncated}
    buffer.add(row, row + 1, row / 10, np.array([reward]), np.array([done]), [info])


class TestSamples:
    def test_values_stop_at_terminations_alone(self):
        buffer = make_buffer()
        add(buffer, 0)
        add(buffer, 1, done=True, truncated=True)
        add(buffer, 2, done=True)
        sample = buffer.sample(50)
        assert th.equal(sample.dones, (sample.observations == 2).float())

    def test_normalizing_spares_what_the_bonus_sees(self):
        buffer = make_buffer()
        add(buffer, 1, reward=10.0)
        venv = VecNormalize(DummyVecEnv([lambda: gym.make("Pendulum-v1")]))
        venv.obs_rms.mean, venv.obs_rms.var = np.ones(1), np.ones(1)
        venv.ret_rms.var = 4.0
        sample = buffer.sample(1, venv)
        assert sample.observations.item() == 0.0
        assert sample.next_observations.item() == pytest.approx(1.0)
        assert sample.rewards.item() == pytest.approx(10.0 / 2.0 + 0.5 * worth(1))


def test_by_default_its_bonus_weighs_more_than_a_wrappers():
    buffer = BonusReplayBuffer(9, OBSERVATIONS, ACTIONS, "cpu")
    wrapper = BonusVecEnvWrapper(make_vec_env("Pendulum-v1"))
    assert (buffer.weight, wrapper.weight) == (1.0, 0.02)
    assert (buffer.norm_reward, wrapper.norm_reward) == (False, True)
    assert BonusReplayBuffer(9, OBSERVATIONS, ACTIONS, "cpu", weight=0.5).weight == 0.5


@pytest.mark.parametrize(
    ("step", "name"),
    [({"x": np.nan}, "observations"), ({"x": 1, "reward": np.inf}, "rewards")],
)
def test_what_is_not_finite_is_not_kept(step, name):
    buffer = make_buffer()
    with pytest.raises(ValueError, match=f"`env` must give finite {name}"):
        add(buffer, **step)
    assert buffer.size() == 0


def test_spans_do_not_go_from_the_newest_to_the_oldest():
    buffer = make_buffer(capacity=4)
    buffer.bonus.horizon = 4
    for x in range(6):
        add(buffer, x)
    before, actions, after = buffer.sample_transitions(400)
    assert (after - before).unique().tolist() == [1, 2, 3, 4]
    assert th.allclose(actions, before / 10)


def test_the_bonus_sees_actions_as_the_environment_takes_them():
    buffer = make_buffer(action_space=spaces.Box(np.float32(2), np.float32(10), (1,)))
    buffer.bonus.score = lambda before, actions, after: actions[:, 0]
    for x in (-10, 0, 5):
        add(buffer, x)  # stored as a tenth, in [-1, 1]
    taken = {-10: 2.0, 0: 6.0, 5: 8.0}
    sample = buffer.sample(20)
    states, rewards = sample.observations.ravel().tolist(), sample.rewards.ravel().tolist()
    assert rewards == [0.5 * taken[x] for x in states]
    assert th.equal(sample.actions, sample.observations / 10)
    assert newest(buffer, 3)[1].ravel().tolist() == [2.0, 6.0, 8.0]
    before, actions, _ = buffer.sample_transitions(20)
    assert actions.ravel().tolist() == [taken[x] for x in before.ravel().tolist()]


def walk(buffer, n_steps, ends=lambda env, step: False):
    """Each of the environments goes from 100 * env one up a step, or begins anew where it ended."""
    places = 100.0 * np.arange(buffer.n_envs)
    for step in range(n_steps):
        dones = np.array([ends(env, step) for env in range(buffer.n_envs)])
        rows = places.astype(np.float32)[:, None]
        buffer.add(rows, rows + 1, rows / 1000, places / 10, dones, [{}] * buffer.n_envs)
        places = np.where(dones, 100.0 * np.arange(buffer.n_envs), places + 1)


class TestManyEnvironments:
    @pytest.mark.parametrize("n_envs", [1, 3])
    def test_rows_belong_together(self, n_envs):
        buffer = make_buffer(24, n_envs=n_envs)
        walk(buffer, 6)
        sample = buffer.sample(300)
        x = sample.observations
        assert x.unique().tolist() == [100 * env + i for env in range(n_envs) for i in range(6)]
        assert th.equal(sample.next_observations, x + 1)
        assert th.allclose(sample.actions, x / 1000)
        assert th.allclose(sample.rewards, x / 10 + 0.5 * (6 * x + x / 100 + 4))

    @pytest.mark.parametrize("n_envs", [1, 3])
    def test_the_oldest_go(self, n_envs):
        buffer = make_buffer(4 * n_envs, n_envs=n_envs)
        walk(buffer, 9)
        envs, left = range(n_envs), range(5, 9)
        seen = buffer.sample(300).observations.unique().tolist()
        assert seen == [100 * env + i for env in envs for i in left]
        before, _, after = newest(buffer, 9)
        assert before.ravel().tolist() == [100 * env + i for i in left for env in envs]
        np.testing.assert_array_equal(after, before + 1)

    def test_spans_stay_in_an_episode_of_an_environment(self):
        buffer = make_buffer(60, n_envs=3)
        buffer.bonus.horizon = 4
        walk(buffer, 9, ends=lambda env, step: step == 2 + env)
        before, _, after = buffer.sample_transitions(2000)
        spans = set(zip(before[:, 0].int().tolist(), after[:, 0].int().tolist(), strict=True))
        expected = set()
        for env, (first, second) in enumerate([(3, 6), (4, 5), (5, 4)]):  # steps of its episodes
            for length in (first, second):
                for i in range(length):
                    expected |= {
                        (100 * env + i, 100 * env + j) for j in range(i + 1, min(i + 4, length) + 1)
                    }
        assert spans == expected

    def test_one_is_left_and_the_others_go_on(self):
        buffer = make_buffer(20, n_envs=2)
        buffer.bonus.horizon = 3
        for rows in ([[0], [100]], [[1], [101]], [[50], [102]]):
            rows = np.array(rows, dtype=np.float32)
            buffer.add(rows, rows + 1, rows / 1000, np.zeros(2), np.zeros(2), [{}, {}])
        assert buffer.dones[:3].tolist() == [[0, 0], [1, 0], [0, 0]]
        assert buffer.timeouts[1, 0] == 1  # its value goes on
        before, _, after = buffer.sample_transitions(500)
        assert after[before < 50].max() <= 2
        assert after[before >= 100].max() == 103


def test_choices_are_taken_as_they_are():
    buffer = make_buffer(10, action_space=spaces.Discrete(5))
    taken = []
    buffer.bonus.score = lambda *batch: taken.append(batch) or np.zeros(len(batch[0]))
    for x in range(3):
        row = np.full((1, 1), x, dtype=np.float32)
        buffer.add(row, row + 1, np.array([x + 1]), np.zeros(1), np.zeros(1), [{}])
    sample = buffer.sample(20)
    assert sample.actions.dtype == th.int64
    before, actions, _ = taken[0]
    assert actions.shape == (20,)
    np.testing.assert_array_equal(actions, before[:, 0] + 1)
    before, actions, _ = buffer.sample_transitions(20)
    assert actions.dtype == th.float32
    assert th.equal(actions, before + 1)


def test_whole_actions_are_scored_as_floats():
    """Stable-Baselines3 keeps them in their own type, scaled to [-1, 1]."""
    actions = spaces.Box(-3, 3, (1,), np.int64)
    buffer = make_buffer(20, action_space=actions, bonus="icm", gamma=0.9, train_interval=4)
    walk(buffer, 8)
    assert buffer.sample(8).rewards.isfinite().all()


class TestTraining:
    def test_it_comes_with_every_so_many_transitions(self):
        buffer = make_buffer(60, n_envs=3, train_interval=10, n_updates=2, batch_size=5)
        walk(buffer, 3)
        assert not buffer.bonus.batches
        walk(buffer, 1)  # 12 transitions, 4 of each
        assert len(buffer.bonus.batches) == 2
        assert buffer.bonus.batches[0][0].shape == (5, 1)
        assert buffer.bonus.seen == [0, 100, 200, 1, 101, 201, 2, 102, 202, 0, 100, 200]
        walk(buffer, 4)
        assert len(buffer.bonus.batches) == 4
        assert len(buffer.bonus.seen) == 24

    def test_the_bonus_observes_where_steps_begin_and_where_the_task_ends_episodes(self):
        buffer = make_buffer(train_interval=4)
        for x, how in [
            (0, {}),
            (1, {"done": True}),
            (5, {"done": True, "truncated": True}),
            (7, {}),
        ]:
            add(buffer, x, **how)
        assert buffer.bonus.seen == [0, 1, 5, 7, 2]

    def test_before_it_the_bonus_is_nothing(self):
        buffer = make_buffer(60, train_interval=4, extrinsic=False)
        walk(buffer, 3)
        assert not buffer.sample(9).rewards.any()
        walk(buffer, 1)
        assert buffer.sample(9).rewards.all()

    def test_the_scale_is_that_of_the_sums_so_far(self):
        buffer = make_buffer(60, n_envs=2, train_interval=10, gamma=0.9, extrinsic=False)
        walk(buffer, 5)
        scale = RewardScale(2, bounds_sums=True)
        places = np.arange(5)[:, None] + [0.0, 100.0]
        steps = 6 * places + places / 100 + 4
        largest = 0.0
        for step in steps:
            scale.learn(step, gamma=0.9)
            largest = max(largest, scale.scaled(step).max())
        sample = buffer.sample(200)
        x = sample.observations.numpy()[:, 0]
        of_now = scale.scaled((6 * x + x / 100 + 4).astype(np.float64))
        np.testing.assert_allclose(sample.rewards[:, 0], 0.5 * of_now, rtol=1e-5)
        assert buffer.metrics["recorder/loss"] > 0.0
        assert buffer.metrics["intrinsic/max"] == pytest.approx(0.5 * largest, rel=1e-5)

    @pytest.mark.parametrize("train_interval", [4, 9])
    def test_the_sum_has_the_scale_of_its_sums_over_episodes(self, train_interval):
        of_parts = {"norm_reward": True, "gamma": 0.9, "weight": 0.5}
        buffer = make_buffer(60, train_interval=train_interval, **of_parts)
        bonus_scale, scale = RewardScale(1, bounds_sums=True), RewardScale(1, bounds_sums=False)
        truncated, left = {"done": True, "truncated": True}, {}
        walked = [(0, {}), (1, {}), (2, {"done": True}), (3, left), (5, {}), (6, truncated)]
        walked += [(0, {}), (1, truncated), (2, {})]
        for x, how in walked:
            add(buffer, x, reward=float(x), **how)
            bonus = np.array([worth(x)], dtype=np.float64)
            bonus_scale.learn(bonus, gamma=0.9)
            scale.learn(x + 0.5 * bonus_scale.scaled(bonus), gamma=0.9)
            scale.end(np.array([how is left or "done" in how]))
        buffer.train_bonus()
        sample = buffer.sample(100)
        x = sample.observations.numpy()[:, 0].astype(np.float64)
        expected = scale.scaled(x + 0.5 * bonus_scale.scaled(worth(x)))
        np.testing.assert_allclose(sample.rewards[:, 0], expected, rtol=1e-5)

    def test_a_vec_normalize_scales_rewards_or_the_buffer_does(self):
        buffer = make_buffer(norm_reward=True)
        add(buffer, 1)
        venv = VecNormalize(DummyVecEnv([Count]))
        with pytest.raises(ValueError, match="`norm_reward` must be False of the buffer or of"):
            buffer.sample(1, venv)
        venv.norm_reward = False
        buffer.sample(1, venv)

    def test_each_transition_is_scored_once_until_the_next(self, monkeypatch):
        buffer = make_buffer(40, extrinsic=False, n_envs=2, train_interval=8)
        score, scored = Weighted.score, []
        monkeypatch.setattr(
            Weighted,
            "score",
            lambda self, before, *rest: scored.extend(before) or score(self, before, *rest),
        )
        for round in range(1, 4):
            buffer.bonus.factor = float(round)  # as of a bonus that has learned
            walk(buffer, 4)
            for n in (16, 500):
                sample = buffer.sample(n)
                x, after = sample.observations, sample.next_observations
                assert th.allclose(sample.rewards, 0.5 * round * (2 * x + x / 100 + 4 * after))
            scored.clear()
            buffer.sample(500)
            assert not scored

    def test_what_comes_in_the_place_of_another_is_scored(self):
        buffer = make_buffer(5, extrinsic=False, train_interval=4)
        for x in range(4):
            add(buffer, x)
        buffer.train_interval = 100
        for x in (4, 5, 50, 6, 7, 8):  # an episode is left, so that 5 leads nowhere
            add(buffer, x)
            sample = buffer.sample(64)
            before, after = sample.observations, sample.next_observations
            bonus = 2 * before + before + 4 * after
            assert th.allclose(sample.rewards, 0.5 * bonus)

    @pytest.mark.parametrize("bonus", BONUSES)
    def test_what_was_scored_before_is_what_is_scored_now(self, bonus):
        settings = {"bonus": bonus, "gamma": 0.9, "train_interval": 64, "extrinsic": False}
        buffer = make_buffer(300, spaces.Box(-1, 1, (5,)), **settings)
        rng = np.random.default_rng(0)
        for _ in range(200):
            seen, then = rng.uniform(-1, 1, (2, 1, 5)).astype(np.float32)
            buffer.add(seen, then, rng.uniform(-1, 1, (1, 1)), np.zeros(1), np.zeros(1), [{}])
        for _ in range(4):
            buffer.sample(50)
        twin = copy.deepcopy(buffer)
        twin.scored_at[:] = 0
        for _ in range(4):
            one, other = (each.sample(128).rewards for each in (buffer, twin))
            np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"action_space": spaces.MultiBinary(3)}, "action"),
        ({"observation_space": spaces.Tuple([OBSERVATIONS])}, "policies take"),
        ({"observation_key": "x"}, "`observation_key` must be None"),
        ({"optimize_memory_usage": True}, "`optimize_memory_usage` must be False"),
    ],
)
def test_bad_settings_are_named(settings, said):
    with pytest.raises(ValueError, match=said):
        make_buffer(**settings)


@pytest.mark.parametrize(
    ("holder", "arguments"),
    [(BonusReplayBuffer, (9, OBSERVATIONS, None)), (BonusVecEnvWrapper, (None,))],
)
def test_unknown_keywords_are_told_the_nearest(holder, arguments):
    said = rf"^{holder.__name__} got an unexpected keyword argument 'wieght': did you mean weight\?"
    with pytest.raises(TypeError, match=said):
        holder(*arguments, wieght=1.0)


def test_one_bonus_is_enough():
    venv = BonusVecEnvWrapper(DummyVecEnv([lambda: gym.make("Pendulum-v1")]), bonus="rnd")
    sac = stable_baselines3.SAC
    model = sac("MlpPolicy", venv, replay_buffer_class=BonusReplayBuffer, buffer_size=100)
    with pytest.raises(ValueError, match="`env` must have no BonusVecEnvWrapper"):
        model.learn(2)


def test_observations_of_another_dtype_are_those_that_are_held():
    """As SubprocVecEnv hands on what an environment returns in float64."""
    buffer = make_buffer()
    rows = np.random.default_rng(0).normal(size=(6, 1, 1))
    for before, after in pairwise(rows):
        buffer.add(before, after, before, np.zeros(1), np.zeros(1), [{}])
    assert not buffer.dones.any()
    buffer.add(rows[0], rows[1], rows[0], np.zeros(1), np.zeros(1), [{}])
    assert buffer.dones[:6, 0].tolist() == [0, 0, 0, 0, 1, 0]


def batches(space, n_envs, n_steps):
    """Observations as a vector environment gives them, step by step."""
    space.seed(3)
    for _ in range(n_steps):
        rows = [space.sample() for _ in range(n_envs)]
        empty = gym.vector.utils.create_empty_array(space, n_envs)
        yield gym.vector.utils.concatenate(space, rows, empty)


def rows_of(space, batch):
    return list(gym.vector.utils.iterate(gym.vector.utils.batch_space(space, 1), batch))


@pytest.mark.parametrize("name", OFF_POLICY)
class TestOtherSpaces:
    def fill(self, space, n_steps, *buffers):
        seen = list(batches(space, buffers[0].n_envs, n_steps + 1))
        zeros = np.zeros(buffers[0].n_envs)
        for step, (before, after) in enumerate(pairwise(seen)):
            for buffer in buffers:
                action = np.full((buffer.n_envs, 1), step / 10, np.float32)
                given = before, after, action, zeros + step, zeros
                buffer.add(*copy.deepcopy(given), [{}] * buffer.n_envs)  # SB3's changes it
        return seen

    @pytest.mark.parametrize("n_envs", [1, 4])
    def test_samples_are_sb3s_own(self, name, n_envs, assert_same):
        space, _ = OFF_POLICY[name]
        kind = DictReplayBuffer if isinstance(space, spaces.Dict) else ReplayBuffer
        theirs = kind(40, space, ACTIONS, "cpu", n_envs)
        ours = make_buffer(40, space, n_envs=n_envs)
        ours.bonus.factor = 0.0
        self.fill(space, 14, theirs, ours)  # beyond what the four hold
        for key in space if isinstance(space, spaces.Dict) else (Ellipsis,):
            for column in ("observations", "next_observations"):
                held = [getattr(buffer, column)[key] for buffer in (ours, theirs)]
                np.testing.assert_array_equal(*held)
        drawn = copy.deepcopy(ours)._draw(30)
        sample, theirs_sample = ours.sample(30), _at(theirs, *np.divmod(drawn, n_envs))
        assert type(sample) is type(theirs_sample)
        assert_same(sample[:5], theirs_sample[:5])

    def test_the_bonus_sees_vectors(self, name):
        space, _ = OFF_POLICY[name]
        buffer = make_buffer(40, space, n_envs=4)
        seen = self.fill(space, 5, buffer)
        flat = [
            [spaces.flatten(space, row) for step in steps for row in rows_of(space, step)]
            for steps in (seen[:-1], seen[1:])
        ]
        before, _, after = newest(buffer, 5)
        for shown, expected in zip((before, after), flat, strict=True):
            assert shown.dtype == np.float32
            np.testing.assert_array_equal(shown, np.array(expected, dtype=np.float32))


def _at(buffer, rows, envs):
    """What SB3's own buffer samples where it draws these."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(np.random, "randint", lambda *_, **__: envs)
        return buffer._get_samples(rows)


def test_the_bonus_may_see_one_entry():
    space, _ = OFF_POLICY["task"]
    buffer = make_buffer(40, space, observation_key="achieved_goal")
    seen = TestOtherSpaces().fill(space, 3, buffer)
    before, _, _ = newest(buffer, 3)
    expected = np.concatenate([each["achieved_goal"] for each in seen[:-1]])
    np.testing.assert_array_equal(before, expected.astype(np.float32))


def test_entries_of_a_dictionary_must_be_finite():
    space, _ = OFF_POLICY["task"]
    buffer = make_buffer(40, space)
    good = next(batches(space, 1, 1))
    bad = {**good, "achieved_goal": np.full((1, 2), np.nan)}
    for before, after in [(good, bad), (bad, good)]:
        with pytest.raises(ValueError, match="`env` must give finite observations"):
            buffer.add(before, after, np.zeros((1, 1)), np.zeros(1), np.zeros(1), [{}])
    assert buffer.size() == 0


# -- with the algorithms of others ----------------------------------------------------------------

CONTINUOUS = dict.fromkeys(("SAC", "TD3", "TQC"), "Pendulum-v1")
ALGORITHMS = {**CONTINUOUS, "DQN": "CartPole-v1"}


def make_model(name, envs=2, policy="MlpPolicy", **settings):
    library = sb3_contrib if name == "TQC" else stable_baselines3
    algorithm = getattr(library, name)
    kwargs = {"train_interval": 32, "n_updates": 2, "batch_size": 16, **settings}
    return algorithm(
        policy,
        make_vec_env(ALGORITHMS[name], envs, seed=0) if isinstance(envs, int) else envs,
        learning_starts=40,
        batch_size=16,
        seed=0,
        device="cpu",
        policy_kwargs={"net_arch": [8]},
        replay_buffer_class=BonusReplayBuffer,
        replay_buffer_kwargs={"bonus": "rnd", **kwargs},
    )


def weights(model):
    return th.cat([each.flatten() for each in model.policy.parameters()])


@pytest.mark.parametrize("name", ["numbers", "task"])
def test_a_loaded_model_goes_on_bit_for_bit(name, tmp_path):
    """With its environments and generators as they stood, which SB3's files leave out."""
    algorithm, actions, policy, n_steps = "DQN", spaces.Discrete(3), "MlpPolicy", 64
    if name == "task":
        algorithm, actions, policy = "SAC", None, "MultiInputPolicy"
    envs = DummyVecEnv([lambda: Toy(name, copy.deepcopy(actions))] * 4)
    model = make_model(algorithm, envs, policy, bonus="apt").learn(n_steps)
    model.save(tmp_path / "model")
    model.replay_buffer.save(tmp_path / "buffer.npz")
    envs, choices = copy.deepcopy(model.get_env()), copy.deepcopy(model.action_space)
    torch_state, numpy_state = th.get_rng_state(), np.random.get_state()  # noqa: NPY002  # SB3's
    model.learn(n_steps, reset_num_timesteps=False)

    twin = type(model).load(tmp_path / "model", envs, force_reset=False, device="cpu")
    twin.replay_buffer.restore(tmp_path / "buffer.npz")
    twin.action_space = choices
    th.set_rng_state(torch_state)
    np.random.set_state(numpy_state)  # noqa: NPY002
    twin.learn(n_steps, reset_num_timesteps=False)
    assert th.equal(weights(model), weights(twin))
    assert model.replay_buffer.metrics == twin.replay_buffer.metrics != {}
    assert model.num_timesteps == twin.num_timesteps == 2 * n_steps


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"bonus": "icm"}, "'bonus': 'icm', .* is of {'bonus': 'rnd',"),
        ({"bonus_kwargs": {"hidden": 8}}, "'hidden': 8}, .* is of .*'bonus_kwargs': {},"),
        ({"n_envs": 2}, "'n_envs': 2.* is of .*'n_envs': 1"),
    ],
)
def test_a_file_of_other_settings_changes_nothing(other, message, tmp_path):
    settings = {"bonus": "rnd", "gamma": 0.9, "train_interval": 8}
    buffer, twin = make_buffer(20, **settings), make_buffer(20, **(settings | other))
    walk(buffer, 10)
    buffer.save(tmp_path / "buffer.npz")
    before = copy.deepcopy(twin.state_dict())
    with pytest.raises(ValueError, match=f"`path` must be saved of .*{message}"):
        twin.restore(tmp_path / "buffer.npz")
    assert str(twin.state_dict()) == str(before)


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("settings.made", {}),
        ("settings.now", {"sample": "x"}),
        ("settings.now.weight", -1),
        ("state.curiosity.n_untrained", 1.5),
        ("state.rng", '{"bit_generator": "PCG64"}'),
        ("state.transitions", None),
        ("state.transitions.pos", 1.5),
    ],
)
def test_a_damaged_file_changes_nothing(entry, value, tmp_path):
    buffer, twin = (make_buffer(64, bonus="rnd", train_interval=8, seed=i) for i in range(2))
    walk(buffer, 40)
    walk(twin, 9)
    buffer.weight = 0.5
    buffer.save(tmp_path / "buffer.npz")
    with_entry(tmp_path / "buffer.npz", "BonusReplayBuffer", entry, value)
    before = copy.deepcopy((twin.state_dict(), twin.settings))
    with pytest.raises(ValueError, match=r"^`path` must be saved of a buffer with .*buffer\.npz"):
        twin.restore(tmp_path / "buffer.npz")
    assert str((twin.state_dict(), twin.settings)) == str(before)
