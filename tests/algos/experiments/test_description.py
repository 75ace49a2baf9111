import json
import subprocess

import gymnasium as gym
import numpy as np
import pytest

from curiosity_algos import MAPElites
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.experiments.description import describe_run, git_revision, settings_of


class OwnPolicy(MlpPolicy):
    pass


def test_every_algorithm_can_be_described(any_algorithm, make_model, make_easy_maze):
    described = describe_run(make_model(any_algorithm, make_easy_maze()))
    assert json.loads(json.dumps(described)) == described
    assert described["algorithm"] == any_algorithm.__name__
    assert described["seed"] == 0
    assert described["machine"]["cpus"] >= 1
    assert described["versions"]["numpy"] == np.__version__


def test_settings_are_all_of_the_constructors(any_algorithm, make_model, make_easy_maze):
    settings = settings_of(make_model(any_algorithm, make_easy_maze()))
    parameters = any_algorithm.__signature__.parameters
    assert settings.keys() == parameters.keys() - {"env", "seed"}
    assert settings["policy_kwargs"] == {"net_arch": [4]}
    for name, parameter in parameters.items():
        if isinstance(parameter.default, float):
            assert isinstance(settings[name], float), name


def test_objects_are_told_by_their_class(make_model, make_easy_maze):
    model = make_model(
        MAPElites, make_easy_maze(), policy=OwnPolicy, n_cells=np.int64(3), emitters=None
    )
    settings = settings_of(model)
    assert (settings["policy"], settings["n_cells"]) == ("OwnPolicy", 3)
    assert settings["archive"] == "SparseGridArchive"
    assert settings["emitters"] is None


def test_the_environment_has_its_arguments(make_model):
    env = gym.make("CuriosityMaze-US-v0", horizon=50)
    described = describe_run(make_model(MAPElites, env))
    assert described["env"] == "CuriosityMaze-US-v0"
    assert described["env_kwargs"]["horizon"] == 50


class TestGit:
    @pytest.fixture
    def repository(self, tmp_path):
        identity = ["-c", "user.name=a", "-c", "user.email=a@b"]
        (tmp_path / "file").write_text("one")
        for words in (["init", "-q"], ["add", "file"], [*identity, "commit", "-qm", "First"]):
            subprocess.run(["git", "-C", tmp_path, *words], check=True)
        return tmp_path

    def test_the_revision_is_the_commit(self, repository):
        revision = git_revision(repository)
        assert len(revision) == 40
        (repository / "file").write_text("two")
        assert git_revision(repository) == f"{revision}+"

    def test_elsewhere_there_is_none(self, tmp_path, monkeypatch):
        monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
        assert git_revision(tmp_path) is None
        monkeypatch.setenv("PATH", "")
        assert git_revision(tmp_path) is None
