import io
import json
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from saved_files import no_space, npy_header

from curiosity_algos.archives.base import EliteArchive
from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.checkpoints import archive_file as files

EXTRA = {"seed": ((), np.int64), "behavior": ((3,), np.float32), "solved": ((), np.bool_)}
DIMS, RANGES = [20, 30], [(-1.0, 1.0), (0.1, 5.0)]


def make_archive(n=50, number=0, **changes):
    """A full archive of float32 policies, with every setting and several fields."""
    settings = {
        "solution_dim": 6,
        "dims": DIMS,
        "ranges": RANGES,
        "qd_score_offset": -0.1,
        "solution_dtype": np.float32,
        "extra_fields": EXTRA,
        "net_arch": [8, 4],
    }
    archive = SparseGridArchive(**(settings | changes), seed=1)
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


def settings_of(archive):
    return {
        "qd_score_offset": archive.qd_score_offset,
        "net_arch": archive.net_arch,
        "dims": archive.dims.tolist(),
        "lower": archive.lower_bounds.tolist(),
        "upper": archive.upper_bounds.tolist(),
        "solution_dim": archive.solution_dim,
        "measure_dim": archive.measure_dim,
        "dtypes": archive.dtypes,
    }


def rewrite(path, **changes):
    """Change arrays of a saved archive; None drops one."""
    with np.load(path) as file:
        arrays = {**file, **changes}
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})


def load_or_none(path):
    """The archive, or None where the file is refused as damaged."""
    try:
        return SparseGridArchive.load(path)
    except ValueError as error:
        if "is not a whole file" in str(error):
            return None
        raise


class TestRoundTrip:
    @pytest.mark.parametrize("n", [0, 1, 50, 500])
    def test_everything_comes_back(self, tmp_path, n, assert_same):
        archive = make_archive(n)
        archive.save(tmp_path / "elites.npz")
        loaded = SparseGridArchive.load(tmp_path / "elites.npz")
        assert_same(archive.data(), loaded.data())
        assert settings_of(archive) == settings_of(loaded)
        assert archive.stats.num_elites == loaded.stats.num_elites
        assert archive.stats.obj_max == loaded.stats.obj_max
        assert archive.stats.qd_score == pytest.approx(loaded.stats.qd_score)

    def test_a_loaded_archive_goes_on(self, tmp_path):
        archive = make_archive()
        archive.save(tmp_path / "elites")
        loaded = SparseGridArchive.load(tmp_path / "elites")
        for number in (1, 2):
            more = make_archive(200, number).data()
            del more["index"]
            np.testing.assert_equal(archive.add(**more), loaded.add(**more))
        np.testing.assert_equal(archive.data(), loaded.data())

    @pytest.mark.parametrize("net_arch", [None, [], [5], (16, 8), np.array([3, 2])])
    def test_hidden_layers(self, tmp_path, net_arch):
        make_archive(net_arch=net_arch).save(tmp_path / "elites")
        expected = None if net_arch is None else list(net_arch)
        assert SparseGridArchive.load(tmp_path / "elites").net_arch == expected

    def test_numpy_will_do_for_settings(self, tmp_path):
        changes = {
            "dims": np.array(DIMS, dtype=np.int32),
            "ranges": np.array(RANGES),
            "qd_score_offset": np.float32(-0.5),
        }
        archive = make_archive(**changes)
        archive.save(tmp_path / "elites")
        assert settings_of(SparseGridArchive.load(tmp_path / "elites")) == settings_of(archive)

    @pytest.mark.parametrize(
        ("name", "file"), [("elites", "elites.npz"), ("elites.best", "elites.best")]
    )
    def test_names_get_numpys_suffix(self, tmp_path, name, file):
        make_archive().save(str(tmp_path / "new" / name))
        assert [path.name for path in (tmp_path / "new").iterdir()] == [file]
        assert len(SparseGridArchive.load(str(tmp_path / "new" / name)))


def test_numpy_alone_reads_it(tmp_path):
    """As the module says."""
    archive = make_archive()
    archive.save(tmp_path / "elites.npz")
    with np.load(tmp_path / "elites.npz", allow_pickle=False) as file:
        arrays = dict(file)
    about = json.loads(str(arrays.pop("about")))
    assert about == {
        "format": files.FORMAT,
        "archive": "SparseGridArchive",
        "settings": {
            "dims": DIMS,
            "ranges": [list(bounds) for bounds in RANGES],
            "qd_score_offset": -0.1,
            "net_arch": [8, 4],
        },
    }
    np.testing.assert_equal(arrays, archive.data())
    n = len(archive)
    assert {name: array.shape for name, array in arrays.items()} == {
        "solution": (n, 6),
        "objective": (n,),
        "measures": (n, 2),
        "index": (n,),
        "seed": (n,),
        "behavior": (n, 3),
        "solved": (n,),
    }
    assert arrays["solution"].dtype == np.float32


