import numpy as np
import pytest
from saved_files import through_a_file

from curiosity_algos.archives.history import COLUMNS, ArchiveHistory
from curiosity_algos.archives.sparse_grid import SparseGridArchive


def make_archive():
    return SparseGridArchive(solution_dim=1, dims=[4], ranges=[(0, 1)], qd_score_offset=-2.0)


def make_history(n=3):
    """A history of n generations, each of which finds another cell, and its archive's."""
    history, archive = ArchiveHistory(), make_archive()
    for i in range(n):
        archive.add([[i]], [[1.0, -1.0, 5.0, 0.0][i]], [[i / 4]])
        history.record(10 * (i + 1), archive.stats)
    return history


def test_columns_by_hand():
    history = make_history()
    assert len(history) == 3
    assert history["timesteps"].tolist() == [10, 30, 60]
    assert history["size"].tolist() == [1, 2, 3]
    assert history["coverage"].tolist() == [0.25, 0.5, 0.75]
    assert history["qd_score"].tolist() == [3.0, 4.0, 11.0]
    assert history["best"].tolist() == [1.0, 1.0, 5.0]
    assert all(history[name].dtype == np.float64 for name in COLUMNS)


def test_a_generation_without_elites_has_no_best():
    history = ArchiveHistory()
    history.record(7, make_archive().stats)
    assert [history[name][0] for name in COLUMNS[:4]] == [7.0, 0.0, 0.0, 0.0]
    assert np.isnan(history["best"][0])


def test_a_column_that_there_is_not():
    with pytest.raises(
        ValueError, match=r"`column` must be one of timesteps, size, .* got 'worst'"
    ):
        make_history()["worst"]


@pytest.mark.parametrize("n", [0, 3])
def test_a_state_goes_on(n, assert_same):
    one, other = make_history(n), make_history(2)
    other.load_state_dict(through_a_file(one.state_dict()))
    for history in (one, other):
        history.record(5, make_archive().stats)
    assert len(other) == n + 1
    assert_same(
        {name: np.nan_to_num(one[name], nan=-9.0) for name in COLUMNS},
        {name: np.nan_to_num(other[name], nan=-9.0) for name in COLUMNS},
    )
    assert other["timesteps"][-1] == [5, 0, 0, 65][n]
