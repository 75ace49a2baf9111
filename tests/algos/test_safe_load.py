"""Loading a population algorithm runs no code that a file holds."""

import base64
import io
import json
import pickle
import zipfile

import cloudpickle
import numpy as np
import pytest
import torch as th
from saved_files import rewrite
from stable_baselines3.common.save_util import load_from_zip_file

from curiosity_algos import ICM, CuriosityES, CuriosityMAPElites, MAPElites
from curiosity_algos.evaluation.policies import MlpPolicy


class Payload:
    """Unpickled, it creates a file."""

    def __init__(self, marker):
        self.marker = str(marker)

    def __reduce__(self):
        return open, (self.marker, "w")


class MyPolicy(MlpPolicy):
    """A user's own."""


@pytest.fixture(name="algorithm")
def one_algorithm():
    return CuriosityES


@pytest.fixture
def saved(algorithm, make_model, make_easy_maze, tmp_path):
    model = make_model(algorithm, make_easy_maze()).learn(600)
    model.save(tmp_path / "model")
    return model


@pytest.fixture
def path(tmp_path):
    return tmp_path / "model.zip"


@pytest.fixture
def marker(tmp_path):
    return tmp_path / "marker"


def rewrite_member(path, name, change):
    """Give one member of a zip the content that `change` makes of its own, None: nothing."""
    rewrite(path, lambda members: members | {name: change(members.get(name))})


def with_attributes(**attributes):
    return lambda data: json.dumps(json.loads(data) | attributes)


def tensors(thing):
    file = io.BytesIO()
    th.save(thing, file)
    return file.getvalue()


def pickled(thing):
    return {":type:": "", ":serialized:": base64.b64encode(cloudpickle.dumps(thing)).decode()}


def test_nothing_in_a_file_is_pickled(algorithms, make_model, make_maze, path):
    for algorithm in algorithms:
        make_model(algorithm, make_maze()).learn(1).save(path)
        with zipfile.ZipFile(path) as archive:
            assert b":serialized:" not in archive.read("data"), algorithm


@pytest.mark.parametrize("algorithm", [CuriosityES, MAPElites])
def test_hidden_code_does_not_run(saved, algorithm, path, marker):
    rewrite_member(path, "data", with_attributes(tensorboard_log=pickled(Payload(marker))))
    with pytest.raises(ValueError, match=r"`tensorboard_log` must be given .*allow_pickle=True"):
        algorithm.load(path)
    assert not marker.exists()
    algorithm.load(path, allow_pickle=True)
    assert marker.exists()


@pytest.mark.parametrize("how", ["keyword", "custom_objects"])
def test_what_is_given_is_not_unpickled(saved, algorithm, path, marker, how):
    rewrite_member(path, "data", with_attributes(tensorboard_log=pickled(Payload(marker))))
    given = {"tensorboard_log": "runs"}
    keywords = given if how == "keyword" else {"custom_objects": given}
    assert algorithm.load(path, **keywords).tensorboard_log == "runs"
    assert not marker.exists()


@pytest.mark.parametrize("name", ["policy.pth", "pytorch_variables.pth"])
def test_code_among_the_tensors_never_runs(saved, algorithm, path, marker, name):
    rewrite_member(path, name, lambda content: pickle.dumps(Payload(marker)))
    for allow_pickle in (False, True):
        with pytest.raises(ValueError, match="holds more than tensors and plain values"):
            algorithm.load(path, allow_pickle=allow_pickle)
    with pytest.raises(pickle.UnpicklingError):
        saved.set_parameters(path)
    assert not marker.exists()


def test_no_module_is_imported(saved, algorithm, path, tmp_path, marker, monkeypatch):
    (tmp_path / "evil.py").write_text(f"open({str(marker)!r}, 'w')")
    monkeypatch.syspath_prepend(tmp_path)
    rewrite_member(path, "data", with_attributes(env="evil:CuriosityMaze-Hard-v0"))
    with pytest.raises(ValueError, match=r"must be a saved .* is damaged"):
        algorithm.load(path)
    assert not marker.exists()


@pytest.mark.parametrize(
    "attributes",
    [
        {"observation_space": {":box:": {}}},
        {"_best_parameters": {":array:": {"dtype": "float32", "shape": [9], "bytes": ""}}},
        {"_best_parameters": [1.0]},
        {"num_timesteps": "x"},
        {"generation": "a"},
        {"generation": None},
        {"_best_seed": "0"},
        {"learn": 3},
    ],
    ids=lambda attributes: next(iter(attributes)),
)
def test_damaged_attributes_are_an_error(saved, algorithm, path, attributes):
    rewrite_member(path, "data", with_attributes(**attributes))
    with pytest.raises(ValueError, match=f"must be a saved {algorithm.__name__}, .* is damaged"):
        algorithm.load(path)


