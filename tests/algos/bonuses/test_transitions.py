import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from padded_rollouts import LENGTHS, N_OBSERVATIONS, make_rollouts, only

from curiosity_algos.bonuses.transitions import (
    DrawnTransitions,
    EvenlySpaced,
    RecentSteps,
    draw_steps,
    draw_transitions,
)


def sample(rollouts, n, seed, horizon=1):
    """N transitions of each individual."""
    drawn = draw_transitions(np.random.default_rng(seed), len(rollouts), n, horizon)
    return drawn(rollouts, slice(0, len(rollouts)))


class TestDrawnTransitions:
    @pytest.mark.parametrize("is_discrete", [False, True])
    @pytest.mark.parametrize("horizon", [1, 4])
    def test_spans_end_with_their_episode(self, is_discrete, horizon):
        rollouts, n = make_rollouts(is_discrete), len(LENGTHS)
        drawn = sample(rollouts, 2000, 0, horizon)
        ends, actions = (n, 2000, N_OBSERVATIONS), (n, 2000) if is_discrete else (n, 2000, 2)
        assert [part.shape for part in drawn] == [ends, actions, ends]
        assert [part.dtype for part in drawn] == [np.float32, rollouts.actions.dtype, np.float32]
        for i, length in enumerate(LENGTHS):
            spans = set()
            for before, action, after in zip(*(part[i] for part in drawn), strict=True):
                begin, end = (
                    np.flatnonzero((rollouts.observations[i] == each).all(axis=1)).item()
                    for each in (before, after)
                )
                np.testing.assert_array_equal(action, rollouts.actions[i, begin])
                spans.add((begin, end))
            assert spans == {
                (begin, end)
                for begin in range(length)
                for end in range(begin + 1, min(begin + horizon, length) + 1)
            }

    def test_the_last_step_is_the_highest_that_a_place_can_be(self):
        rollouts = make_rollouts()
        places = np.full((len(LENGTHS), 1), np.nextafter(1.0, 0.0))
        last = DrawnTransitions(places, np.ones_like(places, dtype=np.int64))
        _, _, after = last(rollouts, slice(0, len(LENGTHS)))
        np.testing.assert_array_equal(after[:, 0], rollouts.final_observations)

    @pytest.mark.parametrize("horizon", [1, 4])
    def test_parts_of_a_population_have_their_own(self, horizon):
        rollouts = make_rollouts()
        drawn = draw_transitions(np.random.default_rng(0), len(LENGTHS), 30, horizon)
        whole = drawn(rollouts, slice(0, len(LENGTHS)))
        for read in (drawn, pickle.loads(pickle.dumps(drawn))):
            parts = [read(only(rollouts, each), each) for each in (slice(0, 2), slice(2, 5))]
            for name, joined in zip(
                whole, map(np.concatenate, zip(*parts, strict=True)), strict=True
            ):
                np.testing.assert_array_equal(joined, name)


def test_evenly_spaced_ones_end_with_the_last_step():
    rollouts, n = make_rollouts(), 4
    before, actions, after = EvenlySpaced(n)(rollouts, slice(0, len(LENGTHS)))
    for i, length in enumerate(LENGTHS):
        ends = [-(-j * length // n) for j in range(1, n + 1)]
        assert ends[-1] == length
        begins = [end - 1 for end in ends]
        np.testing.assert_array_equal(after[i], rollouts.observations[i, ends])
        np.testing.assert_array_equal(before[i], rollouts.observations[i, begins])
        np.testing.assert_array_equal(actions[i], rollouts.actions[i, begins])


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
