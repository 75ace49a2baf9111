"""Starts along demonstrations, restored and replayed."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor
from walk import Right, Walk

from curiosity_algos.robust.demonstrations import demonstrate
from curiosity_algos.robust.starts import FRESH, N_SUCCESSES, DemonstrationStarts
from curiosity_algos.sb3.gymnasium_vec_env import GymnasiumVecEnv
from curiosity_gym import MazeLayout, RecordEpisode
from curiosity_gym.maze.maze_env import MazeEnv, MazeVectorEnv

EASY = MazeLayout("corridor", 40, 6, (8, 3), (25, 3), [])
N = 6


class Walks:
    def demonstration(self):
        return demonstrate(Right(), Walk(), seed=3)

    def venv(self):
        return DummyVecEnv([lambda: RecordEpisode(Walk())] * N)


class Mazes:
    def demonstration(self):
        class Ahead:
            def predict(self, observation, deterministic=True):
                return np.array([0.7, 0.0], np.float32), None

        return demonstrate(Ahead(), MazeEnv(EASY, horizon=60), seed=0)

    def venv(self):
        mode = AutoresetMode.SAME_STEP
        return GymnasiumVecEnv(MazeVectorEnv(EASY, horizon=60, num_envs=N, autoreset_mode=mode))


@pytest.fixture(params=[Walks(), Mazes()], ids=["replayed", "restored"])
def kind(request):
    return request.param


def make(kind, **settings):
    return DemonstrationStarts(kind.venv(), [kind.demonstration()], **{"seed": 0} | settings)


def play(starts, n_steps, act):
    """Take steps by a function of the step that each env is at along the demonstration."""
    (demonstration,) = starts.demonstrations
    observations, steps, ended = starts.reset(), starts._begun[:, 1].copy(), []
    for _ in range(n_steps):
        actions = np.stack([act(demonstration, step) for step in steps])
        observations, rewards, dones, infos = starts.step(actions)
        steps = np.where(dones, starts._begun[:, 1], steps + 1)
        ended += [(rewards[i], infos[i]["is_success"]) for i in np.flatnonzero(dones)]
    return observations, ended


def test_a_start_is_a_state_of_the_demonstration_bit_for_bit(kind):
    starts = make(kind, fresh=0.0)
    (demonstration,) = starts.demonstrations
    seen = np.stack(demonstration.observations)
    np.testing.assert_array_equal(starts.reset(), seen[starts._begun[:, 1]])

    def go_on(demonstration, step):
        return demonstration.actions[step]

    _, ended = play(starts, 3, go_on)
    assert len(ended) >= N
    assert ended == [(np.float32(demonstration.total), True)] * len(ended)


def test_the_front_moves_back_as_episodes_succeed_and_then_all_starts_are_fresh(kind):
    starts = make(kind, fresh=0.0)
    begun = int(starts.fronts[0])
    play(starts, 40, lambda demonstration, step: demonstration.actions[step])
    assert 0 <= starts.fronts[0] < begun
    starts.fronts[:] = 0
    starts.reset()
    assert (starts._begun == FRESH).all()
    assert starts.is_free
    play(starts, 1, lambda demonstration, step: demonstration.actions[0])
    assert (starts.free_steps, starts.good_steps) == (N, 0)
    starts.fresh_results.extend([True] * 30)
    play(starts, 1, lambda demonstration, step: demonstration.actions[0])
    assert (starts.free_steps, starts.good_steps) == (2 * N, N)


def test_it_stays_where_episodes_fail():
    starts = make(Walks(), fresh=0.0)
    begun = int(starts.fronts[0])
    _, ended = play(starts, 70, lambda demonstration, step: -demonstration.actions[0])
    assert not any(success for _, success in ended)
    assert starts.fronts[0] == begun


def test_fresh_starts_that_succeed_need_no_demonstration(kind):
    starts = make(kind)
    starts.fresh_results.extend([True] * N_SUCCESSES)
    starts._move()
    assert starts.is_free


def test_fresh_starts_of_replayed_episodes_differ():
    starts = make(Walks(), fresh=1.0)
    starts.fronts[:] = 0
    first, again = starts.reset().copy(), starts.reset()
    assert len(np.unique([*first[:, 0], *again[:, 0]])) == 2 * N


def test_a_state_goes_on_with_the_same_draws(kind, assert_same):
    one, twin = make(kind, seed=0), make(kind, seed=1)
    play(one, 30, lambda demonstration, step: demonstration.actions[0])
    twin.load_state_dict(one.state_dict())
    assert_same(one.state_dict(), twin.state_dict())
    assert [one._draw() for _ in range(20)] == [twin._draw() for _ in range(20)]


def test_mistakes_are_one_sentence():
    demonstration = demonstrate(Right(), Walk(), seed=3)
    with pytest.raises(ValueError, match="`demonstrations` must hold at least one"):
        DemonstrationStarts(Walks().venv(), [])
    with pytest.raises(ValueError, match="`venv` must be a GymnasiumVecEnv"):
        DemonstrationStarts(VecMonitor(Walks().venv()), [demonstration])
    with pytest.raises(ValueError, match=r"one of return .* came to"):
        DemonstrationStarts(Mazes().venv(), [demonstrate_backwards()])


def demonstrate_backwards():
    ahead = Mazes().demonstration()
    return type(ahead)(ahead.start, -ahead.actions, ahead.observations, ahead.total, success=True)