def nested(data):
    return data[:-1] + b', "deep": ' + 10**5 * b"[" + 10**5 * b"]" + b"}"


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("data", nested),
        ("policy.pth", lambda content: b""),
        ("policy.pth", lambda content: content[: len(content) // 2]),
        ("_coverage.pth", lambda content: tensors({"counts": 3})),
        ("_episodes.pth", lambda content: tensors([1])),
        ("pytorch_variables.pth", lambda content: tensors({"policy.mlp": th.zeros(1)})),
    ],
)
def test_damaged_members_are_an_error(saved, algorithm, path, name, change):
    rewrite_member(path, name, change)
    with pytest.raises(ValueError, match=f"must be a saved {algorithm.__name__}"):
        algorithm.load(path)


@pytest.mark.parametrize(("offset", "value"), [(8, 1), (10, 99)], ids=["encrypted", "compressed"])
def test_zips_of_other_kinds_are_an_error(saved, algorithm, path, offset, value):
    content = bytearray(path.read_bytes())
    content[content.index(b"PK\x01\x02") + offset] = value
    path.write_bytes(content)
    with pytest.raises(ValueError, match="is not a whole file of this package"):
        algorithm.load(path)


def test_the_device_is_that_of_load(saved, algorithm, path):
    rewrite_member(path, "data", with_attributes(device="nodevice"))
    assert algorithm.load(path, device="cpu").device == th.device("cpu")


def test_missing_attributes_are_an_error(saved, algorithm, path):
    def without(data):
        return json.dumps({k: v for k, v in json.loads(data).items() if k != "observation_space"})

    rewrite_member(path, "data", without)
    with pytest.raises(ValueError, match="is damaged"):
        algorithm.load(path)


def test_an_unknown_policy_is_an_error(saved, algorithm, path):
    rewrite_member(path, "data", with_attributes(policy_class="os.system"))
    with pytest.raises(ValueError, match="`policy` must be one of MlpPolicy"):
        algorithm.load(path)


def test_a_policy_of_ones_own(algorithm, make_model, make_maze, path, assert_same_run):
    model = make_model(algorithm, make_maze(), policy=MyPolicy).learn(1)
    model.save(path)
    with pytest.raises(ValueError, match="`policy` must be given to `load`"):
        algorithm.load(path)
    for keywords in ({"policy": MyPolicy}, {"allow_pickle": True}):
        loaded = algorithm.load(path, env=make_maze(), **keywords)
        assert loaded.policy_class is MyPolicy is type(loaded.policy)
        assert_same_run(loaded, model)


@pytest.mark.parametrize("algorithm", [CuriosityES, CuriosityMAPElites])
def test_a_bonus_of_ones_own(algorithm, make_model, make_maze, path, assert_same_run):
    env = make_maze()

    def make_bonus():
        return ICM(env.observation_space, env.action_space, seed=7, device="cpu")

    model = make_model(algorithm, env, bonus=make_bonus()).learn(1)
    model.save(path)
    with pytest.raises(ValueError, match="`bonus` must be given to `load`"):
        algorithm.load(path)
    bonus = make_bonus()
    given = algorithm.load(path, env=make_maze(), bonus=bonus)
    assert given.bonus is bonus is given._motivation.bonus
    read = algorithm.load(path, env=make_maze(), allow_pickle=True)
    model.learn(300, reset_num_timesteps=False)
    for each in (given, read):
        assert_same_run(each.learn(300, reset_num_timesteps=False), model)


def test_a_policy_may_be_named(saved, algorithm, path, assert_same_run):
    assert_same_run(algorithm.load(path, policy="MlpPolicy"), saved)


def test_numbers_of_numpy_become_pythons(algorithm, make_model, make_maze, path):
    settings = {"population_size": np.int64(6), "policy_kwargs": {"net_arch": [np.int64(4)]}}
    make_model(algorithm, make_maze(), **settings).save(path)
    loaded = algorithm.load(path)
    assert type(loaded.population_size) is int
    assert loaded.policy_kwargs == settings["policy_kwargs"]


def test_stable_baselines_reads_the_file_too(saved, path, make_model, make_easy_maze, algorithm):
    data, parameters, _ = load_from_zip_file(path)
    assert data["num_timesteps"] == saved.num_timesteps
    assert parameters.keys() == saved.get_parameters().keys()
    other = make_model(algorithm, make_easy_maze(), seed=1)
    other.set_parameters(path)
    np.testing.assert_array_equal(other.policy.vector, saved.policy.vector)
