"""One file for all that has settings and a state, which no file of anyone's can abuse."""

import collections
import io
import json
import pickle
import zipfile

import numpy as np
import pytest
import torch as th
from saved_files import npy_header, rewrite, with_about

from curiosity_algos.state.file import ABOUT, read, save

SETTINGS = {"sigma": 0.3, "net_arch": [32, 16], "widths": (1, 2), "seed": None}
STATE = {
    "policy": {"flat": np.arange(3, dtype=np.float32), "a/b": 1, "..": 2, "@array": "policy/flat"},
    "optimizer": {"state": {0: {"step": th.tensor(3.0)}}, "betas": (0.9, 0.999), "groups": [{}]},
    "rng": {"state": 2**120, "kind": "PCG64"},
    "0": {0: np.zeros(2), "0": np.ones(2), None: True},
    "best": -np.inf,
    "scalar": np.float32(0.1),
    "empty": {"rows": np.empty((0, 4), np.int64), "nothing": {}, "": [], "none": None},
    "mask": np.array([True, False]),
    "column": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "number": np.array(2.5),
}


class Payload:
    """Unpickled, it creates a file."""

    def __init__(self, marker):
        self.marker = str(marker)

    def __reduce__(self):
        return open, (self.marker, "w")


@pytest.fixture
def path(tmp_path):
    save(tmp_path / "thing.zip", "Thing", SETTINGS, STATE)
    return tmp_path / "thing.zip"


def test_what_is_read_is_what_was_written(path, assert_same):
    settings, state = read(path, "Thing")
    assert_same(settings, SETTINGS)
    assert_same(state, STATE)
    state["policy"]["flat"][:] = 0.0  # arrays may be written to


def test_the_same_state_is_the_same_file(path, tmp_path):
    with open(tmp_path / "again", "wb") as file:
        save(file, "Thing", *read(path, "Thing"))
    assert (tmp_path / "again").read_bytes() == path.read_bytes()


def test_numpy_opens_it(path):
    with np.load(path) as file:
        assert np.array_equal(file["policy/flat"], STATE["policy"]["flat"])
        assert json.loads(file[ABOUT])["settings"]["sigma"] == 0.3


@pytest.mark.parametrize(
    ("leaf", "name"),
    [
        (th.zeros(2, dtype=th.bfloat16), r"Tensor of torch\.bfloat16"),
        (np.array([None]), "ndarray of object"),
        (np.zeros(2, dtype=[("x", float)]), "ndarray of "),
        (np.array(["text"]), "ndarray of <U4"),
        (collections.namedtuple("Pair", "a b")(1, 2), "Pair"),
        (Payload("marker"), "Payload"),
    ],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_what_a_file_cannot_hold_is_refused(leaf, name, path):
    before = path.read_bytes()
    with pytest.raises(ValueError, match=rf"^A state must hold .* at `a/b` there is a {name}"):
        save(path, "Thing", {}, {"a": {"b": leaf}})
    assert path.read_bytes() == before


def test_a_file_that_is_missing_or_of_another_kind(path, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"`path` must be a saved Thing, .* no file .*gone"):
        read(tmp_path / "gone.zip", "Thing")
    with pytest.raises(FileNotFoundError):
        read(tmp_path, "Thing")
    with pytest.raises(ValueError, match=r"must be a saved Other, .*thing\.zip is one of 'Thing'"):
        read(path, "Other")


def with_member(name, content):
    return lambda members: members | {name: content}


FLAT = "policy/flat.npy"
DAMAGE = {
    "no about": lambda members: {FLAT: members[FLAT]},
    "no array": lambda members: {name: members[name] for name in members if name != FLAT},
    "another array": lambda members: members | {"other.npy": members[FLAT]},
    "no json": with_member(ABOUT, b"{"),
    "no dictionary": with_member(ABOUT, b"3"),
    "no settings": with_about(lambda about: about.pop("settings")),
    "settings are a number": with_about(lambda about: about.update(settings=1)),
    "unknown kind": with_about(lambda about: about["state"].update(x={"@open": "marker"})),
    "two kinds": with_about(lambda about: about["state"].update(x={"@tuple": [], "b": 1})),
    "an array twice": with_about(lambda about: about["state"].update(x={"@array": "policy/flat"})),
    "a key of lists": with_about(lambda about: about["state"].update(x={"@dict": [[[], 1]]})),
    "deep lists": with_member(ABOUT, b"[" * 10**5 + b"]" * 10**5),
    "no npy": with_member(FLAT, b"x"),
    "a short npy": lambda members: members | {FLAT: members[FLAT][:-1]},
    "a huge count": with_member(FLAT, npy_header((10**15,))),
    "a huge shape": with_member(FLAT, npy_header((2**62, 2**62))),
    "no numbers": with_member(FLAT, npy_header(()).replace(b"<f8", b"|O8") + b"12345678"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_hostile_file_is_one_clear_error(damage, path):
    rewrite(path, DAMAGE[damage])
    with pytest.raises(ValueError, match=r"^`path` must be a saved Thing, .*thing\.zip is not a "):
        read(path, "Thing")


def test_a_pickle_does_not_run(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    marker, file = tmp_path / "marker", io.BytesIO()
    np.save(file, np.array([Payload(marker)]), allow_pickle=True)
    for content in (pickle.dumps(Payload(marker)), file.getvalue()):
        rewrite(path, with_member(FLAT, content))
        with pytest.raises(ValueError, match="must be a saved Thing"):
            read(path, "Thing")
    path.write_bytes(pickle.dumps(Payload(marker)))
    with pytest.raises(ValueError, match="must be a saved Thing"):
        read(path, "Thing")
    assert not marker.exists()


def test_what_is_cut_off_or_changed_is_an_error(path):
    content = path.read_bytes()
    for n in np.linspace(0, len(content) - 1, 20).astype(int):
        path.write_bytes(content[:n])
        with pytest.raises(ValueError, match="must be a saved Thing"):
            read(path, "Thing")
    at = content.index(STATE["policy"]["flat"].tobytes())
    path.write_bytes(content[:at] + b"x" + content[at + 1 :])
    with pytest.raises(ValueError, match="must be a saved Thing"):
        read(path, "Thing")


def test_what_unpacks_to_more_than_it_is_stays_packed(path):
    rewrite(path, with_member("zeros.npy", bytes(10**7)), zipfile.ZIP_DEFLATED)
    with pytest.raises(ValueError, match="must be a saved Thing") as raised:
        read(path, "Thing")
    assert "unpacks to more" in str(raised.value.__cause__)
