import inspect
import json
import subprocess
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import sb3_contrib
import stable_baselines3
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecNormalize

from curiosity_algos import TD3ICM, BonusVecEnvWrapper, CanonicalES, GoExplore, MAPElites
from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.experiments.description import (
    behavior_names,
    check_same,
    describe_env,
    describe_run,
    git_revision,
    settings_of,
)
from curiosity_algos.experiments.env_spec import decode_spec, make_env
from curiosity_gym import BehaviorWrapper, MazeLayout


class OwnPolicy(MlpPolicy):
    pass


def first_two(env, observation, info):
    return observation[:2]


def check_differ(one, other):
    with pytest.raises(ValueError, match="`folder` must be empty or that of this run"):
        check_same(Path(), one, other)


def test_a_description_has_every_setting_of_the_constructor(algorithm, make_model, make_easy_maze):
    described = describe_run(make_model(algorithm, make_easy_maze()))
    assert json.loads(json.dumps(described)) == described
    assert described["algorithm"] == algorithm.__name__
    assert described["seed"] == 0
    assert described["machine"]["cpus"] >= 1
    assert described["versions"]["numpy"] == np.__version__
    settings = described["settings"]
    parameters = inspect.signature(algorithm).parameters
    assert settings.keys() == {*parameters, "preset"} - {"env", "seed"}
    net_arch = {} if algorithm is GoExplore else {"net_arch": [4]}
    assert settings["policy_kwargs"] == net_arch
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


def test_the_archive_of_elites_is_described(make_model, make_easy_maze):
    env = make_easy_maze()
    own = make_model(MAPElites, env, n_cells=3)
    space = env.unwrapped.behavior_space
    ranges = np.stack([space.low, space.high], axis=1).tolist()
    grid = {"dims": [3] * len(ranges), "ranges": ranges}
    described = describe_run(own)["archive"]
    assert described == {"SparseGridArchive": grid | {"qd_score_offset": 0.0}}
    archive = SparseGridArchive(
        solution_dim=own.policy.mlp.n_parameters, qd_score_offset=-5.0, **grid
    )
    given = make_model(MAPElites, env, archive=archive)
    described = describe_run(given)["archive"]
    assert described == {"SparseGridArchive": grid | {"qd_score_offset": -5.0}}
    assert describe_run(make_model(CanonicalES, env))["archive"] is None


@pytest.mark.parametrize(
    "other",
    [
        lambda: gym.make("Pendulum-v1", max_episode_steps=9),
        lambda: gym.wrappers.RescaleAction(gym.make("Pendulum-v1"), np.float32(-1), np.float32(1)),
        lambda: gym.make("Pendulum-v1", g=3.0),
        lambda: gym.make("MountainCarContinuous-v0"),
    ],
)
def test_another_environment_is_another_run(other):
    one, twin = (
        describe_env(CanonicalES._wrap_env(env)) for env in (gym.make("Pendulum-v1"), other())
    )
    check_differ(one, twin)


def test_mazes_of_other_walls_are_other_environments(tmp_path):
    path = tmp_path / "own.json"
    there = []
    for text in ("S.G.\n....", "S..G\n...."):
        layout = MazeLayout.from_ascii(text)
        layout.to_json(path)
        for given in (layout, str(path), path):
            envs = (
                gym.make("CuriosityMaze-v0", layout=given),
                gym.make_vec("CuriosityMaze-v0", 2, "vector_entry_point", layout=given),
                gym.make("CuriosityLocomotion-Ant-v0", world=given, sparse=True),
            )
            there.append([describe_env(CanonicalES._wrap_env(env)) for env in envs])
    one, *alike, other, _, _ = there
    assert [one, one] == alike
    for here, twin in zip(one, other, strict=True):
        check_differ(here, twin)
        assert make_env(json.loads(json.dumps(here)), trust=False).spec is not None


class TestBehaviorNames:
    def named(self, names):
        env, space = gym.make("Pendulum-v1"), gym.spaces.Box(-2.0, 2.0, (2,))
        return CanonicalES._wrap_env(BehaviorWrapper(env, first_two, space, names))

    def test_are_those_of_the_environment(self):
        mode = "vector_entry_point"
        env = gym.make_vec("CuriosityMaze-US-v0", num_envs=2, vectorization_mode=mode)
        described = describe_run(MAPElites(env, n_cells=3))
        assert described["behavior_names"][:2] == ["x (maze units)", "y (maze units)"]
        assert len(described["behavior_names"]) == 4
        assert described["env"] == "CuriosityMaze-US-v0"
        assert "num_envs" not in described["env_kwargs"]

    def test_make_no_other_run(self):
        plain, named = (describe_env(self.named(names)) for names in (None, ("cosine", "sine")))
        assert behavior_names(self.named(("cosine", "sine"))) == ["cosine", "sine"]
        assert behavior_names(self.named(None)) is None
        check_same(Path(), plain, named)
        assert "BehaviorWrapper" in named["wrappers"]

    def test_of_another_number_of_entries_are_none(self):
        """As those of a maze within a wrapper that has a behavior of its own."""
        venv = self.named(("cosine", "sine"))
        venv.envs[0].get_wrapper_attr("env").behavior_names = ("cosine",)
        assert behavior_names(venv) is None


