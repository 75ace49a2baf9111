"""The file of an archive, which numpy alone can read."""

import numpy as np
import pytest

from curiosity_algos.archives.base import EliteArchive
from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.state.file import ABOUT, read, save

EXTRA = {"seed": ((), np.int64), "behavior": ((3,), np.float32), "solved": ((), np.bool_)}
COMMON = {
    "solution_dim": 6,
    "solution_dtype": np.float32,
    "extra_fields": EXTRA,
    "net_arch": [8, np.int64(4)],
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


def make_grid(n=12):
    own = {"dims": [20, 30], "ranges": [(-1.0, 1.0), (0.1, 5.0)], "qd_score_offset": -0.1}
    return fill(SparseGridArchive(**COMMON, **own), n)


def make_unstructured(n=12):
    own = {"measure_dim": 2, "target_size": np.int64(20), "k_neighbors": 3}
    return fill(UnstructuredArchive(**COMMON, **own, threshold=np.float32(0.01)), n)


MAKERS = pytest.mark.parametrize("make", [make_grid, make_unstructured])


@MAKERS
@pytest.mark.parametrize("n", [0, 1, 50])
def test_everything_comes_back(tmp_path, make, n, assert_same):
    archive = make(n)
    archive.save(tmp_path / "elites")
    loaded = type(archive).load(tmp_path / "elites.npz")
    assert_same(archive.data(), loaded.data())
    assert archive._saved_settings() == loaded._saved_settings()
    assert loaded.net_arch == [8, 4]
    assert archive.dtypes == loaded.dtypes
    assert archive.stats.obj_max == loaded.stats.obj_max
    for number in (1, 2):
        for one in (archive, loaded):
            fill(one, 200, number)
    assert_same(archive.data(), loaded.data())


@pytest.mark.parametrize(("name", "file"), [("elites", "elites.npz"), ("a.best", "a.best")])
def test_names_get_numpys_suffix(tmp_path, name, file):
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


def test_files_of_another_class(tmp_path):
    make_grid().save(tmp_path / "elites")
    with pytest.raises(ValueError, match=r"`path` must be a saved EliteArchive, .* is one of"):
        EliteArchive.load(tmp_path / "elites")
    with pytest.raises(FileNotFoundError, match=r"there is no file .*nothing\.npz"):
        SparseGridArchive.load(tmp_path / "nothing")


@MAKERS
@pytest.mark.parametrize(
    "change",
    [
        lambda about, data: data.update(objective=data["objective"][:-1]),
        lambda about, data: data.update(measures=data["measures"][0, 0]),
        lambda about, data: data["measures"].fill(np.nan),
        lambda about, data: data.update(solution=3),
        lambda about, data: data.pop("index"),
        lambda about, data: about.update(net_arch="text"),
        lambda about, data: about.update(dims=[10**9, 10**9], measure_dim=3),
        lambda about, data: about.update(threshold=-1.0, ranges=3),
        lambda about, data: about.pop("solution_dim"),
    ],
)
def test_files_that_are_damaged(make, change, tmp_path):
    archive, path = make(), tmp_path / "elites.npz"
    archive.save(path)
    about, data = read(path, type(archive).__name__)
    change(about, data)
    save(path, type(archive).__name__, about, data)
    with pytest.raises(ValueError, match=r"^`path` must hold a whole "):
        type(archive).load(path)
