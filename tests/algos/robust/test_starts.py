"""Starts along demonstrations, restored and replayed."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor
from walk import HORIZON, Right, Walk

from curiosity_algos.robust.demonstrations import Demonstration, demonstrate
from curiosity_algos.robust.starts import FRESH, IS_FRESH, DemonstrationStarts, FreshMonitor
from curiosity_algos.sb3.gymnasium_vec_env import GymnasiumVecEnv
from curiosity_gym import MazeLayout, RecordEpisode
from curiosity_gym.maze.maze_env import MazeEnv, MazeVectorEnv

EASY = MazeLayout("corridor", 40, 6, (8, 3), (25, 3), [])
N = 6


class Walks:
    horizon = HORIZON

    def demonstration(self):
        return demonstrate(Right(), Walk(), seed=3)

    def venv(self):
        return DummyVecEnv([lambda: RecordEpisode(Walk())] * N)


class Mazes:
    horizon = 60

    def demonstration(self):
        class Ahead:
            def predict(self, observation, deterministic=True):
                return np.array([0.7, 0.0], np.float32), None

        return demonstrate(Ahead(), MazeEnv(EASY, horizon=Mazes.horizon), seed=0)

    def venv(self):
        mode = AutoresetMode.SAME_STEP
        return GymnasiumVecEnv(
            MazeVectorEnv(EASY, horizon=Mazes.horizon, num_envs=N, autoreset_mode=mode)
        )


@pytest.fixture(params=[Walks(), Mazes()], ids=["replayed", "restored"])
def kind(request):
    return request.param


def make(kind, **settings):
    return DemonstrationStarts(kind.venv(), [kind.demonstration()], **{"seed": 0} | settings)


def play(starts, n_steps, act):
    """Take steps by a function of the step that each env is at along the demonstration.

    Gives the last observations, and how episodes ended: where they had begun, their last rewards,
    and their last infos.
    """
    (demonstration,) = starts.demonstrations
    observations, steps, ended = starts.reset(), starts._begun[:, 1].copy(), []
    for _ in range(n_steps):
        begun = starts._begun[:, 1].copy()
        actions = np.stack([act(demonstration, max(0, step)) for step in steps])
        observations, rewards, dones, infos = starts.step(actions)
        steps = np.where(dones, starts._begun[:, 1], steps + 1)
        ended += [(begun[i], rewards[i], infos[i]) for i in np.flatnonzero(dones)]
    return observations, ended


def go_on(demonstration, step):
    return demonstration.actions[step]


def test_a_start_is_a_state_of_the_demonstration_bit_for_bit(kind):
    starts = make(kind, fresh=0.0)
    (demonstration,) = starts.demonstrations
    starts.rates[0, 0] = 1e-9  # no share of its own
    seen = np.stack(demonstration.observations)
    first, begun = starts.reset(), starts._begun[:, 1]
    along = begun != FRESH
    assert along.any()
    np.testing.assert_array_equal(first[along], seen[begun[along]])

    _, ended = play(starts, 3, go_on)
    returns = [(reward, info["is_success"]) for step, reward, info in ended if step != FRESH]
    assert len(returns) >= N - 2
    assert returns == [(np.float32(demonstration.total), True)] * len(returns)


def test_the_front_moves_back_as_episodes_succeed(kind):
    starts = make(kind)
    begun = int(starts.fronts[0])
    play(starts, 40, go_on)
    assert 0 <= starts.fronts[0] < begun
    assert starts.idle_steps < 40 * N


def test_all_starts_are_fresh_if_all_fresh_episodes_succeed(kind):
    starts = make(kind)
    starts.rates[:, 0] = 1.0
    starts.reset()
    assert (starts._begun == FRESH).all()
    assert starts.fronts[0] == 0


def test_a_front_that_fails_moves_forward_again(kind, monkeypatch):
    monkeypatch.setattr("curiosity_algos.robust.starts.MEMORY", 3)
    starts = make(kind)
    starts.rates[:, 5:] = 0.9
    near = starts.fronts[0]
    play(starts, 200, lambda demonstration, step: -demonstration.actions[0])
    assert starts.fronts[0] > near
    assert starts.idle_steps >= 199 * N


def test_idle_steps_are_since_a_front_moved_further_back():
    demonstration = Walks().demonstration()
    starts = DemonstrationStarts(Walks().venv(), [demonstration] * 2, seed=0)
    moves = [((5, 5), 0), ((7, 4), 0), ((5, 5), 9), ((6, 3), 0), ((8, 8), 9), ((6, 4), 0)]
    for places, idle_steps in [*moves, ((0, 0), 0), ((0, 0), 0), ((3, 3), 9)]:
        starts.rates[:] = 0.0
        starts.rates[[0, 1], places] = 0.9
        starts.idle_steps = 9
        starts._move()
        assert starts.idle_steps == idle_steps


@pytest.mark.parametrize("told", [True, False])
def test_an_episode_that_is_cut_has_failed_whatever_it_was_paid(told):
    class Paid(Walk):
        def step(self, action):
            observation, reward, terminated, truncated, info = super().step(action)
            if terminated or told:
                return observation, reward + 0.1, terminated, truncated, info
            return observation, 0.1, False, truncated, {}

    demonstration = demonstrate(Right(), Paid(), seed=3)
    venv = DummyVecEnv([lambda: RecordEpisode(Paid())] * N)
    starts = DemonstrationStarts(venv, [demonstration], seed=0)
    starts.reset()
    starts._left[:] = 1
    starts.rates[:] = 0.9
    starts.step(np.full((N, 1), -1.0, np.float32))
    assert starts.rates.min() < 0.9
    assert starts.rates.max() == 0.9


def test_starts_are_at_the_front_fresh_or_where_most_is_learned():
    starts = make(Mazes(), fresh=0.1)
    n = int(starts._n_stretches[0])
    starts.rates[0, 9:] = 1.0
    starts.rates[0, 9] = 0.5
    shares = starts._shares(0)
    assert shares.shape == (1 + n,)
    assert shares.sum() == pytest.approx(1.0)
    weights = np.array([0.02] + 3 * [0.2 * 0.8 + 0.02] + [0.5 * 0.5 + 0.02] + (n - 9) * [0.02])
    by_hand = 0.45 * weights / weights.sum()
    by_hand[0] += 0.1
    by_hand[1:5] += 0.45 / 4
    np.testing.assert_allclose(shares[[0, *range(6, 1 + n)]], by_hand)
    assert not shares[1:6].any()


def test_it_stays_where_episodes_fail():
    starts = make(Walks())
    begun = int(starts.fronts[0])
    _, ended = play(starts, 70, lambda demonstration, step: -demonstration.actions[0])
    assert not any(info["is_success"] for _, _, info in ended)
    assert starts.fronts[0] == begun


@pytest.mark.parametrize(("late", "slack"), [(1, -3), (2, 3)])
def test_an_episode_that_takes_too_long_is_truncated(kind, late, slack, monkeypatch):
    monkeypatch.setattr("curiosity_algos.robust.starts.LATE", late)
    monkeypatch.setattr("curiosity_algos.robust.starts.SLACK", slack)
    starts = make(kind, fresh=0.5)
    (demonstration,) = starts.demonstrations
    seen = np.stack(demonstration.observations)
    starts.reset()
    begun, ages, lengths = starts._begun[:, 1].copy(), np.zeros(N, dtype=int), {}
    away = np.repeat(-demonstration.actions[:1], N, axis=0)
    for _ in range(150):
        observations, _, dones, infos = starts.step(away)
        ages += 1
        for i in np.flatnonzero(dones):
            if not infos[i]["is_success"] or begun[i] == FRESH:  # one near the goal drifts there
                lengths.setdefault(begun[i], set()).add(int(ages[i]))
                assert infos[i]["TimeLimit.truncated"]
            assert not np.shares_memory(infos[i]["terminal_observation"], observations)
            if (step := starts._begun[i, 1]) != FRESH:
                np.testing.assert_array_equal(observations[i], seen[step])
        ages[dones], begun[dones] = 0, starts._begun[dones, 1]
    fresh = lengths.pop(FRESH, set())
    assert fresh == {kind.horizon}
    assert lengths or late == 2
    for step, found in lengths.items():
        allowed = late * (len(demonstration) - step) + slack
        assert found == {max(1, min(allowed, kind.horizon - step))}


def test_a_fresh_episode_without_an_end_is_cut(monkeypatch):
    class Endless(Walk):
        def step(self, action):
            observation, reward, terminated, _, info = super().step(action)
            return observation, reward, terminated, False, info

    monkeypatch.setattr("curiosity_algos.evaluation.vector.MAX_EPISODE_STEPS", 40)
    envs = DummyVecEnv([lambda: RecordEpisode(Endless())] * 2)
    starts = DemonstrationStarts(envs, [demonstrate(Right(), Endless(), 0)], fresh=1.0, seed=0)
    starts.reset()
    ended = [starts.step(-np.ones((2, 1), np.float32))[2].all() for _ in range(80)]
    assert np.flatnonzero(ended).tolist() == [39, 79]


def test_fresh_starts_of_replayed_episodes_differ():
    starts = make(Walks(), fresh=1.0)
    first, again = starts.reset().copy(), starts.reset()
    assert len(np.unique([*first[:, 0], *again[:, 0]])) == 2 * N


def test_a_state_goes_on_with_the_same_draws(kind, assert_same):
    one, twin = make(kind, seed=0), make(kind, seed=1)
    play(one, 30, lambda demonstration, step: demonstration.actions[0])
    twin.load_state_dict(one.state_dict())
    assert_same(one.state_dict(), twin.state_dict())
    np.testing.assert_array_equal(one._left, twin._left)
    assert [one._draw() for _ in range(20)] == [twin._draw() for _ in range(20)]


def test_mistakes_are_one_sentence():
    demonstration = demonstrate(Right(), Walk(), seed=3)
    with pytest.raises(ValueError, match="`demonstrations` must hold at least one"):
        DemonstrationStarts(Walks().venv(), [])
    with pytest.raises(ValueError, match="`venv` must be a GymnasiumVecEnv"):
        DemonstrationStarts(VecMonitor(Walks().venv()), [demonstration])
    for env in (gym.make("CartPole-v1"), gym.make("Pendulum-v1")):
        wrong = Demonstration(0, np.full((3, 2), 7), np.zeros((3, 2)), 1.0, success=True)
        venv = DummyVecEnv([lambda env=env: RecordEpisode(env)])
        with pytest.raises(ValueError, match="`demonstrations` must have actions of "):
            DemonstrationStarts(venv, [wrong])
    with pytest.raises(ValueError, match=r"one of return .* came to"):
        DemonstrationStarts(Mazes().venv(), [demonstrate_backwards()])


@pytest.mark.parametrize(("info", "is_refused"), [({}, True), ({"is_success": True}, False)])
def test_an_episode_must_end_with_its_reward_or_name_its_success(info, is_refused):
    class GoesOn(Walk):
        def step(self, action):
            observation, reward, _, truncated, _ = super().step(action)
            is_first = self.x >= self.goal > self.x - float(action[0])
            return observation, reward * is_first, False, truncated, info

    demonstration = demonstrate(Right(), GoesOn(), seed=3)
    assert demonstration.total > 0.0
    venv = DummyVecEnv([lambda: RecordEpisode(GoesOn())])
    if is_refused:
        with pytest.raises(ValueError, match="`env` must end an episode where it pays"):
            DemonstrationStarts(venv, [demonstration])
    else:
        DemonstrationStarts(venv, [demonstration])


def demonstrate_backwards():
    ahead = Mazes().demonstration()
    return type(ahead)(ahead.start, -ahead.actions, ahead.observations, ahead.total, success=True)


class Ending(gym.Env):
    """Episodes of two steps of the same reward, which end as it is told."""

    observation_space, action_space = Box(-1.0, 1.0, (1,)), Box(-1.0, 1.0, (1,))

    def __init__(self, reward, is_terminated, info):
        self.reward, self.is_terminated, self.info = reward, is_terminated, info

    def reset(self, **_):
        self.is_last = True
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.is_last = not self.is_last
        ends = self.is_terminated and self.is_last, not self.is_terminated and self.is_last
        return np.zeros(1, np.float32), self.reward, *ends, dict(self.info) if self.is_last else {}


@pytest.mark.parametrize(
    ("reward", "is_terminated", "info", "expected", "is_out_of_time"),
    [
        (0.25, True, {"is_success": True}, 1.5, False),  # pays as much as the demonstrations
        (2.0, True, {"is_success": True}, 4.0, False),  # pays more than they
        (0.25, True, {}, 1.5, False),  # a return above 0 is a success
        (0.25, False, {"is_success": True}, 0.5, True),  # might have gone on
        (0.25, False, {"is_success": False}, 0.5, False),  # time that is over is the end
        (0.25, False, {"is_success": False, IS_FRESH: False}, 0.5, True),  # but of fresh ones alone
        (0.25, True, {"is_success": True, IS_FRESH: False}, 1.5, False),
        (-0.5, True, {"is_success": False}, -1.0, False),
    ],
)
def test_a_learner_is_rewarded_by_success(reward, is_terminated, info, expected, is_out_of_time):
    venv = DummyVecEnv([lambda: Ending(reward, is_terminated, info)])
    monitor = FreshMonitor(venv, 0.75, scale=2.0)
    monitor.reset()
    _, before, *_ = monitor.step(np.zeros((1, 1)))
    assert before == 2.0 * reward
    _, (seen,), _, (said,) = monitor.step(np.zeros((1, 1)))
    assert seen == expected
    assert said["TimeLimit.truncated"] == is_out_of_time
    is_fresh = info.get(IS_FRESH, True)
    assert ("episode" in said) == is_fresh
    if is_fresh:
        assert said["episode"]["r"] == 2 * reward


def test_what_the_last_steps_of_demonstrations_paid_is_known(kind):
    starts = make(kind)
    (demonstration,) = starts.demonstrations
    assert starts.last_reward == pytest.approx(demonstration.total)  # it is all there is


class Paid(Walk):
    """Pays each step, too."""

    def step(self, action):
        observation, reward, *others = super().step(action)
        return observation, reward + 0.1, *others


def test_what_other_steps_paid_is_left_out():
    demonstration = demonstrate(Right(), Paid(), seed=3)
    starts = DemonstrationStarts(DummyVecEnv([lambda: RecordEpisode(Paid())]), [demonstration])
    others = 0.1 * (len(demonstration) - 1)
    assert starts.last_reward == pytest.approx(demonstration.total - others)
