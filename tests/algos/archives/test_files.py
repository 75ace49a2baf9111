"""The file of an archive, which numpy alone can read."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from curiosity_algos.archives.base import EliteArchive
from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.state.file import ABOUT, read, save

EXTRA = {"seed": ((), np.int64), "behavior": ((3,), np.float32), "solved": ((), np.bool_)}
DIMS, RANGES = [20, 30], [(-1.0, 1.0), (0.1, 5.0)]
COMMON = {
    "solution_dim": 6,
    "solution_dtype": np.float32,
    "extra_fields": EXTRA,
    "net_arch": [8, 4],
    "seed": 1,
}


def fill(archive, n, number=0):
    rng = np.random.default_rng(number)
    archive.add(
        rng.normal(size=(n, 6)),
        rng.integers(-3, 3, n) / 10,
        rng.uniform([-1, 0], [1, 5], (n, 2)),
        seed=rng.integers(2**31, size=n),
        behavior=rng.random((n, 3)),
        solved=rng.random(n) < 0.5,
    )
    return archive


def make_grid(n=12, **changes):
    own = {"dims": DIMS, "ranges": RANGES, "qd_score_offset": -0.1}
    return fill(SparseGridArchive(**(COMMON | own | changes)), n)


def make_unstructured(n=12):
    own = {"measure_dim": 2, "target_size": 20, "k_neighbors": 3, "threshold": 0.01}
    return fill(UnstructuredArchive(**COMMON, **own), n)


MAKERS = pytest.mark.parametrize("make", [make_grid, make_unstructured])


class TestRoundTrip:
    @MAKERS
    @pytest.mark.parametrize("n", [0, 1, 50])
    def test_everything_comes_back(self, tmp_path, make, n, assert_same):
        archive = make(n)
        archive.save(tmp_path / "elites.npz")
        loaded = type(archive).load(tmp_path / "elites.npz")
        assert_same(archive.data(), loaded.data())
        assert archive._saved_settings() == loaded._saved_settings()
        assert archive.dtypes == loaded.dtypes
        assert archive.stats.obj_max == loaded.stats.obj_max
        for number in (1, 2):
            for one in (archive, loaded):
                fill(one, 200, number)
        assert_same(archive.data(), loaded.data())

    @pytest.mark.parametrize("net_arch", [None, [], [5], (16, 8), np.array([3, 2])])
    def test_hidden_layers(self, tmp_path, net_arch):
        make_grid(net_arch=net_arch).save(tmp_path / "elites")
        expected = None if net_arch is None else list(net_arch)
        assert SparseGridArchive.load(tmp_path / "elites").net_arch == expected

    @pytest.mark.parametrize(
        ("name", "file"), [("elites", "elites.npz"), ("elites.best", "elites.best")]
    )
    def test_names_get_numpys_suffix(self, tmp_path, name, file):
        make_grid().save(str(tmp_path / "new" / name))
        assert [path.name for path in (tmp_path / "new").iterdir()] == [file]
        assert len(SparseGridArchive.load(str(tmp_path / "new" / name)))


def test_numpy_alone_reads_it(tmp_path):
    archive = make_grid()
    archive.save(tmp_path / "elites.npz")
    with np.load(tmp_path / "elites.npz") as file:
        arrays = dict(file)
    del arrays[ABOUT]
    np.testing.assert_equal(arrays, archive.data())


class TestWrongFiles:
    @pytest.fixture(params=[make_grid, make_unstructured])
    def archive(self, request):
        return request.param()

    def refuse(self, archive, path, message, change):
        archive.save(path)
        about, data = read(path, type(archive).__name__)
        change(about, data)
        save(path, type(archive).__name__, about, data)
        with pytest.raises(ValueError, match=f"^`path` must hold a whole .*{message}"):
            type(archive).load(path)

    def test_of_another_class(self, archive, tmp_path):
        archive.save(tmp_path / "elites")
        with pytest.raises(ValueError, match=r"`path` must be a saved EliteArchive, .* is one of"):
            EliteArchive.load(tmp_path / "elites")
        with pytest.raises(FileNotFoundError, match=r"there is no file .*nothing\.npz"):
            SparseGridArchive.load(tmp_path / "nothing")

    @pytest.mark.parametrize(
        ("name", "change", "message"),
        [
            ("objective", lambda array: array[:-1], "`objective` must"),
            ("behavior", lambda array: array[..., None], "`(extra_fields|behavior)` must"),
            ("index", lambda array: array[..., None], "`index` must"),
            ("index", lambda array: array.astype("i4"), "`index` must be of type"),
            ("index", lambda array: np.roll(array, 1) * 0, "`index` must|cells of another"),
            ("measures", lambda array: array.ravel()[0], "`measures` must"),
            ("measures", lambda array: array.astype(complex), "`measures` must"),
            ("measures", lambda array: array * np.nan, "`measures` must be finite|must be finite"),
            ("solution", lambda array: 3, "`solution` must be an array"),
            ("solution", lambda array: array * np.inf, "`solution` must be finite"),
            ("seed", lambda array: array - 2**40, "`seed` must be at least 0"),
        ],
    )
    def test_of_a_field(self, archive, tmp_path, name, change, message):
        def edit(about, data):
            data[name] = change(data[name])

        self.refuse(archive, tmp_path / "elites.npz", message, edit)

    def test_without_a_field_or_a_setting(self, archive, tmp_path):
        for name in ("solution", "objective", "measures", "index"):
            self.refuse(archive, tmp_path / "e.npz", "", lambda about, data, k=name: data.pop(k))
        for name in archive._saved_settings():
            self.refuse(archive, tmp_path / "e.npz", "", lambda about, data, k=name: about.pop(k))
        more = lambda about, data: about.update(solution_dim=1)  # noqa: E731
        self.refuse(archive, tmp_path / "e.npz", "", more)

    @pytest.mark.parametrize("value", ["text", [1, [2]], {}, -1.5, np.inf])
    def test_settings_of_another_kind(self, archive, tmp_path, value):
        for name in archive._saved_settings().keys() - {"qd_score_offset"}:
            change = lambda about, data, k=name: about.update({k: value})  # noqa: E731
            self.refuse(archive, tmp_path / "elites.npz", "", change)

    def test_cells_without_end_cost_nothing(self, tmp_path):
        change = lambda about, data: about.update(dims=[10**9, 10**9])  # noqa: E731
        self.refuse(make_grid(), tmp_path / "elites.npz", "cells of another", change)


CHANGES = [
    lambda array, rng: array[: rng.integers(len(array) + 1)],
    lambda array, rng: rng.permutation(array),
    lambda array, rng: array[rng.integers(len(array), size=len(array))],
    lambda array, rng: array.astype(rng.choice(["f4", "f8", "i8", "u1", "?", "c8"])),
    lambda array, rng: array.reshape(-1),
    lambda array, rng: array[:, None],
    lambda array, rng: array * np.where(rng.random(array.shape) < 0.1, np.nan, 1),
    lambda array, rng: array.T,
]


@MAKERS
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_whatever_is_in_a_file_is_refused_or_is_an_archive(tmp_path, make, data):
    archive, path = make(), tmp_path / "elites.npz"
    archive.save(path)
    about, arrays = read(path, type(archive).__name__)
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    for name in data.draw(st.lists(st.sampled_from(sorted(arrays)), max_size=2)):
        arrays[name] = data.draw(st.sampled_from(CHANGES))(arrays[name], rng)
    save(path, type(archive).__name__, about, arrays)
    try:
        loaded = type(archive).load(path)
    except ValueError:
        return
    if not loaded.empty:
        loaded.sample_elites(3)
        loaded.nearest(loaded.behaviors[0])
        loaded.add(**{k: array for k, array in loaded.data().items() if k != "index"})
