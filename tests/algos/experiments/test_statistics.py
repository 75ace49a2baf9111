import math

import numpy as np
import pytest

from curiosity_algos.experiments import statistics
from curiosity_algos.experiments.statistics import (
    Interval,
    curve_interval,
    interquartile_mean,
    probability_of_improvement,
    stratified_bootstrap,
    survival,
)

pytestmark = pytest.mark.filterwarnings("error")

NAN = float("nan")


def mean(tasks):
    """Mean over tasks of the means over runs: an aggregate of a user's own."""
    return np.mean([runs.mean(axis=-1) for runs in tasks], axis=0)


def test_the_interquartile_mean_by_hand():
    for scores, expected in [
        ([1, 2, 3, 4, 5, 6, 7, 8], 4.5),  # of 8, 2 go at either end: (3 + 4 + 5 + 6) / 4
        ([100, 0, 1, 3, 2], 2.0),  # of 5, 1.25 rounded down: (1 + 2 + 3) / 3
        ([7, 1], 4.0),  # of 2, none
        ([7], 7.0),
        # A matrix has a row for each run, a list an entry for each task; all are put together:
        # of 1, 2, 3, 4, 10, 20, 30, 40 there stay (3 + 4 + 10 + 20) / 4
        (np.array([[1, 10], [2, 20], [3, 30], [4, 40]]), 9.25),
        ([[1, 2, 3, 4], [10, 20, 30, 40]], 9.25),
        ([[1, 2], (6, 5, 4, 3)], 3.5),  # of 6, 1 goes: (2 + 3 + 4 + 5) / 4
    ]:
        assert interquartile_mean(scores) == expected


class TestStratifiedBootstrap:
    def test_by_hand(self):
        # Of 0, 0 and 3, 8 of 27 resamples have no 3, and 1 of 27 has three.
        assert stratified_bootstrap([0, 0, 3], mean) == Interval(1.0, 0.0, 3.0)
        # Each of 4 draws is 1 with probability 1 / 4. Of the resamples 32 % have no 1, 95 % at
        # most 2 and 99.6 % at most 3: the percentiles are 0 / 4 and 3 / 4.
        assert stratified_bootstrap([0, 0, 0, 1], mean) == Interval(0.25, 0.0, 0.75)
        # Whatever runs are drawn within each task, one's mean is 0 and the other's 1.
        assert stratified_bootstrap([[0, 0, 0], [1, 1, 1]], mean) == Interval(0.5, 0.5, 0.5)

    def test_depends_on_the_seed_alone(self):
        scores = np.random.default_rng(0).normal(size=12)
        np.random.seed(1)  # noqa: NPY002
        one = stratified_bootstrap(scores, interquartile_mean, seed=3)
        np.random.seed(2)  # noqa: NPY002
        assert stratified_bootstrap(scores, interquartile_mean, seed=3) == one
        assert stratified_bootstrap(scores, interquartile_mean, seed=4) != one
        rng = np.random.default_rng(3)  # a generator goes on
        assert stratified_bootstrap(scores, interquartile_mean, seed=rng) == one
        assert stratified_bootstrap(scores, interquartile_mean, seed=rng) != one

    def test_of_fewer_than_three_runs_nothing_is_known(self):
        for scores in ([3], [1, 2], [[1, 2, 3], [6]], [[1, 2, 3], [4, 5]]):
            found = stratified_bootstrap(scores, mean)
            assert math.isfinite(found.estimate)
            assert math.isnan(found.low)
            assert math.isnan(found.high)


class TestProbabilityOfImprovement:
    def test_by_hand(self):
        # 1 wins against 0 alone; 2 against 0, and ties with 2; 3 wins twice: 4.5 of 6 pairs.
        assert probability_of_improvement([1, 2, 3], [2, 0]).estimate == 0.75
        # A second task of equal scores has one half: (0.75 + 0.5) / 2
        assert probability_of_improvement([[1, 2, 3], [4]], [[2, 0], [4]]).estimate == 0.625

    def test_resamples_both_within_each_task(self):
        # X is better in the first task and worse in the second, whatever is drawn.
        found = probability_of_improvement([[5, 6, 6], [0, 1, 0]], [[1, 2, 3], [7, 8, 7]])
        assert found == Interval(0.5, 0.5, 0.5)
        # Of X 8 of 27 resamples are 0 alone, and 1 of 27 is 2 alone.
        assert probability_of_improvement([0, 0, 2], [1, 1, 1]) == Interval(1 / 3, 0.0, 1.0)
        assert probability_of_improvement([1, 1, 1], [0, 0, 2]) == Interval(2 / 3, 0.0, 1.0)

    def test_tasks_are_the_same(self):
        with pytest.raises(ValueError, match="`scores_y` must have the 1 tasks of `scores_x`"):
            probability_of_improvement([1, 2], [[1, 2], [3, 4]])


