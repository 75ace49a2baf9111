import pickle

import numpy as np
import pytest
from padded_rollouts import LENGTHS, N_OBSERVATIONS, make_rollouts, only

from curiosity_algos.bonuses.transitions import (
    DrawnTransitions,
    EvenlySpaced,
    draw_transitions,
)


def sample(rollouts, n, seed, horizon=1):
    """N transitions of each individual."""
    drawn = draw_transitions(np.random.default_rng(seed), len(rollouts), n, horizon)
    return drawn(rollouts, slice(0, len(rollouts)))


class TestDrawnTransitions:
    @pytest.mark.parametrize("is_discrete", [False, True])
    def test_they_are_consecutive_states_of_the_own_episode(self, is_discrete):
        rollouts = make_rollouts(is_discrete)
        drawn = sample(rollouts, 60, 0)
        n = len(LENGTHS)
        assert [part.shape for part in drawn] == [
            (n, 60, N_OBSERVATIONS),
            (n, 60) if is_discrete else (n, 60, 2),
            (n, 60, N_OBSERVATIONS),
        ]
        assert [part.dtype for part in drawn] == [
            np.float32,
            rollouts.actions.dtype,
            np.float32,
        ]
        for i, length in enumerate(LENGTHS):
            times = []
            for observation, action, following in zip(*(part[i] for part in drawn), strict=True):
                is_here = (rollouts.observations[i, :length] == observation).all(axis=1)
                times.append(np.flatnonzero(is_here).item())
                np.testing.assert_array_equal(action, rollouts.actions[i, times[-1]])
                np.testing.assert_array_equal(following, rollouts.observations[i, times[-1] + 1])
            assert set(times) == set(range(length))

    @pytest.mark.parametrize("is_discrete", [False, True])
    def test_spans_end_with_their_episode(self, is_discrete):
        rollouts, horizon = make_rollouts(is_discrete), 4
        drawn = sample(rollouts, 2000, 0, horizon)
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
