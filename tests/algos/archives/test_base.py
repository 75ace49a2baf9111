import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from saved_files import through_a_file

from curiosity_algos.archives.sparse_grid import SparseGridArchive

EXTRA = {"seed": ((), np.int64), "behavior": ((3,), np.float32), "solved": ((), np.bool_)}


def make_archive(seed=0, **changes):
    settings = {"solution_dim": 4, "dims": [20, 30], "ranges": [(-1, 1), (0, 5)]}
    return SparseGridArchive(**(settings | changes), seed=seed)


def make_batch(n=30, number=0):
    """n offers with all of `EXTRA`."""
    rng = np.random.default_rng(number)
    return {
        "solution": rng.normal(size=(n, 4)),
        "objective": rng.normal(size=n),
        "measures": rng.uniform([-1, 0], [1, 5], size=(n, 2)),
        "seed": rng.integers(2**31, size=n),
        "behavior": rng.random((n, 3), dtype=np.float32),
        "solved": rng.random(n) < 0.5,
    }


def make_full(n=30, **changes):
    archive = make_archive(extra_fields=EXTRA, **changes)
    archive.add(**make_batch(n))
    return archive


class TestNoAliases:
    def test_of_what_was_added(self, assert_same):
        archive, twin, batch = make_archive(extra_fields=EXTRA), make_full(), make_batch()
        info = archive.add(**batch)
        for array in [*batch.values(), *info.values()]:
            array[...] = 0
        assert_same(archive.data(), twin.data())
        assert archive.stats == twin.stats

    @pytest.mark.parametrize(
        "read",
        [
            lambda archive: archive.data(),
            lambda archive: {name: archive.data(name) for name in archive.field_list},
            lambda archive: archive.sample_elites(50),
            lambda archive: {"nearest": archive.nearest([0.1, 0.2, 0.3])},
            lambda archive: {k: v for k, v in archive.best_elite.items() if np.ndim(v)},
            lambda archive: archive.state_dict()["elites"],
        ],
    )
    def test_of_what_was_read(self, read, assert_same):
        archive, twin = make_full(), make_full()
        for array in read(archive).values():
            array[...] = 0
        assert_same(archive.data(), twin.data())

    def test_of_a_state_that_was_taken_over(self, assert_same):
        archive, twin = make_archive(extra_fields=EXTRA), make_full()
        state = twin.state_dict()
        archive.load_state_dict(state)
        for array in state["elites"].values():
            array[...] = 0
        assert_same(archive.data(), twin.data())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda batch: batch.pop("seed"), "`batch` must have `seed`"),
        (lambda batch: batch.update(color=np.ones(30)), "`batch` must not have `color`"),
        (lambda batch: batch.update(solution=np.ones((30, 5))), "`solution` must be of shape"),
        (lambda batch: batch.update(solution=np.ones((29, 4))), "`objective` must be of shape"),
        (lambda batch: batch.update(measures=np.ones((31, 2))), "`measures` must be of shape"),
        (lambda batch: batch.update(behavior=np.ones(30)), "`behavior` must be of shape"),
        (lambda batch: batch["objective"].fill(-np.inf), "`objective` must be finite"),
        (lambda batch: batch["measures"].fill(np.inf), "`measures` must be finite"),
        (lambda batch: batch["solution"].fill(np.nan), "`solution` must be finite"),
        (lambda batch: batch.update(objective="text"), "could not convert"),
    ],
)
def test_wrong_batches_leave_no_trace(change, message, assert_same):
    archive, twin, batch = make_full(), make_full(), make_batch()
    change(batch)
    with pytest.raises(ValueError, match=message):
        archive.add(**batch)
    assert_same(archive.data(), twin.data())
    assert archive.stats == twin.stats


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("solution_dim", 2.5),
        ("seed", "a"),
        ("extra_fields", 3),
        ("extra_fields", {"a": 3}),
        ("extra_fields", {"a": ((-1,), float)}),
        ("extra_fields", {"a": ((), "nope")}),
        ("extra_fields", {"a": ((), object)}),
        ("extra_fields", {"solution": ((), float)}),
        ("extra_fields", {"index": ((), float)}),
    ],
    ids=str,
)
def test_arguments_are_named(name, value):
    with pytest.raises(ValueError, match=f"`{name}` must"):
        SparseGridArchive(**{"solution_dim": 4, "dims": [2], "ranges": [(0, 1)], name: value})


class TestData:
    def test_fields_that_there_are_not(self):
        for archive in (make_archive(), make_full()):
            for fields in ("color", ["objective", "color"]):
                with pytest.raises(ValueError, match="color"):
                    archive.data(fields)

    def test_an_empty_archive(self):
        archive = make_archive(extra_fields=EXTRA)
        shapes = {name: array.shape for name, array in archive.data().items()}
        assert shapes == {
            **{"solution": (0, 4), "objective": (0,), "measures": (0, 2)},
            **{"seed": (0,), "behavior": (0, 3), "solved": (0,), "index": (0,)},
        }
        assert archive.best_elite is None
        assert list(archive) == []
        with pytest.raises(IndexError, match="no elites"):
            archive.sample_elites(1)

    def test_types(self):
        archive = make_full(solution_dtype=np.float32)
        for name, array in archive.data().items():
            assert array.dtype == archive.dtypes[name]
        assert archive.dtypes["solution"] == np.float32
        assert archive.dtypes["seed"] == archive.dtypes["index"] == np.int64


