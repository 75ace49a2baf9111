import io
from contextlib import nullcontext
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from curiosity_algos import ICM
from curiosity_algos.sb3 import replay_buffer as module
from curiosity_algos.sb3.replay_buffer import CuriosityReplayBuffer

OBSERVATIONS, ACTIONS = spaces.Box(-9, 9, (1,)), spaces.Box(-1, 1, (1,))


class Weighted:
    """What a transition is worth tells all three parts apart, times a factor that tests change."""

    name = "weighted"
    factor = 1.0

    def score(self, observations, actions, next_observations):
        parts = 2 * observations + 10 * actions + 4 * next_observations
        return self.factor * parts[:, 0]


def worth(x):
    """What Weighted says of `add`'s step from x: 2 x + x + 4 (x + 1)."""
    return 7 * x + 4


def make_buffer(capacity=10, extrinsic=True, seed=0, action_space=ACTIONS):
    return CuriosityReplayBuffer(
        capacity,
        OBSERVATIONS,
        action_space,
        bonus=Weighted(),
        weight=0.5,
        extrinsic=extrinsic,
        seed=np.random.SeedSequence(seed),
        device=th.device("cpu"),
    )


def add(buffer, x, reward=0.0, done=False, truncated=False):
    """A step from x to x + 1."""
    row = np.full((1, 1), x, dtype=np.float32)
    info = {"TimeLimit.truncated": truncated}
    buffer.add(row, row + 1, row / 10, np.array([reward]), np.array([done]), [info])


class TestSamples:
    def test_rewards_are_of_now(self):
        buffer = make_buffer()
        add(buffer, 1, reward=10.0)
        for buffer.bonus.factor in (1.0, 3.0, 0.0):
            (reward,) = buffer.sample(1).rewards.numpy()
            assert reward == pytest.approx(10.0 + 0.5 * worth(1) * buffer.bonus.factor)

    def test_the_reward_of_the_task_may_not_count(self):
        buffer = make_buffer(extrinsic=False)
        add(buffer, 1, reward=10.0)
        assert buffer.sample(1).rewards.item() == pytest.approx(0.5 * worth(1))

    def test_rows_belong_together(self):
        buffer = make_buffer()
        for x in range(7):
            add(buffer, x, reward=100.0 * x)
        sample = buffer.sample(50)
        x = sample.observations
        assert x.unique().tolist() == list(range(7))
        assert th.equal(sample.next_observations, x + 1)
        assert th.allclose(sample.actions, x / 10)
        assert th.allclose(sample.rewards, 100 * x + 0.5 * worth(x))

    def test_those_drawn_ahead_are_the_same(self, monkeypatch):
        monkeypatch.setattr(module, "N_SCORED", 20)  # four of the batches
        n_batches = 11
        buffers = make_buffer(), make_buffer()
        for buffer in buffers:
            for x in range(7):
                add(buffer, x, reward=100.0 * x)
        one_by_one = [buffers[0].sample(5) for _ in range(n_batches + 2)]
        with buffers[1].drawn_ahead(n_batches, 5):
            ahead = [buffers[1].sample(5) for _ in range(n_batches)]
        ahead += [buffers[1].sample(5) for _ in range(2)]
        for one, other in zip(one_by_one, ahead, strict=True):
            assert all(map(th.equal, one[:5], other[:5]))

    @pytest.mark.parametrize(
        ("shape", "batch_size", "n_rows"),
        [((1,), 128, 2048), ((1,), 100, 2000), ((1,), 4096, 4096), ((8, 8, 3), 32, 32)],
    )
    def test_so_many_are_scored_at_once(self, shape, batch_size, n_rows):
        scored = []
        bonus = SimpleNamespace(
            score=lambda seen, *_: scored.append(len(seen)) or np.zeros(len(seen))
        )
        buffer = CuriosityReplayBuffer(
            4,
            spaces.Box(0, 255, shape, np.uint8),
            ACTIONS,
            bonus=bonus,
            weight=0.5,
            extrinsic=True,
            seed=np.random.SeedSequence(0),
            device=th.device("cpu"),
        )
        row = np.zeros((1, *shape), np.uint8)
        buffer.add(row, row, np.zeros((1, 1)), np.zeros(1), np.zeros(1), [{}])
        with buffer.drawn_ahead(100, batch_size):
            buffer.sample(batch_size)
        assert scored == [n_rows]

    @pytest.mark.parametrize("batch_size", [128, 256, 1024])
    def test_the_icm_has_the_same_bits_ahead(self, batch_size):
        space = spaces.Box(-9, 9, (5,))
        rewards = []
        for together in (False, True):
            buffer = CuriosityReplayBuffer(
                500,
                space,
                ACTIONS,
                bonus=ICM(space, ACTIONS, seed=0, device="cpu"),
                weight=0.5,
                extrinsic=False,
                seed=np.random.SeedSequence(0),
                device=th.device("cpu"),
            )
            rng = np.random.default_rng(1)
            for _ in range(300):
                seen, then = rng.normal(size=(2, 1, 5)).astype(np.float32)
                buffer.add(seen, then, rng.uniform(size=(1, 1)), np.zeros(1), np.zeros(1), [{}])
            with buffer.drawn_ahead(20, batch_size) if together else nullcontext():
                rewards.append([buffer.sample(batch_size).rewards for _ in range(20)])
        assert all(map(th.equal, *rewards))

    def test_what_was_drawn_ahead_is_left_where_training_ends_early(self):
        buffer = make_buffer(extrinsic=False)
        add(buffer, 1)
        with buffer.drawn_ahead(4, 1):
            buffer.sample(1)
        buffer.bonus.factor = 3.0
        assert buffer.sample(1).rewards.item() == pytest.approx(1.5 * worth(1))

    def test_values_stop_at_terminations_alone(self):
        buffer = make_buffer()
        add(buffer, 0)
        add(buffer, 1, done=True, truncated=True)
        add(buffer, 2, done=True)
        sample = buffer.sample(50)
        assert th.equal(sample.dones, (sample.observations == 2).float())

    def test_the_oldest_go(self):
        buffer = make_buffer(capacity=3)
        for x in range(5):
            add(buffer, x)
        assert buffer.sample(50).observations.unique().tolist() == [2, 3, 4]

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