@pytest.mark.parametrize(("given", "limit"), [({}, 500), ({"max_episode_steps": 20}, 20)])
def test_a_limit_of_a_vector_entry_is_that_of_a_single_one(given, limit):
    mode = {"vectorization_mode": "vector_entry_point"}
    envs = gym.make_vec("CartPole-v1", num_envs=2, **mode, **given)
    described = describe_env(CanonicalES._wrap_env(envs))
    assert described["env_kwargs"] == {"max_episode_steps": limit}
    env = gym.make(decode_spec(described["env_spec"]))
    assert env.get_wrapper_attr("_max_episode_steps") == limit


def test_settings_of_a_replay_buffer_are_those_in_force(make_model, make_easy_maze):
    model = make_model(TD3ICM, make_easy_maze(), weight=3.0)
    model.replay_buffer.weight = 0.25
    described = settings_of(model)["replay_buffer_kwargs"]
    expected = {"bonus": "icm", "weight": 0.25, "gamma": None, "n_updates": 2, "extrinsic": True}
    assert described.items() >= expected.items()


@pytest.mark.parametrize(
    ("package", "name"),  # on-policy, off-policy and discrete
    [(stable_baselines3, "PPO"), (stable_baselines3, "SAC"), (sb3_contrib, "QRDQN")],
)
def test_stable_baselines_settings_have_their_defaults(package, name):
    cls = getattr(package, name)
    env = "CartPole-v1" if name == "QRDQN" else "Pendulum-v1"
    settings = settings_of(cls("MlpPolicy", env, device="cpu"))
    parameters = inspect.signature(cls).parameters
    left_out = {"env", "seed", "_init_setup_model"}
    assert settings.keys() == parameters.keys() - left_out
    for name, value in settings.items():
        if isinstance(parameters[name].default, bool | float):
            assert value == parameters[name].default, name


def test_wrappers_of_a_vec_env_have_their_settings():
    venv = BonusVecEnvWrapper(make_vec_env("Pendulum-v1", 3), bonus="rnd", weight=0.5, seed=0)
    described = describe_run(PPO("MlpPolicy", VecNormalize(venv, clip_obs=5.0), device="cpu"))
    assert json.loads(json.dumps(described)) == described
    assert described["algorithm"] == "PPO + RND"
    assert described["vec_env"]["n_envs"] == 3
    normalize, bonus = described["vec_env"]["wrappers"].items()
    assert (normalize[0], normalize[1]["clip_obs"]) == ("VecNormalize", 5.0)
    assert bonus[0] == "BonusVecEnvWrapper"
    assert (bonus[1]["weight"], bonus[1]["buffer_size"]) == (0.5, 100_000)
    check_differ(described, described | {"vec_env": {"n_envs": 3, "wrappers": dict([bonus])}})


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


THERE = {"algorithm": "NSES", "env": "A-v0", "seed": 0, "settings": {"k": None, "sigma": 0.5}}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, None),
        ({"settings": {"sigma": 0.5, "k": None, "device": "cuda", "verbose": 2}}, None),
        ({"versions": {"numpy": "9"}, "vec_env": None}, None),
        ({"seed": 1}, "seed is 0, not 1"),
        ({"seed": 1, "env": "B-v0"}, 'env is "A-v0", not "B-v0"'),
        ({"wrappers": {"Flatten": {}}}, "wrappers.Flatten is null, not {}"),
        ({"settings": {"sigma": 0.5, "k": 3}}, "settings.k is null, not 3"),
        ({"num_timesteps": 5}, "num_timesteps is null, not 5"),
    ],
)
def test_the_first_value_that_differs_is_named(changes, message, tmp_path):
    there = THERE | {"wrappers": {}}
    if message is None:
        check_same(tmp_path, there, there | changes)
        return
    with pytest.raises(ValueError, match="must be empty or that of") as raised:
        check_same(tmp_path, there, there | changes)
    assert str(raised.value).endswith(f": in {tmp_path} {message}.")