class TestNearest:
    @settings(deadline=None)
    @given(st.tuples(st.floats(-3, 3), st.floats(-3, 9)), st.integers(1, 40))
    def test_it_is_the_nearest_of_all(self, wanted, n):
        batch = make_batch(n)
        archive = make_archive()
        archive.add(batch["solution"], batch["objective"], batch["measures"])
        elites = archive.data()
        distances = [np.hypot(*(m - wanted)) for m in elites["measures"]]
        found = (elites["solution"] == archive.nearest(wanted)).all(axis=1)
        assert np.array(distances)[found] == pytest.approx(min(distances))

    def test_it_compares_the_kept_behavior(self):
        archive = make_archive(extra_fields={"behavior": ((1,), np.float64)})
        measures = [[0, 0], [0.5, 2], [1, 5]]
        archive.add(np.diag([1, 2, 3, 4])[:3], [0, 0, 0], measures, behavior=[[9], [5], [1]])
        assert archive.nearest([8.0]).tolist() == [1, 0, 0, 0]

    @pytest.mark.parametrize("wanted", [0.5, [0.5], [0.5, np.nan]])
    def test_behaviors_of_another_kind(self, wanted):
        with pytest.raises(ValueError, match=r"`niche` must be a finite behavior of shape \(2,\)"):
            make_archive().nearest(wanted)

    def test_an_empty_archive(self):
        with pytest.raises(ValueError, match="`niche` needs an archive with elites"):
            make_archive().nearest([0.5, 0.5])


class TestStates:
    """A state brings back every bit, also of what happens next."""

    @pytest.mark.parametrize("dtype", [np.float32, np.float64])
    def test_a_run_goes_on(self, dtype, assert_same):
        one = make_archive(1, extra_fields=EXTRA, solution_dtype=dtype, qd_score_offset=-3.3)
        for number in range(12):
            one.add(**make_batch(40, number))
            one.sample_elites(3)
        other = make_archive(2, extra_fields=EXTRA, solution_dtype=dtype, qd_score_offset=-3.3)
        other.add(**make_batch(50, 99))
        other.load_state_dict(through_a_file(one.state_dict()))
        assert other.stats == one.stats
        for number in range(100, 110):
            infos = [archive.add(**make_batch(40, number)) for archive in (one, other)]
            np.testing.assert_equal(*infos)
            assert one.stats == other.stats
            np.testing.assert_equal(one.best_elite, other.best_elite)
            np.testing.assert_equal(one.sample_elites(5), other.sample_elites(5))
        assert_same(one.data(), other.data())

    def test_the_running_sum_is_not_added_up_anew(self):
        one, other = make_archive(), make_archive()
        for objective in (1e16, 2e16):
            one.add(np.ones((1, 4)), [objective], [[0.0, 0.0]])
        one.add(np.ones((3, 4)), [1.0, 1.0, 1.0], [[0.3, 1], [0.6, 2], [0.9, 3]])
        one.add(np.ones((1, 4)), [1.0], [[-0.9, 3]])
        assert one.stats.qd_score != one.data("objective").sum()
        other.load_state_dict(one.state_dict())
        assert other.stats == one.stats

    def test_the_best_is_the_first_there_was(self):
        one, other = make_archive(), make_archive()
        one.add([[1.0] * 4], [1.0], [[-1, 0]])
        one.add([[2.0] * 4], [5.0], [[1, 5]])
        one.add([[3.0] * 4], [5.0], [[-1, 0]])
        other.load_state_dict(one.state_dict())
        assert one.best_elite["solution"].tolist() == [2.0] * 4
        assert other.best_elite["solution"].tolist() == [2.0] * 4

    @pytest.mark.parametrize(
        ("match", "spoil"),
        [
            ("`objective` must be finite", lambda s: s["elites"]["objective"].fill(np.nan)),
            ("of the same grid", lambda s: s["elites"].update(index=s["elites"]["index"] + 1)),
            ("must have `seed`", lambda s: s["elites"].pop("seed")),
            ("must not have `note`", lambda s: s["elites"].update(note=np.ones(1))),
            ("`seed` must be of shape", lambda s: s["elites"].update(seed=np.ones(2, int))),
            (
                "`solution` must be of shape",
                lambda s: s["elites"].update(solution=np.ones((9, 5), "f4")),
            ),
            ("`best_slot` must be", lambda s: s.update(best_slot=999)),
            ("`objective_sum` must be", lambda s: s.update(objective_sum=np.nan)),
            ("`rng` must be the state", lambda s: s.update(rng="text")),
        ],
    )
    def test_those_of_no_archive_are_refused(self, match, spoil):
        state = make_full(20, solution_dtype=np.float32).state_dict()
        spoil(state)
        with pytest.raises(ValueError, match=match):
            make_full().load_state_dict(state)