@pytest.mark.parametrize(
    ("step", "name"),
    [({"x": np.nan}, "observations"), ({"x": 1, "reward": np.inf}, "rewards")],
)
def test_what_is_not_finite_is_not_kept(step, name):
    buffer = make_buffer()
    with pytest.raises(ValueError, match=f"`env` must give finite {name}"):
        add(buffer, **step)
    assert buffer.size() == 0


def test_transitions_for_the_bonus_come_as_tensors():
    buffer = make_buffer()
    for x in range(3):
        add(buffer, x)
    observations, actions, next_observations = buffer.sample_transitions(20)
    assert observations.shape == actions.shape == (20, 1)
    assert th.allclose(actions, observations / 10)
    assert th.equal(next_observations, observations + 1)


class TestSpans:
    """Transitions over several steps, of a bonus that has a horizon."""

    def spans(self, buffer, n=400, horizon=4):
        buffer.bonus.horizon = horizon
        observations, actions, next_observations = buffer.sample_transitions(n)
        begins, ends = observations[:, 0].int(), next_observations[:, 0].int()
        assert th.allclose(actions, observations / 10)
        return set(zip(begins.tolist(), ends.tolist(), strict=True))

    def test_they_stay_within_an_episode(self):
        buffer = make_buffer()
        for x in range(6):
            add(buffer, x, done=x == 2, truncated=x == 2)
        first = {(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)}
        assert self.spans(buffer) == first | {(x + 3, y + 3) for x, y in first}

    def test_they_stop_where_an_episode_was_left(self):
        buffer = make_buffer()
        for x in (0, 1, 2, 10, 11):
            add(buffer, x)
        begins = {0: 3, 1: 3, 2: 3, 10: 12, 11: 12}
        assert {end for _, end in self.spans(buffer)} == {1, 2, 3, 11, 12}
        assert all(end <= begins[begin] for begin, end in self.spans(buffer))
        assert not buffer.sample(100).dones.any()  # its value goes on

    def test_they_do_not_go_from_the_newest_to_the_oldest(self):
        buffer = make_buffer(capacity=4)
        for x in range(6):
            add(buffer, x)
        assert {end - begin for begin, end in self.spans(buffer)} == {1, 2, 3, 4}

    def test_a_horizon_is_the_most(self):
        buffer = make_buffer()
        for x in range(9):
            add(buffer, x)
        assert {end - begin for begin, end in self.spans(buffer, horizon=2)} == {1, 2}


@pytest.mark.parametrize(("n", "expected"), [(2, [3, 4]), (3, [2, 3, 4]), (9, [2, 3, 4])])
def test_the_newest_come_in_order(n, expected):
    buffer = make_buffer(capacity=3)
    for x in range(5):
        add(buffer, x)
    observations, actions, next_observations = buffer.newest(n)
    assert observations.ravel().tolist() == expected
    np.testing.assert_allclose(actions, observations / 10)
    np.testing.assert_array_equal(next_observations, observations + 1)


def test_the_newest_of_a_young_buffer():
    buffer = make_buffer()
    add(buffer, 4)
    assert buffer.newest(3)[0].ravel().tolist() == [4]


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
    assert buffer.newest(3)[1].ravel().tolist() == [2.0, 6.0, 8.0]
    before, actions, _ = buffer.sample_transitions(20)
    assert actions.ravel().tolist() == [taken[x] for x in before.ravel().tolist()]


class TestState:
    @pytest.mark.parametrize("n_added", [0, 2, 3, 5])
    def test_draws_and_additions_go_on(self, n_added):
        buffer, other, file = make_buffer(3), make_buffer(3, seed=1), io.BytesIO()
        for x in range(n_added):
            add(buffer, x, reward=x, done=x % 2, truncated=x % 3 == 0)
        if n_added:
            buffer.sample(5)
        th.save(buffer.state_dict(), file)
        file.seek(0)
        other.load_state_dict(th.load(file, weights_only=True))
        for each in (buffer, other):
            for x in range(7, 9):
                add(each, x)
        for one, twin in zip(buffer.sample(20), other.sample(20), strict=True):
            assert one is twin is None or th.equal(one, twin)
        assert (buffer.pos, buffer.full) == (other.pos, other.full)

    def test_only_what_is_held_is_saved(self):
        buffer = make_buffer(capacity=1000)
        add(buffer, 1)
        state = buffer.state_dict()
        assert state["buffer"]["observations"].shape == (1, 1, 1)
        add(buffer, 2)
        assert state["buffer"]["pos"] == 1

    def test_transitions_may_stay_out(self):
        buffer, other = make_buffer(), make_buffer(seed=1)
        add(buffer, 1)
        state = buffer.state_dict()
        del state["buffer"]
        other.load_state_dict(state)
        assert other.size() == 0
        add(other, 1)
        buffer.sample(3)
        other.sample(3)
        assert buffer.state_dict()["rng"] == other.state_dict()["rng"]
