"""Transitions over several steps, against plain loops."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from curiosity_algos.bonuses.spans import RecentSteps
from curiosity_algos.bonuses.transitions import draw_steps


def rng(seed=0):
    return np.random.default_rng(seed)


class TestDrawSteps:
    def test_they_are_log_uniform(self):
        steps = draw_steps(rng(), (200_000,), 100)
        assert (steps.min(), steps.max()) == (1, 100)
        for low, high in [(1, 1), (2, 3), (10, 19), (50, 100)]:
            share = np.mean((steps >= low) & (steps <= high))
            assert share == pytest.approx(np.log((high + 1) / low) / np.log(101), rel=0.03)

    def test_one_step_draws_nothing(self):
        generator = rng()
        assert draw_steps(generator, (2, 3), 1).tolist() == [[1] * 3] * 2
        assert generator.random() == rng().random()


def make_steps(horizon=5, n_actions=2, seed=0):
    return RecentSteps(2, horizon, (1,), np.float32, n_actions, seed=np.random.SeedSequence(seed))


class TestRecentSteps:
    @given(
        horizon=st.integers(1, 6),
        ends=st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=25),
    )
    def test_they_are_of_one_episode_and_end_now(self, horizon, ends):
        steps, began = make_steps(horizon), np.zeros(2, dtype=int)
        for t, dones in enumerate(ends):
            steps.add(np.full((2, 1), t, dtype=np.float32), np.full((2, 2), t / 8))
            observations, actions = steps.draw()
            firsts = observations[:, 0].astype(int)
            assert (firsts >= np.maximum(began, t - horizon + 1)).all()
            assert (firsts <= t).all()
            np.testing.assert_array_equal(actions, observations.repeat(2, axis=1) / 8)
            steps.end(np.array(dones))
            began[np.array(dones)] = t + 1

    def test_all_lengths_occur(self):
        steps, drawn = make_steps(), set()
        for t in range(300):
            steps.add(np.full((2, 1), t, dtype=np.float32), np.zeros((2, 2)))
            drawn |= set((t + 1 - steps.draw()[0][:, 0]).astype(int))
        assert drawn == {1, 2, 3, 4, 5}

    def test_it_goes_on_where_it_was(self):
        one, other = make_steps(), make_steps(seed=1)
        for t in range(7):
            one.add(np.full((2, 1), t, dtype=np.float32), np.full((2, 2), t))
        one.end(np.array([True, False]))
        other.load_state_dict(one.state_dict())
        for t in range(7, 20):
            for steps in (one, other):
                steps.add(np.full((2, 1), t, dtype=np.float32), np.full((2, 2), t))
            np.testing.assert_equal(one.draw(), other.draw())
