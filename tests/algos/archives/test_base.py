import re

import numpy as np
import pytest
from elites import assert_same_elites
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


def repeated(elites):
    """As many elites, all of them the first."""
    return {name: np.repeat(array[:1], len(array), 0) for name, array in elites.items()}


class TestNoAliases:
    def test_of_what_was_added(self):
        archive, twin, batch = make_archive(extra_fields=EXTRA), make_full(), make_batch()
        info = archive.add(**batch)
        for array in [*batch.values(), *info.values()]:
            array[...] = 0
        assert_same_elites(archive, twin)
        assert archive.stats == twin.stats

    def test_of_a_single_one(self):
        archive = make_archive()
        solution, measures = np.ones(4), np.full(2, 0.5)
        archive.add_single(solution, 3.0, measures)
        solution[:], measures[:] = 9.0, 0.9
        np.testing.assert_array_equal(archive.data("solution"), np.ones((1, 4)))
        np.testing.assert_array_equal(archive.data("measures"), np.full((1, 2), 0.5))

    @pytest.mark.parametrize(
        "read",
        [
            lambda archive: archive.data(),
            lambda archive: dict(enumerate(archive.data(return_type="tuple"))),
            lambda archive: {name: archive.data(name) for name in archive.field_list},
            lambda archive: archive.sample_elites(50),
            lambda archive: {"behaviors": archive.behaviors},
            lambda archive: {"nearest": archive.nearest([0.1, 0.2, 0.3])},
            lambda archive: {k: v for k, v in archive.best_elite.items() if np.ndim(v)},
            lambda archive: {k: v for e in archive for k, v in e.items() if np.ndim(v)},
            lambda archive: archive.state_dict()["elites"],
        ],
    )
    def test_of_what_was_read(self, read):
        archive, twin = make_full(), make_full()
        for array in read(archive).values():
            array[...] = 0
        assert_same_elites(archive, twin)

    def test_of_a_state_that_was_taken_over(self):
        archive, twin = make_archive(extra_fields=EXTRA), make_full()
        state = twin.state_dict()
        archive.load_state_dict(state)
        for tensor in state["elites"].values():
            tensor[...] = 0
        assert_same_elites(archive, twin)


class TestWrongBatches:
    """Each is refused by name, and leaves no trace."""

    def refuse(self, match, batch, single=False):
        archive, twin = make_full(), make_full()
        with pytest.raises(ValueError, match=match):
            (archive.add_single if single else archive.add)(**batch)
        assert_same_elites(archive, twin)
        assert archive.stats == twin.stats

    def test_missing_fields(self):
        batch = make_batch()
        del batch["seed"]
        self.refuse("must have the fields solution, objective, measures, seed, .* got sol", batch)

    def test_unknown_fields(self):
        self.refuse("must have the fields .*, got .*, color", make_batch() | {"color": np.ones(30)})

    @pytest.mark.parametrize(
        ("name", "shape"),
        [
            ("solution", (30, 5)),
            ("solution", ()),
            ("objective", (30, 1)),
            ("measures", (31, 2)),
            ("seed", (5,)),
            ("behavior", (30,)),
        ],
    )
    def test_shapes(self, name, shape):
        # The solutions say how many there are.
        n = r"\d+" if name == "solution" else "30"
        match = rf"`{name}` must be of shape \({n},.*\), got {re.escape(str(shape))}"
        self.refuse(match, make_batch() | {name: np.ones(shape)})

    def test_batches_of_different_lengths(self):
        self.refuse(
            r"`objective` must be of shape \(29,\), got \(30,\)",
            make_batch() | {"solution": np.zeros((29, 4))},
        )

    @pytest.mark.parametrize(
        ("name", "bad"), [("objective", -np.inf), ("measures", np.inf), ("solution", np.nan)]
    )
    def test_numbers_that_are_not_finite(self, name, bad):
        batch = make_batch()
        batch[name][-1] = bad
        self.refuse(rf"`{name}` must be finite\.", batch)

    @pytest.mark.parametrize(
        ("name", "bad"),
        [("objective", "text"), ("solution", [1.0, [2.0]]), ("seed", {"a": 1}), ("seed", 2**70)],
    )
    def test_things_that_are_no_arrays(self, name, bad):
        self.refuse(f"`{name}` must be", make_batch() | {name: bad})

    @pytest.mark.parametrize(
        ("name", "bad"),
        [("solution", np.ones(5)), ("objective", np.nan), ("measures", [0.5]), ("seed", [1, 2])],
    )
    def test_single_ones(self, name, bad):
        one = {key: array[0] for key, array in make_batch().items()}
        self.refuse(f"`{name}` must be", one | {name: bad}, single=True)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("solution_dim", np.nan),
        ("solution_dim", 2.5),
        ("solution_dtype", "nope"),
        ("qd_score_offset", np.nan),
        ("seed", "a"),
        ("net_arch", [2.5]),
        ("extra_fields", 3),
        ("extra_fields", {"a": 3}),
        ("extra_fields", {3: ((), float)}),
        ("extra_fields", {"a": ("xy", float)}),
        ("extra_fields", {"a": ((-1,), float)}),
        ("extra_fields", {"a": (2.5, float)}),
        ("extra_fields", {"a": ((), "nope")}),
    ],
    ids=str,
)
def test_arguments_are_named(name, value):
    with pytest.raises(ValueError, match=f"`{name}` must"):
        SparseGridArchive(**{"solution_dim": 4, "dims": [2], "ranges": [(0, 1)], name: value})