def test_a_full_disk_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "elites.npz"
    make_archive().save(path)
    before = path.read_bytes()

    def write_half(file, **arrays):
        file.write(b"half of an archive")
        no_space()

    monkeypatch.setattr(np, "savez", write_half)
    with pytest.raises(OSError, match="No space left"):
        make_archive(70).save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def as_npy(array):
    """The bytes of a file of numpy's that holds an array."""
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


class TestWrongFiles:
    @pytest.fixture
    def path(self, tmp_path):
        make_archive(5).save(tmp_path / "elites.npz")
        return tmp_path / "elites.npz"

    def refuse(self, path):
        with pytest.raises(
            ValueError,
            match=r"`path` must be a saved SparseGridArchive, .* is not a whole file of this pack",
        ):
            SparseGridArchive.load(path)

    def test_a_missing_one(self, tmp_path):
        with pytest.raises(FileNotFoundError, match=r"`path` .* there is no file .*nothing\.npz"):
            SparseGridArchive.load(tmp_path / "nothing")
        with pytest.raises(FileNotFoundError):
            SparseGridArchive.load(tmp_path)

    @pytest.mark.parametrize("share", [0.0, 0.5, 0.999])
    def test_a_truncated_one(self, path, share):
        content = path.read_bytes()
        path.write_bytes(content[: int(share * len(content))])
        self.refuse(path)

    def test_a_damaged_one(self, path):
        """A byte that changed is noticed, or stands where nothing is read."""
        content, whole = path.read_bytes(), make_archive(5).data()
        n_refused = 0
        for position in range(0, len(content), 7):
            damaged = bytearray(content)
            damaged[position] ^= 0x81
            path.write_bytes(damaged)
            loaded = load_or_none(path)
            n_refused += loaded is None
            if loaded is not None:
                np.testing.assert_equal(loaded.data(), whole)
        assert n_refused > len(content) / 7 / 2

    @pytest.mark.parametrize("flag", [0x01, 0x20])
    def test_one_that_asks_for_a_password_or_another_program(self, path, flag):
        content = bytearray(path.read_bytes())
        content[content.index(b"PK\x01\x02") + 8] |= flag
        path.write_bytes(content)
        self.refuse(path)

    @pytest.mark.parametrize(
        ("name", "content", "compression"),
        [
            ("note", b"text", zipfile.ZIP_STORED),
            ("huge.npy", npy_header((2**50,)), zipfile.ZIP_STORED),
            ("bomb.npy", as_npy(np.zeros(2**14)), zipfile.ZIP_DEFLATED),
        ],
        ids=["no array", "too large for any memory", "unpacks to much more"],
    )
    def test_one_with_a_member_that_is_not_ours(self, path, name, content, compression):
        with zipfile.ZipFile(path, "a", compression) as file:
            file.writestr(name, content)
        self.refuse(path)

    def test_a_foreign_one(self, tmp_path):
        text, folder_of_texts, array = (tmp_path / f"{name}.npz" for name in "abc")
        text.write_text("no archive at all")
        with zipfile.ZipFile(folder_of_texts, "w") as file:
            file.writestr("data", "text")
        with open(array, "wb") as file:
            np.save(file, np.ones(3))
        arrays = tmp_path / "d.npz"
        np.savez(arrays, solution=np.ones((2, 3)))
        for path in (text, folder_of_texts, array, arrays):
            self.refuse(path)

    @pytest.mark.parametrize(
        "about",
        [
            None,
            "no JSON",
            "{}",
            '{"format": "curiosity archive 1"}',
            '{"format": "curiosity archive 0", "archive": "SparseGridArchive", "settings": {}}',
        ],
    )
    def test_one_that_says_something_else_about_itself(self, path, about):
        rewrite(path, about=None if about is None else np.array(about))
        self.refuse(path)

    @pytest.mark.parametrize("name", ["solution", "objective", "measures", "index"])
    def test_one_without_a_field(self, path, name):
        rewrite(path, **{name: None})
        self.refuse(path)

    def test_one_that_would_run_code(self, path):
        rewrite(path, seed=np.array([print] * 5, dtype=object))
        self.refuse(path)
        path.write_bytes(as_npy(np.array([print], dtype=object)))
        self.refuse(path)

    def test_one_of_another_class(self, path, tmp_path):
        with pytest.raises(
            ValueError,
            match=r"`path` must be a saved UnstructuredArchive, .* is one of SparseGridArchive",
        ):
            UnstructuredArchive.load(path)
        other = UnstructuredArchive(solution_dim=2, measure_dim=2, target_size=5, k_neighbors=1)
        other.save(tmp_path / "other")
        with pytest.raises(ValueError, match="is one of UnstructuredArchive"):
            SparseGridArchive.load(tmp_path / "other")

    def test_no_class_in_particular(self, path):
        with pytest.raises(ValueError, match="`path` must be a saved EliteArchive"):
            EliteArchive.load(path)