class TestSurvival:
    def test_by_hand(self):
        # Of 5 runs one finds it at 1: 4 / 5. Of the other 4 one at 3: 4 / 5 * 3 / 4 = 3 / 5. The
        # third ended at 5 without it. Of the 2 that are left one at 7: 3 / 5 * 1 / 2 = 3 / 10.
        found = survival([1, 3, None, 7, None], [10, 10, 5, 10, 10])
        np.testing.assert_array_equal(found.curve.x, [0, 1, 3, 5, 7, 10])
        np.testing.assert_allclose(found.curve.estimate, [1, 0.8, 0.6, 0.6, 0.3, 0.3])
        assert found.median == 7
        at_the_end = survival([10, None], 10)  # of its budget, a reward counts
        assert at_the_end.curve.estimate.tolist() == [1.0, 0.5]
        # At 1, Greenwood's sum is 1 / (5 * 4): S^exp(-+1.96 sqrt(0.05) / ln S)
        spread = 1.959964 * math.sqrt(0.05) / math.log(0.8)
        bounds = [0.8 ** math.exp(-spread), 0.8 ** math.exp(spread)]
        np.testing.assert_allclose([found.curve.low[1], found.curve.high[1]], bounds, rtol=1e-6)

    def test_where_the_formula_is_undefined(self):
        never = survival([None, None, None], 10).curve
        assert (never.estimate.tolist(), never.low.tolist()) == ([1, 1], [1, 1])
        always = survival([2, 2, 3], 10).curve
        np.testing.assert_allclose(always.estimate, [1, 1 / 3, 0])
        assert (always.low[-1], always.high[-1]) == (0, always.high[1])

    def test_of_fewer_than_three_runs_there_are_no_bounds(self):
        for firsts in ([2], [None, 2]):
            found = survival(firsts, 10)
            assert found.median == 2
            assert np.isfinite(found.curve.estimate).all()
            assert np.isnan([found.curve.low, found.curve.high]).all()

    def test_other_times_and_budgets_are_refused(self):
        for first in ([], [0], [-1, 2]):
            with pytest.raises(ValueError, match="`first_rewards` must hold"):
                survival(first, 10)
        for budgets in (0, NAN, math.inf, [10, -1]):
            with pytest.raises(ValueError, match="`budgets` must"):
                survival([1, None], budgets)


def height(x, values, time):
    """The last value at or before a time."""
    return ([0.0] + [value for end, value in zip(x, values, strict=True) if end <= time])[-1]


class TestCurves:
    def test_interval_over_runs_by_hand(self):
        # At 3 the runs stand at 0.2, 0.6 and 0.4, with mean 0.4; at 4 at 0.8, 0.6 and 0.7.
        runs = [([1, 4], [0.2, 0.8]), ([3, 4], [0.6, 0.6]), ([2, 4], [0.4, 0.7])]
        curve = curve_interval(runs, [0, 3, 4])
        np.testing.assert_array_equal(curve.x, [0, 3, 4])
        np.testing.assert_allclose(curve.estimate, [0, 0.4, 0.7])
        np.testing.assert_allclose(curve.low, [0, 0.2, 0.6])
        np.testing.assert_allclose(curve.high, [0, 0.6, 0.8])

    def test_each_point_has_the_interval_of_its_heights(self):
        rng = np.random.default_rng(0)
        ends = [np.append(np.sort(rng.random(n)), 1.0) for n in (4, 9, 6, 7, 5)]
        runs = [(x, rng.random(len(x))) for x in ends]
        grid = np.linspace(0, 1, 5)
        curve = curve_interval(runs, grid, seed=2)
        heights = np.array([[height(*run, time) for time in grid] for run in runs])
        for i in range(len(grid)):
            expected = stratified_bootstrap(heights[:, i], interquartile_mean, seed=2)
            assert Interval(curve.estimate[i], curve.low[i], curve.high[i]) == expected
        for n in (1, 2):  # which have no interval
            curve = curve_interval([([1, 2], [0.5, 0.5])] * n, [0, 2])
            np.testing.assert_array_equal(curve.estimate, [0, 0.5])
            assert np.isnan([curve.low, curve.high]).all()

    def test_a_mean_is_over_the_same_runs_at_every_point(self):
        # The second run has ended at 3: nobody knows where it would be at 4.
        runs = [([1, 10], [0.2, 0.8]), ([2, 3], [0.1, 0.6])]
        curve = curve_interval(runs, [0, 3, 4, 10])
        np.testing.assert_array_equal(curve.x, [0, 3])
        np.testing.assert_allclose(curve.estimate, [0, 0.4])
        whole = curve_interval(runs)
        assert (len(whole.x), whole.x[0], whole.x[-1]) == (statistics.N_POINTS, 2, 3)
        np.testing.assert_allclose(whole.estimate[[0, -1]], [0.15, 0.4])
        apart = curve_interval([([1, 2], [0.2, 0.8]), ([3, 4], [0.1, 0.6])])
        assert [len(each) for each in (apart.x, apart.estimate, apart.low)] == [0, 0, 0]

    @pytest.mark.parametrize(
        ("curves", "grid", "message"),
        [
            ([], [0, 1], "`curves` must hold at least one run"),
            ([([3], [0.5])], [4, 5], "`grid` must begin before the shortest run ends, at 3"),
            ([([1], [1])], [NAN], "`grid` must"),
            ([([], [])], None, "`x` must hold finite numbers, at least one"),
            ([([2, 1], [0, 1])], None, "`x` must ascend from at least 0"),
            ([([-1, 1], [0, 1])], None, "`x` must ascend from at least 0"),
            ([([1, 2], [0])], None, "`values` must be as many as `x`, 2, got 1"),
            ([([1, 2], [0, NAN])], None, "`values` must hold finite numbers"),
        ],
    )
    def test_other_curves_and_grids_are_refused(self, curves, grid, message):
        with pytest.raises(ValueError, match=message):
            curve_interval(curves, grid)


def test_other_scores_are_refused():
    for scores in ([], [1, NAN], [1, None], [[1], []], [[1, 2], 3], np.empty((3, 0)), 3.0):
        with pytest.raises(ValueError, match="`scores` must hold finite numbers, at least one"):
            interquartile_mean(scores)