class TestExtraFields:
    @pytest.mark.parametrize("name", ["solution", "objective", "index"])
    def test_names_that_are_taken(self, name):
        with pytest.raises(ValueError, match=f"`extra_fields` must not hold {name}"):
            make_archive(extra_fields={name: ((), np.float64)})

    @pytest.mark.parametrize("dtype", [object, "U5", "datetime64[s]", [("a", int)]])
    def test_types_that_hold_no_numbers(self, dtype):
        with pytest.raises(ValueError, match="`extra_fields` must hold types of numbers"):
            make_archive(extra_fields={"note": ((), dtype)})

    def test_a_shape_may_be_a_length(self):
        archive = make_archive(extra_fields={"path": (3, np.float32)})
        archive.add(np.ones((2, 4)), [1, 2], [[0, 0], [1, 1]], path=[[1, 2, 3], [4, 5, 6]])
        assert archive.data("path").tolist() == [[1, 2, 3], [4, 5, 6]]


class TestData:
    def test_fields_that_there_are_not(self):
        for archive in (make_archive(), make_full()):
            for fields in ("color", ["objective", "color"]):
                with pytest.raises(ValueError, match="color"):
                    archive.data(fields)

    def test_containers_that_there_are_not(self):
        for fields in (None, "objective", ["objective"]):
            with pytest.raises(ValueError, match="list"):
                make_full().data(fields, return_type="list")

    def test_an_empty_archive(self):
        archive = make_archive(extra_fields=EXTRA)
        shapes = {name: array.shape for name, array in archive.data().items()}
        assert shapes == {
            "solution": (0, 4),
            "objective": (0,),
            "measures": (0, 2),
            "seed": (0,),
            "behavior": (0, 3),
            "solved": (0,),
            "index": (0,),
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

    def test_behaviors_are_the_measures_unless_kept(self):
        archive = make_full()
        np.testing.assert_array_equal(archive.behaviors, archive.data("behavior"))
        plain = make_archive()
        plain.add(np.ones((1, 4)), [0.0], [[0.5, 0.6]])
        assert plain.behaviors.tolist() == [[0.5, 0.6]]


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
        assert archive.nearest([-8.0]).tolist() == [0, 0, 3, 0]

    @pytest.mark.parametrize("wanted", [0.5, [0.5], [0.5, 0.5, 0.5], [[0.5, 0.5]], [0.5, np.nan]])
    def test_behaviors_of_another_kind(self, wanted):
        archive = make_archive()
        for _ in range(2):
            with pytest.raises(ValueError, match=r"`niche` must be finite of shape \(2,\)"):
                archive.nearest(wanted)
            archive.add_single(np.ones(4), 1.0, [0, 0])

    def test_an_empty_archive(self):
        with pytest.raises(ValueError, match="`niche` needs an archive with elites"):
            make_archive().nearest([0.5, 0.5])


class TestStates:
    """A state brings back every bit, also of what happens next."""

    def live(self, archive):
        """Batches and draws."""
        for number in range(12):
            archive.add(**make_batch(40, number))
            archive.sample_elites(3)

    @pytest.mark.parametrize("dtype", [np.float32, np.float64])
    def test_a_run_goes_on(self, dtype):
        one = make_archive(1, extra_fields=EXTRA, solution_dtype=dtype, qd_score_offset=-3.3)
        self.live(one)
        other = make_archive(2, extra_fields=EXTRA, solution_dtype=dtype, qd_score_offset=-3.3)
        other.add(**make_batch(50, 99))
        other.load_state_dict(one.state_dict())
        assert other.stats == one.stats
        assert_same_elites(one, other)
        for number in range(100, 110):
            infos = [archive.add(**make_batch(40, number)) for archive in (one, other)]
            np.testing.assert_equal(*infos)
            assert one.stats == other.stats
            np.testing.assert_equal(one.best_elite, other.best_elite)
            np.testing.assert_equal(one.sample_elites(5), other.sample_elites(5))
        assert_same_elites(one, other)

    def test_the_running_sum_is_not_added_up_anew(self):
        one, other = make_archive(), make_archive()
        for objective in (1e16, 2e16):
            one.add_single(np.ones(4), objective, [0.0, 0.0])
        one.add(np.ones((3, 4)), [1.0, 1.0, 1.0], [[0.3, 1], [0.6, 2], [0.9, 3]])
        one.add_single(np.ones(4), 1.0, [-0.9, 3])
        assert one.stats.qd_score != one.data("objective").sum()
        other.load_state_dict(one.state_dict())
        assert other.stats == one.stats

    def test_the_best_is_the_first_there_was(self):
        one, other = make_archive(), make_archive()
        one.add_single(np.full(4, 1.0), 1.0, [-1, 0])
        one.add_single(np.full(4, 2.0), 5.0, [1, 5])
        one.add_single(np.full(4, 3.0), 5.0, [-1, 0])
        other.load_state_dict(one.state_dict())
        assert one.best_elite["solution"].tolist() == [2.0] * 4
        assert other.best_elite["solution"].tolist() == [2.0] * 4

    @pytest.mark.parametrize("n", [0, 30])
    def test_they_hold_only_what_is_safe_to_load(self, n):
        archive = make_full(n)
        other = make_archive(7, extra_fields=EXTRA)
        other.load_state_dict(through_a_file(archive.state_dict()))
        assert_same_elites(archive, other)
        assert archive.stats == other.stats
        for one in (archive, other):
            one.add(**make_batch(1, 5))
        np.testing.assert_equal(archive.sample_elites(9), other.sample_elites(9))

    @pytest.mark.parametrize(
        ("match", "spoil"),
        [
            ("`objective` must be finite", lambda s: s["elites"]["objective"].fill(np.nan)),
            ("of the same grid", lambda s: s["elites"].update(index=s["elites"]["index"] + 1)),
            ("`index` must be another", lambda s: s["elites"].update(repeated(s["elites"]))),
            ("must have the fields", lambda s: s["elites"].pop("seed")),
            ("must have the fields", lambda s: s["elites"].update(note=np.ones(1))),
            ("`seed` must be of shape", lambda s: s["elites"].update(seed=np.ones(2, int))),
            ("`seed` must be one whole", lambda s: s["elites"].update(seed=np.ones((2, 3)))),
            (
                "`solution` must be of shape",
                lambda s: s["elites"].update(solution=np.ones((9, 5), "f4")),
            ),
            (
                "`objective` must be of type",
                lambda s: s["elites"].update(objective=np.ones(9, "f4")),
            ),
            ("`best_slot` must be", lambda s: s.update(best_slot=999)),
            ("`best_slot` must be", lambda s: s.update(best_slot="first")),
            ("`objective_sum` must be", lambda s: s.update(objective_sum=np.nan)),
            ("`rng` must be the state", lambda s: s.update(rng="text")),
        ],
    )
    def test_those_of_no_archive_leave_all_as_it_was(self, match, spoil, assert_same):
        archive, twin = make_full(), make_full()
        state = make_full(20, solution_dtype=np.float32).state_dict()
        spoil(state)
        with pytest.raises(ValueError, match=match):
            archive.load_state_dict(state)
        assert archive.dtypes == twin.dtypes
        assert_same(archive.state_dict(), twin.state_dict())
        for one in (archive, twin):
            one.add(**make_batch(9, 3))
        assert_same_elites(archive, twin)

    def test_they_do_not_follow_the_archive(self, assert_same):
        archive = make_full()
        state, twin = archive.state_dict(), make_full().state_dict()
        archive.add(**make_batch(30, 1))
        archive.sample_elites(3)
        assert_same(state, twin)