def make_unstructured(n=12):
    archive = UnstructuredArchive(
        solution_dim=6,
        measure_dim=2,
        target_size=20,
        k_neighbors=3,
        threshold=0.01,
        solution_dtype=np.float32,
        extra_fields=EXTRA,
        net_arch=[8, 4],
        seed=1,
    )
    elites = make_archive(n).data()
    del elites["index"]
    archive.add(**elites)
    return archive


def read(path):
    """Settings and elites as they stand in a file."""
    with np.load(path) as file:
        arrays = dict(file)
    return json.loads(str(arrays.pop("about"))), arrays


def write(path, about, arrays):
    np.savez(path, about=np.array(json.dumps(about)), **arrays)


def damage(path, change):
    """Let `change` edit settings and elites of a file."""
    about, arrays = read(path)
    change(about["settings"], arrays)
    write(path, about, arrays)


MAKERS = pytest.mark.parametrize(
    "make", [make_archive, make_unstructured], ids=["grid", "unstructured"]
)


class TestDamagedContent:
    """Files whose every byte is as it was written, by a program that wrote nonsense."""

    def refuse(self, make, path, change, message):
        archive = make(12)
        archive.save(path)
        damage(path, change)
        name = type(archive).__name__
        with pytest.raises(ValueError, match=rf"^`path` must (hold|be) a .*{name}.*{message}"):
            type(archive).load(path)

    @pytest.mark.parametrize(
        ("name", "change"),
        [
            ("objective", lambda array: array[:-1]),
            ("behavior", lambda array: array[..., None]),
            ("index", lambda array: array[..., None]),
            ("measures", lambda array: array.ravel()[0]),
            ("solution", lambda array: array.astype(str)),
            ("solved", lambda array: array.astype(str)),
            ("measures", lambda array: array.astype(complex)),
            ("seed", lambda array: np.full_like(array, np.datetime64("now"), "datetime64[s]")),
        ],
        ids=["fewer", "deeper", "deeper", "scalar", "text", "text", "complex", "dates"],
    )
    def test_of_a_field(self, tmp_path, name, change):
        def edit(settings, arrays):
            arrays[name] = change(arrays[name])

        match = f"`({name}|objective|extra_fields)` must"
        self.refuse(make_archive, tmp_path / "elites.npz", edit, match)

    @pytest.mark.parametrize("name", ["solution", "objective", "measures", "behavior"])
    def test_numbers_that_are_not_finite(self, tmp_path, name):
        def edit(settings, arrays):
            arrays[name][3] = np.nan

        self.refuse(make_archive, tmp_path / "elites.npz", edit, f"`{name}` must be finite")

    @MAKERS
    def test_a_cell_that_is_taken_twice(self, tmp_path, make):
        def edit(settings, arrays):
            arrays["index"][3] = arrays["index"][4]
            arrays["measures"][3] = arrays["measures"][4]

        self.refuse(make, tmp_path / "elites.npz", edit, "`index` must")

    def test_seeds_below_zero(self, tmp_path):
        def edit(settings, arrays):
            arrays["seed"][0] = -1

        self.refuse(make_archive, tmp_path / "elites.npz", edit, "`seed` must be at least 0")

    @pytest.mark.parametrize("name", ["objective", "measures", "index"])
    def test_types_of_another_size(self, tmp_path, name):
        def edit(settings, arrays):
            arrays[name] = arrays[name].astype(arrays[name].dtype.kind + "4")

        self.refuse(make_archive, tmp_path / "elites.npz", edit, f"`{name}` must be of type")

    @pytest.mark.parametrize("whole", [None, [], {}, {"seed": 1}])
    def test_other_settings(self, tmp_path, whole):
        archive, path = make_archive(12), tmp_path / "elites.npz"
        archive.save(path)
        about, arrays = read(path)
        write(path, about | {"settings": whole}, arrays)
        with pytest.raises(ValueError, match=r"^`path` must "):
            type(archive).load(path)

    @MAKERS
    @pytest.mark.parametrize("value", ["text", [1, [2]], {}, -1, 1e999])
    def test_settings_of_another_kind(self, tmp_path, make, value):
        archive, path = make(12), tmp_path / "elites.npz"
        archive.save(path)
        about, arrays = read(path)
        fine = {("qd_score_offset", "-1")}
        for name in about["settings"]:
            if (name, str(value)) not in fine:
                write(path, about | {"settings": about["settings"] | {name: value}}, arrays)
                with pytest.raises(ValueError, match=r"^`path` must hold a whole"):
                    type(archive).load(path)

    @MAKERS
    def test_settings_that_are_more_or_fewer(self, tmp_path, make):
        for name in make(12)._saved_settings():
            self.refuse(make, tmp_path / "elites.npz", lambda s, arrays, k=name: s.pop(k), "")
        for name in ("seed", "color", "solution_dim", "extra_fields"):
            more = lambda s, arrays, k=name: s.update({k: None})  # noqa: E731
            self.refuse(make, tmp_path / "elites.npz", more, "")

    def test_cells_without_end_cost_nothing(self, tmp_path):
        def edit(settings, arrays):
            settings["dims"] = [10**9, 10**9]

        self.refuse(make_archive, tmp_path / "elites.npz", edit, "cells of another")


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 2**70) | st.floats() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)


def of_numbers(change):
    """The change, but of text, which an earlier one may have made of numbers: that stays."""
    return lambda array, rng: array if array.dtype.kind == "U" else change(array, rng)


CHANGES = [
    lambda array, rng: array[: rng.integers(len(array) + 1)],
    lambda array, rng: rng.permutation(array),
    lambda array, rng: array[rng.integers(len(array), size=len(array))],
    of_numbers(
        lambda array, rng: array.astype(rng.choice(["f4", "f8", "i8", "u1", "?", "U5", "c8"]))
    ),
    lambda array, rng: array.reshape(-1),
    lambda array, rng: array[:, None],
    of_numbers(lambda array, rng: array * np.where(rng.random(array.shape) < 0.1, np.nan, 1)),
    of_numbers(
        lambda array, rng: np.where(rng.random(array.shape) < 0.1, -array.astype(float), array)
    ),
    lambda array, rng: array.T,
]


def assert_lives(archive, path):
    """It does what an archive does, and what it saves is what it loads."""
    archive.sample_elites(3)
    assert archive.stats.num_elites == len(archive)
    assert archive.nearest(archive.behaviors[0]).shape == (archive.solution_dim,)
    assert archive.data("seed").shape == (len(archive),)
    archive.save(path)
    np.testing.assert_equal(type(archive).load(path).data(), archive.data())
    more = {name: array for name, array in archive.data().items() if name != "index"}
    archive.add(**more)


def load_damaged(kind, path):
    """Load, and use what was loaded; refusals name the argument."""
    archive, refusal = None, "`path` must "
    try:
        archive = kind.load(path)
    except ValueError as error:
        refusal = str(error)
    assert refusal.startswith("`path` must ")
    assert "\n" not in refusal
    if archive is not None and not archive.empty:
        assert_lives(archive, path)


HOSTILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


class TestRandomDamage:
    """Whatever stands in a file, it is refused, or it is an archive."""

    @MAKERS
    @HOSTILE
    @given(data=st.data())
    def test_of_content(self, tmp_path, make, data):
        archive, path = make(12), tmp_path / "elites.npz"
        archive.save(path)
        about, arrays = read(path)
        rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
        for name in data.draw(st.lists(st.sampled_from(sorted(arrays)), max_size=2)):
            if arrays[name].ndim:
                arrays[name] = data.draw(st.sampled_from(CHANGES))(arrays[name], rng)
        for name in data.draw(st.lists(st.sampled_from(sorted(about["settings"])), max_size=1)):
            about["settings"][name] = data.draw(VALUES)
        write(path, about, arrays)
        load_damaged(type(archive), path)

    @MAKERS
    @HOSTILE
    @given(data=st.data())
    def test_of_bytes_whose_checksums_are_right(self, tmp_path, make, data):
        archive, path = make(12), tmp_path / "elites.npz"
        archive.save(path)
        with zipfile.ZipFile(path) as file:
            members = {name: bytearray(file.read(name)) for name in file.namelist()}
        for _ in range(data.draw(st.integers(1, 4))):
            member = members[data.draw(st.sampled_from(sorted(members)))]
            position = data.draw(st.integers(0, min(len(member), 200) - 1))
            member[position] = data.draw(st.integers(0, 255))
        with zipfile.ZipFile(path, "w") as file:
            for name, content in members.items():
                file.writestr(name, bytes(content))
        load_damaged(type(archive), path)
